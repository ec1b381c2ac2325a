"""A joint model and one task as a plain ground planning task, for the planners of others.

Two forms.  *Explicit*: one plain action per joint action.  *Select-then-apply*, of linear size: the robots choose one
after another, what they chose is checked, and only then the effects happen, one robot after another; all choices and
checks see the state before the step, and only the first choice of a step pays for it.

This is the cross-check of `planners.composition`, `planners.interference` and `planners.whole`, so it shares their
input and nothing else: interference, formulas about the joint step and conditional effects are worked out anew here.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from typing import Literal

from planners.grounding import GroundAction
from planners.joint import FullState, Goal, JointModel, show
from planners.model import PlanningTask
from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, Not, Or, StepAtom, Truth

Form = Literal["explicit", "select-then-apply"]
#: A condition on a plain state: the number of a fact, and whether it is to be true.
Condition = tuple[int, bool]
Known = Mapping[Atom, bool]

#: The makespan up to which `PlainTask.cost` is sure to be lexicographic by default.
LONGEST = 100


@dataclass(frozen=True, slots=True)
class PlainAction:
    """A ground STRIPS action with negative preconditions; facts by number, ``adds`` and ``deletes`` are disjoint."""

    name: str
    preconditions: tuple[Condition, ...]
    adds: tuple[int, ...]
    deletes: tuple[int, ...]
    cost: int


@dataclass(frozen=True, slots=True)
class PlainTask:
    """A ground planning task.

    ``facts`` are texts; facts of the model are its PDDL atoms.  A plan of total cost ``step_cost * m + s`` stands for
    a joint plan of makespan ``m`` and second cost ``s``; ``dearest`` is the most that one joint step adds to ``s``.
    """

    name: str
    form: Form
    facts: tuple[str, ...]
    init: frozenset[int]
    actions: tuple[PlainAction, ...]
    goal: tuple[Condition, ...]
    step_cost: int
    dearest: int

    def cost(self, total: int) -> tuple[int, int] | None:
        """An optimal total cost as (makespan, second cost); None if ``step_cost`` is too small to be sure.

        A plan of ``k`` steps costs from ``step_cost * k`` to ``(step_cost + dearest) * k``, which is less than
        ``step_cost * m`` for every ``k < m`` when ``step_cost > dearest * m``: then no plan has fewer than ``m`` steps.
        """
        makespan, second = divmod(total, self.step_cost)
        return (makespan, second) if self.step_cost > self.dearest * makespan else None


def compile_plain(model: JointModel, task: PlanningTask, limit: int = 2000, longest: int = LONGEST) -> PlainTask:
    """The plain form of a task: explicit with at most ``limit`` plain actions, else select-then-apply.

    Parameters
    ----------
    limit
        0 asks for select-then-apply.  Joint-action PDDL, whose ground actions are plain actions already, may exceed it.
    longest
        The makespan, in joint steps, up to which `PlainTask.cost` has to be sure.
    """
    team = _team(model)
    step_cost = team.dearest * longest + 1
    out, form = _written(team, model, task.goal, step_cost, limit)
    true = {out.fact(atom) for atom, holds in _state(model, task.init.tolist()).items() if holds}
    return PlainTask(
        name=task.name,
        form=form,
        facts=tuple(show(atom) for atom in out.facts),
        init=frozenset(true | out.init),
        actions=tuple(out.actions),
        goal=out.goal,
        step_cost=step_cost,
        dearest=team.dearest,
    )


def _written(team: _Team, model: JointModel, goal: Goal, step_cost: int, limit: int) -> tuple[_Writer, Form]:
    if model.is_joint_action and limit:
        limit = max(limit, 4 * len(model.actions))
    if limit:
        with suppress(_TooManyError):
            return _explicit(team, model, goal, step_cost, limit), "explicit"
    return _select_then_apply(team, model, goal, step_cost), "select-then-apply"


class _TooManyError(Exception):
    """The explicit form is larger than its limit."""


# --- the joint model, as both forms read it --------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Team:
    """Who chooses what: for joint-action PDDL there is one chooser, of whole joint actions.

    ``seconds`` is the second cost of each action, ``clashes`` the actions of others that cannot share a step with it.
    """

    choosers: tuple[str, ...]
    may_idle: tuple[bool, ...]
    actions: tuple[GroundAction, ...]
    owners: tuple[tuple[int, ...], ...]
    seconds: tuple[int, ...]
    clashes: tuple[frozenset[int], ...]

    @property
    def dearest(self) -> int:
        """The most that one joint step can add to the second cost."""
        most = [0] * len(self.choosers)
        for owners, second in zip(self.owners, self.seconds, strict=True):
            most[owners[0]] = max(most[owners[0]], second)
        return sum(most)


def _team(model: JointModel) -> _Team:
    actions = model.actions
    seconds = tuple(_second(model, action) for action in actions)
    if model.is_joint_action:
        nothing = (frozenset[int](),) * len(actions)
        return _Team(("team",), (False,), actions, ((0,),) * len(actions), seconds, nothing)
    owners = tuple(action.owners for action in actions)
    return _Team(model.robots, model.keeps_idle, actions, owners, seconds, _clashes(actions))


def _second(model: JointModel, action: GroundAction) -> int:
    if model.cost == "makespan+cost":
        return action.cost
    if model.cost == "makespan":
        return 0
    return sum(part is not None for part in action.parts) if model.is_joint_action else int(not action.does_nothing)


def _clashes(actions: Sequence[GroundAction]) -> tuple[frozenset[int], ...]:
    """For each action the others that cannot share a joint step with it (design.md, section 4).

    In terms of literals ``(atom, value)``: two actions interfere when one writes the contrary of what the other writes
    or reads; the latter is forgiven when a positive formula links them.  Besides, a formula may forbid the other.
    """
    number = {StepAtom(a.schema, a.args): n for n, a in enumerate(actions)}
    writers, readers = defaultdict(set), defaultdict(set)
    named: set[frozenset[int]] = set()
    forbidden: set[frozenset[int]] = set()
    for n, action in enumerate(actions):
        adds = {e.atom for e in action.effects if e.adds}
        for effect in action.effects:
            if effect.adds or effect.atom not in adds:
                writers[effect.atom, effect.adds].add(n)
        for leaf, positive in _leaves((action.precondition, *(e.condition for e in action.effects))):
            if isinstance(leaf, Atom):
                readers[leaf, positive].add(n)
            elif positive and leaf in number:
                named.add(frozenset((n, number[leaf])))
        named |= {frozenset((n, number[link])) for link in action.links if link in number}
        for part in _conjuncts(action.precondition):
            if isinstance(part, Not) and isinstance(part.part, StepAtom) and part.part in number:
                forbidden.add(frozenset((n, number[part.part])))
    pairs = set(forbidden)
    for (atom, value), changing in writers.items():
        pairs |= {frozenset(p) for p in product(changing, writers.get((atom, not value), ()))}
        disturbed = product(changing, readers.get((atom, not value), ()))
        pairs |= {frozenset(p) for p in disturbed} - named
    found: list[set[int]] = [set() for _ in actions]
    for pair in pairs:
        if len(pair) == 2:
            first, second = pair
            found[first].add(second)
            found[second].add(first)
    return tuple(frozenset(others) for others in found)


# --- ground formulas -------------------------------------------------------------------------------------------------

Leaf = Atom | StepAtom


def _leaves(formulas: Iterable[Formula]) -> Iterator[tuple[Leaf, bool]]:
    """The literals that are left in ground formulas in negation normal form, with their sign."""
    todo = [*formulas]
    while todo:
        match todo.pop():
            case Atom() | StepAtom() as leaf:
                yield leaf, True
            case Not(Atom() | StepAtom() as leaf):
                yield leaf, False
            case And(parts) | Or(parts):
                todo += parts


def _conjuncts(formula: Formula) -> tuple[Formula, ...]:
    return formula.parts if isinstance(formula, And) else (formula,)


def _put(formula: Formula, value: Callable[[Leaf], Formula]) -> Formula:
    """A formula with its leaves replaced, truth values simplified away, conjunctions in conjunctions flattened."""
    match formula:
        case Atom() | StepAtom():
            return value(formula)
        case Not(part):
            return _negated(_put(part, value))
        case And(parts):
            return _join(And, (_put(part, value) for part in parts))
        case Or(parts):
            return _join(Or, (_put(part, value) for part in parts))
    return formula


def _join(kind: type[And] | type[Or], parts: Iterable[Formula]) -> Formula:
    neutral, decisive = (TRUE, FALSE) if kind is And else (FALSE, TRUE)
    kept: list[Formula] = []
    for part in parts:
        if part == decisive:
            return decisive
        if part != neutral:
            kept += part.parts if isinstance(part, And | Or) and isinstance(part, kind) else (part,)
    if not kept:
        return neutral
    return kept[0] if len(kept) == 1 else kind(tuple(kept))


def _negated(formula: Formula) -> Formula:
    """The negation of a formula in negation normal form, in negation normal form."""
    match formula:
        case Truth(value):
            return Truth(not value)
        case Not(part):
            return part
        case And(parts):
            return Or(tuple(_negated(part) for part in parts))
        case Or(parts):
            return And(tuple(_negated(part) for part in parts))
    return Not(formula)


def _literals(formula: Formula) -> tuple[dict[Atom, bool], list[Formula]] | None:
    """The literals that a formula demands and its other conjuncts, or None if it contradicts itself at once."""
    known: dict[Atom, bool] = {}
    rest: list[Formula] = []
    for part in _conjuncts(formula):
        atom, positive = (part.part, False) if isinstance(part, Not) else (part, True)
        if part == FALSE or (isinstance(atom, Atom) and known.setdefault(atom, positive) != positive):
            return None
        if part != TRUE and not isinstance(atom, Atom):
            rest.append(part)
    return known, rest


# --- what both forms write -------------------------------------------------------------------------------------------


class _Writer:
    """Collects facts and actions; equal actions are written once."""

    def __init__(self, facts: Iterable[Atom]) -> None:
        self.facts: dict[Atom, int] = {atom: n for n, atom in enumerate(facts)}
        self.actions: list[PlainAction] = []
        self.init: set[int] = set()
        self.goal: tuple[Condition, ...] = ()
        self._seen: set[PlainAction] = set()
        self._places = 0

    def fact(self, atom: Atom) -> int:
        return self.facts.setdefault(atom, len(self.facts))

    def conditions(self, known: Known) -> tuple[Condition, ...]:
        return tuple(sorted((self.fact(atom), value) for atom, value in known.items()))

    def action(self, name: str, known: Known, adds: Iterable[Atom], deletes: Iterable[Atom], cost: int = 0) -> None:
        """An action; an atom that it both adds and deletes is added."""
        plus = {self.fact(atom) for atom in adds}
        minus = {self.fact(atom) for atom in deletes} - plus
        new = PlainAction(name, self.conditions(known), tuple(sorted(plus)), tuple(sorted(minus)), cost)
        if new not in self._seen:
            self._seen.add(new)
            self.actions.append(new)

    def place(self) -> Atom:
        """A new fact that says where between two joint states the computation is."""
        self._places += 1
        return _own("at place", str(self._places))

    def route(
        self, name: str, formula: Formula, start: Atom, end: Atom, known: Known, gain: tuple[Atom, ...] = ()
    ) -> None:
        """Zero-cost actions that lead from ``start`` to ``end`` (and add ``gain``) exactly if ``formula`` holds.

        A conjunction is a way through places, a disjunction a fork, so that the size is linear.
        """
        if isinstance(formula, Or):
            for part in formula.parts:
                self.route(name, part, start, end, known, gain)
            return
        found = _literals(formula)
        if found is None or any(known.get(atom, value) != value for atom, value in found[0].items()):
            return
        literals, forks = found
        here = start
        if literals or not forks:
            after = self.place() if forks else end
            self.action(name, {**known, **literals, here: True}, (after, *(() if forks else gain)), (here,))
            here = after
        for left, fork in zip(range(len(forks) - 1, -1, -1), forks, strict=True):
            after = self.place() if left else end
            self.route(name, fork, here, after, known, () if left else gain)
            here = after


def _own(kind: str, *args: str) -> Atom:
    """A fact of the compilation: its predicate contains a space, so that no name of the user's can be the same."""
    assert " " in kind
    return Atom(kind, args)


