# SPDX-License-Identifier: GPL-3.0-or-later
"""Small inputs that ask for much: refused, or stopped at a limit, before they take the machine."""

from __future__ import annotations

import gzip
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path

import msgspec
import pytest

from coordlang.verification.certificate_file import Cnf, read_certificate
from coordlang.verification.check_certificate import check
from planners.pddl import lifted, parse_domain
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput, OutOfMemory, Refuted
from planners.system.files import read_bytes
from planners.system.limits import time_limit
from tests.support import thorough
from tests.support.forks import fork_command
from tests.support.task_languages import built_for

MIB = 2**20


@contextmanager
def at_most(mib: int) -> Iterator[None]:
    """The block allocates no more."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < mib * MIB
    finally:
        tracemalloc.stop()


# Sizes


def bomb(folder: Path, mib: int) -> Path:
    """A file of gzip that holds so many MiB."""
    path = folder / "bomb.json.gz"
    path.write_bytes(gzip.compress(b" " * MIB) * mib)
    return path


def test_too_much_is_refused_before_it_takes_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with at_most(16), pytest.raises(BadInput, match=r"bomb\.json\.gz: .* more than 64 MiB"):
        read_bytes(bomb(tmp_path, 65), most=64 * MIB)
    with pytest.raises(BadInput, match="more than 2 MiB"):
        read_bytes(Path("/dev/zero"), most=2 * MIB)
    assert len(read_bytes(bomb(tmp_path, 2), most=2 * MIB)) == 2 * MIB
    monkeypatch.setattr("planners.system.files.memory_left", lambda: 64 * MIB)
    assert read_bytes(bomb(tmp_path, 16))
    with pytest.raises(OutOfMemory, match=r"bomb.*\.gz: reading 17 MiB takes 68 MiB.* 64 MiB are"):
        read_bytes(bomb(tmp_path, 17))


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data,
        lambda data: data + b"\0" * 700,  # gzip pads with zeros
        lambda data: data + data,
        lambda data: data[:-9],
        lambda data: data[:30] + b"??" + data[32:],
        lambda data: data + b"x",
    ],
)
def test_other_gzip_is_read_as_python_reads_it(
    change: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    data = change(gzip.compress(bytes(range(256)) * 20_000))
    (tmp_path / "f.gz").write_bytes(data)
    try:
        expected = gzip.decompress(data)
    except Exception:
        with pytest.raises(BadInput, match="cannot be read"):
            read_bytes(tmp_path / "f.gz")
    else:
        assert read_bytes(tmp_path / "f.gz") == expected


# Nesting, and keys that occur twice

#: A certificate; all files of JSON are read by one function.
CERTIFICATE = (
    '{"format": "coordlang/certificate", "version": 1, "domain": "grid", '
    '"robots": ["r1", "r2"], "refuted": 0, "reasons": [], "producer": {"x": %s}}'
)


def test_deep_nesting_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep.json"
    for opening, inside, closing in (("[", "", "]"), ('{"k":', "0", "}")):
        path.write_text(CERTIFICATE % (opening * 100_000 + inside + closing * 100_000))
        with pytest.raises(BadInput, match=r"deep\.json: this is no JSON, or it is cut off: "):
            read_certificate(path)
    path.write_text(CERTIFICATE % ("[" * 150 + "]" * 150))
    assert read_certificate(path)


@pytest.mark.parametrize(("key", "value"), [("refuted", "1"), ("robots", "[]"), ("x", "1")])
def test_a_certificate_has_no_key_twice(key: str, value: str, tmp_path: Path) -> None:
    path, text = tmp_path / "twice.json", CERTIFICATE % "1"
    path.write_text(text.replace(f'"{key}": ', f'"{key}": {value}, "{key}": ', 1))
    with pytest.raises(BadInput, match=rf"twice\.json: the key '{key}' occurs twice"):
        read_certificate(path)


# Certificates


def test_a_false_claim_is_refuted_before_it_takes_memory() -> None:
    """There are 12 states."""
    built = built_for("grid", "gw1-2x2")
    for refuted in (11, 12, 1_000_000, 10**30):
        claim = msgspec.structs.replace(built.certificate(), refuted=refuted)
        with at_most(16), pytest.raises(Refuted, match=f"leave languages with {refuted} words"):
            check(claim, built.job.candidates)
    claim = msgspec.structs.replace(built.certificate(), domain="t-map")
    with pytest.raises(Refuted, match="about the domain 't-map', not 'grid'"):
        check(claim, built.job.candidates)


def test_a_formula_that_would_not_fit_is_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimate has room for the solver, and is of the right size."""
    left = 60 * MIB
    monkeypatch.setattr("coordlang.verification.certificate_file.memory_left", lambda: left)
    clauses = [frozenset({two}) for two in combinations(range(80), 2)]
    with at_most(32):
        with pytest.raises(OutOfMemory, match=r"79 words for 80 states has [\d,]+ clauses"):
            Cnf(clauses, 79)
        cnf = Cnf(clauses, 20)
        made = tracemalloc.get_traced_memory()[0]
    left = made
    with pytest.raises(OutOfMemory, match="20 words for 80 states"):
        Cnf(clauses, 20)
    left = 4 * made
    assert Cnf(clauses, 20).clauses == cnf.clauses


