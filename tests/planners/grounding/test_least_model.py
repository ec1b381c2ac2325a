# SPDX-License-Identifier: GPL-3.0-or-later
"""What Tarski and clingo find is the least relaxed model, by its definition."""

from __future__ import annotations

from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import pytest

from planners.grounding.reachability import reachable_arguments
from planners.pddl import read_domain, read_problem
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Problem, Variable
from planners.pddl.robots import objects_of
from tests.support.domains import DOMAINS
from tests.support.random_pddl import KINDS, Kind, random_model
from tests.support.texts import parsed


def least_model(domain: Domain, problem: Problem) -> dict[str, set[Any]]:
    """The definition: every instance of every rule, until nothing is new."""

    def values(variables: tuple[Variable, ...]) -> Any:
        return product(*(objects_of(domain, problem, v.types) for v in variables))

    def put(atom: Atom, binding: dict[str, str]) -> Atom:
        return Atom(atom.predicate, tuple(binding.get(arg, arg) for arg in atom.args))

    true = set(problem.init)
    instances: dict[str, set[Any]] = {schema.name: set() for schema in domain.schemas}
    size = -1
    while size != len(true):
        size = len(true)
        for schema in domain.schemas:
            names = [p.name for p in schema.parameters]
            for args in values(schema.parameters):
                outer = dict(zip(names, args, strict=True))
                if not all(put(a, outer) in true for a in required_atoms(schema.precondition)):
                    continue
                instances[schema.name].add(args)
                for effect in (e for e in schema.effects if e.adds):
                    for inner in values(effect.variables):
                        own = [variable.name for variable in effect.variables]
                        both = outer | dict(zip(own, inner, strict=True))
                        if all(put(a, both) in true for a in required_atoms(effect.condition)):
                            true.add(put(effect.atom, both))
    return instances


def found(domain: Domain, problem: Problem) -> dict[str, set[Any]]:
    reached = reachable_arguments(domain, problem.objects, sorted(problem.init, key=str))
    assert all(len({*own}) == len(own) for own in reached.values())
    return {name: {*own} for name, own in reached.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_random_models(kind: Kind) -> None:
    for seed in range(25):
        text = random_model(seed, kind)
        domain, problem = parsed(text.domain, text.problem)
        assert found(domain, problem) == least_model(domain, problem)


def test_conditions_with_constants_repeated_variables_and_more_types() -> None:
    domain, problem = parsed(
        """(define (domain d) (:types robot place - thing) (:constants hub - place)
        (:predicates (at ?x - thing ?y - place) (way ?a ?b ?c) (seen ?a ?b) (lit))
        (:action go :agent ?r - robot :parameters (?x - (either robot place) ?p - place ?q)
         :precondition (and (and (at ?r ?p) (way ?p ?x ?p)) (way hub ?q ?q) (not (lit)))
         :effect (and (forall (?z - place) (when (and (seen ?z ?z) (lit)) (at ?r ?z)))
                      (lit) (seen ?q ?x) (not (at ?r ?p)))))""",
        """(define (problem p) (:domain d) (:objects r1 r2 - robot a b - place)
        (:init (at r1 a) (at r2 b) (way a b a) (way a r2 a) (way b a a) (way hub b b) (way hub r1 r1)
               (seen a a) (seen hub b)) (:goal (lit)))""",
    )
    assert found(domain, problem)["go"] == least_model(domain, problem)["go"] != set()


#: Instances of actions that are tried in every round.
MOST = 3_000
FOLDERS = sorted(path.parent for path in DOMAINS.glob("*/domain.pddl"))


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_shipped_problems(folder: Path) -> None:
    """Those of which all instances can be tried."""
    domain = read_domain(folder / "domain.pddl")
    paths = sorted({*folder.glob("*.pddl")} - {folder / "domain.pddl"})
    problems = [read_problem(path, domain) for path in paths]
    small = [problem for problem in problems if instances(domain, problem) <= MOST]
    for problem in small:
        assert found(domain, problem) == least_model(domain, problem)
    assert small


def instances(domain: Domain, problem: Problem) -> int:
    return sum(
        prod(len(objects_of(domain, problem, p.types)) for p in schema.parameters)
        for schema in domain.schemas
    )
