# SPDX-License-Identifier: GPL-3.0-or-later
"""Small random models as PDDL text: unstructured enough to meet what grids never show."""

from __future__ import annotations

from random import Random

from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import Cost, ModelOptions
from tests.support.random_pddl import RandomModel
from tests.support.texts import parsed

GRAPH = """(define (domain random) (:types robot place)
(:predicates (at ?r - robot ?x - place) (way ?r - robot ?x ?y - place))
(:action go :agent ?r - robot :parameters (?x ?y - place)
 :precondition (and (at ?r ?x) (way ?r ?x ?y) RULES)
 :effect (and (at ?r ?y) (not (at ?r ?x)))))"""
CHORES = """(define (domain chores) (:types robot chore thing)
 (:predicates (mine ?r - robot ?c - chore) (done ?c - chore) (got ?t - thing) (gets ?c - chore ?t - thing)
  (before ?c ?d - chore) (undoes ?c ?d - chore) (clash ?c ?d - chore))
 (:action do :agent ?r - robot :parameters (?c - chore)
  :precondition (and (mine ?r ?c) (not (done ?c))
    (forall (?d - chore) (or (not (before ?d ?c)) (done ?d)))
    (forall (?o - robot ?d - chore) (or (not (clash ?c ?d)) (not (do ?o ?d)))))
  :effect (and (done ?c) (forall (?t - thing) (when (gets ?c ?t) (got ?t)))
    (forall (?d - chore) (when (undoes ?c ?d) (not (done ?d)))))))
"""
_ROBOTS = ("r1", "r2", "r3")
_FACTS = ("(p)", "(q)", "(s)")


def literals(random: Random, facts: list[str], positive: float = 0.5) -> str:
    """At most two."""
    chosen = random.sample(facts, random.randint(0, min(2, len(facts))))
    return " ".join(f"({f})" if random.random() < positive else f"(not ({f}))" for f in chosen)


def joint_text(random: Random, robots: int) -> tuple[str, list[str]]:
    """Joint-action PDDL, two subactions a robot: mixtures that drift and come back, dead ends."""
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
            f"(:action j{number} :parameters ()\n{comments}\n  :precondition (and {literals(random, facts)})\n"
            f"  :effect (and {literals(random, facts, 0.6)}))"
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
    """MA-PDDL, facts of each robot's own and shared ones: interference and idling."""
    shared = [f"f{n}" for n in range(random.randint(1, 3))]
    actions = []
    for number in range(random.randint(2, 3)):
        pool = [*shared, "own ?r"]
        actions.append(
            f"(:action a{number} :agent ?r - robot :parameters ()\n"
            f"  :precondition (and {literals(random, pool)})\n  :effect (and {literals(random, pool, 0.6)}))"
        )
    predicates = " ".join(f"({f})" for f in shared) + " (own ?r - robot)"
    domain = (
        f"(define (domain random) (:types robot) (:predicates {predicates})\n"
        + "\n".join(actions)
        + ")"
    )
    return domain, shared + [f"own r{n + 1}" for n in range(robots)]


def graph_text(random: Random, robots: int) -> tuple[str, str]:
    """Robots on a small random digraph with edges of their own, and random rules. Much RC."""
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
    return GRAPH.replace("RULES", " ".join(rules)), problem


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
    goal = literals(random, facts)
    problem = f"(define (problem p) (:domain random) {objects} (:init {init}) (:goal (and {goal})))"
    return (*parsed(text, problem), ModelOptions(cost=cost))


