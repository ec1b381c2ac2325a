# SPDX-License-Identifier: GPL-3.0-or-later
"""Factored MA-PDDL: one domain and one problem file per robot -> one domain and one problem.

A robot's files hold what it knows: public objects, its own private ones, and the actions that it
can do.  The union is the unfactored form; the parameter that can only be the robot itself becomes
the action's ``:agent``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from operator import or_
from pathlib import Path
from typing import Any, TypeVar

from msgspec import structs

from planners.pddl.domain import parse_domains
from planners.pddl.formula_tree import label
from planners.pddl.lifted import And, Atom, Constraint, Domain, Effect, Problem, Quantified, Schema
from planners.pddl.problem import read_problem
from planners.pddl.robots import objects_of
from planners.pddl.sexpr import Source, read_source
from planners.system.errors import Position
from planners.system.limits import reaching
from planners.system.messages import echoed

K = TypeVar("K")
V = TypeVar("V")


def read_factored(directory: str | Path) -> tuple[Domain, Problem]:
    """Read the domain and the problem file of every robot of a directory.

    They are called ``domain-ROBOT.pddl`` and ``problem-ROBOT.pddl``, as in CoDMAP, or
    ``ROBOT_domain.pddl`` and ``ROBOT_problem.pddl``, as unified-planning writes them.

    Raises `BadInput` where a file has no partner, an action differs between files in more than its
    agent's name and type, or has no parameter for its robot, or a constraint in more than actions.
    """
    folder = Path(directory)
    if not folder.is_dir():
        what = "this is a file, not a folder" if folder.exists() else "there is no such folder"
        raise Position(str(directory)).fail(what, "Name the folder of the robots' files.")
    domains, problems = _files(folder, "domain"), _files(folder, "problem")
    if not domains or set(domains) != set(problems):
        odd = ", ".join(sorted(set(domains) ^ set(problems))) or "no such files"
        raise Position(str(directory)).fail(
            "expected domain-ROBOT.pddl and problem-ROBOT.pddl (or ROBOT_domain.pddl and "
            f"ROBOT_problem.pddl) for every robot; without a partner: {odd}",
            "Unfactored files are given as DOMAIN PROBLEM, without --factored.",
        )
    with reaching(lambda: f"reading {directory}", "shorter files"):
        read = parse_domains([*map(read_source, domains.values())])
    views: dict[str, Domain] = {}
    tasks: list[Problem] = []
    for robot, own in zip(domains, read, strict=True):
        tasks.append(read_problem(problems[robot], own))
        views[robot] = _of_robot(robot, own, tasks[-1])
    domain = _join_domains([*views.values()], str(directory))
    problem = _join_problems(tasks, str(directory))
    _require_owners(domain, problem, views)
    return domain, problem


def _files(folder: Path, kind: str) -> dict[str, Path]:
    """Robot -> its file of a kind; `BadInput` where both names are there for a robot."""
    found: dict[str, Path] = {}
    for path in sorted(folder.glob("*.pddl")):
        robot = path.stem.removeprefix(f"{kind}-").removesuffix(f"_{kind}").lower()
        if not robot or len(path.stem) - len(robot) != len(kind) + 1:
            continue
        if robot in found:
            raise Position(str(folder)).fail(
                f"two {kind} files of robot {echoed(robot)}: {found[robot].name} and {path.name}",
                "Remove one of them.",
            )
        found[robot] = path
    return found


def _of_robot(robot: str, domain: Domain, problem: Problem) -> Domain:
    """The robot's domain with its own parameter in every action marked as the agent."""
    if robot not in problem.objects:
        raise problem.source.section(":objects").fail(
            f"robot {echoed(robot)} of the file name is no object of its problem",
            "A robot's files have its name, and its problem declares it.",
        )
    schemas = tuple(replace(s, agent=_agent(robot, s, domain, problem)) for s in domain.schemas)
    return replace(domain, schemas=schemas)


def _agent(robot: str, schema: Schema, domain: Domain, problem: Problem) -> int:
    for number, parameter in enumerate(schema.parameters):
        if objects_of(domain, problem, parameter.types) == (robot,):
            return number
    raise schema.position.fail(
        f"action {echoed(schema.name)} has no parameter that can only be {echoed(robot)}",
        "Give the robot a type of its own and a parameter of this type.",
    )


def _join_domains(domains: list[Domain], name: str) -> Domain:
    first = domains[0]
    schemas: dict[str, Schema] = {}
    for domain in domains:
        if domain.name != first.name:
            raise domain.source.section("domain").fail(
                f"domain {echoed(domain.name)}, expected {echoed(first.name)}",
                "All files of a folder belong to one domain.",
            )
        for schema in domain.schemas:
            known = schemas.setdefault(schema.name, schema)
            if _without_agent(known) != _without_agent(schema):
                raise schema.position.fail(
                    f"action {echoed(schema.name)} differs between the robots' files in more than "
                    "the agent's name and type",
                    f"The other one is at {known.position}. Give different actions "
                    "different names.",
                )
            schemas[schema.name] = _with_types(known, _both(_agent_of(known), _agent_of(schema)))
    return replace(
        first,
        source=_union(name, domains),
        types=_merged((domain.types for domain in domains), _both),
        constants=_merged((domain.constants for domain in domains), _both),
        predicates=_merged((domain.predicates for domain in domains), _signatures),
        functions=_merged((domain.functions for domain in domains), _signatures),
        schemas=tuple(schemas.values()),
        constraints=_join_constraints(domains),
        dependences=tuple(dict.fromkeys(d for domain in domains for d in domain.dependences)),
    )


