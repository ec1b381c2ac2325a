# SPDX-License-Identifier: GPL-3.0-or-later
"""Random models in which several robots have something to choose: which chores, and in which order;
tools are few.

Each robot has a few things to get done, each by one or by either of two chores.  No two chores with
one tool can be done in one step; a chore may have to wait for another one, of any robot, and may
undo one.  Small random models and graphs leave several robots with several subplans only now and
then; these do it often.
"""

from __future__ import annotations

from random import Random

from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from tests.support.texts import parsed

DOMAIN = """(define (domain chores) (:types robot chore thing)
 (:predicates (mine ?r - robot ?c - chore) (done ?c - chore) (got ?t - thing) (gets ?c - chore ?t - thing)
  (before ?c ?d - chore) (undoes ?c ?d - chore) (clash ?c ?d - chore))
 (:action do :agent ?r - robot :parameters (?c - chore)
  :precondition (and (mine ?r ?c) (not (done ?c))
    (forall (?d - chore) (or (not (before ?d ?c)) (done ?d)))
    (forall (?o - robot ?d - chore) (or (not (clash ?c ?d)) (not (do ?o ?d)))))
  :effect (and (done ?c) (forall (?t - thing) (when (gets ?c ?t) (got ?t)))
    (forall (?d - chore) (when (undoes ?c ?d) (not (done ?d)))))))
"""


def random_chores(seed: int, robots: int) -> tuple[Domain, Problem, ModelOptions]:
    """One to three things a robot, one or two with three robots."""
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
    return (*parsed(DOMAIN, problem), options)
