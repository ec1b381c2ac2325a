# SPDX-License-Identifier: GPL-3.0-or-later
"""``--cost makespan+cost`` against brute force on random models: makespan, then action cost."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from itertools import product
from random import Random

import pytest

from planners.classical import compile_classical
from planners.loading import PlanningInstance, task_of
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plans import Plans
from planners.search.reachable import explore
from tests.support.joint_twin import far
from tests.support.naive_classical import optimal_plans
from tests.support.naive_joint_steps import Labels, TooLarge, Twin
from tests.support.random_pddl import Kind, random_model
from tests.support.texts import model_of, parsed

Price = Callable[[str], int]


#: Resting is idling, with some arguments only; of which no action changes anything.
_REST = {
    "agent": "(:action rest :agent ?q - robot :parameters (?x) :precondition {} :effect ())",
    "plain": "(:action rest :parameters (?q - robot ?x) :precondition {} :effect ())",
}
_FITTING = (
    "()",
    "(not (= ?q ?x))",
    "(or (fee ?x) (= ?q ?x))",
    "(exists (?y) (and (fee ?y) (= ?x ?y)))",
)


def priced(seed: int, kind: Kind) -> tuple[PlanningInstance, Price]:
    """A random model; an action costs a constant, what its last argument costs, or nothing."""
    text = random_model(seed, kind)
    random = Random(seed)
    rest = _REST[kind].format(random.choice(_FITTING))
    resting = text.domain.replace("(:action ", f"{rest} (:action ", 1)
    names = re.findall(r"\(:action (\S+)", resting)
    pieces = re.split(r"(?=\(:action )", resting)
    fixed: dict[str, int | None] = {}
    for number, name in enumerate(names, 1):
        variables = re.findall(r"\?\w+", pieces[number].split(":precondition")[0])
        fixed[name] = random.choice((0, 1, 2, 5, None if variables else 3))
        term = f"(price {variables[-1]})" if fixed[name] is None else str(fixed[name])
        cost = (
            "" if fixed[name] == 0 and random.random() < 0.5 else f"(increase (total-cost) {term}) "
        )
        pieces[number] = re.sub(
            r":effect \((?:and ?)?", f":effect (and {cost}", pieces[number], count=1
        )
    functions = "(:functions (price ?x)) (:predicates (fee ?x)"
    priced_domain = "".join(pieces).replace("(:predicates", functions, 1)
    _, plain = parsed(priced_domain, text.problem)
    prices = {name: random.randrange(4) for name in sorted(plain.objects)}
    known = " ".join(f"(= (price {name}) {value})" for name, value in prices.items())
    known += "".join(f" (fee {name})" for name in prices if random.random() < 0.5)
    priced_problem = text.problem.replace("(:init", f"(:init {known}", 1)
    options = ModelOptions(unowned=text.unowned, cost="makespan+cost")
    loaded = model_of(priced_domain, priced_problem, options)

    def price(label: str) -> int:
        name, *args = label.strip("()").split()
        own = fixed[name]
        return prices[args[-1]] if own is None else own

    return loaded, price


def step_price(twin: Twin, price: Price) -> Callable[[Labels], int]:
    """Each subaction once; idling costs as the robot's cheapest action that is idling, or 0.

    Where its precondition is false by equality and by what never changes, there is no such action.
    """
    rules = twin.rules
    found: list[list[int]] = [[] for _ in rules.team.robots]
    for schema in filter(twin.is_idling, rules.domain.schemas):
        for args in product(*(rules.meaning.objects(v.types) for v in schema.parameters)):
            bound = rules.bind(schema, args)
            owners = bound.owners
            needs = rules.meaning.required(schema.precondition, bound.binding, True, owners)
            if len(owners) == 1 and needs is not False:
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
            problem = far(twin, twin.reachable(128)[-1])
            found = twin.optimal(problem.goal, step_price(twin, price))
            assert found is not None
        except TooLarge:
            seen["too large"] += 1
            continue
        wanted = (found.makespan, found.second, found.count)
        task = task_of(model, loaded.domain, problem)
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
    :precondition (exists (?r - robot ?a ?b - place) (drive ?r ?a ?b)) :effect (increase (total-cost) 7)))"""
_OVER = """(define (problem over) (:domain ways) (:objects r1 r2 - robot a b c {more} - place)
  (:init (at r1 a) (at r2 a) (next a b) (next b c) (jumps r1) {price} (= (price r2) 5))
  (:goal (and (at r1 c) (at r2 c))))"""


@pytest.mark.parametrize(
    ("price", "cost", "count"), [(0, 3, 2), (1, 4, 3), (2, 4, 1), (None, 4, 1)]
)
def test_idling_costs_what_the_cheapest_action_that_is_idling_costs(
    price: int | None, cost: int, count: int
) -> None:
    """While r2 drives two steps, r1 drives too, or jumps and idles once, for ``price``.

    It does not matter that nobody can ever rest.  Without a price only waiting is left, for 7,
    with any of 24 ** 9 arguments.
    """
    known = "" if price is None else f"(= (price r1) {price})"
    text = _OVER.format(price=known, more=" ".join(f"p{k}" for k in range(20)))
    loaded = model_of(_WAYS, text, ModelOptions(cost="makespan+cost"))
    model, task = loaded.model, loaded.tasks[0]
    assert model.idling_costs == (7 if price is None else price, 5)
    for heuristic in ("auto", "blind", "projections", "relaxed"):
        space = search(model, task, heuristic=heuristic)
        assert (space.cost_of(0), Plans.of(space).count) == ((2, cost), count)
        assert {*space.state.tolist()} == {*range(len(space.rows))}  # no others were kept
    for limit in (100_000, 0):
        plain = compile_classical(model, task, limit)
        found = optimal_plans(plain)
        assert found.cost is not None
        assert (plain.cost(found.cost), found.count()) == ((2, cost), count)
