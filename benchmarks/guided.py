"""How many nodes A* expands with and without a sentence, over all candidate tasks of a row of Table
1.

    python benchmarks/guided.py [ROW ..] [--method greedy|minimal] [--heuristic NAME]

The paper reports 1.6 times fewer nodes on GWB7.  For each language and heuristic, over all tasks:

- steps: the mean makespan, which is the least number of nodes that any search expands.
- without: nodes expanded without a sentence (mean over the tasks).
- first: with the sentence of the plan that A* finds without one: as a robot would that plans first,
  then speaks.
- average: with every sentence of the task, weighted by the number of plans that have it: the
  expected number for a plan drawn uniformly.
- sum ratio: all nodes without / all nodes with a sentence.  mean ratio: the mean over the tasks of
  that ratio.
- most: with the sentence that most plans have, as somebody would say who leaves as much open as he
  can.

"pruned" is the paper's search: what does not fit the sentence is pruned, nothing else.  "+words"
also takes the number of words still to say as a lower bound on the steps.  Ties are broken as
`coordlang.use.sentence.guided_search.a_star` says.  All plans found are checked to be optimal and
to have the sentence.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field
from time import perf_counter

from table1 import ROWS, candidates_of

from coordlang.building import build_language
from coordlang.language.sentences import task_sentences
from coordlang.use.sentence.guided_search import ExpandedStates, plan_under_sentence
from coordlang.use.sentence.task_language import TaskLanguage, languages_in_tasks


@dataclass(slots=True)
class Sums:
    """Nodes expanded, summed over tasks, and ratios of tasks."""

    steps: int = 0
    without: float = 0.0
    with_sentence: dict[str, float] = field(default_factory=dict)
    ratios: dict[str, float] = field(default_factory=dict)
    tasks: int = 0

    def add(self, steps: int, without: int, **chosen: float) -> None:
        self.tasks += 1
        self.steps += steps
        self.without += without
        for kind, nodes in chosen.items():
            self.with_sentence[kind] = self.with_sentence.get(kind, 0.0) + nodes
            self.ratios[kind] = self.ratios.get(kind, 0.0) + without / nodes


def run(
    spoken: TaskLanguage, terrain: ExpandedStates, heuristic: str, count_words: bool, sums: Sums
) -> int:
    """One task; the number of searches."""
    without = plan_under_sentence(spoken, None, heuristic, terrain)
    nodes = {}
    said = task_sentences(spoken.space, spoken.task, spoken.partition)
    sentences = {spoken.words_of(sentence.words): sentence.plans for sentence in said}
    for words in sentences:
        found = plan_under_sentence(spoken, words, heuristic, terrain, count_words=count_words)
        assert (found.words, found.cost) == (words, without.cost)
        nodes[words] = found.expanded
    plans = sum(sentences.values())
    average = sum(nodes[words] * number for words, number in sentences.items()) / plans
    most = max(sorted(sentences), key=lambda words: sentences[words])
    sums.add(
        without.cost[0],
        without.expanded,
        first=nodes[without.words],
        average=average,
        most=nodes[most],
    )
    return len(nodes) + 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="*", default=["GWB7"])
    parser.add_argument("--method", choices=["greedy", "minimal"], action="append")
    parser.add_argument("--heuristic", choices=["blind", "manhattan", "relaxed"], action="append")
    arguments = parser.parse_args()
    kinds = ("first", "average", "most")
    head = (
        "row",
        "language",
        "words",
        "heuristic",
        "search",
        "tasks",
        "searches",
        "steps",
        "without",
        *kinds,
    )
    head += tuple(f"{how} {kind}" for kind in kinds for how in ("sum", "mean"))
    widths = (5, 8, 5, 9, 7, 6, 8, 6, 8, *(7,) * 3, *(12,) * 6, 6)
    print("  ".join(f"{h:>{w}}" for h, w in zip((*head, "s"), widths, strict=True)))
    for row in ROWS:
        if row.name not in arguments.rows:
            continue
        candidates = candidates_of(row)
        for method in arguments.method or ["greedy", "minimal"]:
            language = build_language(candidates, method).language
            spoken = list(languages_in_tasks(language, candidates))
            terrain = ExpandedStates(candidates.model, spoken[0].partition)
            for heuristic in arguments.heuristic or ["manhattan", "blind", "relaxed"]:
                for count_words in (False, True):
                    start, sums = perf_counter(), Sums()
                    searches = sum(
                        run(one, terrain, heuristic, count_words, sums) for one in spoken
                    )
                    cells = (
                        row.name,
                        method,
                        len(language.words),
                        heuristic,
                        "+words" if count_words else "pruned",
                        sums.tasks,
                        searches,
                        f"{sums.steps / sums.tasks:.2f}",
                        f"{sums.without / sums.tasks:.2f}",
                        *(f"{sums.with_sentence[kind] / sums.tasks:.2f}" for kind in kinds),
                        *(
                            f"{value:.2f}x"
                            for kind in kinds
                            for value in (
                                sums.without / sums.with_sentence[kind],
                                sums.ratios[kind] / sums.tasks,
                            )
                        ),
                        f"{perf_counter() - start:.1f}",
                    )
                    print(
                        "  ".join(f"{c:>{w}}" for c, w in zip(cells, widths, strict=True)),
                        flush=True,
                    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
