# SPDX-License-Identifier: GPL-3.0-or-later
"""Disruptions: subactions become impossible after the robots have committed.

A robot that has committed to a plan succeeds if its part needs none of the forbidden subactions.
One that has committed to a sentence succeeds if one of its own choices (`coordlang.execution`)
needs none of them; it selects among these without observing the other robots.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import inf, prod
from random import Random
from statistics import fmean

import numpy as np

from benchmarks.paper.grid import task_cells
from benchmarks.paper.task_choices import (
    Disruption,
    avoids,
    choices_under,
    draw_plan,
    languages_in_tasks,
    plans_of,
    sentence_of,
)
from benchmarks.paper.warehouse import Delivery, human_in
from coordlang.execution.automaton import Automaton
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import Candidates
from coordlang.language.sentences import Sentence, sentence_counts
from coordlang.language.words import Language
from planners.joint.model import JointModel
from planners.joint.tables import Bools, Ints
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory


@dataclass(frozen=True, slots=True)
class SuccessRates:
    """Exact success rates of one task under one disruption, over plans drawn uniformly.

    ``plan``: the share of optimal plans that need no forbidden subaction.  ``sentence``: the share
    of optimal plans under whose sentence every robot has a choice that needs none.
    """

    plan: float
    sentence: float


def success_rates(
    space: PlanSpace, word: Ints, disruptions: Sequence[Disruption], most: float = inf
) -> list[list[SuccessRates]]:
    """Return the success rates of every task (rows) under every disruption (columns).

    A sentence succeeds if for every robot there is a plan with it in which this robot is spared.
    There may be none in which all are: what they choose may have another sentence.

    ``word``: (nodes) The word number of each plan-space node.  ``most``: the most steps of counting
    sentences, see `sentence_counts`.  Raises `OutOfMemory` if there are more sentences than
    ``most`` allows.
    """
    word_of = np.zeros(len(space.rows), np.int64)
    word_of[space.state] = word

    def counted(edges: Bools) -> list[Counter[Sentence]]:
        """The sentences of the plans of each task along some edges."""
        part = space.along(edges)
        counts = sentence_counts(part, word_of[part.state], most_steps=most)
        return [counts[start] for start in part.starts.tolist()]

    every = counted(np.ones(len(space.target), np.bool_))
    found: list[list[SuccessRates]] = [[] for _ in every]
    for disruption in disruptions:
        spared = disruption.spared(space)
        left, own = counted(np.all(spared, axis=0)), list(map(counted, spared))
        for task, (row, said) in enumerate(zip(found, every, strict=True)):
            good = sum(n for words, n in said.items() if all(words in of[task] for of in own))
            total = said.total()
            row.append(SuccessRates(left[task].total() / total, good / total))
    return found


#: Steps of counting sentences up to which success rates are computed exactly.
MOST_STEPS = 2_000_000


@dataclass(frozen=True, slots=True)
class Trial:
    """Tasks (by number), one after the other, and the disruption that occurs when they begin."""

    tasks: tuple[int, ...]
    disruption: int


@dataclass(frozen=True, slots=True)
class Trials:
    """All equally likely trials over the tasks of one plan space, by number, in a language."""

    languages: tuple[TaskLanguage, ...]
    disruptions: tuple[Disruption, ...]
    trials: tuple[Trial, ...]

    def sample(self, runs: int, random: Random) -> dict[str, int]:
        """Count the successes in random trials.

        Plan and sentence get the same task, disruption and plan, the sentence being that plan's.
        """
        plans, plan, sentence = plans_of(self.languages), 0, 0

        @cache
        def choices(task: int, words: Sentence) -> list[Automaton]:
            return choices_under(self.languages[task], words)

        for _ in range(runs):
            trial = self.trials[random.randrange(len(self.trials))]
            disruption = self.disruptions[trial.disruption]
            agreed = [(task, draw_plan(plans[task], random)) for task in trial.tasks]
            plan += not any(disruption.breaks(own) for _, own in agreed)
            parts = (choices(task, sentence_of(self.languages[task], own)) for task, own in agreed)
            sentence += all(all(map(avoids, own, disruption.forbidden)) for own in parts)
        return {"runs": runs, "plan": plan, "sentence": sentence}

    def exact(self) -> dict[str, float] | None:
        """Return the success rates over all trials, plans drawn uniformly.

        None where there are too many sentences.
        """
        space, word = self.languages[0].space, self.languages[0].word
        try:
            rates = success_rates(space, word, self.disruptions, MOST_STEPS)
        except OutOfMemory:
            return None
        found = [[rates[task][trial.disruption] for task in trial.tasks] for trial in self.trials]
        return {
            what: round(fmean(prod(getattr(rate, what) for rate in legs) for legs in found), 6)
            for what in ("plan", "sentence")
        }


def _in_tasks(candidates: Candidates, language: Language) -> tuple[TaskLanguage, ...]:
    assert len(candidates.spaces) == 1, "these models are small"
    return tuple(languages_in_tasks(language, candidates))


def warehouse_trials(
    candidates: Candidates, language: Language, every: Sequence[Delivery]
) -> Trials:
    """Return the trials of deliveries: a human stands in any cell that is no corner."""
    languages, model = _in_tasks(candidates, language), candidates.model
    corners = {cell for delivery in every for cell in delivery.start}
    cells = sorted({atom.args[1] for atom in model.codec.facts.atoms} - corners)
    disruptions = tuple(human_in(model, cell) for cell in cells)
    # Tasks are grouped by goal in a plan space, so they are found by their states.
    number = {task_cells(used.space, used.task): used.task for used in languages}
    trials = [
        Trial(tuple(number[leg] for leg in delivery.legs), disruption)
        for delivery in every
        for disruption in range(len(disruptions))
    ]
    return Trials(languages, disruptions, tuple(trials))


def subaction_trials(candidates: Candidates, language: Language) -> Trials:
    """Return the trials in which one subaction is impossible that an optimal plan needs."""
    languages = _in_tasks(candidates, language)
    space = languages[0].space
    disruptions = _single_subactions(candidates.model, space)
    hit = [space.sources[~np.all(disruption.spared(space), axis=0)] for disruption in disruptions]
    concerned = [space.ancestors(nodes)[space.starts] for nodes in hit]
    trials = [
        Trial((task,), number)
        for task in range(len(space.starts))
        for number, tasks in enumerate(concerned)
        if tasks[task]
    ]
    return Trials(languages, tuple(disruptions), tuple(trials))


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
