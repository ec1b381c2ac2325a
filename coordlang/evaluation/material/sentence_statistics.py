# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences of every candidate task: their lengths, and how many plans each leaves open."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from coordlang.language.sentences import Sentence, sentence, sentence_counts
from coordlang.language.words import Language
from coordlang.tasks.candidates import Candidates
from planners.search.plan_space import PlanSpace
from planners.tables import Ints

#: Tasks whose own numbers are kept in the results.
MOST_LISTED = 1000


@dataclass(frozen=True, slots=True)
class SentenceStatistics:
    """The sentences of one task.

    Attributes
    ----------
    steps
        The makespan of its optimal plans, in joint steps.
    plans
        Sentence -> the exact number of optimal plans with it.
    first, last
        The sentences of the first and of the last plan, in the order of
        `planners.search.plans.Plans`.
    """

    steps: int
    plans: Mapping[Sentence, int]
    first: Sentence
    last: Sentence

    @property
    def count(self) -> int:
        """N, the number of optimal plans."""
        return sum(self.plans.values())

    @property
    def expected_open(self) -> Fraction:
        """Plans left open by the sentence of a plan drawn uniformly: sum of n_s^2 / N."""
        return Fraction(sum(n * n for n in self.plans.values()), self.count)

    @property
    def expected_words(self) -> Fraction:
        """Words of the sentence of a plan drawn uniformly."""
        return Fraction(sum(n * len(s) for s, n in self.plans.items()), self.count)

    @property
    def fewest_words(self) -> int:
        """Words of the shortest sentence."""
        return min(map(len, self.plans))

    def saving(self, words: Fraction | int) -> float:
        """Return the communication saving of a sentence with so many words.

        It is the share of the plan's states (steps + 1) that need no word.
        """
        return float(1 - Fraction(words) / (self.steps + 1))


def candidate_statistics(
    candidates: Candidates, language: Language
) -> Iterator[SentenceStatistics]:
    """Yield the statistics of each candidate task."""
    partition = language.partition(candidates.model)
    for space in candidates.spaces:
        yield from task_statistics(space, partition.word_of(space.rows)[space.state])


def task_statistics(space: PlanSpace, word: Ints) -> list[SentenceStatistics]:
    """Return the statistics of the tasks of one plan space.

    ``word`` (nodes) holds the word number of each plan-space node.
    """
    plans = sentence_counts(space, word)
    return [
        SentenceStatistics(
            int(space.layer[node]),
            plans[node],
            sentence(word[space.nodes_on(node, space.first_path(node))].tolist()),
            sentence(word[_last_nodes(space, node)].tolist()),
        )
        for node in space.starts.tolist()
    ]


def _last_nodes(space: PlanSpace, node: int) -> list[int]:
    """The nodes of the last plan from a node: it always takes the last edge."""
    nodes = [node]
    while space.layer[nodes[-1]] > 0:
        nodes.append(space.target_of(space.out_edges(nodes[-1])[-1]))
    return nodes
