# SPDX-License-Identifier: GPL-3.0-or-later
"""Disruptions: subactions become impossible after the robots have committed.

A robot that has committed to a plan succeeds if its part needs none of the forbidden subactions.
One that has committed to a sentence succeeds if one of its own choices (`coordlang.execution`)
needs none of them; it selects among these without observing the other robots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from random import Random
from statistics import fmean

import numpy as np

from benchmarks.paper.grid import task_cells
from benchmarks.paper.task_choices import Disruption, TaskChoices, languages_in_tasks
from benchmarks.paper.warehouse import Delivery, human_in
from coordlang.language.candidates import Candidates
from coordlang.language.sentences import Sentence, sentence_counts
from coordlang.language.words import Language
from planners.joint.model import JointModel
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory


@dataclass(frozen=True, slots=True)
class SuccessRates:
    """Exact success rates of one task under one disruption, over plans drawn uniformly.

    ``plan``: the share of optimal plans that need no forbidden subaction.  ``sentence``: the share
    of optimal plans under whose sentence every robot has a choice that needs none.  ``possible``:
    whether any optimal plan needs none: what robots could reach that agree again.
    """

    plan: float
    sentence: float
    possible: bool


def success_rates(
    space: PlanSpace, word: Ints, disruptions: Sequence[Disruption], most: int | None = None
) -> list[list[SuccessRates]]:
    """Return the success rates of every task (rows) under every disruption (columns).

    The plans of a sentence are RC-free, so some plan with the sentence succeeds exactly if every
    robot has a successful choice: the successful sentences are those of the successful plans.

    ``word``: (nodes) The word number of each plan-space node.  ``most``: the most steps of counting
    sentences, see `sentence_counts`.  Raises `OutOfMemory` if there are more sentences than
    ``most`` allows.
    """
    every = sentence_counts(space, word, most_steps=most)
    word_of = np.zeros(len(space.rows), np.int64)
    word_of[space.state] = word
    found: list[list[SuccessRates]] = [[] for _ in space.starts]
    for disruption in disruptions:
        spared = space.along(disruption.spared(space))
        left = sentence_counts(spared, word_of[spared.state])
        starts = zip(space.starts.tolist(), spared.starts.tolist(), strict=True)
        for row, (node, own) in zip(found, starts, strict=True):
            row.append(_rates(every[node], left[own]))
    return found


def _rates(every: Mapping[Sentence, int], left: Mapping[Sentence, int]) -> SuccessRates:
    """The rates of a task from the plans of each sentence, all of them and the successful ones."""
    total, plans = sum(every.values()), sum(left.values())
    in_sentences = sum(every[words] for words in left)
    return SuccessRates(plans / total, in_sentences / total, plans > 0)


#: Steps of counting sentences up to which success rates are computed exactly.
MOST_STEPS = 2_000_000


@dataclass(frozen=True, slots=True)
class Trial:
    """Tasks (by number), one after the other, and the disruption that occurs when they begin."""

    tasks: tuple[int, ...]
    disruption: int


@dataclass(frozen=True, slots=True)
class Trials:
    """All equally likely trials over the tasks of one plan space."""

    choices: TaskChoices
    disruptions: tuple[Disruption, ...]
    trials: tuple[Trial, ...]

    def sample(self, runs: int, random: Random) -> dict[str, int]:
        """Count the successes in random trials.

        Plan and sentence get the same task, disruption and plan, the sentence being that plan's.
        """
        plan = sentence = 0
        for _ in range(runs):
            trial = self.trials[random.randrange(len(self.trials))]
            disruption = self.disruptions[trial.disruption]
            drawn = [(task, *self.choices.draw(task, random)) for task in trial.tasks]
            plan += not any(disruption.breaks(agreed) for _, agreed, _ in drawn)
            sentence += all(
                self.choices.succeeds(task, words, disruption) for task, _, words in drawn
            )
        return {"runs": runs, "plan": plan, "sentence": sentence}

    def exact(self) -> dict[str, float] | None:
        """Return the success rates over all trials, plans drawn uniformly.

        ``possible`` is the rate of trials in which some optimal plan of every task succeeds.  None
        where there are too many sentences.
        """
        language = self.choices.language
        try:
            rates = success_rates(language.space, language.word, self.disruptions, MOST_STEPS)
        except OutOfMemory:
            return None
        found = [[rates[task][trial.disruption] for task in trial.tasks] for trial in self.trials]

        def mean(of: Callable[[SuccessRates], float]) -> float:
            return round(fmean(prod(map(of, legs)) for legs in found), 6)

        return {
            "plan": mean(lambda rate: rate.plan),
            "sentence": mean(lambda rate: rate.sentence),
            "possible": mean(lambda rate: float(rate.possible)),
        }


def _choices(candidates: Candidates, language: Language) -> TaskChoices:
    assert len(candidates.spaces) == 1, "these models are small"
    return TaskChoices(next(iter(languages_in_tasks(language, candidates))))


def warehouse_trials(
    candidates: Candidates, language: Language, every: Sequence[Delivery]
) -> Trials:
    """Return the trials of deliveries: a human stands in any cell that is no corner."""
    choices = _choices(candidates, language)
    model = candidates.model
    corners = {cell for delivery in every for cell in delivery.start}
    cells = sorted({atom.args[1] for atom in model.codec.facts.atoms} - corners)
    disruptions = tuple(human_in(model, cell) for cell in cells)
    # Tasks are grouped by goal in a plan space, so they are found by their states.
    number = {task_cells(choices.space, task): task for task in range(len(choices.space.starts))}
    trials = [
        Trial(tuple(number[leg] for leg in delivery.legs), disruption)
        for delivery in every
        for disruption in range(len(disruptions))
    ]
    return Trials(choices, disruptions, tuple(trials))


def subaction_trials(candidates: Candidates, language: Language) -> Trials:
    """Return the trials in which one subaction is impossible that an optimal plan needs."""
    choices = _choices(candidates, language)
    disruptions = _single_subactions(candidates.model, choices.space)
    space = choices.space
    hit = [space.sources[~disruption.spared(space)] for disruption in disruptions]
    concerned = [space.ancestors(nodes)[space.starts] for nodes in hit]
    trials = [
        Trial((task,), number)
        for task in range(len(space.starts))
        for number, tasks in enumerate(concerned)
        if tasks[task]
    ]
    return Trials(choices, tuple(disruptions), tuple(trials))


def _single_subactions(model: JointModel, space: PlanSpace) -> list[Disruption]:
    """A disruption for each subaction in the plan space that does something."""
    found = []
    for robot, name in enumerate(model.robots):
        for label in np.unique(space.robot_labels(robot)).tolist():
            text = model.label_text(robot, label)
            if text is None:
                continue
            forbidden = [frozenset[int]()] * len(model.robots)
            forbidden[robot] = frozenset([label])
            found.append(Disruption(f"{name} {text}", tuple(forbidden)))
    return found