def _join_constraints(domains: Sequence[Domain]) -> tuple[Constraint, ...]:
    """A file's constraint lists the actions of its robot: those of one name are one constraint."""
    joined: dict[str, Constraint] = {}
    for domain in domains:
        for own in domain.constraints:
            known = joined.setdefault(own.name, own)
            if replace(known, actions=own.actions) != own:
                raise domain.source.section(":concurrency-constraint").fail(
                    f"the constraint {echoed(own.name)} differs between the robots' files in more "
                    "than its actions",
                    "Write the same :parameters and :bounds, or give it another name.",
                )
            joined[own.name] = replace(own, actions=_both(known.actions, own.actions))
    return tuple(joined.values())


def _union(name: str, files: Sequence[Domain | Problem]) -> Source:
    return Source(name, "\n".join(file.source.text for file in files), is_union=True)


def _agent_of(schema: Schema) -> tuple[str, ...]:
    assert schema.acting is not None
    return schema.acting.types


def _with_types(schema: Schema, types: tuple[str, ...]) -> Schema:
    parameters = (
        structs.replace(p, types=types) if p == schema.acting else p for p in schema.parameters
    )
    return replace(schema, parameters=tuple(parameters))


def _without_agent(schema: Schema) -> Schema:
    """The action with neither the name nor the type of its agent, nor names of inner variables."""
    assert schema.acting is not None
    found: Schema = _numbered(_with_types(schema, ()), (schema.acting.name,))
    return found


def _numbered(part: Any, scope: tuple[str, ...]) -> Any:
    """A part of an action in which numbers stand for the variables in ``scope``.

    Those of quantifiers and effects come into it; of variables of one name the last one counts.
    """
    if isinstance(part, tuple):
        return tuple(_numbered(inner, scope) for inner in part)
    if isinstance(part, Quantified | Effect):
        scope += tuple(variable.name for variable in part.variables)
    if own := getattr(type(part), "__match_args__", ()):  # the fields of a record
        return type(part)(*(_numbered(getattr(part, name), scope) for name in own))
    # No token has a blank: a variable may be called "?0".
    return {name: f"? {number}" for number, name in enumerate(scope)}.get(part, part)


def _require_owners(domain: Domain, problem: Problem, views: Mapping[str, Domain]) -> None:
    """Raise `BadInput` where the union gives a robot an action that its own file lacks.

    A robot does what its agent's type allows: two robots of one type have the same actions.
    """
    for schema in [schema for view in views.values() for schema in view.schemas]:
        agents = objects_of(domain, problem, _agent_of(schema))
        for robot, other in views.items():
            if robot in agents and all(s.name != schema.name for s in other.schemas):
                raise schema.position.fail(
                    f"action {echoed(schema.name)} is for agents such as {echoed(robot)}, "
                    f"whose own domain {other.source.name} does not have it",
                    "Give robots with different actions different types.",
                )


def _merged(tables: Iterable[Mapping[K, V]], join: Callable[[V, V], V]) -> dict[K, V]:
    """One table of several, in which values of one key are joined."""
    merged: dict[K, V] = {}
    for table in tables:
        for key, value in table.items():
            merged[key] = join(merged[key], value) if key in merged else value
    return merged


def _signatures(
    one: Mapping[int, tuple[frozenset[str], ...]], other: Mapping[int, tuple[frozenset[str], ...]]
) -> dict[int, tuple[frozenset[str], ...]]:
    return _merged((one, other), lambda a, b: tuple(map(or_, a, b)))


def _both(one: tuple[V, ...], other: tuple[V, ...]) -> tuple[V, ...]:
    return tuple(dict.fromkeys((*one, *other)))


def _join_problems(problems: list[Problem], name: str) -> Problem:
    goals = tuple(dict.fromkeys(problem.goal for problem in problems))
    objects = _agreed("object", [(problem, problem.objects) for problem in problems])
    return replace(
        problems[0],
        source=_union(name, problems),
        objects=dict(sorted(objects.items())),
        init=frozenset().union(*(problem.init for problem in problems)),
        goal=goals[0] if len(goals) == 1 else And(goals),
        values=_agreed("value", [(problem, problem.values) for problem in problems]),
    )


def _agreed(what: str, tables: Iterable[tuple[Problem, Mapping[K, V]]]) -> dict[K, V]:
    """One table of all problems; `BadInput` where one says something else of a key."""
    merged: dict[K, V] = {}
    for problem, table in tables:
        for key, value in table.items():
            if merged.setdefault(key, value) != value:
                text = label(key.predicate, key.args) if isinstance(key, Atom) else echoed(key)
                raise problem.source.section(":objects" if what == "object" else ":init").fail(
                    f"the {what} {text} is not the same in all robots' problems",
                    "Give it one type, or one value, in all of them.",
                )
    return merged
