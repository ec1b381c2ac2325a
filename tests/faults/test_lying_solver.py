# SPDX-License-Identifier: GPL-3.0-or-later
"""A SAT solver that calls formulas unsatisfiable that are not: nothing wrong is certified."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest

from coordlang.verification.certificate_file import Certificate
from coordlang.verification.make_certificate import certify
from planners.search import sat
from tests.support.command import Command
from tests.support.domains import DOMAINS

#: Folder, problem -> the least number of words for all pairs of states.
_LEAST = {("t-map", "problem"): 3, ("grid", "gw1-2x2"): 3, ("three-cells", "problem"): 3}
_SEEDS = range(8)
#: The solver that checks certificates, by which no language is built.
_CHECKS = "maplesat"
_INTERNAL = 32


def _lying(random: Random) -> type:
    """A class of solvers that answer "unsatisfiable" to 30 % of all satisfiable questions."""

    class Lying(sat._solver_class()):  # type: ignore[misc]
        def __init__(self, name: str, **arguments: Any) -> None:
            super().__init__(name=name, **arguments)
            self.is_honest = name == _CHECKS

        def solve_limited(self, **arguments: Any) -> bool | None:
            answer: bool | None = super().solve_limited(**arguments)
            lies = answer and not self.is_honest and random.random() < 0.3
            return False if lies else answer

    return Lying


@pytest.mark.parametrize(("world", "least"), _LEAST.items())
def test_a_false_refutation_is_not_certified(
    coordlang: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    world: tuple[str, str],
    least: int,
) -> None:
    """Exit code 0 with a certificate that holds, or an error with every file as it was."""
    files = DOMAINS / world[0] / "domain.pddl", DOMAINS / world[0] / f"{world[1]}.pddl"
    language, proof = tmp_path / "language.json", tmp_path / "proof.json"
    codes = []
    for seed in _SEEDS:
        language.write_text("old language")
        proof.write_text("old proof")
        with monkeypatch.context() as patched:
            liar = _lying(Random(seed))
            patched.setattr(sat, "_solver_class", lambda liar=liar: liar)
            built = coordlang(
                *("build", *files, "--tasks", "all", "--method", "minimal", "--jobs", 1),
                *("-o", language, "--certificate", proof),
            )
        codes.append(built.code)
        if built.code == 0:
            guarantee = json.loads(language.read_text())["guarantee"]
            assert guarantee["size"] == guarantee["lower_bound"] == least
            assert coordlang("verify", language, *files, "--certificate", proof).code == 0
        else:
            assert built.code == _INTERNAL, built.err
            assert language.read_text() == "old language"
            assert proof.read_text() == "old proof"
    assert _INTERNAL in codes


@pytest.mark.parametrize("world", _LEAST)
def test_no_bound_is_above_the_size(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, world: tuple[str, str]
) -> None:
    """Without a certificate, too: a contradiction is an error, and nothing is written."""
    files = DOMAINS / world[0] / "domain.pddl", DOMAINS / world[0] / f"{world[1]}.pddl"
    for seed in _SEEDS:
        language = tmp_path / f"{seed}.json"
        with monkeypatch.context() as patched:
            liar = _lying(Random(seed))
            patched.setattr(sat, "_solver_class", lambda liar=liar: liar)
            built = coordlang(
                *("build", *files, "--tasks", "all", "--method", "minimal", "--jobs", 1),
                *("-o", language),
            )
        assert language.exists() == (built.code == 0)
        if built.code == 0:
            guarantee = json.loads(language.read_text())["guarantee"]
            assert guarantee["lower_bound"] <= guarantee["size"]
        else:
            assert built.code == _INTERNAL, built.err


def test_a_certificate_with_too_few_reasons_is_not_written(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a false refutation leaves them; the language, though right, is not written either."""

    def too_few(*arguments: Any) -> Certificate:
        whole = certify(*arguments)
        return msgspec.structs.replace(whole, reasons=whole.reasons[:1])

    monkeypatch.setattr("coordlang.commands.built.certify", too_few)
    files = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
    built = coordlang(
        *("build", *files, "--tasks", "all", "--method", "minimal", "--jobs", 1),
        *("-o", tmp_path / "language.json", "--certificate", tmp_path / "proof.json"),
    )
    assert built.code == _INTERNAL
    assert "the lower bound is not proved" in built.err
    assert not [*tmp_path.iterdir()]
