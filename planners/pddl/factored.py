# SPDX-License-Identifier: GPL-3.0-or-later
"""Factored MA-PDDL: one domain and one problem file per robot -> one domain and one problem.

A robot's files hold what it knows: public objects, its own private ones, and the actions that it
can do.  The union is the unfactored form; the parameter that can only be the robot itself becomes
the action's ``:agent``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from planners.pddl.domain import read_domain
from planners.pddl.formula_tree import Leaf, fold, with_parts
from planners.pddl.lifted import (
    And,
    Atom,
    Domain,
    Equal,
    Formula,
    Problem,
    Schema,
    Signatures,
    StepAtom,
    Term,
    Variable,
)
from planners.pddl.problem import read_problem
from planners.pddl.sexpr import JoinedSource
from planners.system.errors import BadInput, Position
from planners.system.messages import echoed

_AtomKind = TypeVar("_AtomKind", Atom, StepAtom)


def read_factored(directory: str | Path) -> tuple[Domain, Problem]:
    """Read the domain and the problem file of every robot of a directory.

    They are called ``domain-ROBOT.pddl`` and ``problem-ROBOT.pddl``, as in CoDMAP, or
    ``ROBOT_domain.pddl`` and ``ROBOT_problem.pddl``, as unified-planning writes them.

    Raises `BadInput` where a file has no partner, an action differs between files in more than its
    agent's name and type, or has no parameter for its robot.
    """
    folder = Path(directory)
    if not folder.is_dir():
        what = "this is a file, not a folder" if folder.exists() else "there is no such folder"
        raise BadInput(
            what, position=Position(str(directory)), remedy="Name the folder of the robots' files."
        )
    domains, problems = _files(folder, "domain"), _files(folder, "problem")
    if not domains or set(domains) != set(problems):
        odd = ", ".join(sorted(set(domains) ^ set(problems))) or "no such files"
        raise BadInput(
            "expected domain-ROBOT.pddl and problem-ROBOT.pddl (or ROBOT_domain.pddl and "
            f"ROBOT_problem.pddl) for every robot; without a partner: {odd}",
            position=Position(str(directory)),
            remedy="Unfactored files are given as DOMAIN PROBLEM, without --factored.",
        )
    views: list[tuple[Domain, Problem]] = []
    for robot, path in domains.items():
        domain = read_domain(path)
        views.append(_of_robot(robot, domain, read_problem(problems[robot], domain)))
    _require_owners(views, list(domains))
    domain = _join_domains([domain for domain, _ in views], str(directory))
    return domain, _join_problems([problem for _, problem in views], domain, str(directory))


def _files(folder: Path, kind: str) -> dict[str, Path]:
    """Robot -> its file of a kind; `BadInput` where both names are there for a robot."""
    found: dict[str, Path] = {}
    for path in sorted(folder.glob("*.pddl")):
        robot = path.stem.removeprefix(f"{kind}-").removesuffix(f"_{kind}").lower()
        if not robot or len(path.stem) - len(robot) != len(kind) + 1:
            continue
        if robot in found:
            raise BadInput(
                f"two {kind} files of robot {echoed(robot)}: {found[robot].name} and {path.name}",
                position=Position(str(folder)),
                remedy="Remove one of them.",
            )
        found[robot] = path
    return found


def _of_robot(robot: str, domain: Domain, problem: Problem) -> tuple[Domain, Problem]:
    """The robot's view with its own parameter in every action marked as the agent."""
    if robot not in problem.objects:
        raise BadInput(
            f"robot {echoed(robot)} of the file name is no object of its problem",
            position=problem.source.section(":objects"),
            remedy="A robot's files have its name, and its problem declares it.",
        )
    schemas = tuple(replace(s, agent=_agent(robot, s, domain, problem)) for s in domain.schemas)
    return replace(domain, schemas=schemas), problem


def _agent(robot: str, schema: Schema, domain: Domain, problem: Problem) -> int:
    for number, parameter in enumerate(schema.parameters):
        wanted = set(parameter.types)
        fitting = [
            name
            for name, types in problem.objects.items()
            if "object" in wanted or any(domain.supertypes(t) & wanted for t in types)
        ]
        if fitting == [robot]:
            return number
    raise BadInput(
        f"action {echoed(schema.name)} has no parameter that can only be {echoed(robot)}",
        position=domain.source.position(schema.offset),
        remedy="Give the robot a type of its own and a parameter of this type.",
    )


def _join_domains(domains: list[Domain], name: str) -> Domain:
    first = domains[0]
    source = JoinedSource(name, [domain.source for domain in domains])
    schemas: dict[str, Schema] = {}
    for domain in domains:
        if domain.name != first.name:
            raise BadInput(
                f"domain {echoed(domain.name)}, expected {echoed(first.name)}",
                position=domain.source.section("domain"),
                remedy="All files of a folder belong to one domain.",
            )
        for schema in domain.schemas:
            own = replace(schema, offset=source.offset(domain.source, schema.offset))
            known = schemas.setdefault(schema.name, own)
            if _without_agent(known) != _without_agent(own):
                raise BadInput(
                    f"action {echoed(schema.name)} differs between the robots' files in more than "
                    "the agent's name and type",
                    position=domain.source.position(schema.offset),
                    remedy=f"The other one is at {source.position(known.offset)}. Give different "
                    "actions different names.",
                )
            schemas[schema.name] = _with_agent_of(known, own)
    return replace(
        first,
        source=source,
        types=_all_types([domain.types for domain in domains]),
        constants=_all_types([domain.constants for domain in domains]),
        predicates=_union([domain.predicates for domain in domains]),
        functions=_union([domain.functions for domain in domains]),
        schemas=tuple(schemas.values()),
        constraints=tuple(
            dict.fromkeys(
                replace(c, offsets=tuple(source.offset(domain.source, at) for at in c.offsets))
                for domain in domains
                for c in domain.constraints
            )
        ),
        dependences=tuple(dict.fromkeys(d for domain in domains for d in domain.dependences)),
        signatures=_joined_signatures([domain.signatures for domain in domains]),
    )


