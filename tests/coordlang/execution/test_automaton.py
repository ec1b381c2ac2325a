# SPDX-License-Identifier: GPL-3.0-or-later
"""The least automaton of any layered graph, however nondeterministic: far more so than robots'
plans are.
"""

from __future__ import annotations

from collections import Counter
from random import Random

import pytest

from coordlang.execution.automaton import Automaton, determinise
from planners.search.plan_space import PlanSpace
from tests.support.layered_spaces import layered_space

Word = tuple[int, ...]


def random_graph(random: Random) -> tuple[PlanSpace, list[list[tuple[int, int]]], list[int]]:
    """A plan space with made-up edges of one robot; its edges (label, target) by node; its true
    facts by node.
    """
    width, depth, labels = random.randint(1, 4), random.randint(0, 4), random.randint(1, 3)
    tables: list[list[set[tuple[int, int]]]] = []  # from the start: (label, number in next layer)
    size = 1
    for _ in range(depth):
        after = random.randint(1, width)
        rows = [
            {
                (random.randrange(labels), random.randrange(after))
                for _ in range(random.randint(1, 4))
            }
            for _ in range(size)
        ]
        used = sorted({to for row in rows for _, to in row})
        tables.append([{(label, used.index(to)) for label, to in row} for row in rows])
        size = len(used)
    tables.append([set() for _ in range(size)])
    edges: list[list[tuple[int, int]]] = []
    sizes = [len(layer) for layer in reversed(tables)]
    offset = 0  # of the next layer
    for number, layer in enumerate(reversed(tables)):
        edges += [sorted((label, to + offset) for label, to in own) for own in layer]
        offset += sizes[number - 1] if number else 0
    facts = [random.choice([0, 1, 3, 3, 3, 3]) for _ in edges]
    return layered_space(sizes, edges), edges, facts


def reached(edges: list[list[tuple[int, int]]], word: Word) -> set[int]:
    here = {len(edges) - 1}
    for label in word:
        here = {to for node in here for own, to in edges[node] if own == label}
    return here


def words(edges: list[list[tuple[int, int]]], depth: int) -> list[set[Word]]:
    """The beginnings of each length."""
    found: list[set[Word]] = [{()}]
    for _ in range(depth):
        longer = ((w, label) for w in found[-1] for n in reached(edges, w) for label, _ in edges[n])
        found.append({(*w, label) for w, label in longer})
    return found


def known(edges: list[list[tuple[int, int]]], facts: list[int], word: Word) -> tuple[int, int]:
    true, possible = ~0, 0
    for node in reached(edges, word):
        true, possible = true & facts[node], possible | facts[node]
    return true, possible


def at(automaton: Automaton, word: Word) -> int:
    state = 0
    for label in word:
        state = dict(automaton.moves(state))[label]
    return state


@pytest.mark.parametrize("annotated", [False, True])
def test_least_automaton_of_any_graph(annotated: bool) -> None:
    seen: Counter[str] = Counter()
    for seed in range(600):
        space, edges, facts = random_graph(Random(seed))
        depth = int(space.layer[-1])
        beginnings = words(edges, depth)
        whole = beginnings[-1]
        steps = range(depth + 1 if annotated else 0)
        automaton = determinise(space, 0, facts if annotated else None)
        assert automaton.count == len(whole)
        futures: set[frozenset[object]] = set()
        subsets: set[frozenset[int]] = set()
        for step, here in enumerate(beginnings):
            for word in here:
                state = at(automaton, word)
                assert state in automaton.layers[step]
                assert {label for label, _ in automaton.moves(state)} == {
                    w[step] for w in whole if w[:step] == word and step < depth
                }
                assert automaton.left[state] == sum(w[:step] == word for w in whole)
                if annotated:
                    assert automaton.known[state] == known(edges, facts, word)
                futures.add(
                    frozenset(
                        (w[step:], tuple(known(edges, facts, w[:k]) for k in steps[step:]))
                        for w in whole
                        if w[:step] == word
                    )
                )
                subsets.add(frozenset(reached(edges, word)))
        assert len(automaton) == len(futures)
        seen["merged"] += len(subsets) > len(futures)
        seen["nondeterministic"] += any(len(s) > 1 for s in subsets)
        seen["several"] += len(whole) > 1
    assert min(seen.values()) >= 30, seen
