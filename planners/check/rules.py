# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules of joint steps, read literally: one at a time, over states that are sets of atoms.

The independent twin of grounding and composition (docs/pddl.md has the rules): nothing is shared
with them, only the lifted nouns and the robots.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import product

from planners.check.meaning import Binding, Literal, Meaning, Moment, State, ground_atom, text_of
from planners.pddl.lifted import (
    And,
    Atom,
    Constraint,
    Domain,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    Problem,
    Schema,
    StepAtom,
)
from planners.pddl.robots import Team

#: One entry per robot: the text of its subaction, or None for idling.
Labels = Sequence[str | None]


@dataclass(frozen=True, slots=True)
class Instance:
    """A schema with arguments, by ``name`` in formulas, and the robots that choose it together."""

    schema: Schema
    name: StepAtom
    binding: Binding = field(compare=False)
    owners: tuple[int, ...]

    @property
    def text(self) -> str:
        """The subaction as PDDL text."""
        return text_of(self.name)


@dataclass(frozen=True, slots=True)
class Touched:
    """What an action requires, names and changes, as the interference rule reads it."""

    needs: frozenset[Literal]
    adds: frozenset[Atom]
    deletes: frozenset[Atom]


class Rules:
    """The rules of joint steps for one problem and its team."""

    def __init__(self, domain: Domain, problem: Problem, team: Team) -> None:
        self.domain, self.problem, self.team = domain, problem, team
        self.meaning = Meaning(domain, problem, team)
        self.touched = cache(self._touched)

    def step(self, state: State, labels: Labels, joint_action: str | None = None) -> State | str:
        """The state after a joint step, or the first rule that it breaks, in words.

        ``joint_action``: the one that it is, by name; None: any with these subactions.
        Raises `BadInput` where two applicable joint actions with these subactions have different
        results.
        """
        robots = self.team.robots
        if len(labels) != len(robots):
            return f"the step has {len(labels)} entries for {len(robots)} robots"
        if self.domain.is_joint_action:
            return self._joint_action(state, labels, joint_action)
        chosen: list[Instance | None] = []
        for robot, label in zip(robots, labels, strict=True):
            found = self.instance(label) if label is not None else None
            if isinstance(found, str):
                return f"{robot}: {found}"
            chosen.append(found)
        return self._composed(state, chosen)

    def _composed(self, state: State, chosen: Sequence[Instance | None]) -> State | str:
        """The state after the robots' own subactions, or the first rule that they break."""
        # A shared subaction stands for all its owners.
        together = {action.name: action for action in chosen if action}.values()
        acting = [action for action in together if not self.is_idling(action.schema)]
        return (
            self._wrong_choice(chosen)
            or self._unmet(state, chosen)
            or self._network(acting)
            or self._interference(acting)
            or self._after(state, together)
        )

    def instance(self, label: str) -> Instance | str:
        """The subaction that a text names, or what is wrong with the text."""
        name, *args = _tokens(label) or [""]
        schema = self.meaning.schemas.get(name)
        if schema is None:
            return f"{label} is no action of the domain"
        if len(args) != len(schema.parameters):
            return f"{label} has {len(args)} arguments, {name} takes {len(schema.parameters)}"
        for parameter, arg in zip(schema.parameters, args, strict=True):
            if arg not in self.meaning.objects(parameter.types):
                return f"in {label}, {arg} is no object of type {' or '.join(parameter.types)}"
        return self.bind(schema, tuple(args))

    def is_idling(self, schema: Schema) -> bool:
        """Whether an action has no effects as written, and no formula or network speaks of it.

        Where a step has it in words, its owner and its precondition count, and no interference.
        """
        if schema.effects or schema.parts:
            return False
        domain, name = self.domain, schema.name
        formulas = [
            f for s in domain.schemas for f in (s.precondition, *(e.condition for e in s.effects))
        ]
        listed = [action for constraint in domain.constraints for action, _ in constraint.actions]
        return name not in listed and not any(name in _actions_in(f) for f in formulas)

    def bind(self, schema: Schema, args: tuple[str, ...]) -> Instance:
        """A schema with (type-correct) arguments."""
        binding = {p.name: arg for p, arg in zip(schema.parameters, args, strict=True)}
        owners = () if schema.parts else self.team.owners(schema, args)
        return Instance(schema, StepAtom(schema.name, args), binding, owners)

    def _wrong_choice(self, chosen: Sequence[Instance | None]) -> str | None:
        """Labels that no step may have: another robot's action, or a part of a shared one alone."""
        robots = self.team.robots
        for robot, action in enumerate(chosen):
            if action is None:
                continue
            if robot not in action.owners:
                whose = " and ".join(robots[i] for i in action.owners) or "no robot"
                return f"{robots[robot]} cannot do {action.text}: it belongs to {whose}"
            for other in action.owners:
                partner = chosen[other]
                if partner is None or partner.name != action.name:
                    return f"{action.text} needs {robots[other]} to choose it too"
        return None

    def _unmet(self, state: State, chosen: Sequence[Instance | None]) -> str | None:
        """The first precondition that does not hold in the state before the step."""
        step = frozenset(action.name for action in chosen if action)
        for robot, action in enumerate(chosen):
            if action is None:
                continue
            formula, moment = action.schema.precondition, Moment(state, step, action.owners)
            if why := self.meaning.fails(formula, action.binding, moment):
                return f"{self.team.robots[robot]} cannot do {action.text} here: {why}"
        return None

    def _interference(self, actions: Sequence[Instance]) -> str | None:
        pairs = ((one, other) for j, other in enumerate(actions) for one in actions[:j])
        clashes = (self._clash(*pair) or self._clash(*pair[::-1]) for pair in pairs)
        return next(filter(None, clashes), None)

    def _clash(self, one: Instance, other: Instance) -> str | None:
        """How the changes of ``one`` interfere with ``other``."""
        mine, theirs = self.touched(one, other), self.touched(other, one)
        if both := mine.deletes & theirs.adds:
            return f"{one.text} deletes {_first(both)}, which {other.text} adds"
        if self._linked(one, other):
            return None  # meant to be done together
        if both := frozenset(atom for atom in mine.deletes if (atom, True) in theirs.needs):
            return f"{one.text} deletes {_first(both)}, which {other.text} requires"
        if both := frozenset(atom for atom in mine.adds if (atom, False) in theirs.needs):
            return f"{one.text} adds {_first(both)}, which {other.text} requires to be false"
        return None

    def _network(self, actions: Sequence[Instance]) -> str | None:
        """The first constraint of the concurrency network that the step breaks."""
        used: dict[str, dict[tuple[str, ...], list[Instance]]] = {}
        for constraint in self.domain.constraints:
            groups = used.setdefault(constraint.name, {})
            for action in actions:
                for binding in self._matches(constraint, action):
                    groups.setdefault(binding, []).append(action)
            for binding, group in groups.items():
                if reason := _outside(constraint, binding, group):
                    return reason
        for needed, by in self.domain.dependences:
            for binding, group in used[by].items():
                if binding not in used[needed]:
                    return (
                        f"{group[0].text} needs an action of "
                        f"constraint {needed} {' '.join(binding)} in the same step"
                    )
        return None

    def _matches(self, constraint: Constraint, action: Instance) -> set[tuple[str, ...]]:
        """The bindings of a constraint's parameters that an action matches."""
        return {
            binding
            for name, positions in constraint.actions
            if name == action.schema.name
            for binding in [tuple(action.name.args[p] for p in positions)]
            if all(
                v in self.meaning.objects(p.types)
                for v, p in zip(binding, constraint.parameters, strict=True)
            )
        }

    def _linked(self, one: Instance, other: Instance) -> bool:
        """Whether a positive literal of a condition of one is the other, or the network joins them.

        By a constraint that takes two or more, or by two that depend on each other.
        """
        for action, named in ((one, other), (other, one)):
            if (named.name, True) in self.touched(action).needs:
                return True
        by_name = {constraint.name: constraint for constraint in self.domain.constraints}
        pairs = [(c.name, c.name) for c in self.domain.constraints if c.low > 1]
        pairs += [pair for v, w in self.domain.dependences for pair in ((v, w), (w, v))]
        return any(
            self._matches(by_name[v], one) & self._matches(by_name[w], other) for v, w in pairs
        )

    def _touched(self, action: Instance, other: Instance | None = None) -> Touched:
        """Conditional effects count as if they fired and their conditions as required.

        Adding wins over deleting.  Beside ``other``, effects count whose conditions are true in
        some state with exactly these two subactions in the step.
        """
        pair = frozenset((action.name, other.name)) if other else None
        own = self.meaning.required(action.schema.precondition, action.binding, True, action.owners)
        needs = [own]
        changes: dict[bool, set[Atom]] = {True: set(), False: set()}
        for effect in action.schema.effects:
            for binding in self.meaning.bindings(effect.variables, action.binding):
                if self.meaning.holds(effect.condition, binding, True, Moment(None, pair)):
                    needs.append(self.meaning.required(effect.condition, binding, True, ()))
                    changes[effect.adds].add(ground_atom(effect.atom, binding))
        literals = frozenset[Literal]().union(
            *(part for part in needs if not isinstance(part, bool))
        )
        adds, deletes = frozenset(changes[True]), frozenset(changes[False] - changes[True])
        return Touched(literals, adds, deletes)

    def _after(self, state: State, actions: Iterable[Instance]) -> State:
        """All effects together; an atom that is both added and deleted becomes true."""
        actions = tuple(actions)
        moment = Moment(state, frozenset(action.name for action in actions))
        changes: dict[bool, set[Atom]] = {True: set(), False: set()}
        for action in actions:
            for effect in action.schema.effects:
                for binding in self.meaning.bindings(effect.variables, action.binding):
                    if self.meaning.holds(effect.condition, binding, True, moment):
                        changes[effect.adds].add(ground_atom(effect.atom, binding))
        return (state - changes[False]) | changes[True]

    def _joint_action(self, state: State, labels: Labels, name: str | None) -> State | str:
        """The state after the joint action with these subactions, or what is wrong with them."""
        parts = ", ".join(
            f"{robot} {label or 'idle'}"
            for robot, label in zip(self.team.robots, labels, strict=True)
        )
        reason = f"no joint action of the domain has the parts {parts}"
        results: dict[State, str] = {}
        actions = [a for a in self._whole_actions(labels) if name in (None, a.text)]
        for number, action in enumerate(actions):
            why = self.meaning.fails(action.schema.precondition, action.binding, Moment(state))
            if why is None:
                results.setdefault(self._after(state, (action,)), action.text)
            elif not number:
                reason = f"{action.text} is not applicable: {why}"
        if len(results) > 1:
            first, second = sorted(results.values())[:2]
            raise self.domain.schemas[0].position.fail(
                f"{first} and {second} have the same subactions but different results",
                "The subactions of a joint action must determine what it does: rename one of them.",
            )
        return next(iter(results), reason)

    def _whole_actions(self, labels: Labels) -> Iterator[Instance]:
        """The type-correct joint actions whose subaction comments read as these labels."""
        said = _words(None if label is None else _tokens(label) for label in labels)
        for schema in self.domain.schemas:
            binding = self._reading(schema, said)
            if binding is None:
                continue
            domains = [
                tuple(o for o in self.meaning.objects(p.types) if binding.get(p.name, o) == o)
                for p in schema.parameters
            ]
            for args in product(*domains):
                yield self.bind(schema, args)

    def _reading(self, schema: Schema, said: Sequence[str]) -> Binding | None:
        """The parameters' values with which its subaction comments say these words, if any do."""
        templates = {part.robot: part.template for part in schema.parts}
        terms = _words(map(templates.get, self.team.robots))  # a missing line means idle
        binding = {term: name for term, name in zip(terms, said, strict=False) if term[0] == "?"}
        return binding if [binding.get(term, term) for term in terms] == said else None


