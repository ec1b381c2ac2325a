# SPDX-License-Identifier: GPL-3.0-or-later
"""What clingo finds is the least relaxed model, and the closure check sees every atom that lacks."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from random import Random
from typing import Any

import pytest

from planners.grounding.reachability import reachable_arguments
from planners.pddl import parse_domain, parse_problem
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import Atom, Domain, Problem, Variable
from planners.pddl.robots import objects_of
from planners.pddl.sexpr import Source
from tests.support.domains import DOMAINS
from tests.support.naive_closure import NotClosed, clingo_model, require_closed
from tests.support.random_pddl import KINDS, Kind, random_model


def read(domain: str, problem: str) -> tuple[Domain, Problem]:
    parsed = parse_domain(Source("domain", domain))
    return parsed, parse_problem(Source("problem", problem), parsed)


def least_model(domain: Domain, problem: Problem) -> tuple[set[Atom], dict[str, set[Any]]]:
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
    return true, instances


@pytest.mark.parametrize("kind", KINDS)
def test_the_least_model_and_what_lacks_in_it(kind: Kind) -> None:
    for seed in range(25):
        text = random_model(seed, kind)
        domain, problem = read(text.domain, text.problem)
        objects, init = problem.objects, sorted(problem.init, key=str)
        model = clingo_model(domain, objects, init)
        true, instances = least_model(domain, problem)
        atoms = [(signature, args) for signature, found in model.atoms.items() for args in found]
        assert {Atom(predicate, args) for (predicate, _), args in atoms} == true
        assert model.instances == instances
        require_closed(model, domain, objects, init)
        for signature, args in Random(seed).sample(atoms, min(4, len(atoms))):
            less = {**model.atoms, signature: model.atoms[signature] - {args}}
            with pytest.raises(NotClosed, match="missing"):
                require_closed(replace(model, atoms=less), domain, objects, init)
        for name, found in model.instances.items():
            if found:
                fewer = {**model.instances, name: found - {min(found)}}
                with pytest.raises(NotClosed, match="missing"):
                    require_closed(replace(model, instances=fewer), domain, objects, init)


def test_conditions_with_constants_repeated_variables_and_more_types() -> None:
    domain, problem = read(
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
    found = reachable_arguments(domain, problem.objects, sorted(problem.init, key=str))
    _, instances = least_model(domain, problem)
    assert set(found["go"]) == instances["go"] != set()


PROBLEMS = sorted(path for path in DOMAINS.glob("*/*.pddl") if path.name != "domain.pddl")


@pytest.mark.parametrize("path", PROBLEMS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_is_found_in_shipped_problems_is_closed(path: Path) -> None:
    domain, problem = read((path.parent / "domain.pddl").read_text(), path.read_text())
    init = sorted(problem.init, key=str)
    model = clingo_model(domain, problem.objects, init)
    require_closed(model, domain, problem.objects, init)
    name, instances = max(model.instances.items(), key=lambda item: len(item[1]))
    fewer = {**model.instances, name: instances - {min(instances)}}
    with pytest.raises(NotClosed, match=rf"\({name} .*\) is missing"):
        require_closed(replace(model, instances=fewer), domain, problem.objects, init)
