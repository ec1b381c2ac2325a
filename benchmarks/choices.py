# SPDX-License-Identifier: GPL-3.0-or-later
"""Every robot's choices for every sentence of every task of a row: their size and their time.

    python benchmarks/choices.py [NAME]

NAME is a task file in domains/grid, ``gwb7-3x5`` without it.  Prints the numbers of automata,
states and combinations checked, and the seconds for one sentence.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time

from coordlang.building import build_language
from coordlang.language.sentences import task_sentences
from coordlang.tasks.candidates import from_listed
from coordlang.tasks.task_file import read_task_file
from coordlang.use.choices.choices import choices
from coordlang.use.choices.file import to_bytes
from coordlang.use.sentence.task_language import TaskLanguage, languages_in_tasks
from planners.pddl import read_domain, read_problem
from planners.search.edge_index import EdgeIndex

GRID = Path(__file__).resolve().parents[1] / "domains" / "grid"


@dataclass(slots=True)
class Sums:
    """What was computed: sums over sentences, and the sizes of all automata."""

    seconds: float = 0.0
    nodes: int = 0
    bytes: int = 0
    sentences: int = 0
    states: list[int] = field(default_factory=list)
    subplans: list[int] = field(default_factory=list)

    def add(self, language: TaskLanguage, index: EdgeIndex) -> None:
        """Compute the choices under every sentence of a task."""
        for sentence in task_sentences(language.space, language.task, language.partition):
            words = language.words_of(sentence.words)
            start = process_time()
            found = choices(language, words, index)
            self.seconds += process_time() - start
            assert found.mixtures is not None
            assert found.mixtures.holds
            self.sentences += 1
            self.nodes += found.mixtures.nodes
            self.bytes += len(to_bytes(found))
            self.states += [len(own.automaton) for own in found.robots]
            self.subplans += [own.automaton.count for own in found.robots]


def main(name: str = "gwb7-3x5") -> None:
    """Print the sums of a task file."""
    domain = read_domain(GRID / "domain.pddl")
    problem = read_problem(GRID / f"{name}.pddl", domain)
    candidates = from_listed(domain, [problem], read_task_file(GRID / f"{name}.tasks.json"))
    language = build_language(candidates).language
    index = {id(space): EdgeIndex.of(space) for space in candidates.spaces}
    sums = Sums()
    for one in languages_in_tasks(language, candidates):
        sums.add(one, index[id(one.space)])
    states, subplans = sums.states, sums.subplans
    print(
        f"{candidates.count:,} tasks, {sums.sentences:,} sentences of {len(language.words)} words: "
        "every combination optimal"
    )
    print(
        f"{len(states):,} automata, {sum(count > 1 for count in subplans):,} of them with more "
        f"than one subplan (at most {max(subplans):,})"
    )
    mean = sum(states) / len(states)
    print(f"states: {sum(states):,}, {mean:.1f} each, at most {max(states)}")
    print(f"{sums.nodes:,} nodes of combinations checked; choices files: {sums.bytes / 1e6:.1f} MB")
    each = 1000 * sums.seconds / sums.sentences
    print(f"{sums.seconds:.1f} s of CPU, {each:.2f} ms a sentence")


if __name__ == "__main__":
    main(*sys.argv[1:])