#: What an agent is called while actions are compared: no variable of a file has this name.
_AGENT = "?"


def _without_agent(schema: Schema) -> Schema:
    """The action with neither the name nor the type of its agent, nor its position."""
    assert schema.agent is not None
    own = schema.parameters[schema.agent].name

    def term(name: Term) -> Term:
        return _AGENT if name == own else name

    def in_formula(formula: Formula) -> Formula:
        return fold(formula, _renamed_leaf(term), with_parts)

    parameters = list(schema.parameters)
    parameters[schema.agent] = Variable(_AGENT)
    cost = schema.cost
    return replace(
        schema,
        offset=0,
        parameters=tuple(parameters),
        precondition=in_formula(schema.precondition),
        effects=tuple(
            replace(
                effect,
                atom=_renamed(effect.atom, term),
                condition=in_formula(effect.condition),
            )
            for effect in schema.effects
        ),
        cost=_renamed(cost, term) if isinstance(cost, Atom) else cost,
    )


def _renamed_leaf(term: Callable[[Term], Term]) -> Callable[[Leaf], Formula]:
    def leaf(found: Leaf) -> Formula:
        match found:
            case Equal(left, right):
                return Equal(term(left), term(right))
            case Atom():
                return _renamed(found, term)
            case StepAtom():
                return _renamed(found, term)
        return found

    return leaf


def _renamed(atom: _AtomKind, term: Callable[[Term], Term]) -> _AtomKind:
    return replace(atom, args=tuple(map(term, atom.args)))


def _with_agent_of(known: Schema, other: Schema) -> Schema:
    """The action for the agents of both."""
    assert known.agent is not None
    assert other.agent is not None
    parameters = list(known.parameters)
    agent = parameters[known.agent]
    types = tuple(dict.fromkeys((*agent.types, *other.parameters[other.agent].types)))
    parameters[known.agent] = replace(agent, types=types)
    return replace(known, parameters=tuple(parameters))


def _require_owners(views: list[tuple[Domain, Problem]], robots: list[str]) -> None:
    """Raise `BadInput` where the union would give a robot an action that its own file lacks.

    A robot does what its agent's type allows: two robots of one type have the same actions.
    """
    for domain, _ in views:
        for schema in domain.schemas:
            assert schema.agent is not None
            wanted = set(schema.parameters[schema.agent].types)
            for robot, (other, problem) in zip(robots, views, strict=True):
                types = problem.objects[robot]
                fits = any(other.supertypes(t) & wanted for t in types)
                if fits and all(s.name != schema.name for s in other.schemas):
                    raise BadInput(
                        f"action {echoed(schema.name)} is for agents such as {echoed(robot)}, "
                        f"whose own domain {other.source.name} does not have it",
                        position=domain.source.position(schema.offset),
                        remedy="Give robots with different actions different types.",
                    )


def _all_types(tables: list[dict[str, tuple[str, ...]]]) -> dict[str, tuple[str, ...]]:
    """Types (or objects) with all the supertypes (types) that they have in some file."""
    joined: dict[str, tuple[str, ...]] = {}
    for table in tables:
        for name, types in table.items():
            joined[name] = tuple(dict.fromkeys((*joined.get(name, ()), *types)))
    return joined


def _union(tables: list[dict[str, frozenset[int]]]) -> dict[str, frozenset[int]]:
    """Names with all the numbers of arguments that they have in some file."""
    joined: dict[str, frozenset[int]] = {}
    for table in tables:
        for name, arities in table.items():
            joined[name] = joined.get(name, frozenset()) | arities
    return joined


def _joined_signatures(tables: list[Signatures]) -> Signatures:
    """The types that arguments may have in some file."""
    joined: Signatures = {}
    for table in tables:
        for key, own in table.items():
            joined[key] = tuple(a | b for a, b in zip(joined.get(key, own), own, strict=True))
    return joined


def _join_problems(problems: list[Problem], domain: Domain, name: str) -> Problem:
    first = problems[0]
    objects: dict[str, tuple[str, ...]] = {}
    init: set[Atom] = set()
    goals: dict[Formula, None] = {}
    values: dict[Atom, float] = {}
    for problem in problems:
        for function, value in problem.values.items():
            if values.setdefault(function, value) != value:
                raise BadInput(
                    f"{function.predicate} {' '.join(function.args)} has another value elsewhere",
                    position=problem.source.section(":init"),
                    remedy="Give it one value in all robots' problems.",
                )
        for obj, types in problem.objects.items():
            if objects.setdefault(obj, types) != types:
                raise BadInput(
                    f"object {echoed(obj)} has other types elsewhere",
                    position=problem.source.section(":objects"),
                    remedy="Declare it with the same type in all robots' problems.",
                )
        init |= problem.init
        goals[problem.goal] = None
    goal = next(iter(goals)) if len(goals) == 1 else And(tuple(goals))
    return replace(
        first,
        source=JoinedSource(name, [problem.source for problem in problems]),
        objects=dict(sorted(objects.items())),
        init=frozenset(init),
        goal=goal,
        values=values,
    )
