# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground actions: arguments put in, statics evaluated, the rest in negation normal form.

Static atoms, equalities and types are evaluated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from planners.errors import BadInput, Unsupported
from planners.grounding.reachability import reachable_arguments
from planners.limits import reaching
from planners.pddl.formula_tree import distinct, joined, label, literals, negated, required_atoms
from planners.pddl.formulas import MAX_COST
from planners.pddl.lifted import (
    FALSE,
    TRUE,
    And,
    Atom,
    Domain,
    Effect,
    Equal,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    Problem,
    Schema,
    StepAtom,
    Truth,
    Variable,
)
from planners.pddl.robots import Team, fluent_predicates, objects_of, static_atoms

#: What to try when grounding is too much.
FEWER = "fewer objects, or actions with fewer parameters"
Binding = dict[str, str]


@dataclass(frozen=True, slots=True)
class GroundEffect:
    """``atom`` becomes true (``adds``) or false if ``condition`` holds before the step."""

    atom: Atom
    adds: bool
    condition: Formula


@dataclass(frozen=True, slots=True)
class GroundAction:
    """A ground action in negation normal form over fluent atoms and step atoms.

    ``owners`` are the indices of the robots that choose it together; for joint-action PDDL they are
    all robots and ``parts`` holds each robot's own label (None: idle).  ``cost`` is the PDDL action
    cost.  ``does_nothing`` says that the action is as good as idling: it has no effect, no cost
    that is counted, and no formula or network names it. ``links`` are the actions that a
    concurrency network joins it with: they are meant to be done together.
    """

    schema: str
    args: tuple[str, ...]
    owners: tuple[int, ...]
    precondition: Formula
    effects: tuple[GroundEffect, ...]
    parts: tuple[str | None, ...] = ()
    cost: int = 1
    does_nothing: bool = False
    links: frozenset[StepAtom] = frozenset()

    @property
    def label(self) -> str:
        """The action in PDDL syntax."""
        return label(self.schema, self.args)

    def part_of(self, robot: int) -> str | None:
        """The label of a robot in it; None if the robot idles or does not take part."""
        if self.parts:
            return self.parts[robot]
        return self.label if robot in self.owners else None


def ground_actions(
    domain: Domain, problem: Problem, team: Team, *, also: Iterable[Atom] = (), costs: bool = False
) -> tuple[GroundAction, ...]:
    """All ground actions that may ever be applied.

    Sorted by schema (in domain order) and arguments.

    Parameters
    ----------
    also
        Fluent atoms of further initial states (other problems, task files).
    costs
        Whether PDDL action costs are wanted; else every cost is 1.

    Raises
    ------
    BadInput
        An action that no robot owns (``--unowned error``), or a missing cost value.
    """
    grounder = _Grounder(domain, problem, team)
    world = f"{len(domain.schemas):,} action schemas over {len(problem.objects):,} objects"
    with reaching(lambda: f"looking for the applicable instances of {world}", FEWER):
        reachable = reachable_arguments(
            domain, problem.objects, sorted({*problem.init, *also}, key=str)
        )
    total = sum(map(len, reachable.values()))
    actions: list[GroundAction] = []
    with reaching(
        lambda: f"{len(actions):,} of at most {total:,} ground actions, of {world}", FEWER
    ):
        for schema in domain.schemas:
            for args in reachable[schema.name]:
                action = grounder.action(schema, args, costs)
                if action is not None:
                    actions.append(action)
    return tuple(actions)


def ground_goal(domain: Domain, problem: Problem, goal: Formula) -> Formula:
    """A goal formula over fluent atoms, in negation normal form."""
    return _Grounder(domain, problem, Team((), "")).formula(goal, {}, True)


