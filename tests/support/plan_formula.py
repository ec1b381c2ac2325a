# SPDX-License-Identifier: GPL-3.0-or-later
"""The joint plans of a task as models of a formula: the definition of a joint step, and nothing else.

The formula is written from the ground actions alone: no bound, no mutex, no table of interference
and no other part of the search has to do with it.  Shared with the search are the PDDL reader, the
grounder and the rule of who may idle.  Actions with conditional effects, disjunctions, quantifiers
or conditions about the joint step are not written down here, nor those of several robots.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import permutations

from pysat.solvers import Cadical153

from planners.grounding import GroundAction
from planners.joint.model import FullState
from planners.loading import PlanningInstance
from planners.pddl.lifted import TRUE, And, Atom, Formula, Not


class NotWritten(Exception):
    """The task has something that this formula does not say."""


class PlanFormula:
    """The joint plans of a task with so many steps, as models of a formula in conjunctive form.

    Parameters
    ----------
    loaded
        The joint model and its task; ground actions, robots and the first task are read.
    steps
        The number of joint steps.
    most
        The most actions that a plan may have, without those that do nothing; None: any number.
    least
        The least number of them.

    Raises
    ------
    NotWritten
        A condition is no conjunction of literals over states, or an action has several robots.
    """

    def __init__(
        self, loaded: PlanningInstance, steps: int, least: int = 0, most: int | None = None
    ) -> None:
        model, task = loaded.model, loaded.tasks[0]
        if isinstance(task.goal, FullState):
            raise NotWritten("a goal that is a whole state")
        self.clauses: list[list[int]] = []
        self.size = 0
        #: Per step and robot the variables of its actions; the first one is idling.
        self.chosen: list[list[list[int]]] = []
        self._actions: list[list[GroundAction]] = [[] for _ in model.robots]
        for action in model.actions:
            if len(action.owners) != 1 or action.parts:
                raise NotWritten("an action of several robots")
            self._actions[action.owners[0]].append(action)
        self._conditions = {
            id(action): literals(action.precondition) for own in self._actions for action in own
        }
        facts = list(model.codec.facts)
        true = {facts[number] for number in model.codec.true_facts(task.init)} | model.statics
        goal = literals(task.goal)
        mentioned = {fact for fact, _ in goal}
        for own in self._actions:
            for action in own:
                mentioned |= {fact for fact, _ in self._conditions[id(action)]}
                mentioned |= {effect.atom for effect in action.effects}
        now = {fact: self._fresh() for fact in sorted(mentioned, key=str)}
        for fact, variable in now.items():
            self.clauses.append([variable if fact in true else -variable])
        for _ in range(steps):
            now = self._step(now)
        for fact, value in goal:
            self.clauses.append([now[fact] if value else -now[fact]])
        if most is not None:
            self._count(least, most)

    @property
    def sampled(self) -> list[int]:
        """The variables that are the plan: the robots' actions."""
        return [variable for step in self.chosen for own in step for variable in own]

    def _fresh(self) -> int:
        self.size += 1
        return self.size

    def _any(self, variables: Sequence[int]) -> int:
        """A variable that is true where one of these is, and nowhere else."""
        if len(variables) == 1:
            return variables[0]
        found = self._fresh()
        self.clauses.append([-found, *variables])
        self.clauses += [[found, -variable] for variable in variables]
        return found

    def _step(self, now: dict[Atom, int]) -> dict[Atom, int]:
        """The clauses of a joint step; the variables of the facts after it."""
        own = [[self._fresh() for _ in (None, *actions)] for actions in self._actions]
        self.chosen.append(own)
        touched: list[dict[str, dict[Atom, int]]] = []
        for robot, variables in enumerate(own):
            self._exactly_one(variables)
            footprint: dict[str, dict[Atom, list[int]]] = {
                kind: {} for kind in ("adds", "deletes", "needs", "forbids")
            }
            for action, variable in zip(self._actions[robot], variables[1:], strict=True):
                for fact, value in self._conditions[id(action)]:
                    self.clauses.append([-variable, now[fact] if value else -now[fact]])
                for kind, fact in footprints(action, self._conditions[id(action)]):
                    footprint[kind].setdefault(fact, []).append(variable)
            touched.append(
                {
                    kind: {fact: self._any(labels) for fact, labels in found.items()}
                    for kind, found in footprint.items()
                }
            )
        for one, other in permutations(touched, 2):
            for kind, against in (("deletes", "needs"), ("deletes", "adds"), ("adds", "forbids")):
                for fact in one[kind].keys() & other[against].keys():
                    self.clauses.append([-one[kind][fact], -other[against][fact]])
        after = {}
        for fact, before in now.items():
            adding = [robot["adds"][fact] for robot in touched if fact in robot["adds"]]
            deleting = [robot["deletes"][fact] for robot in touched if fact in robot["deletes"]]
            after[fact] = self._after(before, adding, deleting)
        return after

    def _after(self, before: int, adding: list[int], deleting: list[int]) -> int:
        """A fact after a step: it is added, or was true and is not deleted."""
        if not adding and not deleting:
            return before
        after = self._fresh()
        self.clauses += [[-variable, after] for variable in adding]
        self.clauses += [[-variable, -after, *adding] for variable in deleting]
        self.clauses.append([-after, before, *adding])
        self.clauses.append([after, -before, *deleting])
        return after

    def _exactly_one(self, variables: Sequence[int]) -> None:
        """One of some variables is true, by whether one up to here is."""
        self.clauses.append([*variables])
        so_far = variables[0]
        for variable in variables[1:]:
            self.clauses.append([-so_far, -variable])
            so_far = self._any([so_far, variable])

    def _count(self, least: int, most: int) -> None:
        """The actions that are no idling are so many: a sequential counter."""
        counted = [
            self._any(variables[1:]) for step in self.chosen for variables in step if variables[1:]
        ]
        # at_least[k]: of those so far more than k are true.
        at_least: list[int] = []
        for variable in counted:
            more = []
            for k in range(min(len(at_least) + 1, most + 1)):
                fewer = [at_least[k - 1], variable] if k else [variable]
                both = fewer[0] if len(fewer) == 1 else self._all(fewer)
                more.append(self._any([both, at_least[k]]) if k < len(at_least) else both)
            at_least = more
        if len(at_least) > most:
            self.clauses.append([-at_least[most]])
        if least:
            self.clauses.append([at_least[least - 1]] if least <= len(at_least) else [])

    def _all(self, variables: Sequence[int]) -> int:
        """A variable that is true where all of these are, and nowhere else."""
        return -self._any([-variable for variable in variables])


