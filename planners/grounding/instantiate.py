# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground actions: arguments put in, statics evaluated, the rest in negation normal form.

Static atoms, equalities and types are evaluated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planners.errors import BadInput, Unsupported
from planners.grounding.actions import GroundAction, GroundEffect
from planners.grounding.bindings import Binding, Bindings
from planners.grounding.reachability import reachable_arguments
from planners.limits import reaching
from planners.messages import echoed
from planners.pddl.formula_tree import distinct, joined, label, literals
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
)
from planners.pddl.robots import Team, fluent_predicates, static_atoms

#: What to try when grounding is too much.
FEWER = "fewer objects, or actions with fewer parameters"


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
        self._bindings = Bindings(domain, problem, self._fluents, self._statics)
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
            does_nothing=not schema.effects
            and schema.name not in self._named
            and not (costs and cost),
        )

    def formula(
        self, f: Formula, binding: Binding, positive: bool, acting: tuple[int, ...] = ()
    ) -> Formula:
        """``f`` (negated unless ``positive``) with arguments put in.

        ``acting`` are the robots whose precondition this is: a negative step atom never speaks of
        them.
        """
        match f:
            case Not(part):
                return self.formula(part, binding, not positive, acting)
            case And() | Or() | Forall() | Exists():
                kind = And if isinstance(f, And | Forall) == positive else Or
                instances = self._instances(f, binding)
                ground = (self.formula(part, inner, positive, acting) for part, inner in instances)
                return distinct(joined(kind, ground))
            case StepAtom(action, args):
                values = tuple(binding.get(a, a) for a in args)
                return self._step_atom(action, values, positive, acting)
        return self._state_literal(f, binding, positive)

    def _instances(
        self, f: And | Or | Forall | Exists, binding: Binding
    ) -> Iterator[tuple[Formula, Binding]]:
        """The parts of a formula with the values of their variables."""
        if isinstance(f, And | Or):
            yield from ((part, binding) for part in f.parts)
        else:
            guards = self._bindings.guards_of(f)
            for inner in self._bindings.values(f.variables, binding, guards):
                yield f.part, inner

    def _state_literal(self, f: Truth | Equal | Atom, binding: Binding, positive: bool) -> Formula:
        if isinstance(f, Truth):
            return Truth(f.value == positive)
        if isinstance(f, Equal):
            same = binding.get(f.left, f.left) == binding.get(f.right, f.right)
            return Truth(same == positive)
        atom = self._atom(f.predicate, f.args, binding)
        if f.predicate not in self._fluents:
            return Truth((atom in self._statics) == positive)
        return atom if positive else Not(atom)

    def _step_atom(
        self, action: str, args: tuple[str, ...], positive: bool, acting: tuple[int, ...]
    ) -> Formula:
        schema = self._schemas[action]
        if self._domain.is_joint_action:
            raise BadInput(
                f"action {echoed(action)} is used as a formula in a joint-action domain",
                position=self._domain.source.position(schema.offset),
                remedy="A joint action already says what every robot does: use predicates only.",
            )
        for parameter, arg in zip(schema.parameters, args, strict=True):
            if arg not in self._bindings.objects(parameter.types):
                return FALSE if positive else TRUE
        if not positive and set(self._team.owners(schema, args)) & set(acting):
            return TRUE
        atom = StepAtom(action, args)
        return atom if positive else Not(atom)

    def _effect(self, effect: Effect, binding: Binding) -> Iterator[GroundEffect]:
        guards = self._bindings.static_atoms(effect.condition) if effect.variables else ()
        for inner in self._bindings.values(effect.variables, binding, guards):
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
