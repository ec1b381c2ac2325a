# SPDX-License-Identifier: GPL-3.0-or-later
"""Independent plan checker: whether a sequence of joint steps is a plan.

Reads `planners.check.rules`, the rules of joint steps read literally, and nothing of grounding,
composition or search.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from planners.check.meaning import Moment
from planners.check.rules import Labels, Rules
from planners.pddl.lifted import Atom, Domain, Formula, Problem
from planners.pddl.robots import Team


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a plan is one.

    ``makespan`` is its number of joint steps.  For an invalid plan ``step`` is the first step that
    breaks a rule (from 0; the makespan if only the goal fails) and ``reason`` says which, in words.
    """

    valid: bool
    makespan: int
    step: int | None
    reason: str


def validate(
    domain: Domain,
    problem: Problem,
    team: Team,
    plan: Sequence[Labels],
    *,
    init: Iterable[Atom] | None = None,
    goal: Formula | None = None,
) -> Verdict:
    """Check that every step is legal where it is taken and that the goal holds at the end.

    ``plan[k][i]`` is the subaction of robot ``i`` in step ``k``, such as ``"(move r1 a b)"`` (in
    joint-action PDDL the filled-in template of the subaction comment), or None if it idles.
    ``init`` (true fluents; statics come from the problem) and ``goal`` are of another task than the
    problem's own.

    Raises `BadInput` where two applicable joint actions with the same subactions have different
    results.
    """
    rules = Rules(domain, problem, team)
    state = rules.meaning.fluents_of(problem.init if init is None else init)
    for number, labels in enumerate(plan):
        after = rules.step(state, labels)
        if isinstance(after, str):
            return Verdict(False, len(plan), number, after)
        state = after
    wanted = problem.goal if goal is None else goal
    at_end = Moment(state)
    if not rules.meaning.holds(wanted, {}, True, at_end):
        why = rules.meaning.why_not(wanted, {}, True, at_end)
        reason = f"the goal does not hold at the end: {why}"
        return Verdict(False, len(plan), len(plan), reason)
    return Verdict(
        True, len(plan), None, "every step is a joint step and the goal holds at the end"
    )
