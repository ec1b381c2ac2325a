# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas about the joint step as clauses, against the formulas themselves."""

from __future__ import annotations

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.joint.conditions import Evaluator
from planners.joint.states import FactTable, StateCodec
from planners.joint.step_clauses import StepClauses, clauses
from planners.pddl.lifted import And, Atom, Formula, Not, Or, StepAtom, Truth

ROBOTS, LABELS = 3, 3
FACTS = FactTable.of({Atom("p", (name,)) for name in "abcd"})
STEPS = {StepAtom(f"do{r}", (f"{k}",)): (r, k) for r in range(ROBOTS) for k in range(1, LABELS)}
EVALUATOR = Evaluator(FACTS, STEPS)
LEAVES = st.sampled_from(
    [*FACTS.atoms, *STEPS, Atom("never", ()), StepAtom("nobody", ()), Truth(True), Truth(False)]
)
FORMULAS = st.recursive(
    LEAVES,
    lambda part: st.one_of(
        part.map(Not),
        st.lists(part, max_size=3).map(lambda parts: And(tuple(parts))),
        st.lists(part, max_size=3).map(lambda parts: Or(tuple(parts))),
    ),
    max_leaves=8,
)
#: All states, and for each robot all labels of the others.
ROWS = StateCodec(FACTS).rows_of([[f for f in range(4) if n >> f & 1] for n in range(16)])


def agree(met: Counter[str], formulas: list[Formula], robot: int, label: int) -> None:
    found = [clauses(formula, EVALUATOR, robot, label) for formula in formulas]
    together = [clause for own in found if own is not None for clause in own]
    assert None not in found
    table = StepClauses(robot, {label: together}, LABELS)
    rows = np.repeat(np.arange(16), LABELS**ROBOTS)
    joint = np.stack(np.unravel_index(np.arange(LABELS**ROBOTS), (LABELS,) * ROBOTS))
    chosen = np.tile(joint, 16)
    mine = np.flatnonzero(chosen[robot] == label)
    rows, chosen = rows[mine], chosen[:, mine]
    holds = np.ones(len(rows), np.bool_)
    for formula in formulas:
        holds &= EVALUATOR.holds(formula, ROWS, rows, chosen.T.astype(np.int32))
    possible, waiting = table.waiting(ROWS, np.arange(16), np.full(16, label))
    answer = possible[rows]
    for stage, open_clauses in waiting.items():
        assert stage >= robot
        answer &= ~table.unmet(open_clauses, rows, chosen)
    assert (answer == holds).all()
    # What no choice of the others makes possible is possible for the state alone, or it is not.
    met[f"possible: {possible.any()}"] += 1
    met[f"waiting: {bool(waiting)}"] += 1


def test_clauses_say_what_the_formulas_say() -> None:
    met: Counter[str] = Counter()

    @settings(max_examples=150, deadline=None, derandomize=True)
    @given(st.lists(FORMULAS, min_size=1, max_size=2), st.integers(0, 2), st.integers(0, 2))
    def compare(formulas: list[Formula], robot: int, label: int) -> None:
        agree(met, formulas, robot, label)

    compare()
    assert min(met["possible: True"], met["possible: False"]) >= 10
    assert min(met["waiting: True"], met["waiting: False"]) >= 10