def literals(formula: Formula) -> list[tuple[Atom, bool]]:
    """The literals of a conjunction."""
    if isinstance(formula, And):
        return [found for part in formula.parts for found in literals(part)]
    if isinstance(formula, Atom):
        return [(formula, True)]
    if isinstance(formula, Not) and isinstance(formula.part, Atom):
        return [(formula.part, False)]
    if formula == TRUE:
        return []
    raise NotWritten("a condition that is no conjunction of facts")


def footprints(
    action: GroundAction, conditions: Iterable[tuple[Atom, bool]]
) -> Iterable[tuple[str, Atom]]:
    """What an action needs, forbids, adds and deletes; what it adds, it does not delete."""
    for fact, value in conditions:
        yield "needs" if value else "forbids", fact
    if any(effect.condition != TRUE for effect in action.effects):
        raise NotWritten("a conditional effect")
    adds = {effect.atom for effect in action.effects if effect.adds}
    yield from (("adds", fact) for fact in sorted(adds, key=str))
    deletes = {effect.atom for effect in action.effects if not effect.adds} - adds
    yield from (("deletes", fact) for fact in sorted(deletes, key=str))


def answer(formula: PlanFormula) -> bool:
    """Whether a formula has a model, by CaDiCaL."""
    with Cadical153(bootstrap_with=formula.clauses) as solver:
        return bool(solver.solve())


def listed(formula: PlanFormula, most: int) -> int:
    """How many plans a formula has, found one by one by CaDiCaL until no other is left.

    It stops at one more than ``most``.
    """
    found = 0
    with Cadical153(bootstrap_with=formula.clauses) as solver:
        while found <= most and solver.solve():
            found += 1
            true = set(solver.get_model() or ())
            solver.add_clause([-variable for variable in formula.sampled if variable in true])
    return found
