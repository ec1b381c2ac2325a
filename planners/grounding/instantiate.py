# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground actions: arguments put in, statics evaluated, the rest in negation normal form.

Static atoms, equalities and types are evaluated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import replace
from functools import cache
from math import prod

from planners.grounding.actions import GroundAction, idling_schemas
from planners.grounding.reachability import Arguments, reachable_arguments
from planners.pddl.formula_tree import conjuncts, joined, label, literals, negated, required_atoms
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
    Junction,
    Not,
    Or,
    Problem,
    Schema,
    StepAtom,
    Truth,
    Variable,
)
from planners.pddl.robots import Team, fluent_predicates, objects_of, static_atoms
from planners.system.errors import Unsupported
from planners.system.limits import reaching

#: Variable -> the object that it stands for.
Binding = dict[str, str]
#: An atom without which an instance of a quantified part is no matter.
Guard = Atom | StepAtom
#: The variables in a quantified formula, its guards, and the signs of its step atoms.
_Shape = tuple[tuple[str, ...], tuple[Atom, ...], tuple[StepAtom, ...], set[bool]]
#: From this many values for the variables on, only subactions that are ever possible are tried.
_MANY = 1000


#: What to try when grounding is too much.
FEWER = "fewer objects, or actions with fewer parameters"


def ground_actions(
    domain: Domain, problem: Problem, team: Team, starts: Set[Atom], *, costs: bool
) -> tuple[GroundAction, ...]:
    """All ground actions that may ever be applied; those that are idling are left out.

    Sorted by schema (in domain order) and arguments.  ``starts`` are the true atoms of all
    initial states; without ``costs`` every cost is 1.  Raises `BadInput` for an action that no
    robot owns (``--unowned error``), or a missing cost value.
    """
    idling = idling_schemas(domain)
    domain = replace(domain, schemas=tuple(s for s in domain.schemas if s.name not in idling))
    world = f"{len(domain.schemas):,} action schemas over {len(problem.objects):,} objects"
    with reaching(lambda: f"looking for the applicable instances of {world}", FEWER):
        reachable = reachable_arguments(domain, problem, sorted(starts, key=str))
    grounder = _Grounder(domain, problem, team, reachable)
    total = sum(map(len, reachable.values()))
    actions: list[GroundAction] = []
    with reaching(
        lambda: f"{len(actions):,} of at most {total:,} ground actions, of {world}",
        FEWER,
    ):
        for schema in domain.schemas:
            for args in reachable[schema.name]:
                action = grounder.action(schema, args, costs)
                if action is not None:
                    actions.append(action)
    return tuple(actions)


def idling_costs(domain: Domain, problem: Problem, team: Team, *, costs: bool) -> tuple[int, ...]:
    """What idling costs each robot: what its cheapest action that is idling costs, else 0.

    Of all arguments with which equality, static atoms and types do not make the precondition false;
    where it holds does not matter: idling is always possible.  Without ``costs`` nothing.
    """
    idling = idling_schemas(domain) if costs else frozenset()
    grounder = _Grounder(domain, problem, team, {})
    found = [
        pair
        for schema in domain.schemas
        if schema.name in idling
        for pair in grounder.costs_alone(schema)
    ]
    robots = range(len(team.robots))
    return tuple(min((cost for owner, cost in found if owner == r), default=0) for r in robots)


def goal_grounder(domain: Domain, problem: Problem) -> Callable[[Formula], Formula]:
    """Makes goals formulas over fluent atoms, in negation normal form."""
    grounder = _Grounder(domain, problem, Team((), ""), {})
    return lambda goal: grounder.formula(goal, {}, True)


def _terms(leaves: Iterable[Atom | StepAtom | Equal]) -> set[str]:
    return {t for a in leaves for t in ((a.left, a.right) if isinstance(a, Equal) else a.args)}


def _bound(atom: Atom, binding: Binding) -> Atom:
    """An atom with the values of its variables."""
    return Atom(atom.predicate, tuple([binding.get(a, a) for a in atom.args]))