def _atoms(model: JointModel) -> list[Atom]:
    numbers = model.evaluator.facts
    return sorted(numbers, key=numbers.__getitem__)


def _state(model: JointModel, words: Sequence[int]) -> dict[Atom, bool]:
    """The value of each fact in a row of the model; remembered actions are left out."""
    return {atom: bool(words[n // 64] >> n % 64 & 1) for n, atom in enumerate(_atoms(model))}


def _goal(model: JointModel, goal: Goal) -> Formula:
    """A goal over facts of the model; a fact that can never be true is replaced by its value."""
    if isinstance(goal, FullState):
        values = _state(model, goal.words)
        return And(tuple(atom if value else Not(atom) for atom, value in values.items()))
    return _put(goal, _of_state(model))


def _of_state(model: JointModel) -> Callable[[Leaf], Formula]:
    facts = model.evaluator.facts
    return lambda leaf: leaf if leaf in facts else FALSE


# --- the explicit form -----------------------------------------------------------------------------------------------


def _explicit(team: _Team, model: JointModel, goal: Goal, step_cost: int, limit: int) -> _Writer:
    """One plain action per joint action, or one per case where it has disjunctions or conditional effects."""
    out = _Writer(_atoms(model))
    for step in _joint_steps(team, limit):
        for known, adds, deletes in _cases_of(team, model, step):
            cost = step_cost + sum(team.seconds[n] for n in step)
            out.action(_name(team, step), known, adds, deletes, cost)
            if len(out.actions) > limit:
                raise _TooManyError
    found = _literals(wanted := _goal(model, goal))
    if found and not found[1]:
        out.goal = out.conditions(found[0])
        return out
    done = _own("goal reached")
    out.goal = out.conditions({done: True})
    for known in _split({}, [wanted], []):
        out.action("reach the goal", known, (done,), ())
        if len(out.actions) > limit:
            raise _TooManyError
    return out


def _joint_steps(team: _Team, limit: int) -> Iterator[tuple[int, ...]]:
    """The sets of actions that may share a step as far as owners and interference say; `_TooManyError` beyond a limit."""
    partial: list[tuple[int, ...]] = [()]
    for robot, idle in enumerate(team.may_idle):
        first = [n for n, owners in enumerate(team.owners) if owners[0] == robot]
        grown: list[tuple[int, ...]] = []
        for step in partial:
            bound = any(robot in team.owners[n] for n in step)
            if bound or idle:
                grown.append(step)
            for n in () if bound else first:
                taken = any(set(team.owners[n]) & set(team.owners[m]) for m in step)
                if not taken and team.clashes[n].isdisjoint(step):
                    grown.append((*step, n))
            if len(grown) > limit:
                raise _TooManyError
        partial = grown
    yield from partial


def _name(team: _Team, step: Sequence[int]) -> str:
    """The label tuple: ground actions of joint-action PDDL that do the same with the same labels are one."""
    chosen = {robot: team.actions[n].label for n in step for robot in team.owners[n]}
    parts = next((team.actions[n].parts for n in step), ()) or [chosen.get(r) for r in range(len(team.choosers))]
    return " ".join(part or "idle" for part in parts)


def _cases_of(team: _Team, model: JointModel, step: Sequence[int]) -> Iterator[tuple[Known, set[Atom], set[Atom]]]:
    """The disjoint cases (what is known, adds, deletes) in which a joint action is applicable, however it turns out."""
    chosen = {StepAtom(team.actions[n].schema, team.actions[n].args) for n in step}
    on_state = _of_state(model)

    def value(leaf: Leaf) -> Formula:
        return Truth(leaf in chosen) if isinstance(leaf, StepAtom) else on_state(leaf)

    effects = [effect for n in step for effect in team.actions[n].effects if on_state(effect.atom) != FALSE]
    conditions = [_put(effect.condition, value) for effect in effects]
    for known in _split({}, [_put(team.actions[n].precondition, value) for n in step], conditions):
        fired = [e for e, c in zip(effects, conditions, strict=True) if _put(c, _lookup(known)) == TRUE]
        adds = {e.atom for e in fired if e.adds}
        yield known, adds, {e.atom for e in fired if not e.adds} - adds


def _lookup(known: Known) -> Callable[[Leaf], Formula]:
    return lambda leaf: Truth(known[leaf]) if isinstance(leaf, Atom) and leaf in known else leaf


def _split(known: Known, formulas: Sequence[Formula], conditions: Sequence[Formula]) -> Iterator[dict[Atom, bool]]:
    """Disjoint conjunctions of literals that together say ``formulas`` and each decide all ``conditions``."""
    found = _literals(_join(And, (_put(f, _lookup(known)) for f in formulas)))
    if found is None:
        return
    literals, rest = found
    known = {**known, **literals}
    if literals and rest:
        yield from _split(known, rest, conditions)
        return
    open_formulas = rest or [c for c in (_put(c, _lookup(known)) for c in conditions) if not isinstance(c, Truth)]
    if not open_formulas:
        yield dict(known)
        return
    atom = next(leaf for leaf, _ in _leaves(open_formulas[:1]) if isinstance(leaf, Atom))
    for value in (True, False):
        yield from _split({**known, atom: value}, rest, conditions)


# --- the select-then-apply form --------------------------------------------------------------------------------------


def _select_then_apply(team: _Team, model: JointModel, goal: Goal, step_cost: int) -> _Writer:
    """Stages of a step: all choose; all check; all undo (rarely); all apply.  Robots without work skip a stage."""
    out = _Writer(_atoms(model))
    value = _of_choices(team, model)
    choices = [_Choice(team, n, value) for n in range(len(team.actions))]
    robots = range(len(team.choosers))
    stages = [
        *(("choose", i) for i in robots),
        *(("check", i) for i in robots if any(c.robot == i and c.has_checks for c in choices)),
        *(("undo", i) for i in robots if any(c.robot == i and c.early for c in choices)),
        *(("apply", i) for i in robots),
    ]
    names = [_own(f"time to {stage}", team.choosers[i]) for stage, i in stages]
    stage = {s: (names[k], names[(k + 1) % len(names)]) for k, s in enumerate(stages)}
    kinds = [[kind for kind in ("check", "undo") if (kind, i) in stage] for i in robots]
    for robot in robots:
        if team.may_idle[robot]:
            _choose(out, team, None, robot, stage["choose", robot], step_cost, kinds[robot])
        for kind in kinds[robot]:
            _pass(out, f"nothing to {kind}", *stage[kind, robot], _simple(team, robot, kind))
        for choice in choices:
            if robot in team.owners[choice.number]:
                _choose(out, team, choice, robot, stage["choose", robot], step_cost, kinds[robot])
                _carry_out(out, team, choice, robot, stage)
        idle = _chosen(team, robot, "idle")
        here, after = stage["apply", robot]
        if team.may_idle[robot]:
            _pass(out, f"apply {team.choosers[robot]} idle", here, after, idle)
    _set_goal(out, _goal(model, goal), names[0])
    return out


def _carry_out(
    out: _Writer, team: _Team, choice: _Choice, robot: int, stage: Mapping[tuple[str, int], tuple[Atom, Atom]]
) -> None:
    """Check, undo and apply of a chosen subaction; of a shared one the first owner does all."""
    here, after = stage["apply", robot]
    if robot != choice.robot:
        mark = _chosen(team, robot, choice.label)
        _pass(out, f"apply {team.choosers[robot]} {choice.label}", here, after, mark)
        return
    if choice.has_checks:
        _check(out, choice, *stage["check", robot])
    if choice.early:
        _perform(out, choice, *stage["undo", robot], early=True)
    _perform(out, choice, here, after, early=False)


class _Choice:
    """A subaction of its first owner: what is read when it is chosen, checked afterwards, and done at last.

    ``literals`` is None if they contradict each other.  ``groups`` are its conditional effects by condition.  ``early``
    are the atoms that it may both delete and conditionally add: their deletes come before all adds of the step.
    """

    def __init__(self, team: _Team, number: int, value: Callable[[Leaf], Formula]) -> None:
        action = team.actions[number]
        self.number, self.label, self.robot = number, action.label, team.owners[number][0]
        self.chosen = _chosen(team, self.robot, self.label)
        now: list[Formula] = []
        later: list[Formula] = []
        for part in _conjuncts(action.precondition):
            if isinstance(part, Not) and isinstance(part.part, StepAtom):
                continue  # among the clashes
            (later if isinstance(part, And | Or | StepAtom) else now).append(_put(part, value))
        found = _literals(_join(And, now))
        self.literals = None if found is None else found[0]
        self.checks = _join(And, later)
        by_condition: dict[Formula, tuple[set[Atom], set[Atom]]] = {TRUE: (set(), set())}
        for effect in action.effects:
            if value(effect.atom) != FALSE:
                sets = by_condition.setdefault(_put(effect.condition, value), (set(), set()))
                sets[0 if effect.adds else 1].add(effect.atom)
        by_condition.pop(FALSE, None)
        self.adds, self.deletes = by_condition.pop(TRUE)
        self.groups = list(by_condition.items())
        maybe = {atom for _, (adds, _) in self.groups for atom in adds} - self.adds
        self.early = maybe & self.deletes.union(*(deletes for _, (_, deletes) in self.groups))

    @property
    def has_checks(self) -> bool:
        return self.checks != TRUE or bool(self.groups)

    def fires(self, group: int) -> Atom:
        return _own("condition holds", *self.chosen.args, str(group))


def _of_choices(team: _Team, model: JointModel) -> Callable[[Leaf], Formula]:
    """The meaning of leaves on the plain facts: that a subaction is done means that its first owner has chosen it."""
    on_state = _of_state(model)
    who = {
        StepAtom(action.schema, action.args): _chosen(team, owners[0], action.label)
        for action, owners in zip(team.actions, team.owners, strict=True)
    }
    return lambda leaf: who.get(leaf, FALSE) if isinstance(leaf, StepAtom) else on_state(leaf)


def _chosen(team: _Team, robot: int, label: str) -> Atom:
    return _own("has chosen", team.choosers[robot], label)


def _simple(team: _Team, robot: int, kind: str) -> Atom:
    return _own(f"nothing to {kind}", team.choosers[robot])


def _choose(
    out: _Writer, team: _Team, choice: _Choice | None, robot: int, stage: tuple[Atom, Atom], step_cost: int,
    kinds: Sequence[str],
) -> None:  # fmt: skip
    """One robot's choosing of a subaction (or of idling), unless an earlier robot's choice forbids it."""
    here, after = stage
    label = choice.label if choice else "idle"
    known = {here: True}
    adds, deletes = {after, _chosen(team, robot, label)}, {here}
    first = choice.robot if choice else robot
    cost = step_cost if robot == 0 else 0
    if choice and robot == first:
        if choice.literals is None:
            return
        known |= choice.literals
        cost += team.seconds[choice.number]
        for other in team.clashes[choice.number]:
            if (earlier := team.owners[other][0]) < robot:
                known[_chosen(team, earlier, team.actions[other].label)] = False
        adds |= {_calls(team, robot, k) for k in team.owners[choice.number] if k != robot}
    for caller in _callers(team, robot):
        known[_calls(team, caller, robot)] = caller == first
    if choice and robot != first:
        known[choice.chosen] = True
        deletes.add(_calls(team, first, robot))
    for kind in kinds:
        if not choice or robot != first or not (choice.has_checks if kind == "check" else choice.early):
            adds.add(_simple(team, robot, kind))
    out.action(f"choose {team.choosers[robot]} {label}", known, adds, deletes, cost)


def _calls(team: _Team, caller: int, robot: int) -> Atom:
    """The caller has chosen a subaction that this robot has to choose too."""
    return _own("waits for", team.choosers[caller], team.choosers[robot])


def _callers(team: _Team, robot: int) -> list[int]:
    return sorted({owners[0] for owners in team.owners if robot in owners and owners[0] != robot})


def _check(out: _Writer, choice: _Choice, here: Atom, after: Atom) -> None:
    """Meet the formulas of a chosen subaction and note which of its conditional effects fire."""
    name, known = f"check {choice.label}", {choice.chosen: True}
    if choice.checks != TRUE:
        end = out.place() if choice.groups else after
        out.route(name, choice.checks, here, end, known)
        here = end
    for k, (condition, _) in enumerate(choice.groups):
        end = after if k + 1 == len(choice.groups) else out.place()
        out.route(f"{name} fires {k}", condition, here, end, known, (choice.fires(k),))
        out.route(f"{name} does not fire {k}", _negated(condition), here, end, known)
        here = end


def _perform(out: _Writer, choice: _Choice, here: Atom, after: Atom, *, early: bool) -> None:
    """The effects of a chosen subaction: only the early deletes, or all the rest."""

    def part(adds: set[Atom], deletes: set[Atom]) -> tuple[set[Atom], set[Atom]]:
        if early:
            return set(), deletes & choice.early
        return set(adds), deletes - choice.early - choice.adds

    name = f"{'undo' if early else 'apply'} {choice.label}"
    adds, deletes = part(choice.adds, choice.deletes)
    end = out.place() if choice.groups else after
    done = set() if early else {choice.chosen}
    out.action(name, {here: True, choice.chosen: True}, adds | {end}, deletes | done | {here})
    for k, (_, effects) in enumerate(choice.groups):
        here, end = end, after if k + 1 == len(choice.groups) else out.place()
        adds, deletes = part(*effects)
        fires = choice.fires(k)
        done = set() if early else {fires}
        out.action(f"{name} fired {k}", {here: True, fires: True}, adds | {end}, deletes | done | {here})
        out.action(f"{name} not fired {k}", {here: True, fires: False}, {end}, {here})


def _pass(out: _Writer, name: str, here: Atom, after: Atom, mark: Atom) -> None:
    """Leave a stage in which a robot has nothing to do."""
    out.action(name, {here: True, mark: True}, {after}, {here, mark})


def _set_goal(out: _Writer, formula: Formula, here: Atom) -> None:
    """The goal counts between two steps (``here``)."""
    out.init = {out.fact(here)}
    found = _literals(formula)
    if found and not found[1]:
        out.goal = out.conditions({here: True, **found[0]})
        return
    done = _own("goal reached")
    out.goal = out.conditions({done: True})
    out.route("reach the goal", formula, here, done, {})


# --- PDDL ------------------------------------------------------------------------------------------------------------


def to_pddl(plain: PlainTask) -> tuple[str, str]:
    """Domain and problem text of a plain task: STRIPS with negative preconditions and action costs.

    Facts become predicates without arguments; a comment keeps what each predicate and action stands for.
    """
    facts = _safe_names(plain.facts)
    actions = _safe_names(action.name for action in plain.actions)
    domain = [
        f"; {plain.name}: {plain.form} form; one joint step costs {plain.step_cost}",
        "(define (domain plain)",
        "  (:requirements :strips :negative-preconditions :action-costs)",
        "  (:predicates",
        *(f"    ({safe}) ; {text}" for safe, text in zip(facts, plain.facts, strict=True)),
        "  )",
        "  (:functions (total-cost) - number)",
    ]
    for safe, action in zip(actions, plain.actions, strict=True):
        changes = [f"({facts[n]})" for n in action.adds] + [f"(not ({facts[n]}))" for n in action.deletes]
        domain += [
            f"  ; {action.name}",
            f"  (:action {safe}",
            "    :parameters ()",
            f"    :precondition {_all_of(facts, action.preconditions)}",
            f"    :effect (and {' '.join((*changes, f'(increase (total-cost) {action.cost})'))}))",
        ]
    problem = [
        "(define (problem plain-task)",
        "  (:domain plain)",
        "  (:init",
        "    (= (total-cost) 0)",
        *(f"    ({facts[n]})" for n in sorted(plain.init)),
        "  )",
        f"  (:goal {_all_of(facts, plain.goal)})",
        "  (:metric minimize (total-cost)))",
    ]
    return "\n".join((*domain, ")", "")), "\n".join((*problem, ""))


def _all_of(names: Sequence[str], conditions: Iterable[Condition]) -> str:
    parts = [f"({names[n]})" if positive else f"(not ({names[n]}))" for n, positive in conditions]
    return f"(and{''.join(f' {part}' for part in parts)})"


def _safe_names(texts: Iterable[str]) -> list[str]:
    """For each text a PDDL name of its own: letters, digits, ``-`` and ``_``, beginning with a letter."""
    taken: dict[str, int] = defaultdict(int)
    used: set[str] = set()
    names = []
    for text in texts:
        base = re.sub(r"[^a-z0-9-]+", "_", text.lower()).strip("_-")
        base = base if base[:1].isalpha() else f"x_{base}"
        name = base
        while name in used or name in _RESERVED:
            taken[base] += 1
            name = f"{base}__{taken[base]}"
        used.add(name)
        names.append(name)
    return names


#: Names that are words of PDDL itself.
_RESERVED = frozenset(["and", "or", "not", "imply", "forall", "exists", "when", "either", "object", "total-cost"])
