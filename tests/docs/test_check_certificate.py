# SPDX-License-Identifier: GPL-3.0-or-later
"""The script that checks a certificate's formula with other programs, where they are installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.command import Command
from tests.support.domains import ROOT

SCRIPT = ROOT / "docs" / "examples" / "check_certificate.sh"
SOLVER, CHECKER = os.environ.get("SOLVER", "cadical"), os.environ.get("DRAT_TRIM", "drat-trim")
installed = pytest.mark.skipif(
    not (shutil.which(SOLVER) and shutil.which(CHECKER)),
    reason=f"{SOLVER} and {CHECKER} are not both installed (SOLVER and DRAT_TRIM name others)",
)


def run(formula: Path, **environment: object) -> subprocess.CompletedProcess[str]:
    named = {name: str(value) for name, value in environment.items()}
    return subprocess.run(
        ["sh", SCRIPT, formula], capture_output=True, text=True, env=os.environ | named
    )


@pytest.fixture
def formula(coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path) -> Path:
    language, proof, formula = tmp_path / "l.json", tmp_path / "c.json", tmp_path / "f.cnf"
    options = ("--tasks", "all", "--method", "minimal", "-o", language, "--certificate", proof)
    assert coordlang("build", *t_map, *options).code == 0
    made = coordlang("verify", language, *t_map, "--certificate", proof, "--dimacs", formula)
    assert made.code == 0
    return formula


@installed
def test_a_certificate_is_verified(formula: Path) -> None:
    done = run(formula)
    assert done.returncode == 0, done.stderr
    assert f"refuted by {SOLVER} in " in done.stdout
    assert f"proof verified by {CHECKER} in " in done.stdout


def program(path: Path, text: str) -> Path:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def test_the_answers_of_both_programs_count(tmp_path: Path) -> None:
    """No answer but "unsatisfiable" of the one and "verified" of the other is taken for a proof."""
    formula = tmp_path / "f.cnf"
    formula.write_text("p cnf 1 2\n1 0\n-1 0\n")
    refutes = program(tmp_path / "refutes", 'echo "s UNSATISFIABLE"; echo 0 > "$2"; exit 20')
    satisfied = program(tmp_path / "satisfied", "exit 10")
    gives_up = program(tmp_path / "gives-up", "exit 0")
    verifies = program(tmp_path / "verifies", 'echo "s VERIFIED"')
    refuses = program(tmp_path / "refuses", 'echo "s NOT VERIFIED"; exit 1')
    fails = program(tmp_path / "fails", "exit 139")
    codes = {
        (refutes, verifies): 0,
        (refutes, refuses): 1,
        (refutes, fails): 1,
        (satisfied, verifies): 1,
        (gives_up, verifies): 1,
        (refutes, tmp_path / "missing"): 77,
        (tmp_path / "missing", verifies): 77,
    }
    for (solver, checker), code in codes.items():
        assert run(formula, SOLVER=solver, DRAT_TRIM=checker).returncode == code
    assert run(tmp_path / "none.cnf").returncode == 2
