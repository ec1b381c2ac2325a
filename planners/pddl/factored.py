# SPDX-License-Identifier: GPL-3.0-or-later
"""Factored MA-PDDL: one domain and one problem file per robot -> one domain and one problem.

A robot's files hold what it knows: public objects, its own private ones, and the actions that it
can do.  The union is the unfactored form; the parameter that can only be the robot itself becomes
the action's ``:agent``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from planners.errors import BadInput, Position
from planners.messages import echoed
from planners.pddl.domain import read_domain
from planners.pddl.lifted import And, Atom, Domain, Formula, Problem, Schema
from planners.pddl.problem import read_problem
from planners.pddl.sexpr import JoinedSource


def read_factored(directory: str | Path) -> tuple[Domain, Problem]:
    """Read ``domain-ROBOT.pddl`` and ``problem-ROBOT.pddl`` for every robot of a directory.

    Raises `BadInput` where a file has no partner, an action differs between files or has no
    parameter for its robot.
    """
    folder = Path(directory)
    if not folder.is_dir():
        what = "this is a file, not a folder" if folder.exists() else "there is no such folder"
        raise BadInput(
            what, position=Position(str(directory)), remedy="Name the folder of the robots' files."
        )
    domains = {
        path.stem.partition("-")[2].lower(): path for path in sorted(folder.glob("domain-*.pddl"))
    }
    problems = {
        path.stem.partition("-")[2].lower(): path for path in sorted(folder.glob("problem-*.pddl"))
    }
    if not domains or set(domains) != set(problems):
        odd = ", ".join(sorted(set(domains) ^ set(problems))) or "no such files"
        raise BadInput(
            "expected domain-ROBOT.pddl and problem-ROBOT.pddl for every robot; without a "
            f"partner: {odd}",
            position=Position(str(directory)),
            remedy="Unfactored files are given as DOMAIN PROBLEM, without --factored.",
        )
    views: list[tuple[Domain, Problem]] = []
    for robot, path in domains.items():
        domain = read_domain(path)
        views.append(_of_robot(robot, domain, read_problem(problems[robot], domain)))
    domain = _join_domains([domain for domain, _ in views], str(directory))
    return domain, _join_problems([problem for _, problem in views], domain, str(directory))


def _of_robot(robot: str, domain: Domain, problem: Problem) -> tuple[Domain, Problem]:
    """The robot's view with its own parameter in every action marked as the agent."""
    if robot not in problem.objects:
        raise BadInput(
            f"robot {echoed(robot)} of the file name is no object of its problem",
            position=problem.source.section(":objects"),
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
            )
        for schema in domain.schemas:
            known = schemas.setdefault(
                schema.name, replace(schema, offset=source.offset(domain.source, schema.offset))
            )
            if replace(known, offset=0) != replace(schema, offset=0):
                raise BadInput(
                    f"action {echoed(schema.name)} differs between the robots' files",
                    position=domain.source.position(schema.offset),
                )
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
                )
        for obj, types in problem.objects.items():
            if objects.setdefault(obj, types) != types:
                raise BadInput(
                    f"object {echoed(obj)} has other types elsewhere",
                    position=problem.source.section(":objects"),
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
