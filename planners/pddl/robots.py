# SPDX-License-Identifier: GPL-3.0-or-later
"""Who acts: the robots of a problem and the owners of an action."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Formula, Problem, Schema, Variable, supertypes
from planners.pddl.model_options import ModelOptions, Unowned
from planners.system.errors import BadInput, UsageError, note
from planners.system.messages import echoed, some

#: The name of the extra robot that owns actions without a robot, under ``--unowned environment``.
ENVIRONMENT = "environment"


#: More objects than this are not taken to be robots unless the user says so.
_MOST_GUESSED = 12
#: Objects of a type that messages list.
_SHOWN = 6


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """A sort key in which ``r2`` comes before ``r10``."""
    parts = enumerate(re.split(r"([0-9]+)", name))  # every second one is a number
    # Numbers compare by their length without leading zeros, then as text: no int() that has limits.
    return tuple(
        (1, len(p.lstrip("0")), f"{p.lstrip('0')} {p}") if n % 2 else (0, 0, p) for n, p in parts
    )


@dataclass(frozen=True, slots=True)
class Team:
    """Who acts in a joint step, in natural order of the names.

    ``by`` says how they were found, for `coordlang inspect`.  Where ``unowned`` is ``environment``
    the last one is the environment.
    """

    robots: tuple[str, ...]
    by: str
    unowned: Unowned = "error"

    def owners(self, schema: Schema, args: tuple[str, ...]) -> tuple[int, ...]:
        """The indices of the robots that must choose this subaction together (usually one).

        The ``:agent`` if the schema has one, else the robots among its arguments, else whoever
        ``unowned`` names; empty if there is none.
        """
        if schema.agent is not None:
            agent = args[schema.agent]
            return (self.robots.index(agent),) if agent in self.robots else ()
        found = tuple(sorted({self.robots.index(arg) for arg in args if arg in self.robots}))
        if found or self.unowned == "error":
            return found
        if self.unowned == "environment":
            return (len(self.robots) - 1,)
        return tuple(range(len(self.robots)))

    def without_idle_environment(self, owners: Iterable[int]) -> Team:
        """The team without the environment if it owns no ground action: then nobody owns any."""
        if self.unowned != "environment" or len(self.robots) - 1 in set(owners):
            return self
        return replace(self, robots=self.robots[:-1], unowned="error")


def objects_of(domain: Domain, problem: Problem, types: Sequence[str]) -> tuple[str, ...]:
    """The objects that belong to one of ``types``, in natural order."""
    wanted = set(types)
    found = [
        name
        for name, own in problem.objects.items()
        if "object" in wanted or any(supertypes(domain.types, t) & wanted for t in own)
    ]
    return tuple(sorted(found, key=natural))


def find_team(domain: Domain, problem: Problem, choice: ModelOptions) -> Team:
    """The robots: from subaction comments, ``:agent``, the user's choice, or by detection.

    Raises `BadInput` for no robot, or more than one way to tell who the robots are (the candidates
    are listed), and `UsageError` for a choice that contradicts the files or names an unknown object
    or type.
    """
    if choice.recorded and choice.unowned == "environment" and ENVIRONMENT not in problem.objects:
        choice = replace(choice, robots=sorted({*choice.names} - {ENVIRONMENT}, key=natural))
    robots, by = _found(domain, problem, choice)
    if not robots:
        raise problem.source.section(":objects").fail(
            "there is no robot in this problem",
            f"Robots are found by {by}; declare at least one such object.",
        )
    unowned = choice.unowned
    if all(s.agent is not None or s.parts for s in domain.schemas):
        unowned = "error"  # there is no such action
    if unowned == "environment":
        if ENVIRONMENT in problem.objects:
            raise UsageError(
                "--unowned environment: an object of this problem is called "
                f"{ENVIRONMENT!r} already",
                remedy="Rename the object.",
            )
        robots = (*robots, ENVIRONMENT)
    return Team(robots, by, unowned)


def _found(domain: Domain, problem: Problem, choice: ModelOptions) -> tuple[tuple[str, ...], str]:
    kinds = _Kinds(domain, problem)
    declared = _declared(domain, problem)
    if declared is not None:
        _require_agreement(kinds, choice, *declared)
        return declared
    if choice.names:
        for name in (own for own in choice.names if own not in problem.objects):
            remedy = f"Objects: {', '.join(sorted(problem.objects, key=natural))}."
            if not choice.recorded:
                raise UsageError(f"--robots: there is no object {echoed(name)}", remedy=remedy)
            what = f"the language file's robot {echoed(name)} is no object of the problem"
            raise problem.source.section(":objects").fail(what, remedy)
        return tuple(sorted(set(choice.names), key=natural)), "--robots"
    if choice.robot_type:
        robots = kinds.of(choice.robot_type)
        if not robots:
            raise UsageError(
                f"--robot-type: nothing has type or predicate {echoed(choice.robot_type)}",
                remedy=f"Candidates: {', '.join(kinds.likely()) or 'none'}.",
            )
        return robots, f"--robot-type {choice.robot_type}"
    return _detect(kinds)


def _require_agreement(
    kinds: _Kinds, choice: ModelOptions, robots: tuple[str, ...], by: str
) -> None:
    """Raise `UsageError` for robots that are not the domain's, `BadInput` if a file names them."""
    given, said = {*choice.names}, f"--robots {','.join(choice.names)}"
    if choice.robot_type:
        given, said = {*kinds.of(choice.robot_type)}, f"--robot-type {choice.robot_type}"
    if given == {*robots} or not (choice.names or choice.robot_type):
        return
    remedy = f"The robots are {', '.join(robots)} (by {by})."
    if choice.recorded:
        what = f"the language file's robots {', '.join(choice.names)} contradict the domain"
        raise kinds.problem.source.section(":objects").fail(what, remedy)
    raise UsageError(f"{said} contradicts the domain", remedy=remedy)