class _Grounder:
    """Puts arguments into formulas; ``reachable`` are those of actions, empty if unknown."""

    def __init__(
        self,
        domain: Domain,
        problem: Problem,
        team: Team,
        reachable: Mapping[str, list[Arguments]],
    ) -> None:
        self._problem, self._team, self._reachable = problem, team, reachable
        self._fluents = fluent_predicates(domain)
        self._statics = static_atoms(domain, problem)
        self._schemas = {schema.name: schema for schema in domain.schemas}
        #: The objects of some types, numbered in their order.
        self._objects = cache(
            lambda types: {o: n for n, o in enumerate(objects_of(domain, problem, types))}
        )
        #: The arguments with which a guard is true, by what it is about and their number.
        self._true: dict[tuple[type[Guard], str, int], list[Arguments]] = {
            (StepAtom, action, len(own[0])): own for action, own in reachable.items() if own
        }
        for fact in self._statics:
            self._true.setdefault((Atom, fact.predicate, len(fact.args)), []).append(fact.args)
        #: For a guard, the places of known arguments and a wanted one: known values -> the others.
        self._tables: dict[tuple[object, ...], dict[Arguments, set[str]]] = {}
        #: Ground quantified formulas by the values of variables in them: actions share most.
        self._quantified: dict[tuple[object, ...], Formula] = {}
        self._shape = cache(self._shape_of)

    def action(self, schema: Schema, args: tuple[str, ...], costs: bool) -> GroundAction | None:
        """The instance, or None if its precondition is false in every state."""
        binding = {p.name: a for p, a in zip(schema.parameters, args, strict=True)}
        everyone = tuple(range(len(self._team.robots)))
        owners = everyone if schema.parts else self._team.owners(schema, args)
        precondition = self.formula(schema.precondition, binding, True, acting=owners)
        if precondition == FALSE:
            return None
        if not owners:
            raise schema.position.fail(
                f"action {label(schema.name, args)} names no robot "
                f"(robots: {', '.join(self._team.robots)})",
                "Say --unowned environment (one extra robot owns such actions) "
                "or --unowned shared (all robots choose them together).",
            )
        effects = tuple(e for effect in schema.effects for e in self._effect(effect, binding))
        return GroundAction(
            schema=schema.name,
            args=args,
            owners=owners,
            precondition=precondition,
            effects=effects,
            parts=self._parts(schema, binding),
            cost=self._cost(schema, binding) if costs else 1,
        )

    def formula(
        self, f: Formula, binding: Binding, positive: bool, acting: tuple[int, ...] = ()
    ) -> Formula:
        """``f`` (negated unless ``positive``) with arguments put in.

        ``acting`` are the robots whose precondition this is: a negative step atom never speaks of
        them.
        """
        # Asked for each node of each action: `match` takes longer.
        if isinstance(f, Atom):
            atom = _bound(f, binding)
            if f.predicate in self._fluents:
                return atom if positive else Not(atom)
            return Truth((atom in self._statics) == positive)
        if isinstance(f, Not):
            return self.formula(f.part, binding, not positive, acting)
        if isinstance(f, Junction):
            kind = And if isinstance(f, And) == positive else Or
            ground = (self.formula(part, binding, positive, acting) for part in f.parts)
            return joined(kind, ground)
        if isinstance(f, StepAtom):
            values = tuple([binding.get(a, a) for a in f.args])
            return self._step_atom(f.action, values, positive, acting)
        if isinstance(f, Equal):
            same = binding.get(f.left, f.left) == binding.get(f.right, f.right)
            return Truth(same == positive)
        if isinstance(f, Truth):
            return Truth(f.value == positive)
        return self._quantifier(f, binding, positive, acting)

    def _quantifier(
        self, f: Forall | Exists, binding: Binding, positive: bool, acting: tuple[int, ...]
    ) -> Formula:
        names, statics, steps, signs = self._shape(f)
        if (not positive) not in signs:
            acting = ()  # no negative step atom asks
        key = f, positive, acting, *map(binding.get, names)
        found = self._quantified.get(key)
        if found is None:
            kind = And if isinstance(f, Forall) == positive else Or
            instances = self._values(f.variables, binding, statics, steps)
            ground = (self.formula(f.part, inner, positive, acting) for inner in instances)
            found = joined(kind, ground)
            if steps and isinstance(found, Truth):
                # One subaction that nobody can ever do stays, so that what is beside it counts.
                instances = self._values(f.variables, binding, statics)
                ground = (self.formula(f.part, inner, positive, acting) for inner in instances)
                found = next((one for one in ground if not isinstance(one, Truth)), found)
            self._quantified[key] = found
        return found

    def _values(
        self,
        variables: tuple[Variable, ...],
        binding: Binding,
        statics: tuple[Atom, ...] = (),
        steps: tuple[StepAtom, ...] = (),
    ) -> Iterator[Binding]:
        """Bindings of the variables too, in the order of the objects.

        Many that make one of the guards false are left out, the others are left to the formula.
        Only where there are many values, subactions are guards, too (`coordlang inspect` names
        subactions that a formula speaks of and that nobody can ever do).
        """
        if not variables:  # as of most effects
            return iter((binding,))
        named = {arg for guard in statics for arg in guard.args}
        others = [self._objects(v.types) for v in variables if v.name not in named]
        guards: tuple[Guard, ...] = statics
        if self._reachable and prod(map(len, others)) > _MANY:
            guards += steps
        own = {v.name for v in variables}
        outer = {name: value for name, value in binding.items() if name not in own}
        return self._extended(outer, variables, guards)

    def _extended(
        self, binding: Binding, variables: tuple[Variable, ...], guards: tuple[Guard, ...]
    ) -> Iterator[Binding]:
        if not variables:
            yield binding
            return
        name, members = variables[0].name, self._objects(variables[0].types)
        fitting: Set[str] = members.keys()
        for guard in guards:
            if name in guard.args:
                fitting = fitting & self._allowed(guard, name, binding)
        for value in sorted(fitting, key=members.__getitem__):
            yield from self._extended({**binding, name: value}, variables[1:], guards)

    def _allowed(self, guard: Guard, name: str, binding: Binding) -> Set[str]:
        """The values of a variable with which a guard may be true, by its known arguments."""
        about = guard.predicate if isinstance(guard, Atom) else guard.action
        values = [binding.get(arg, arg) for arg in guard.args]
        known = [n for n, value in enumerate(values) if not value.startswith("?")]
        kind, place = (type(guard), about, len(values)), guard.args.index(name)
        table = self._tables.get((kind, place, *known))
        if table is None:
            table = self._tables[kind, place, *known] = {}
            for args in self._true.get(kind, ()):
                table.setdefault(tuple(args[n] for n in known), set()).add(args[place])
        return table.get(tuple(values[n] for n in known), frozenset())

    def _shape_of(self, f: Forall | Exists) -> _Shape:
        """The variables in a formula, its guards, and whether its step atoms are positive.

        Guards are static atoms and actions that the part requires under ``exists``, and its
        negation under ``forall``: where one of them is false, the instance is no matter.  An action
        is one only if all else is static: literals beside it count, whether or not it is done.
        """
        found = literals(f)
        leaves = [leaf for leaf, _ in found]
        signs = {sign for leaf, sign in found if isinstance(leaf, StepAtom)}
        names = tuple(sorted(term for term in _terms(leaves) if term.startswith("?")))
        part = f.part if isinstance(f, Exists) else negated(f.part)
        changing = {leaf for leaf in leaves if not self._is_static(leaf)}
        steps = tuple(p for p in conjuncts(part) if isinstance(p, StepAtom) and {p} == changing)
        return names, self._static_atoms(part), steps, signs

    def _static_atoms(self, f: Formula) -> tuple[Atom, ...]:
        """The static atoms among the parts that must all hold."""
        return tuple(a for a in required_atoms(f) if self._is_static(a))

    def _is_static(self, leaf: Atom | StepAtom | Equal) -> bool:
        is_fluent = isinstance(leaf, Atom) and leaf.predicate in self._fluents
        return not is_fluent and not isinstance(leaf, StepAtom)

    def _step_atom(
        self, action: str, args: tuple[str, ...], positive: bool, acting: tuple[int, ...]
    ) -> Formula:
        schema = self._schemas[action]
        pairs = zip(schema.parameters, args, strict=True)
        if any(arg not in self._objects(parameter.types) for parameter, arg in pairs):
            return Truth(not positive)
        if not positive and not set(acting).isdisjoint(self._team.owners(schema, args)):
            return TRUE
        found = StepAtom(action, args)
        return found if positive else Not(found)

    def _effect(self, effect: Effect, binding: Binding) -> Iterator[Effect]:
        guards = self._static_atoms(effect.condition) if effect.variables else ()
        for inner in self._values(effect.variables, binding, guards):
            condition = self.formula(effect.condition, inner, True)
            if condition != FALSE:
                yield Effect(_bound(effect.atom, inner), effect.adds, condition)

    def _parts(self, schema: Schema, binding: Binding) -> tuple[str | None, ...]:
        if not schema.parts:
            return ()
        templates = {part.robot: part.template for part in schema.parts}
        return tuple(
            label(t[0], (binding.get(a, a) for a in t[1:])) if (t := templates.get(robot)) else None
            for robot in self._team.robots
        )

    def costs_alone(self, schema: Schema) -> Iterator[tuple[int, int]]:
        """The robot and the cost of each instance with one owner, as far as its cost is given.

        Instances with a precondition that is false in every state are none.  Of arguments that
        matter neither for that nor for the owner and the cost only the first is taken.
        """
        objects = {p.name: self._objects(p.types) for p in schema.parameters}
        if not all(objects.values()):
            return
        first = {name: next(iter(own)) for name, own in objects.items()}
        guards = self._static_atoms(schema.precondition)
        for binding in self._values(self._deciding(schema), first, guards):
            owners = self._team.owners(schema, tuple(binding[p.name] for p in schema.parameters))
            cost = schema.cost
            is_given = not isinstance(cost, Atom) or _bound(cost, binding) in self._problem.values
            possible = self.formula(schema.precondition, binding, True, owners) != FALSE
            if len(owners) == 1 and possible and is_given:
                yield owners[0], self._cost(schema, binding)

    def _deciding(self, schema: Schema) -> tuple[Variable, ...]:
        """The parameters that decide whether an instance is possible, its owner and its cost."""
        literal = (leaf for leaf, _ in literals(schema.precondition))
        named = _terms(a for a in literal if getattr(a, "predicate", "") not in self._fluents)
        if isinstance(schema.cost, Atom):
            named |= {*schema.cost.args}
        robots = set(self._team.robots)
        return tuple(
            p
            for p in schema.parameters
            if p.name in named or not robots.isdisjoint(self._objects(p.types))
        )

    def _cost(self, schema: Schema, binding: Binding) -> int:
        if schema.cost is None or isinstance(schema.cost, int):
            if (schema.cost or 0) > MAX_COST:
                raise Unsupported(
                    f"an action cost above {MAX_COST} (of {schema.name}) is not supported",
                    position=schema.position,
                    remedy="Write costs in a larger unit, or leave out --cost makespan+cost.",
                )
            return schema.cost or 0
        atom = _bound(schema.cost, binding)
        value = self._problem.values.get(atom)
        if value is None or not 0 <= value <= MAX_COST or value != int(value):
            raise schema.position.fail(
                f"the cost {label(atom.predicate, atom.args)} has no whole value from 0 "
                f"to {MAX_COST} in the initial state "
                f"of {self._problem.source.name}",
                "Give it a value in (:init ..), or leave out --cost makespan+cost.",
            )
        return int(value)
