# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans, sentences and choices of the tasks of one plan space, computed once and kept."""

from __future__ import annotations

from functools import cached_property
from random import Random

import numpy as np

from coordlang.evaluation.material.disruptions import Disruption
from coordlang.language.sentences import Sentence, sentence
from coordlang.use.choices.automaton import Automaton, determinise
from coordlang.use.sentence.fitting_plans import plans_with_sentence
from coordlang.use.sentence.task_language import TaskLanguage
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, counts


class TaskChoices:
    """The tasks of one plan space in a language.

    Parameters
    ----------
    language
        The language in any of these tasks.
    """

    def __init__(self, language: TaskLanguage) -> None:
        self.language = language
        self._plans: dict[int, Plans] = {}
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
        if task not in self._plans:
            self._plans[task] = Plans(self.space, int(self.space.starts[task]), self._counted)
        plans = self._plans[task]
        plan = plans.unrank(random.randrange(plans.count))
        path = self.space.path_with(plans.start, plan)
        assert path is not None, "a plan is a path of its plan space"
        return plan, self._sentence(task, path)

    def first(self, task: int) -> tuple[Plan, Sentence]:
        """Return the first optimal plan of a task, in the order of `Plans`, and its sentence."""
        path = self.space.first_path(int(self.space.starts[task]))
        return tuple(map(self.space.labels_of, path)), self._sentence(task, path)

    def _sentence(self, task: int, path: list[int]) -> Sentence:
        nodes = self.space.nodes_on(int(self.space.starts[task]), path)
        return sentence(self.language.word[nodes].tolist())

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
            names = self.language.partition.words
            plans = plans_with_sentence(self.space, self.language.word, task, words, names)
            robots = range(len(self.language.model.robots))
            self._choices[task, words] = [determinise(plans, robot) for robot in robots]
        return self._choices[task, words]

    def optimal_choices(self, task: int, robot: int) -> Automaton:
        """Return the parts of a robot in all optimal plans of a task."""
        only = np.array([task])
        space = self.space.with_tasks(self.space.starts[only], self.space.second[only])
        return determinise(space, robot)


def avoids(automaton: Automaton, forbidden: frozenset[int]) -> bool:
    """Say whether an automaton accepts a subplan without forbidden labels."""
    alive = {0}
    for _ in range(automaton.steps):
        alive = {
            to for state in alive for label, to in automaton.moves(state) if label not in forbidden
        }
    return bool(alive)
