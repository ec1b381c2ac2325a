"""Small random models as PDDL text: unstructured enough to meet what grids never show.

Joint-action PDDL over a few facts, every joint action with random literals: joint actions with the same effect, mixtures that
drift away and come back, dead ends, several goal states.  MA-PDDL with random subactions: interference and idling.
"""

from __future__ import annotations

from random import Random

from planners.model import ModelOptions
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.sexpr import Source


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
    domain = f"(define (domain random) (:types robot) (:predicates {predicates})\n" + "\n".join(actions) + ")"
    return domain, shared + [f"own r{n + 1}" for n in range(robots)]


def random_model(seed: int, robots: int) -> tuple[Domain, Problem, ModelOptions]:
    """A random model with a random start and goal."""
    random = Random(seed)
    style = random.choice([joint_text, ma_text])
    text, facts = style(random, robots)
    domain = parse_domain(Source("random-domain.pddl", text))
    names = " ".join(f"r{n + 1}" for n in range(robots))
    objects = f"(:objects {names} - robot)" if style is ma_text else ""
    init = " ".join(f"({f})" for f in facts if random.random() < 0.5)
    goal = " ".join(literals(random, facts, 2))
    problem = f"(define (problem p) (:domain random) {objects} (:init {init}) (:goal (and {goal})))"
    cost = random.choice(["makespan", "makespan", "makespan+actions"])
    return domain, parse_problem(Source("random-problem.pddl", problem), domain), ModelOptions(cost=cost)
