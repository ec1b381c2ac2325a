# SPDX-License-Identifier: GPL-3.0-or-later
"""The explicit form: one classical action per joint action."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from planners.classical.selectors import Selectors
from planners.classical.task import Known
from planners.classical.writer import (
    Writer,
    goal_formula,
    known_literals,
    own_fact,
    state_reader,
)
from planners.joint.model import Goal, JointModel
from planners.pddl.formula_tree import GroundLeaf, joined, literals, negated, substituted
from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, StepAtom, Truth


class TooManyError(Exception):
    """The explicit form is larger than its limit."""


def explicit(team: Selectors, model: JointModel, goal: Goal, step_cost: int, limit: int) -> Writer:
    """One action per joint action, and case of its disjunctions and conditional effects."""
    out = Writer(model.codec.facts)
    if not limit:
        raise TooManyError
    for step in _joint_steps(team, limit):
        parts, cost = _parts(team, step), step_cost + team.second_cost(step)
        name = " ".join(part or "idle" for part in parts)
        for known, adds, deletes in _cases_of(team, model, step):
            out.action(name, known, adds, deletes, cost, tuple(enumerate(parts)))
            if len(out.actions) > limit:
                raise TooManyError
    found = known_literals(wanted := goal_formula(model, goal))
    if found and not found[1]:
        out.goal = out.conditions(found[0])
        return out
    done = own_fact("goal reached")
    out.goal = out.conditions({done: True})
    for known in _split({}, [wanted], []):
        out.action("reach the goal", {**known, done: False}, (done,), ())
        if len(out.actions) > limit:
            raise TooManyError
    return out


def _joint_steps(team: Selectors, limit: int) -> list[tuple[int, ...]]:
    """Sets of actions that owners and interference allow; `TooManyError` beyond a limit."""
    partial: list[tuple[int, ...]] = [()]
    for robot, idling in enumerate(team.idling):
        first = [n for n, owners in enumerate(team.owners) if owners[0] == robot]
        grown: list[tuple[int, ...]] = []
        for step in partial:
            taken = {owner for n in step for owner in team.owners[n]}
            if robot in taken or idling is not None:
                grown.append(step)
            if robot not in taken:
                grown += [
                    (*step, n)
                    for n in first
                    if taken.isdisjoint(team.owners[n]) and team.clashes[n].isdisjoint(step)
                ]
            if len(grown) > limit:
                raise TooManyError
        partial = grown
    return partial


def _parts(team: Selectors, step: Sequence[int]) -> Sequence[str | None]:
    """What each robot does in a joint action, the same for ground actions that do the same."""
    chosen = {robot: team.actions[n].label for n in step for robot in team.owners[n]}
    whole = next((team.actions[n].parts for n in step), ())
    return whole or [chosen.get(robot) for robot in range(len(team.names))]


def _cases_of(
    team: Selectors, model: JointModel, step: Sequence[int]
) -> Iterator[tuple[Known, set[Atom], set[Atom]]]:
    """The disjoint cases in which a joint action is applicable, as (known, adds, deletes)."""
    chosen = {StepAtom(team.actions[n].schema, team.actions[n].args) for n in step}
    on_state = state_reader(model)

    def value(leaf: GroundLeaf) -> Formula:
        return Truth(leaf in chosen) if isinstance(leaf, StepAtom) else on_state(leaf)

    covered_by = [other for n in step for other in team.covered_by[n]]
    wanted = [substituted(team.actions[n].precondition, value) for n in step]
    wanted += [negated(substituted(team.actions[n].precondition, value)) for n in covered_by]
    effects = [
        (substituted(effect.condition, value), effect)
        for n in step
        for effect in team.actions[n].effects
        if on_state(effect.atom) != FALSE
    ]
    for known in _split({}, wanted, [condition for condition, _ in effects]):
        fired = [e for condition, e in effects if substituted(condition, _lookup(known)) == TRUE]
        adds = {e.atom for e in fired if e.adds}
        yield known, adds, {e.atom for e in fired if not e.adds} - adds


def _lookup(known: Known) -> Callable[[GroundLeaf], Formula]:
    return lambda leaf: Truth(known[leaf]) if isinstance(leaf, Atom) and leaf in known else leaf


def _split(
    known: Known, formulas: Sequence[Formula], conditions: Sequence[Formula]
) -> Iterator[dict[Atom, bool]]:
    """Disjoint conjunctions of literals that say ``formulas`` and decide all ``conditions``."""
    found = known_literals(joined(And, (substituted(f, _lookup(known)) for f in formulas)))
    if found is None:
        return
    new, rest = found
    known = {**known, **new}
    if new and rest:
        yield from _split(known, rest, conditions)
        return
    open_formulas = rest or [
        c for c in (substituted(c, _lookup(known)) for c in conditions) if not isinstance(c, Truth)
    ]
    if not open_formulas:
        yield dict(known)
        return
    *_, atom = (leaf for leaf, _ in literals(open_formulas[0]) if isinstance(leaf, Atom))
    for value in (True, False):
        yield from _split({**known, atom: value}, rest, conditions)
