# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans as models of a formula, counted one by one, against the number that the search finds."""

from __future__ import annotations

from random import Random

import pytest

from planners.loading import PlanningInstance, build, load
from planners.pddl import parse_domain, parse_problem
from planners.pddl.model_options import Cost, ModelOptions
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import search
from planners.search.plans import counts
from planners.system.errors import ProvedImpossible
from tests.support.domains import DOMAINS
from tests.support.plan_formula import NotWritten, PlanFormula, answer, listed

_MOST = 400


def random_strips(seed: int, cost: Cost) -> PlanningInstance:
    """Two or three robots, actions with literals of seven facts as conditions and effects."""
    random = Random(seed)
    facts = [f"f{n}" for n in range(7)]

    def some(most: int) -> str:
        chosen = random.sample(facts, random.randint(0, most))
        return " ".join(random.choice(["({})", "({})", "(not ({}))"]).format(f) for f in chosen)

    text = "(define (domain d) (:types robot) (:predicates (able ?r - robot ?n - object)"
    text += " ".join(f"({fact})" for fact in facts) + ")"
    for name, fact in zip("abcdefg", facts, strict=True):
        text += (
            f"(:action {name} :agent ?r - robot :parameters (?n)"
            f" :precondition (and (able ?r ?n) {some(2)})"
            f" :effect (and {some(2)} ({fact})))"
        )
    domain = parse_domain(Source("domain.pddl", text + ")"))
    names = [f"r{n}" for n in range(random.choice([2, 3]))]
    able = [f"(able {name} {random.choice('xy')})" for name in names]
    true = [f"({fact})" for fact in facts[1:] if random.random() < 0.4]
    missing = [f"({fact})" for fact in facts if f"({fact})" not in true]
    problem = (
        f"(define (problem p) (:domain d) (:objects {' '.join(names)} - robot x y)"
        f"(:init {' '.join((*able, *true))})"
        f"(:goal (and {' '.join(random.sample(missing, random.randint(1, min(3, len(missing)))))})))"
    )
    parsed = parse_problem(Source("problem.pddl", problem), domain)
    return build(domain, [parsed], ModelOptions(cost=cost))


def check(loaded: PlanningInstance) -> tuple[int, int, int]:
    """Compare with the search; the cost, and the number of plans, -1 where there are too many."""
    space = search(loaded.model, loaded.tasks[0])
    makespan, second = space.cost_of(0)
    expected = counts(space)[int(space.starts[0])]
    if expected > _MOST:
        return makespan, second, -1
    counting = loaded.model.cost == "makespan+actions"
    most = second if counting else None
    assert not any(answer(PlanFormula(loaded, steps)) for steps in range(makespan))
    if most:
        assert not answer(PlanFormula(loaded, makespan, most=most - 1))
    formula = PlanFormula(loaded, makespan, most or 0, most)
    assert listed(formula, _MOST) == expected
    assert listed(formula, 0) == 1, "there is one more than none"
    return makespan, second, expected


@pytest.mark.parametrize("cost", ["makespan", "makespan+actions"])
def test_random_strips(cost: Cost) -> None:
    found = []
    for seed in range(150):
        try:
            found.append(check(random_strips(seed, cost)))
        except ProvedImpossible:
            continue
    # What was compared is no trifle: plans of several steps, and many plans.
    assert sum(makespan > 1 and plans > 1 for makespan, _, plans in found) > 10, found


@pytest.mark.parametrize(
    ("folder", "problem", "cost", "expected"),
    [
        ("vans", "alone", "makespan", (5, 0, 2)),
        ("two-arms", "exchange", "makespan", (8, 0, 2)),
        ("two-arms", "pass-on", "makespan+actions", (8, 8, 4)),
    ],
)
def test_shipped_domains(
    folder: str, problem: str, cost: Cost, expected: tuple[int, int, int]
) -> None:
    files = (DOMAINS / folder / "domain.pddl", [DOMAINS / folder / f"{problem}.pddl"])
    assert check(load(*files, ModelOptions(cost=cost))) == expected


def test_what_is_not_written_is_refused() -> None:
    """Robots that lift a tray together: a condition about the joint step."""
    files = (DOMAINS / "tray" / "domain.pddl", [DOMAINS / "tray" / "serve.pddl"])
    with pytest.raises(NotWritten):
        PlanFormula(load(*files, ModelOptions()), 1)
