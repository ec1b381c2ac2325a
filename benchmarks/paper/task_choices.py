# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans, sentences and choices of the tasks of one plan space, computed once and kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
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
    partition = language.partition(candidates.model)
    for space in candidates.spaces:
        word = partition.word_of(space.rows)[space.state]
        for task in range(len(space.starts)):
            yield TaskLanguage(language, partition, space, task, word, True)


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


class TaskChoices:
    """The tasks of one plan space, in the language ``language``."""

    def __init__(self, language: TaskLanguage) -> None:
        self.language = language
        self._choices: dict[tuple[int, Sentence], list[Automaton]] = {}
        self._succeeds: dict[tuple[int, Sentence, str], bool] = {}

    @property
    def space(self) -> PlanSpace:
        """The plan space of all tasks."""
        return self.language.space

    @cached_property
    def _counted(self) -> list[int]:
        return counts(self.space)

    def draw(self, task: int, random: Random) -> tuple[Plan, Sentence]:
        """Return an optimal plan of a task, drawn uniformly, and its sentence."""
        plans = Plans(self.space, int(self.space.starts[task]), self._counted)
        return self._said(task, plans.unrank(random.randrange(plans.count)))

    def first(self, task: int) -> tuple[Plan, Sentence]:
        """Return the first optimal plan of a task, in the order of `Plans`, and its sentence."""
        path = self.space.first_path(int(self.space.starts[task]))
        return self._said(task, tuple(map(self.space.labels_of, path)))

    def _said(self, task: int, plan: Plan) -> tuple[Plan, Sentence]:
        return plan, sentence_of(replace(self.language, task=task), plan)

    def succeeds(self, task: int, words: Sentence, disruption: Disruption) -> bool:
        """Say whether every robot has a choice under a sentence that needs nothing forbidden."""
        key = (task, words, disruption.name)
        if key not in self._succeeds:
            own = zip(self.choices(task, words), disruption.forbidden, strict=True)
            self._succeeds[key] = all(avoids(automaton, forbidden) for automaton, forbidden in own)
        return self._succeeds[key]

    def choices(self, task: int, words: Sentence) -> list[Automaton]:
        """Return each robot's choices under a sentence of a task."""
        if (task, words) not in self._choices:
            plans = replace(self.language, task=task).plans_with(words)
            robots = range(len(self.language.model.robots))
            self._choices[task, words] = [determinise(plans, robot) for robot in robots]
        return self._choices[task, words]

    def optimal_choices(self, task: int, robot: int) -> Automaton:
        """Return the parts of a robot in all optimal plans of a task."""
        only = np.array([task])
        space = self.space.with_tasks(self.space.starts[only], self.space.second[only])
        return determinise(space, robot)


def sentence_of(used: TaskLanguage, plan: Plan) -> Sentence:
    """Return the sentence of an optimal plan of a task."""
    path = used.space.path_with(used.start, plan)
    assert path is not None, "a plan is a path of its plan space"
    return sentence(used.word[used.space.nodes_on(used.start, path)].tolist())


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
