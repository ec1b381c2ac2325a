# SPDX-License-Identifier: GPL-3.0-or-later
"""``--cost makespan+cost`` against brute force: least makespan, then least PDDL action cost, on
random models.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from random import Random

import pytest

from planners.check.validate import validate
from planners.classical import compile_classical
from planners.loading import PlanningInstance, build, task_of
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import And, Formula, Not
from planners.pddl.model_options import ModelOptions
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plans import Plans
from planners.search.reachable import explore
from tests.support.naive_classical import optimal_plans
from tests.support.naive_joint_steps import Labels, TooLarge, Twin
from tests.support.random_pddl import Kind, random_model

Price = Callable[[str], int]


def priced(seed: int, kind: Kind) -> tuple[PlanningInstance, Price]:
    """A random model in which every action costs a constant, or what its first argument costs, or
    nothing.
    """
    text = random_model(seed, kind)
    random = Random(seed)
    names = re.findall(r"\(:action (\S+)", text.domain)
    pieces = re.split(r"(?=\(:action )", text.domain)
    fixed: dict[str, int | None] = {}
    for number, name in enumerate(names, 1):
        variables = re.findall(r"\?\w+", pieces[number].split(":precondition")[0])
        fixed[name] = random.choice((0, 1, 2, 5, None if variables else 3))
        term = f"(price {variables[0]})" if fixed[name] is None else str(fixed[name])
        cost = (
            "" if fixed[name] == 0 and random.random() < 0.5 else f"(increase (total-cost) {term}) "
        )
        pieces[number] = re.sub(
            r":effect \((?:and ?)?", f":effect (and {cost}", pieces[number], count=1
        )
    domain = parse_domain(
        Source(
            "d", "".join(pieces).replace("(:predicates", "(:functions (price ?x)) (:predicates", 1)
        )
    )
    plain = parse_problem(Source("p", text.problem), domain)
    prices = {name: random.randrange(4) for name in sorted(plain.objects)}
    known = " ".join(f"(= (price {name}) {value})" for name, value in prices.items())
    problem = parse_problem(
        Source("p", text.problem.replace("(:init", f"(:init {known}", 1)), domain
    )
    loaded = build(domain, [problem], ModelOptions(unowned=text.unowned, cost="makespan+cost"))

    def price(label: str) -> int:
        name, *args = label.strip("()").split()
        own = fixed[name]
        return prices[args[0]] if own is None else own

    return loaded, price


def step_price(twin: Twin, price: Price) -> Callable[[Labels], int]:
    """What a joint step costs: each subaction once, and the robots that idle.

    Idling costs as much as the robot's cheapest action that is idling, else nothing.
    """
    rules = twin.rules
    found: list[list[int]] = [[] for _ in rules.team.robots]
    for schema in filter(twin.is_idling, rules.domain.schemas):
        for args in product(*(rules.meaning.objects(v.types) for v in schema.parameters)):
            owners = rules.bind(schema, args).owners
            if len(owners) == 1:
                found[owners[0]].append(price(f"({' '.join((schema.name, *args))})"))
    idling = [min(own, default=0) for own in found]

    def of_step(labels: Labels) -> int:
        chosen = sum(price(label) for label in {*labels} - {None} if label)
        return chosen + sum(own for own, label in zip(idling, labels, strict=True) if not label)

    return of_step


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["agent", "plain"])
def test_the_same_cost_and_the_same_number_of_plans(kind: Kind) -> None:
    seen: Counter[str] = Counter()
    for seed in range(30):
        loaded, price = priced(seed, kind)
        model = loaded.model
        twin = Twin(loaded.domain, loaded.problems[0], loaded.team, 3000)
        try:
            last = twin.reachable(128)[-1]
            parts: tuple[Formula, ...] = (
                *sorted(last - twin.init, key=str),
                *(Not(a) for a in sorted(twin.init - last, key=str)),
            )
            goal = And(parts)
            found = twin.optimal(goal, step_price(twin, price))
            assert found is not None
        except TooLarge:
            seen["too large"] += 1
            continue
        wanted = (found.makespan, found.second, found.count)
        task = task_of(model, loaded.domain, replace(loaded.problems[0], goal=goal))
        space = search(model, task)
        assert (*space.cost_of(0), Plans.of(space).count) == wanted, seed
        init = task.init[None, :]
        (other,) = plan_spaces(explore(model, init), [(task.goal, init)])
        assert (*other.cost_of(0), Plans.of(other).count) == wanted, seed
        seen["costs"] += wanted[1] > 0
        seen["idling costs"] += any(model.idling_costs)
        seen["several plans"] += wanted[2] > 1
    assert seen["costs"] >= 8
    assert seen["several plans"] >= 5
    assert seen["idling costs"] >= 5


_WAYS = """(define (domain ways) (:types robot place) (:constants hell - place)
  (:predicates (at ?r - robot ?p - place) (next ?a ?b - place) (jumps ?r - robot))
  (:functions (price ?r - robot))
  (:action drive :agent ?r - robot :parameters (?a ?b - place)
    :precondition (and (at ?r ?a) (next ?a ?b))
    :effect (and (not (at ?r ?a)) (at ?r ?b) (increase (total-cost) 1)))
  (:action jump :agent ?r - robot :parameters (?a ?b ?c - place)
    :precondition (and (jumps ?r) (at ?r ?a) (next ?a ?b) (next ?b ?c))
    :effect (and (not (at ?r ?a)) (at ?r ?c) (increase (total-cost) 1)))
  (:action rest :agent ?r - robot :parameters () :precondition (at ?r hell)
    :effect (increase (total-cost) (price ?r)))
  (:action wait :agent ?r - robot :parameters (?p ?p2 ?p3 ?p4 ?p5 ?p6 ?p7 ?p8 ?p9 - place)
    :effect (increase (total-cost) 7)))"""
_OVER = """(define (problem over) (:domain ways) (:objects r1 r2 - robot a b c {more} - place)
  (:init (at r1 a) (at r2 a) (next a b) (next b c) (jumps r1) {price} (= (price r2) 5))
  (:goal (and (at r1 c) (at r2 c))))"""


@pytest.mark.parametrize(
    ("price", "cost", "count"),
    [(0, 3, 2), (1, 4, 3), (2, 4, 1), (None, 4, 1)],
)
def test_idling_costs_what_the_cheapest_action_that_is_idling_costs(
    price: int | None, cost: int, count: int
) -> None:
    """While r2 drives two steps, r1 drives too, or jumps and idles once, for ``price``.

    It does not matter that nobody can ever rest.  Without a price only waiting is left, for 7,
    with any of 24 ** 9 arguments.
    """
    domain = parse_domain(Source("d", _WAYS))
    known = "" if price is None else f"(= (price r1) {price})"
    problem = parse_problem(
        Source("p", _OVER.format(price=known, more=" ".join(f"p{k}" for k in range(20)))), domain
    )
    loaded = build(domain, [problem], ModelOptions(cost="makespan+cost"))
    model, task = loaded.model, loaded.tasks[0]
    assert model.idling_costs == (7 if price is None else price, 5)
    for heuristic in ("auto", "blind", "projections", "relaxed"):
        space = search(model, task, heuristic=heuristic)
        assert (space.cost_of(0), Plans.of(space).count) == ((2, cost), count)
    for limit in (100_000, 0):
        plain = compile_classical(model, task, limit)
        found = optimal_plans(plain)
        assert found.cost is not None
        assert (plain.cost(found.cost), found.count()) == ((2, cost), count)


def test_what_belonged_to_an_environment_that_is_not_there_costs_nobody() -> None:
    """The environment could do nothing but idle, so there is none; no robot pays for its idling."""
    domain = """(define (domain d) (:types robot place) (:predicates (at ?r - robot ?p - place))
      (:action go :parameters (?r - robot ?a ?b - place) :precondition (at ?r ?a)
        :effect (and (not (at ?r ?a)) (at ?r ?b) (increase (total-cost) 3)))
      (:action tick :parameters () :effect (increase (total-cost) 7)))"""
    problem = """(define (problem p) (:domain d) (:objects r1 r2 - robot a b - place)
      (:init (at r1 a) (at r2 a)) (:goal (at r1 b)))"""
    read = parse_domain(Source("d", domain))
    options = ModelOptions(("r1", "r2"), unowned="environment", cost="makespan+cost")
    loaded = build(read, [parse_problem(Source("p", problem), read)], options)
    assert loaded.model.robots == ("r1", "r2")
    assert search(loaded.model, loaded.tasks[0]).cost_of(0) == (1, 3)
    verdict = validate(read, loaded.problems[0], loaded.team, [["(go r1 a b)", "(tick)"]])
    assert "it belongs to no robot" in verdict.reason