def _actions_in(formula: Formula) -> set[str]:
    match formula:
        case StepAtom(action):
            return {action}
        case Not(part) | Forall(_, part) | Exists(_, part):
            return _actions_in(part)
        case And(parts) | Or(parts):
            return set().union(*map(_actions_in, parts))
    return set()


def _first(atoms: Iterable[Atom | StepAtom]) -> str:
    return min(text_of(atom) for atom in atoms)


def _tokens(label: str) -> list[str]:
    """The names in the text of a subaction, without its parentheses."""
    return label.lower().replace("(", " ").replace(")", " ").split()


def _words(parts: Iterable[Sequence[str] | None]) -> list[str]:
    """The words of all robots' parts one after another; no name is a bracket."""
    return [word for part in parts for word in (("(",) if part is None else ("(", *part, ")"))]


def _outside(
    constraint: Constraint, binding: tuple[str, ...], group: Sequence[Instance]
) -> str | None:
    """Which bounds of a constraint a group of actions breaks."""
    high = constraint.high
    if constraint.low <= len(group) and (high is None or len(group) <= high):
        return None
    bounds = f"{constraint.low} to {'any number' if high is None else high}"
    doing = ", ".join(action.text for action in group)
    return f"constraint {constraint.name} {' '.join(binding)} takes {bounds} together: {doing}"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a plan is one.

    For an invalid plan ``step`` is the first step that breaks a rule (from 0; the makespan if only
    the goal fails) and ``reason`` says which, in words.
    """

    valid: bool
    step: int | None
    reason: str


def validate(
    domain: Domain,
    problem: Problem,
    team: Team,
    plan: Sequence[Labels],
    *,
    joint_actions: Sequence[str] | None = None,
) -> Verdict:
    """Check that every step is legal where it is taken and that the goal holds at the end.

    ``plan[k][i]`` is the subaction of robot ``i`` in step ``k``, such as ``"(move r1 a b)"`` (in
    joint-action PDDL the filled-in template of the subaction comment), or None if it idles.
    ``joint_actions`` names the one of each step; None: any with its subactions.

    Raises `BadInput` where two applicable joint actions with the same subactions have different
    results.
    """
    rules = Rules(domain, problem, team)
    state = rules.meaning.fluents_of(problem.init)
    for number, labels in enumerate(plan):
        after = rules.step(state, labels, joint_actions[number] if joint_actions else None)
        if isinstance(after, str):
            return Verdict(False, number, after)
        state = after
    if why := rules.meaning.fails(problem.goal, {}, Moment(state)):
        return Verdict(False, len(plan), f"the goal does not hold at the end: {why}")
    return Verdict(True, None, "every step is a joint step and the goal holds at the end")