def _declared(domain: Domain, problem: Problem) -> tuple[tuple[str, ...], str] | None:
    if domain.is_joint_action:
        names = {part.robot for schema in domain.schemas for part in schema.parts}
        return tuple(sorted(names, key=natural)), "subaction comments"
    agents = [(s.acting, s.precondition) for s in domain.schemas if s.acting is not None]
    if not agents:
        return None
    robots = set[str]().union(*(_possible_agents(domain, problem, *own) for own in agents))
    types = set[str]().union(*(agent.types for agent, _ in agents))
    return tuple(sorted(robots, key=natural)), f":agent of type {', '.join(sorted(types))}"


def _possible_agents(
    domain: Domain, problem: Problem, agent: Variable, precondition: Formula
) -> tuple[str, ...]:
    """The objects of the agent's type, or, untyped, of its static type predicates."""
    objects = objects_of(domain, problem, agent.types)
    if agent.types != ("object",):
        return objects
    changed = fluent_predicates(domain)
    kinds = {
        atom.predicate
        for atom in required_atoms(precondition)
        if atom.args == (agent.name,) and atom.predicate not in changed
    }
    return tuple(o for o in objects if all(Atom(kind, (o,)) in problem.init for kind in kinds))


@dataclass(frozen=True, slots=True)
class _Kinds:
    """What robots may be told by: types, and unary predicates."""

    domain: Domain
    problem: Problem

    def of(self, kind: str) -> tuple[str, ...]:
        """Objects of a type, or those of which a predicate of that name is true at the start."""
        if kind in self.domain.types:
            return objects_of(self.domain, self.problem, (kind,))
        names = [a.args[0] for a in self.problem.init if a.predicate == kind and len(a.args) == 1]
        return tuple(sorted(names, key=natural))

    def likely(self) -> list[str]:
        """What can be given as ``--robot-type``: likely types, else all, else unary predicates."""
        static = static_atoms(self.domain, self.problem)
        unary = {atom.predicate for atom in static if len(atom.args) == 1}
        named = [kind for kind in ("agent", "robot") if self.of(kind)]
        return named or self.taken_by_all() or self.inhabited() or sorted(unary)

    def inhabited(self) -> list[str]:
        return [kind for kind in sorted(self.domain.types) if self.of(kind)]

    def is_one(self, variable: Variable, kind: str) -> bool:
        """Whether all that a variable stands for is of a type."""
        return all(kind in supertypes(self.domain.types, own) for own in variable.types)

    def taken_by_all(self) -> list[str]:
        """The most specific types of which every action takes an object."""
        found = [
            kind
            for kind in self.inhabited()
            if all(any(self.is_one(p, kind) for p in s.parameters) for s in self.domain.schemas)
        ]
        above = {t for kind in found for t in supertypes(self.domain.types, kind) - {kind}}
        return [kind for kind in found if kind not in above]

    def unclear(self, why: str, candidates: Sequence[str]) -> BadInput:
        """The error for robots that cannot be told, with the candidates and their objects."""
        listed = "; ".join(f"{kind} ({some(self.of(kind), _SHOWN)})" for kind in candidates)
        return self.domain.source.section(":types").fail(
            f"which objects are the robots? {why}",
            "Say --robot-type TYPE or --robots NAME,NAME."
            + (f" Candidates: {listed}." if listed else ""),
        )


