# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences of every candidate task, as `communication` and `flexibility` compare methods."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from benchmarks.paper.recipe import Record, Result, Settings, Unit
from benchmarks.paper.state_orders import RANDOM_ORDERS, greedy_partitions
from benchmarks.paper.suite import METHODS, OTHERS, QUICK_ROW, ROW, WORLDS, language_for
from coordlang.language.candidates import Candidates
from coordlang.language.flexibility import Flexibility, flexibility
from coordlang.language.sentences import Sentence, sentence, sentence_counts
from coordlang.language.words import Language
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace

#: Tasks whose own numbers are kept in the results.
MOST_LISTED = 1000


@dataclass(frozen=True, slots=True)
class SentenceStatistics:
    """The sentences of one task.

    ``steps``: the makespan of its optimal plans, in joint steps.  ``plans``: sentence -> the exact
    number of optimal plans with it.  ``first`` and ``last``: the sentences of the first and of the
    last plan, in the order of `planners.search.plans.Plans`.
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


def comparison_units(experiment: str, settings: Settings) -> list[Unit]:
    """Return a unit for each method and world, and one for the greedy method in other orders."""
    row = QUICK_ROW if settings.quick else ROW
    methods = METHODS if settings.quick else (*METHODS, "flexible")
    worlds = (row, *(world.name for world in OTHERS[: 1 if settings.quick else None]))
    found = [
        Unit(experiment, f"{name}/{method}", {"world": name, "method": method})
        for name in worlds
        for method in methods
    ]
    orders = {"world": row, "orders": 10 if settings.quick else RANDOM_ORDERS}
    return [*found, Unit(experiment, f"{row}/orders", orders)]


def compare(
    unit: Unit,
    settings: Settings,
    measures: Callable[[Sequence[SentenceStatistics]], Result],
    of_order: Callable[[Flexibility], Sequence[float]],
) -> Result:
    """Measure one language; or, in the field ``orders``, the greedy method in many orders."""
    world, asked = WORLDS[unit.parameters["world"]], unit.parameters
    if "orders" not in asked:
        candidates, language = language_for(world, asked["method"], settings.seed)
        statistics = list(candidate_statistics(candidates, language))
        return {"words": len(language.words), **measures(statistics)}
    candidates = world.candidates()
    spaces, found = candidates.spaces, {}
    for name, words in greedy_partitions(candidates, asked["orders"], unit.random(settings.seed)):
        found[name] = of_order(flexibility(spaces, [words[space.state] for space in spaces]))
    return {"orders": found}


@dataclass(frozen=True, slots=True)
class Comparison:
    """The results of `comparison_units`.

    ``row``: the row of Table 1.  ``languages``: one for each method, on the row.  ``others``: the
    languages of other worlds.  ``orders``: what was measured of the greedy method in random and in
    systematic orders, by their names.
    """

    row: str
    languages: list[Record]
    others: list[Record]
    orders: dict[str, list[float]]

    @classmethod
    def of(cls, records: Sequence[Record]) -> Comparison:
        """Sort records, the first of which is one of the row."""
        row = records[0].parameters["world"]
        built = [record for record in records if "method" in record.parameters]
        orders = [record.result for record in records if "orders" in record.parameters]
        return cls(
            row,
            [record for record in built if record.parameters["world"] == row],
            [record for record in built if record.parameters["world"] != row],
            next(iter(orders[0].values())) if orders else {},
        )

    @property
    def of_paper(self) -> dict[str, Result]:
        """The results by method, if the row is the one that the paper reports of."""
        if self.row != ROW:
            return {}
        return {record.parameters["method"]: record.result for record in self.languages}
