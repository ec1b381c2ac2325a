# SPDX-License-Identifier: GPL-3.0-or-later
"""A SAT solver that calls formulas unsatisfiable that are not, and a Fast Downward whose plan is cut
off or none: nothing wrong is certified, and no agreement or "no plan" is false.
"""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest
from pysat.solvers import Solver

from coordlang.verification.certificate_file import Certificate
from coordlang.verification.make_certificate import certify
from planners.classical import compile_classical, fast_downward
from planners.classical.fast_downward import FastDownwardFailed, answered, total_cost
from planners.classical.task import LONGEST
from planners.search import sat
from tests.support import thorough
from tests.support.command import Command
from tests.support.domains import files_of, loaded_from

#: Worlds in which three words are least for all pairs of states.
_WORLDS = (("t-map", "problem"), ("grid", "gw1-2x2"), ("three-cells", "problem"))
#: The solver that checks certificates, by which no language is built.
_CHECKS = "maplesat"
_INTERNAL = 32


# ---- a SAT solver

_WHOLE = sat.whole


def _lying(random: Random) -> type:
    """A class of solvers that answer "unsatisfiable" to 30 % of all satisfiable questions."""

    class Lying(_WHOLE(Solver)):  # type: ignore[misc]
        def __init__(self, name: str, **arguments: Any) -> None:
            super().__init__(name=name, **arguments)
            self.is_honest = name == _CHECKS

        def solve_limited(self, **arguments: Any) -> bool | None:
            answer: bool | None = super().solve_limited(**arguments)
            return False if answer and not self.is_honest and random.random() < 0.3 else answer

    return Lying


@pytest.mark.parametrize("certified", [True, False])
@pytest.mark.parametrize("world", [_WORLDS[2], *thorough((_WORLDS[0],), (_WORLDS[1],))])
def test_a_false_refutation_is_not_told(
    coordlang: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    world: tuple[str, str],
    certified: bool,
) -> None:
    """Code 0 with a certificate that holds, or an error with every file as it was."""
    files = files_of(*world)
    language, proof = tmp_path / "language.json", tmp_path / "proof.json"
    outputs = ("-o", language, *(("--certificate", proof) if certified else ()))
    build = ("build", *files, "--tasks", "all", "--method", "minimal", "--jobs", 1, *outputs)
    codes = []
    for seed in range(5):
        language.write_text("old language")
        proof.write_text("old proof")
        with monkeypatch.context() as patched:
            liar = _lying(Random(seed))
            patched.setattr(
                sat, "whole", lambda kind, liar=liar: liar if kind is Solver else _WHOLE(kind)
            )
            codes.append(coordlang(*build).code)
        if codes[-1] != 0:
            assert codes[-1] == _INTERNAL
            assert [language.read_text(), proof.read_text()] == ["old language", "old proof"]
            continue
        guarantee = json.loads(language.read_text())["guarantee"]
        assert guarantee["lower_bound"] <= guarantee["size"]
        if certified:
            assert guarantee["size"] == guarantee["lower_bound"] == 3
            assert coordlang("verify", language, *files, "--certificate", proof).code == 0
    assert _INTERNAL in codes or not certified


def test_a_certificate_with_too_few_reasons_is_not_written(
    coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a false refutation leaves them; the language, though right, is not written either."""

    def too_few(*arguments: Any) -> Certificate:
        whole = certify(*arguments)
        return msgspec.structs.replace(whole, reasons=whole.reasons[:1])

    monkeypatch.setattr("coordlang.commands.building.certify", too_few)
    outputs = ("-o", tmp_path / "language.json", "--certificate", tmp_path / "proof.json")
    build = ("build", *files_of(*_WORLDS[0]), "--tasks", "all", "--method", "minimal")
    ended = coordlang(*build, *outputs)
    assert ended.code == _INTERNAL
    assert "the lower bound is not proved" in ended.err
    assert not [*tmp_path.iterdir()]


# ---- Fast Downward


def test_a_plan_that_is_cut_off_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The line with the cost is the last one, and it must be whole."""
    loaded = loaded_from(*_WORLDS[2])
    task = compile_classical(loaded.model, loaded.tasks[0], 2000, LONGEST)
    plan, found = tmp_path / "plan", list[str]()

    def read(classical: Any, directory: Path, code: int) -> int | None:
        found.append((directory / "plan").read_text())
        return answered(classical, directory, code)

    monkeypatch.setattr(fast_downward, "answered", read)
    assert total_cost(task) == 2
    (text,) = found
    for size in range(-1, len(text.rstrip())):
        if size >= 0:
            plan.write_text(text[:size])
        with pytest.raises(FastDownwardFailed, match="is not complete"):
            answered(task, tmp_path, 0)
    for size in range(len(text.rstrip()), len(text) + 1):
        plan.write_text(text[:size])
        assert answered(task, tmp_path, 0) == 2
    *actions, cost = text.splitlines()
    wrong = [[], actions[:1], actions[1:], actions[::-1], [*actions, "(fly )"], actions * 2]
    lines = [[*some, cost] for some in wrong] + [[*actions, cost.replace("2", "1")]]
    for some in lines:
        plan.write_text("\n".join(some))
        with pytest.raises(FastDownwardFailed, match="actions that are no plan of its task"):
            answered(task, tmp_path, 0)