def random_chores(seed: int, robots: int) -> tuple[Domain, Problem, ModelOptions]:
    """Robots that choose which chores to do, and in which order; tools are few.

    Each has one to three things to get done (one or two with three robots), each by one or by either
    of two chores.  A chore may have to wait for another one, of any robot, and may undo one.  Several
    robots with several subplans are frequent here, and rare in the other models.
    """
    random = Random(seed)
    names = [f"r{n + 1}" for n in range(robots)]
    facts: list[str] = []
    things: list[str] = []
    chores: list[str] = []
    tool: dict[str, int] = {}
    tools = random.choice([2, 4, 6]) * robots
    for robot in names:
        for _ in range(random.randint(1, 3 if robots == 2 else 2)):
            things.append(f"t{len(things)}")
            for _ in range(random.choice([1, 1, 2])):
                chores.append(f"c{len(chores)}")
                facts += [f"(mine {robot} {chores[-1]})", f"(gets {chores[-1]} {things[-1]})"]
                tool[chores[-1]] = random.randrange(tools)
    facts += [f"(clash {c} {d})" for c in chores for d in chores if c != d and tool[c] == tool[d]]
    facts += [
        f"(before {c} {d})"
        for n, d in enumerate(chores)
        for c in chores[:n]
        if random.random() < 0.08
    ]
    if random.random() < 0.3 and len(chores) > 1:
        facts.append(f"(undoes {' '.join(random.sample(chores, 2))})")
    goal = [f"(got {t})" for t in things if random.random() < 0.9]
    problem = (
        f"(define (problem p) (:domain chores)\n"
        f"(:objects {' '.join(names)} - robot {' '.join(chores)} - chore {' '.join(things)} - thing)\n"
        f"(:init {' '.join(facts)}) (:goal (and {' '.join(goal)})))"
    )
    options = ModelOptions(cost=random.choice(["makespan", "makespan+actions", "makespan+actions"]))
    return (*parsed(CHORES, problem), options)


def random_threes(seed: int) -> RandomModel:
    """Three robots; effects depend on two others, so a third decides what happens between two."""
    pick = Random(f"threes {seed}")
    names = [
        (f"a{n}{k}", robot) for n, robot in enumerate(_ROBOTS) for k in range(1 + (n == seed % 3))
    ]
    actions = []
    for name, robot in names:
        others = [f"({a} {r})" for a, r in names if r != robot]
        needed = _literal(pick) if pick.random() < 0.15 else ""
        done = "" if pick.random() < 0.2 else f"(done {robot})"
        effects = " ".join(_effect(pick, others) for _ in range(pick.choice((0, 1, 1, 2))))
        actions.append(
            f"  (:action {name} :agent ?r - robot :parameters ()\n"
            f"    :precondition (and (= ?r {robot}) {needed})\n    :effect (and {done} {effects}))"
        )
    domain = (
        "(define (domain threes) (:requirements :adl :multi-agent) (:types robot)\n"
        f"  (:constants {' '.join(_ROBOTS)} - robot)\n"
        f"  (:predicates {' '.join(_FACTS)} (done ?r - robot) (never))\n"
        + "\n".join(actions)
        # Every fact is in some effect, so that all of them are fluents.
        + "\n  (:action never :agent ?r - robot :parameters () :precondition (never)\n"
        f"    :effect (and (never) (done ?r) {' '.join(_FACTS)})))\n"
    )
    init = " ".join(fact for fact in _FACTS if pick.random() < 0.5)
    goal = " ".join(_literal(pick) for _ in range(pick.choice((1, 1, 2))))
    done = " ".join(f"(done {robot})" for robot in _ROBOTS if pick.random() < 0.5)
    problem = (
        f"(define (problem threes-1) (:domain threes) (:init {init}) (:goal (and {done} {goal})))\n"
    )
    return RandomModel(domain, problem)


def _effect(pick: Random, others: list[str]) -> str:
    """A literal; mostly under a condition that two actions of others decide."""
    if pick.random() < 0.3:
        return _literal(pick)
    named = [atom if pick.random() < 0.8 else f"(not {atom})" for atom in pick.sample(others, 2)]
    more = [_literal(pick)] if pick.random() < 0.2 else []
    condition = f"({pick.choice(('and', 'and', 'and', 'or'))} {' '.join(named + more)})"
    return f"(when {condition} {_literal(pick)})"


def _literal(pick: Random) -> str:
    fact = pick.choice(_FACTS)
    return fact if pick.random() < 0.55 else f"(not {fact})"
