"""Every robot's choices for every sentence of every task of GWB7: how large they are, and how long
they take.

    python benchmarks/choices.py [NAME]

NAME is a task file in domains/grid, ``gwb7-3x5`` without it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import process_time

from coordlang.building import build_language
from coordlang.language.sentences import task_sentences
from coordlang.tasks.candidates import from_listed
from coordlang.tasks.task_file import read_task_file
from coordlang.use.choices.choices import choices
from coordlang.use.choices.file import to_bytes
from coordlang.use.sentence.task_language import languages_in_tasks
from planners.pddl import read_domain, read_problem
from planners.search.edge_index import EdgeIndex

GRID = Path(__file__).resolve().parents[1] / "domains" / "grid"


def main(name: str = "gwb7-3x5") -> None:
    domain = read_domain(GRID / "domain.pddl")
    problem = read_problem(GRID / f"{name}.pddl", domain)
    candidates = from_listed(domain, [problem], read_task_file(GRID / f"{name}.tasks.json"))
    language = build_language(candidates).language
    index = {id(space): EdgeIndex.of(space) for space in candidates.spaces}
    seconds, walked, size, sentences = 0.0, 0, 0, 0
    states: list[int] = []
    subplans: list[int] = []
    for spoken in languages_in_tasks(language, candidates):
        for sentence in task_sentences(spoken.space, spoken.task, spoken.partition):
            words = spoken.words_of(sentence.words)
            start = process_time()
            found = choices(spoken, words, index[id(spoken.space)])
            seconds += process_time() - start
            assert found.mixtures is not None
            assert found.mixtures.holds
            sentences += 1
            walked += found.mixtures.nodes
            size += len(to_bytes(found))
            states += [len(own.automaton) for own in found.robots]
            subplans += [own.automaton.count for own in found.robots]
    free = sum(count > 1 for count in subplans)
    print(
        f"{candidates.count:,} tasks, {sentences:,} sentences of {len(language.words)} words: "
        "every combination optimal"
    )
    print(
        f"{len(states):,} automata, {free:,} of them with more than one subplan (at "
        f"most {max(subplans):,})"
    )
    print(f"states: {sum(states):,}, {sum(states) / len(states):.1f} each, at most {max(states)}")
    print(f"{walked:,} nodes of combinations walked; choices files: {size / 1e6:.1f} MB")
    print(f"{seconds:.1f} s of CPU, {1000 * seconds / sentences:.2f} ms a sentence")


if __name__ == "__main__":
    main(*sys.argv[1:])
