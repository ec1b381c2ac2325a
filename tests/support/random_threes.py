# SPDX-License-Identifier: GPL-3.0-or-later
"""Small random models of three robots in which effects depend on what two others do.

Interference is a matter of pairs; here a third robot decides what happens between two.
"""

from __future__ import annotations

from random import Random

from tests.support.random_pddl import RandomModel

_ROBOTS = ("r1", "r2", "r3")
_FACTS = ("(p)", "(q)", "(s)")


def random_threes(seed: int) -> RandomModel:
    """The model of a seed; the same seed writes the same text."""
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
