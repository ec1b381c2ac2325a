# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans, sentences and choices in the tasks of a language."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random

import numpy as np

from coordlang.execution.automaton import Automaton, determinise
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import Candidates
from coordlang.language.sentences import Sentence, sentence
from coordlang.language.words import Language
from planners.joint.tables import Bools
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts


def languages_in_tasks(language: Language, candidates: Candidates) -> Iterator[TaskLanguage]:
    """Yield a language in each of its candidate tasks."""
    partition, loaded = language.partition(candidates.model), candidates.loaded
    declared = loaded.domain, loaded.problems[0]
    for space in candidates.spaces:
        word = partition.word_of(space.rows)[space.state]
        for task in range(len(space.starts)):
            yield TaskLanguage(language, partition, space, task, word, True, declared)


@dataclass(frozen=True, slots=True)
class Disruption:
    """Subactions that become impossible: ``forbidden[i]`` are label numbers of robot i."""

    name: str
    forbidden: tuple[frozenset[int], ...]

    def breaks(self, plan: Plan) -> bool:
        """Say whether some robot's part of a plan needs a forbidden subaction."""
        return any(
            label in own for step in plan for label, own in zip(step, self.forbidden, strict=True)
        )

    def spared(self, space: PlanSpace) -> list[Bools]:
        """Return for each robot a mask of the edges in which it needs no forbidden subaction."""
        forbidden = enumerate(map(sorted, self.forbidden))
        return [~np.isin(space.robot_labels(robot), own) for robot, own in forbidden]


def plans_of(languages: Sequence[TaskLanguage]) -> list[Plans]:
    """Return the plans of every task; those of one plan space are counted once."""
    spaces = {id(used.space): used.space for used in languages}
    counted = {number: counts(space) for number, space in spaces.items()}
    return [Plans(used.space, used.start, counted[id(used.space)]) for used in languages]


def draw_plan(plans: Plans, random: Random) -> Plan:
    """Return a plan drawn uniformly."""
    return plans.unrank(random.randrange(plans.count))


def first_plan(used: TaskLanguage) -> tuple[Plan, Sentence]:
    """Return the first optimal plan of a task, in the order of `Plans`, and its sentence."""
    plan = tuple(map(used.space.labels_of, used.space.first_path(used.start)))
    return plan, sentence_of(used, plan)


def sentence_of(used: TaskLanguage, plan: Plan) -> Sentence:
    """Return the sentence of an optimal plan of a task."""
    path = used.space.path_with(used.start, plan)
    assert path is not None, "a plan is a path of its plan space"
    return sentence(used.word[used.space.nodes_on(used.start, path)].tolist())


def choices_under(used: TaskLanguage, words: Sentence) -> list[Automaton]:
    """Return each robot's choices under a sentence of a task."""
    plans = used.plans_with(words)
    return [determinise(plans, robot) for robot in range(len(used.model.robots))]


def optimal_choices(used: TaskLanguage, robot: int) -> Automaton:
    """Return the parts of a robot in all optimal plans of a task."""
    only = np.array([used.task])
    space = used.space.with_tasks(used.space.starts[only], used.space.second[only])
    return determinise(space, robot)


def avoids(automaton: Automaton, forbidden: frozenset[int]) -> bool:
    """Say whether an automaton accepts a subplan without forbidden labels."""
    alive = {0}
    for _ in range(automaton.steps):
        alive = {
            to
            for state in alive
            for label, to in automaton.moves[state].items()
            if label not in forbidden
        }
    return bool(alive)
