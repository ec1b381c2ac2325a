# SPDX-License-Identifier: GPL-3.0-or-later
"""Small worlds for robots that keep no common step."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.building import build_language
from coordlang.execution.choices import SentenceChoices, choices
from coordlang.language.words import Partition
from planners.loading import build
from planners.pddl.model_options import ModelOptions
from planners.search.asynchronous import as_executed
from planners.search.optimal_plans import search
from tests.support.asynchronous import Parts, Plans, World, random_plans
from tests.support.domains import own_task
from tests.support.task_languages import in_words, sentence_of
from tests.support.texts import parsed

EITHER_WAY = """(define (domain either) (:types robot way) (:predicates (there ?r - robot))
 (:action go :agent ?r - robot :parameters (?w - way)
  :precondition (not (there ?r)) :effect (there ?r)))"""
EITHER_WAY_BOTH = """(define (problem p) (:domain either) (:objects r1 r2 - robot a b - way)
 (:init) (:goal (and (there r1) (there r2))))"""
ONLY_R1 = EITHER_WAY_BOTH.replace("(and (there r1) (there r2))", "(there r1)")

LIFT = """(define (domain lift) (:types robot)
 (:predicates (middle ?r - robot) (once ?r - robot) (twice ?r - robot))
 (:action hold :agent ?r - robot :parameters ()
  :precondition (and (not (middle ?r)) (not (twice ?r)) (exists (?o - robot) (lift ?o)))
  :effect (and (once ?r) (when (once ?r) (twice ?r))))
 (:action lift :agent ?r - robot :parameters ()
  :precondition (and (middle ?r) (not (twice ?r)) (forall (?o - robot) (or (middle ?o) (hold ?o))))
  :effect (and (once ?r) (when (once ?r) (twice ?r)))))"""

LIFT_TWICE = """(define (problem p) (:domain lift) (:objects r1 r2 r3 - robot) (:init (middle r2))
 (:goal (and (twice r1) (twice r2) (twice r3))))"""


def turning_round() -> SentenceChoices:
    """r1 and r2 turn round on the 2x2 grid, each in two moves."""
    made = own_task("grid", "gw1-2x2", ModelOptions(asynchronous=True))
    used = next(languages_in_tasks(build_language(made, "minimal").language, made))
    return choices(used, used.words_of(sentence_of(used)))


def choices_in(domain: str, problem: str) -> SentenceChoices:
    """Of robots that may follow any optimal plan."""
    read, read_problem = parsed(domain, problem)
    loaded = build(read, [read_problem], ModelOptions(asynchronous=True))
    space = as_executed(search(loaded.model, loaded.tasks[0]))
    one_word = Partition.of_states(space.rows, dict.fromkeys(range(len(space.rows)), 0))
    found = choices(in_words(None, one_word, space, 0), (0,))
    assert found.guaranteed
    return found


def random_choices(
    robots: int, seeds: range
) -> Iterator[tuple[World, Plans, list[Parts], SentenceChoices, Random]]:
    """Sentences of random models, two words at random: all plans, own plans, robots' choices."""
    for world, space, plans, made, random in random_plans(robots, seeds, 40):
        word = {state: random.randrange(2) for state in range(len(space.rows))}
        table = Partition.of_states(space.rows, word)
        word = dict(enumerate(table.word_of(space.rows).tolist()))
        own = in_words(None, table, made, 0)
        for words, group in plans.by_sentence(word).items():
            yield world, plans, group, choices(own, words), random
