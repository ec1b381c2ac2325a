#!/bin/sh
# Check, without coordlang, that the formula of a certificate is unsatisfiable:
#
#     coordlang verify LANGUAGE DOMAIN PROBLEM --certificate CERTIFICATE --dimacs FORMULA.cnf
#     sh docs/examples/check_certificate.sh FORMULA.cnf [PROOF]
#
# A SAT solver refutes the formula and writes a proof (DRAT); drat-trim checks it.  PROOF keeps the
# proof.  Others than these two are named by SOLVER and DRAT_TRIM: SOLVER is called with FORMULA and
# PROOF and ends with 20 if the formula is unsatisfiable, as cadical and kissat do.
#
# On Debian cadical is a package, and its source has drat-trim (apt needs a deb-src line for it):
#
#     apt-get install cadical && apt-get source cadical
#     gcc -O2 -o drat-trim cadical-*/test/cnf/drat-trim.c
#
# Exit codes: 0 the proof holds; 1 the formula is satisfiable or the proof is wrong; 2 usage;
# 77 a program is missing.
set -eu

if [ $# -lt 1 ] || [ ! -r "$1" ]; then
    echo "usage: check_certificate.sh FORMULA.cnf [PROOF]" >&2
    exit 2
fi
formula=$1
solver=${SOLVER:-cadical}
checker=${DRAT_TRIM:-drat-trim}
for program in "$solver" "$checker"; do
    if ! command -v "$program" > /dev/null; then
        echo "$program is not installed; the first lines of this script say where to get it" >&2
        exit 77
    fi
done

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
proof=${2:-$folder/proof}

begin=$(date +%s)
code=0
"$solver" "$formula" "$proof" > "$folder/solver" || code=$?
if [ "$code" -ne 20 ]; then
    tail -n 3 "$folder/solver" >&2
    echo "$solver did not refute the formula (exit code $code)" >&2
    exit 1
fi
solved=$(date +%s)
echo "refuted by $solver in $((solved - begin)) s, with a proof of $(wc -c < "$proof") bytes"

"$checker" "$formula" "$proof" -t 1000000 > "$folder/checker" || true
if ! grep -q '^s VERIFIED' "$folder/checker"; then
    tail -n 3 "$folder/checker" >&2
    echo "$checker does not accept the proof" >&2
    exit 1
fi
echo "proof verified by $checker in $(($(date +%s) - solved)) s"