def _detect(kinds: _Kinds) -> tuple[tuple[str, ...], str]:
    named = {kind: robots for kind in ("robot", "agent") if (robots := kinds.of(kind))}
    if len(set(named.values())) == 1:
        kind, robots = next(iter(named.items()))
        return robots, f"type {kind}"
    candidates = sorted(named) or kinds.taken_by_all()
    if len(candidates) == 1:
        return _guessed(kinds, candidates[0])
    why = "Several types could be" if candidates else "No type is taken by every action"
    raise kinds.unclear(why, candidates or kinds.likely())


def _guessed(kinds: _Kinds, kind: str) -> tuple[tuple[str, ...], str]:
    """The objects of the one type that every action takes, noted; `BadInput` for unlikely ones."""
    domain, robots = kinds.domain, kinds.of(kind)
    first = [variable for schema in domain.schemas for variable in schema.parameters[:1]]
    doubt = None
    if len(robots) == len(kinds.problem.objects) > 1:
        doubt = "are all its objects"
    elif len(robots) > _MOST_GUESSED:
        doubt = f"are {len(robots):,}"
    elif not any(kind in supertypes(domain.types, t) for own in first for t in own.types):
        doubt = "are never the first argument of an action"
    elif not _acts(kinds, kind):
        doubt = "never move or hold anything"
    if doubt:
        what = f"Every action takes objects of type {echoed(kind)}, but they {doubt}"
        raise kinds.unclear(what, kinds.inhabited())
    note(
        f"the robots are taken to be {some(robots, _SHOWN)}: every action takes an object of type "
        f"{echoed(kind)}",
        position=domain.source.section(":types"),
        remedy=f"Say --robot-type {kind} if that is so; --robots NAME,NAME names others.",
    )
    return robots, f"type {kind}"


def _acts(kinds: _Kinds, kind: str) -> bool:
    """Whether objects of a type move or hold something, by actions that take just one of them.

    Moving changes another argument of a fact about the object, as (at ?r ?from) to (at ?r ?to).
    Holding adds a fact that has it first, as (holding ?r ?x), which another action deletes.
    """
    changed: dict[bool, set[str]] = {True: set(), False: set()}
    for schema in kinds.domain.schemas:
        own = [p.name for p in schema.parameters if kinds.is_one(p, kind)]
        if len(own) != 1:
            continue
        facts = [e for e in schema.effects if own[0] in e.atom.args]
        if any(
            a.adds > b.adds and _moves(a.atom, b.atom, own[0]) for a, b in product(facts, repeat=2)
        ):
            return True
        for effect in facts:
            if effect.atom.args[0] == own[0] and _others(effect.atom, own[0]):
                changed[effect.adds].add(effect.atom.predicate)
    return not changed[True].isdisjoint(changed[False])


def _moves(after: Atom, before: Atom, robot: str) -> bool:
    """Whether two atoms say the same of a robot and some other variable."""
    return (
        after.predicate == before.predicate
        and [arg == robot for arg in after.args] == [arg == robot for arg in before.args]
        and _others(after, robot) != _others(before, robot)
    )


def _others(atom: Atom, robot: str) -> list[str]:
    """The variables of an atom besides the robot; constants are phases, not places or things."""
    return [arg for arg in atom.args if arg.startswith("?") and arg != robot]


def static_atoms(domain: Domain, problem: Problem) -> frozenset[Atom]:
    """The initial atoms that no action can change."""
    changed = fluent_predicates(domain)
    return frozenset(atom for atom in problem.init if atom.predicate not in changed)


def fluent_predicates(domain: Domain) -> frozenset[str]:
    """Predicates that occur in some action's effect."""
    return frozenset(e.atom.predicate for schema in domain.schemas for e in schema.effects)
