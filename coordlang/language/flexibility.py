# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a language leaves open, and how much it need not say.

*Flexibility* of a task: draw one of its N optimal plans uniformly and say its sentence.  With
``n_s`` plans that have the sentence s, ``n_s`` plans are then open.  The expectation is ``E = sum_s
n_s^2 / N``; 1 where the sentence gives every plan away, N where one sentence holds all of them.

*Communication saving* of a plan: ``1 - len(sentence) / len(state sequence)``, the share of its
states that need no word.  The paper's figures on GWB7, 33.3 % over the 784 plans whose sentence is
shorter and 27.3 % over all 956, agree with each other only if a plan whose sentence is not shorter
saves nothing (33.3 % * 784 / 956 = 27.3 %).  Measured against the joint *actions* of the plan, one
fewer than its states, such a plan would save less than nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coordlang.language.sentences import sentence, sentence_counts
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.system.limits import memory_left

Floats = NDArray[np.float64]

#: What a sentence of a node takes while sentences are counted, in bytes, and the most that are.
_SENTENCE, _MOST = 200, 20_000_000
#: More plans than this are not told apart by the measures: it is near the largest float.
MANY = 10**300


@dataclass(frozen=True, slots=True)
class Flexibility:
    """Measures of a partition, one entry for each candidate task.

    The tasks of all plan spaces, in their order.

    ``plans``: N, exact.  ``expected``: plans left open in expectation over a plan drawn uniformly.
    ``first``: plans left open by the sentence of the first plan in our order.  ``words`` and
    ``first_words``: words of a sentence, in expectation and for the first plan.  ``steps``: joint
    steps of the task's plans.  Numbers of plans are floats with a relative error below 1e-12; a
    task with more than `MANY` counts as one with so many.
    """

    plans: tuple[int, ...]
    expected: Floats
    first: Floats
    words: Floats
    first_words: Floats
    steps: Ints

    @property
    def value(self) -> float:
        """Plans left open, averaged over the tasks: what ``--prefer flexible`` maximises."""
        return float(self.expected.mean())

    @property
    def saving(self) -> Floats:
        """Expected communication saving of each task's plans, against the states of a plan."""
        return 1 - self.words / (self.steps + 1)


def flexibility(spaces: Sequence[PlanSpace], words: Sequence[Ints]) -> Flexibility:
    """Measure a partition; ``words[k]`` holds the word number of each node of ``spaces[k]``.

    From the plans counted with each sentence: O(edges * sentences of a node).  Raises `OutOfMemory`
    when there are too many sentences to count.
    """
    tasks = (task for pair in zip(spaces, words, strict=True) for task in _tasks(*pair))
    plans, *columns = zip(*tasks, strict=True)
    measures: list[NDArray[Any]] = [np.array(column) for column in columns]
    return Flexibility(plans, *measures)


def _tasks(space: PlanSpace, word: Ints) -> Iterator[tuple[float, ...]]:
    """The measures of each task, in the order of the fields of `Flexibility`."""
    counted = sentence_counts(space, word, most_steps=min(_MOST, memory_left() // _SENTENCE))
    for start in space.starts.tolist():
        said = counted[start]
        plans = said.total()
        most = float(min(plans, MANY))
        first = sentence(word[space.nodes_on(start, space.first_path(start))].tolist())
        yield (
            plans,
            most * (sum(number**2 for number in said.values()) / plans**2),
            most * (said[first] / plans),
            sum(number * len(words) for words, number in said.items()) / plans,
            float(len(first)),
            int(space.layer[start]),
        )
