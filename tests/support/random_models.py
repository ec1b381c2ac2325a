# SPDX-License-Identifier: GPL-3.0-or-later
"""Small random models as PDDL text: unstructured enough to meet what grids never show.

Joint-action PDDL over a few facts, every joint action with random literals: joint actions with the
same effect, mixtures that drift away and come back, dead ends, several goal states.  MA-PDDL with
random subactions: interference and idling.
"""

from __future__ import annotations

from random import Random

from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import Cost, ModelOptions
from tests.support.texts import parsed


def literals(random: Random, facts: list[str], most: int) -> list[str]:
    chosen = random.sample(facts, random.randint(0, min(most, len(facts))))
    return [f"({f})" if random.random() < 0.5 else f"(not ({f}))" for f in chosen]


def effects(random: Random, facts: list[str]) -> str:
    chosen = random.sample(facts, random.randint(0, min(2, len(facts))))
    return " ".join(f"({f})" if random.random() < 0.6 else f"(not ({f}))" for f in chosen)


def joint_text(random: Random, robots: int) -> tuple[str, list[str]]:
    """Joint-action PDDL: each robot has two subactions or idles."""
    facts = [f"f{n}" for n in range(random.randint(2, 4))]
    names = [f"r{n + 1}" for n in range(robots)]
    actions = []
    tuples = {
        tuple(random.choice(["idle", "(a)", "(b)"]) for _ in names)
        for _ in range(random.randint(3, 7 if robots == 2 else 10))
    }
    for number, parts in enumerate(sorted(tuples)):
        comments = "\n".join(f"  ; subaction {r} {p}" for r, p in zip(names, parts, strict=True))
        actions.append(
            f"(:action j{number} :parameters ()\n{comments}\n  :precondition (and {' '.join(literals(random, facts, 2))})\n"
            f"  :effect (and {effects(random, facts)}))"
        )
    # Every fact is in some effect, so that all of them are fluents.
    touch = " ".join(f"({f})" for f in facts)
    actions.append(
        "(:action never :parameters ()\n"
        + "\n".join(f"  ; subaction {r} idle" for r in names)
        + f"\n  :precondition (and (never)) :effect (and (never) {touch}))"
    )
    predicates = " ".join(f"({f})" for f in [*facts, "never"])
    return f"(define (domain random) (:predicates {predicates})\n" + "\n".join(actions) + ")", facts


def ma_text(random: Random, robots: int) -> tuple[str, list[str]]:
    """MA-PDDL: facts of each robot's own and shared ones; random subactions."""
    shared = [f"f{n}" for n in range(random.randint(1, 3))]
    actions = []
    for number in range(random.randint(2, 3)):
        pool = [*shared, "own ?r"]
        actions.append(
            f"(:action a{number} :agent ?r - robot :parameters ()\n"
            f"  :precondition (and {' '.join(literals(random, pool, 2))})\n  :effect (and {effects(random, pool)}))"
        )
    predicates = " ".join(f"({f})" for f in shared) + " (own ?r - robot)"
    domain = (
        f"(define (domain random) (:types robot) (:predicates {predicates})\n"
        + "\n".join(actions)
        + ")"
    )
    return domain, shared + [f"own r{n + 1}" for n in range(robots)]


def graph_text(random: Random, robots: int) -> tuple[str, str]:
    """Robots on a small random directed graph, each with edges of its own; random rules of the
    road.  Much RC.
    """
    places = [f"c{n}" for n in range(max(robots, random.choice([3, 3, 4])))]
    names = [f"r{n + 1}" for n in range(robots)]
    rules = ["(forall (?o - robot ?z - place) (not (go ?o ?z ?y)))"]
    if random.random() < 0.7:
        rules.append("(forall (?o - robot) (not (go ?o ?y ?x)))")
    if random.random() < 0.3:
        rules.append("(forall (?o - robot) (not (at ?o ?y)))")
    else:
        rules.append(
            "(forall (?o - robot) (or (= ?o ?r) (not (at ?o ?y)) (exists (?z - place) (and (way ?o ?y ?z) (go ?o ?y ?z)))))"
        )
    domain = (
        "(define (domain random) (:types robot place)\n"
        "(:predicates (at ?r - robot ?x - place) (way ?r - robot ?x ?y - place))\n"
        "(:action go :agent ?r - robot :parameters (?x ?y - place)\n"
        f" :precondition (and (at ?r ?x) (way ?r ?x ?y) {' '.join(rules)})\n"
        " :effect (and (at ?r ?y) (not (at ?r ?x)))))"
    )
    ways = [
        f"(way {r} {x} {y})"
        for r in names
        for x in places
        for y in places
        if x != y and random.random() < 0.75
    ]
    start, end = (random.sample(places, robots) for _ in range(2))
    at = [f"(at {r} {p})" for r, p in zip(names, start, strict=True)]
    goal = [f"(at {r} {p})" for r, p in zip(names, end, strict=True)]
    random.shuffle(goal)
    problem = (
        f"(define (problem p) (:domain random) (:objects {' '.join(names)} - robot {' '.join(places)} - place)\n"
        f"(:init {' '.join(at + ways)}) (:goal (and {' '.join(goal[: random.randint(1, robots)])})))"
    )
    return domain, problem


def random_model(seed: int, robots: int) -> tuple[Domain, Problem, ModelOptions]:
    """A random model with a random start and goal."""
    random = Random(seed)
    cost: Cost = random.choice(["makespan", "makespan", "makespan+actions"])
    if random.random() < 0.4:
        text, problem = graph_text(random, robots)
        return (*parsed(text, problem), ModelOptions(cost=cost))
    style = random.choice([joint_text, ma_text])
    text, facts = style(random, robots)
    names = " ".join(f"r{n + 1}" for n in range(robots))
    objects = f"(:objects {names} - robot)" if style is ma_text else ""
    init = " ".join(f"({f})" for f in facts if random.random() < 0.5)
    goal = " ".join(literals(random, facts, 2))
    problem = f"(define (problem p) (:domain random) {objects} (:init {init}) (:goal (and {goal})))"
    return (*parsed(text, problem), ModelOptions(cost=cost))
