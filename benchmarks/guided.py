# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that A* expands with and without a sentence, over all candidate tasks of rows of Table 1.

    python benchmarks/guided.py [ROW ..] [--method greedy|minimal] [--heuristic NAME]

The paper reports 1.6 times fewer nodes on GWB7, the default.  For each language and heuristic, over
all tasks:

- steps: the mean makespan, which is the least number of nodes that any search expands.
- without: nodes expanded without a sentence (mean over the tasks).
- first: with the sentence of the plan that A* finds without one: as a robot that plans first, then
  speaks.
- average: with every sentence of the task, weighted by the number of plans that have it: the
  expected number for a plan drawn uniformly.
- most: with the sentence that most plans have, which leaves most plans open.
- sum ratio: all nodes without / all nodes with a sentence.  mean ratio: the mean over the tasks of
  that ratio.

"pruned" is the paper's search: what does not fit the sentence is pruned, nothing else.  "+words"
also uses the number of remaining words as a lower bound on the steps.  Ties are broken as
`coordlang.use.sentence.astar.astar` says.  All plans found are checked to be optimal and to have
the sentence.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from time import perf_counter

from printed_table import PrintedTable

from coordlang.building import build_language
from coordlang.evaluation.material.suite import ROWS, World, find_domains
from coordlang.language.sentences import task_sentences
from coordlang.use.sentence.guided_search import ExpandedStates, plan_under_sentence
from coordlang.use.sentence.task_language import TaskLanguage, languages_in_tasks

KINDS = ("first", "average", "most")
COLUMNS = (
    ("row", 5),
    ("language", 8),
    ("words", 5),
    ("heuristic", 9),
    ("search", 7),
    ("tasks", 6),
    ("searches", 8),
    ("steps", 6),
    ("without", 8),
    *((kind, 7) for kind in KINDS),
    *((f"{how} {kind}", 12) for kind in KINDS for how in ("sum", "mean")),
    ("s", 6),
)


@dataclass(slots=True)
class Sums:
    """Nodes expanded, summed over tasks, and ratios of tasks."""

    steps: int = 0
    without: float = 0.0
    searches: int = 0
    tasks: int = 0
    with_sentence: dict[str, float] = field(default_factory=lambda: dict.fromkeys(KINDS, 0.0))
    ratios: dict[str, float] = field(default_factory=lambda: dict.fromkeys(KINDS, 0.0))

    def add(
        self, language: TaskLanguage, states: ExpandedStates, heuristic: str, count_words: bool
    ) -> None:
        """Search one task without a sentence, then with each of its sentences."""
        without = plan_under_sentence(language, None, heuristic, states)
        listed = task_sentences(language.space, language.task, language.partition)
        plans = {language.words_of(one.words): one.plans for one in listed}
        nodes = {}
        for words in plans:
            found = plan_under_sentence(language, words, heuristic, states, count_words=count_words)
            assert (found.words, found.cost) == (words, without.cost)
            nodes[words] = found.expanded
        weighted = sum(nodes[words] * number for words, number in plans.items())
        chosen = {
            "first": nodes[without.words],
            "average": weighted / sum(plans.values()),
            "most": nodes[max(sorted(plans), key=lambda words: plans[words])],
        }
        self.tasks += 1
        self.searches += 1 + len(nodes)
        self.steps += without.cost[0]
        self.without += without.expanded
        for kind, expanded in chosen.items():
            self.with_sentence[kind] += expanded
            self.ratios[kind] += without.expanded / expanded

    def cells(self) -> list[object]:
        """The columns from "tasks" to the last ratio."""
        means = [f"{self.with_sentence[kind] / self.tasks:.2f}" for kind in KINDS]
        ratios = []
        for kind in KINDS:
            ratios.append(f"{self.without / self.with_sentence[kind]:.2f}x")
            ratios.append(f"{self.ratios[kind] / self.tasks:.2f}x")
        return [
            self.tasks,
            self.searches,
            f"{self.steps / self.tasks:.2f}",
            f"{self.without / self.tasks:.2f}",
            *means,
            *ratios,
        ]


def print_language(row: World, method: str, heuristics: Sequence[str], table: PrintedTable) -> None:
    """Build the language of a row by a method, and search all its tasks."""
    candidates = row.candidates(find_domains(None))
    language = build_language(candidates, method).language
    tasks = list(languages_in_tasks(language, candidates))
    states = ExpandedStates(candidates.model, tasks[0].partition)
    for heuristic, count_words in product(heuristics, (False, True)):
        start, sums = perf_counter(), Sums()
        for task in tasks:
            sums.add(task, states, heuristic, count_words)
        search = "+words" if count_words else "pruned"
        seconds = f"{perf_counter() - start:.1f}"
        size = len(language.words)
        table.print(row.name, method, size, heuristic, search, *sums.cells(), seconds)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*", default=["GWB7"])
    parser.add_argument("--method", choices=["greedy", "minimal"], action="append")
    parser.add_argument("--heuristic", choices=["blind", "manhattan", "relaxed"], action="append")
    arguments = parser.parse_args()
    table = PrintedTable(*COLUMNS)
    heuristics = arguments.heuristic or ["manhattan", "blind", "relaxed"]
    for row in ROWS:
        if row.name in arguments.rows:
            for method in arguments.method or ["greedy", "minimal"]:
                print_language(row, method, heuristics, table)


if __name__ == "__main__":
    main()