# PDDL


def typed(types: str, predicates: str = "(p)") -> Source:
    action = "(:action act :parameters () :effect (p))"
    return Source("d", f"(define (domain d) (:types {types}) (:predicates {predicates}) {action})")


def test_ten_thousand_types_one_below_the_other() -> None:
    types = " ".join(f"t{n} - t{n + 1}" for n in range(10_000))
    with time_limit(15):  # with a look at all types above each type: minutes
        domain = parse_domain(typed(types, "(p) (q ?x - t10000)"))
        assert len(lifted.supertypes(domain.types, "t0")) == 10_002
        with pytest.raises(BadInput, match="the types form a cycle: t4000 - t4001 - "):
            parse_domain(typed(types.replace("t9999 - t10000", "t9999 - t4000")))


DOMAIN = """(define (domain d) (:requirements :typing :multi-agent) (:types robot thing)
  (:constants o1 - thing)
  (:predicates (done ?r - robot) (linked ?a ?b - thing) (p ?a ?b ?c ?d ?e ?f - thing))
  (:action finish :agent ?r - robot :parameters () :effect (done ?r))
  (:action act :agent ?r - robot :parameters (%s) :precondition (and %s) :effect (and %s)))"""
SIX = "?a ?b ?c ?d ?e ?f - thing"
ATOM = "(p ?a ?b ?c ?d ?e ?f)"
NINE = "?a ?b ?c ?d ?e ?f ?g ?h ?i - thing"
CLIQUE = " ".join(f"(linked ?{a} ?{b})" for a, b in combinations("abcdefghi", 2))
_LATE = (23, "coordlang: the time limit of 1 s is over\n  Reached: ")
#: Two hundred things and a predicate of six: all instances, all effects, all conditions; and eighty
#: things and nine parameters: a join that looks at 10^8 combinations and finds none.
LARGE = {
    "instances": (
        DOMAIN % (SIX, "", ATOM),
        (22, "domain.pddl:5:3: action 'act' has 128,000,000,000,000 instances: they take"),
    ),
    "effects": (DOMAIN % ("", "", f"(forall ({SIX}) {ATOM})"), _LATE),
    "conditions": (DOMAIN % ("", f"(forall ({SIX}) (not {ATOM}))", "(p o1 o1 o1 o1 o1 o1)"), _LATE),
    "join": (DOMAIN % (NINE, CLIQUE, "(done ?r)"), _LATE),
}
ALIKE = ("effects", "conditions")


@pytest.mark.parametrize("name", [*sorted({*LARGE} - {*ALIKE}), *thorough(*ALIKE)])
def test_six_parameters_and_two_hundred_objects(name: str, tmp_path: Path) -> None:
    text, (code, said) = LARGE[name]
    number = 80 if name == "join" else 200
    names = " ".join(f"o{n}" for n in range(number))
    pairs = [(m, n) for m in range(number) for n in range(number) if m % 8 < n % 8]
    links = " ".join(f"(linked o{m} o{n})" for m, n in pairs) if name == "join" else ""
    domain, problem = tmp_path / "domain.pddl", tmp_path / "problem.pddl"
    domain.write_text(text)
    problem.write_text(
        f"(define (problem large) (:domain d) (:objects r1 r2 - robot {names} - thing) "
        f"(:init {links}) (:goal (and (done r1) (done r2))))"
    )
    seconds = 1 if code == 23 else 100
    done = fork_command("plans", domain, problem, "--count", "--time-limit", seconds).join(60)
    assert done.code == code, done
    assert said in done.err