class _Grounder:
    def __init__(self, domain: Domain, problem: Problem, team: Team) -> None:
        self._domain = domain
        self._problem = problem
        self._team = team
        self._fluents = fluent_predicates(domain)
        self._statics = static_atoms(domain, problem)
        self._schemas = {schema.name: schema for schema in domain.schemas}
        self._named = {atom.action for schema in domain.schemas for atom in _step_atoms(schema)}
        self._named |= {name for constraint in domain.constraints for name, _ in constraint.actions}
        self._members: dict[tuple[str, ...], dict[str, int]] = {}
        self._facts: dict[tuple[str, int, str], list[tuple[str, ...]]] = {}
        for fact in self._statics:
            for position, arg in enumerate(fact.args):
                self._facts.setdefault((fact.predicate, position, arg), []).append(fact.args)
        self._guards: dict[
            int, tuple[Formula, tuple[Atom, ...]]
        ] = {}  # by identity; the formula stays alive here
        self._atoms: dict[tuple[str, tuple[str, ...]], Atom] = {}

    def action(self, schema: Schema, args: tuple[str, ...], costs: bool) -> GroundAction | None:
        """The instance, or None if its precondition is false in every state."""
        binding = {p.name: a for p, a in zip(schema.parameters, args, strict=True)}
        everyone = tuple(range(len(self._team.robots)))
        owners = everyone if schema.parts else self._team.owners(schema, args)
        precondition = self.formula(schema.precondition, binding, True, acting=owners)
        if precondition == FALSE:
            return None
        if not owners:
            raise BadInput(
                f"action {label(schema.name, args)} names no robot "
                f"(robots: {', '.join(self._team.robots)})",
                position=self._domain.source.position(schema.offset),
                remedy="Say --unowned environment (one extra robot owns such actions) "
                "or --unowned shared (all robots choose them together).",
            )
        effects = tuple(e for effect in schema.effects for e in self._effect(effect, binding))
        cost = self._cost(schema, binding) if costs else 1
        return GroundAction(
            schema=schema.name,
            args=args,
            owners=owners,
            precondition=precondition,
            effects=effects,
            parts=self._parts(schema, binding),
            cost=cost,
            does_nothing=not effects and schema.name not in self._named and not (costs and cost),
        )

    def formula(
        self, f: Formula, binding: Binding, positive: bool, acting: tuple[int, ...] = ()
    ) -> Formula:
        """``f`` (negated unless ``positive``) with arguments put in.

        ``acting`` are the robots whose precondition this is: a negative step atom never speaks of
        them.
        """
        match f:
            case Truth(value):
                return TRUE if value == positive else FALSE
            case Atom(predicate, args):
                atom = self._atom(predicate, args, binding)
                if predicate in self._fluents:
                    return atom if positive else Not(atom)
                return TRUE if (atom in self._statics) == positive else FALSE
            case Equal(left, right):
                same = binding.get(left, left) == binding.get(right, right)
                return TRUE if same == positive else FALSE
            case StepAtom(action, args):
                return self._step_atom(
                    action, tuple(binding.get(a, a) for a in args), positive, acting
                )
            case Not(part):
                return self.formula(part, binding, not positive, acting)
            case And(parts) | Or(parts):
                ground = (self.formula(part, binding, positive, acting) for part in parts)
                return distinct(joined(And if isinstance(f, And) == positive else Or, ground))
            case Forall(variables, part) | Exists(variables, part):
                guards = self._guards_of(f)
                ground = (
                    self.formula(part, inner, positive, acting)
                    for inner in self._bindings(variables, binding, guards)
                )
                return distinct(joined(And if isinstance(f, Forall) == positive else Or, ground))
        raise AssertionError(f)

    def _step_atom(
        self, action: str, args: tuple[str, ...], positive: bool, acting: tuple[int, ...]
    ) -> Formula:
        schema = self._schemas[action]
        if self._domain.is_joint_action:
            raise BadInput(
                f"action {action!r} is used as a formula in a joint-action domain",
                position=self._domain.source.position(schema.offset),
                remedy="A joint action already says what every robot does: use predicates only.",
            )
        for parameter, arg in zip(schema.parameters, args, strict=True):
            if arg not in self._objects(parameter.types):
                return FALSE if positive else TRUE
        if not positive and set(self._team.owners(schema, args)) & set(acting):
            return TRUE
        atom = StepAtom(action, args)
        return atom if positive else Not(atom)

    def _effect(self, effect: Effect, binding: Binding) -> Iterator[GroundEffect]:
        guards = self._static_atoms(effect.condition) if effect.variables else ()
        for inner in self._bindings(effect.variables, binding, guards):
            condition = self.formula(effect.condition, inner, True)
            if condition != FALSE:
                atom = self._atom(effect.atom.predicate, effect.atom.args, inner)
                yield GroundEffect(atom, effect.adds, condition)

    def _atom(self, predicate: str, args: tuple[str, ...], binding: Binding) -> Atom:
        key = (predicate, tuple([binding.get(a, a) for a in args]))
        atom = self._atoms.get(key)
        if atom is None:
            atom = self._atoms[key] = Atom(*key)
        return atom

    def _guards_of(self, f: Forall | Exists) -> tuple[Atom, ...]:
        """Static atoms without which an instance of the quantified part is no matter.

        False under ``exists``, true under ``forall``.
        """
        if id(f) not in self._guards:
            part = f.part if isinstance(f, Exists) else negated(f.part)
            self._guards[id(f)] = f, self._static_atoms(part)
        return self._guards[id(f)][1]

    def _static_atoms(self, f: Formula) -> tuple[Atom, ...]:
        """The static atoms among the parts that must all hold."""
        return tuple(a for a in required_atoms(f) if a.args and a.predicate not in self._fluents)

    def _bindings(
        self, variables: tuple[Variable, ...], binding: Binding, guards: tuple[Atom, ...] = ()
    ) -> Iterator[Binding]:
        """Values for the variables, in the order of the objects.

        Without such as make one of the guards false.

        The first guard that leaves the fewest facts is looked up; the others are left to the
        formula.
        """
        if not variables:
            yield binding
            return
        names = [v.name for v in variables]
        members = [self._objects(v.types) for v in variables]
        outer = {name: value for name, value in binding.items() if name not in names}
        known = [
            one for guard in guards if (one := self._facts_of(guard, outer, names)) is not None
        ]
        rows: Iterable[tuple[str, ...]] = product(*members)
        if known:
            rows = self._unified(*min(known, key=lambda one: len(one[1])), outer, names, members)
        for values in rows:
            yield {**binding, **dict(zip(names, values, strict=True))}

    def _facts_of(
        self, guard: Atom, outer: Binding, names: Sequence[str]
    ) -> tuple[Atom, list[tuple[str, ...]]] | None:
        """A guard with the facts that may match it.

        The facts are looked up by an argument that is known, if there is one.
        """
        known = [(n, outer.get(arg, arg)) for n, arg in enumerate(guard.args) if arg not in names]
        lists = [self._facts.get((guard.predicate, n, value), []) for n, value in known]
        return (guard, min(lists, key=len)) if lists else None

    @staticmethod
    def _unified(
        guard: Atom,
        facts: Iterable[tuple[str, ...]],
        outer: Binding,
        names: Sequence[str],
        members: Sequence[dict[str, int]],
    ) -> list[tuple[str, ...]]:
        """All values under which the guard is one of the facts, in the order of the objects."""
        rows: set[tuple[str, ...]] = set()
        for fact in facts:
            if len(fact) != len(guard.args):
                continue
            values: Binding = {}
            for arg, value in zip(guard.args, fact, strict=True):
                wanted = values.setdefault(arg, value) if arg in names else outer.get(arg, arg)
                if wanted != value:
                    break
            else:
                options = [
                    (values[n],) if n in values else tuple(own)
                    for n, own in zip(names, members, strict=True)
                ]
                rows.update(product(*options))
        typed = (
            row
            for row in rows
            if all(value in own for value, own in zip(row, members, strict=True))
        )
        return sorted(
            typed, key=lambda row: [own[value] for value, own in zip(row, members, strict=True)]
        )

    def _objects(self, types: tuple[str, ...]) -> dict[str, int]:
        """The objects of some types, numbered in their order."""
        if types not in self._members:
            found = objects_of(self._domain, self._problem, types)
            self._members[types] = {name: number for number, name in enumerate(found)}
        return self._members[types]

    def _parts(self, schema: Schema, binding: Binding) -> tuple[str | None, ...]:
        if not schema.parts:
            return ()
        templates = {part.robot: part.template for part in schema.parts}
        return tuple(
            label(t[0], (binding.get(a, a) for a in t[1:])) if (t := templates.get(robot)) else None
            for robot in self._team.robots
        )

    def _cost(self, schema: Schema, binding: Binding) -> int:
        if schema.cost is None or isinstance(schema.cost, int):
            if (schema.cost or 0) > MAX_COST:
                raise Unsupported(
                    f"an action cost above {MAX_COST} (of {schema.name}) is not supported",
                    position=self._domain.source.position(schema.offset),
                    remedy="Write costs in a larger unit, or leave out --cost makespan+cost.",
                )
            return schema.cost or 0
        atom = self._atom(schema.cost.predicate, schema.cost.args, binding)
        value = self._problem.values.get(atom)
        if value is None or not 0 <= value <= MAX_COST or value != int(value):
            raise BadInput(
                f"the cost {label(atom.predicate, atom.args)} has no whole value from 0 "
                f"to {MAX_COST} in the initial state "
                f"of {self._problem.source.name}",
                position=self._domain.source.position(schema.offset),
                remedy="Give it a value in (:init ..), or leave out --cost makespan+cost.",
            )
        return int(value)


def _step_atoms(schema: Schema) -> Iterator[StepAtom]:
    for formula in (schema.precondition, *(e.condition for e in schema.effects)):
        yield from (leaf for leaf, _ in literals(formula) if isinstance(leaf, StepAtom))
