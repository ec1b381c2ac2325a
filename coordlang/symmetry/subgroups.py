# SPDX-License-Identifier: GPL-3.0-or-later
"""Subgroups of a group of symmetries, and the ways in which they can act on a few words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planners.joint.tables import Ints

#: Numbers of elements of a group.
Subgroup = frozenset[int]


@dataclass(frozen=True, slots=True)
class WordAction:
    """A map of a subgroup to permutations of words that keeps products.

    ``words[h]`` says where element ``h`` of the group takes every word.
    """

    words: Mapping[int, tuple[int, ...]]

    @property
    def subgroup(self) -> list[int]:
        """The elements, sorted."""
        return sorted(self.words)


@dataclass(frozen=True)
class GroupTable:
    """A group of permutations of states, by the numbers of its elements.

    ``elements`` say where each takes every state number; they are closed under products, and the
    identity is number 0.
    """

    elements: Sequence[Ints]

    @cached_property
    def product(self) -> list[list[int]]:
        """``product[a][b]``: first b, then a."""
        number = {element.tobytes(): n for n, element in enumerate(self.elements)}
        return [[number[a[b].tobytes()] for b in self.elements] for a in self.elements]

    @cached_property
    def inverse(self) -> list[int]:
        """The inverse of each element."""
        return [row.index(0) for row in self.product]

    def generated(self, generators: Subgroup) -> Subgroup:
        """The least subgroup with these elements."""
        found = {0}
        waiting = [0]
        while waiting:
            element = waiting.pop()
            fresh = {self.product[g][element] for g in generators} - found
            found |= fresh
            waiting += sorted(fresh)
        return frozenset(found)

    def subgroups(self, within: Subgroup, most: int) -> list[Subgroup]:
        """The subgroups of a subgroup, small ones first; those met first where there are more."""
        found = {frozenset({0})}
        front = list(found)
        while front and len(found) < most:
            grown = {
                self.generated(smaller | {element})
                for smaller in front
                for element in within - smaller
            }
            front = sorted(grown - found, key=_by_size)
            found |= grown
        return sorted(found, key=_by_size)[:most]

    def up_to_conjugation(self, subgroups: Sequence[Subgroup], by: Subgroup) -> list[Subgroup]:
        """One of each class of subgroups that elements of ``by`` conjugate."""
        seen: set[Subgroup] = set()
        chosen: list[Subgroup] = []
        for subgroup in subgroups:
            if subgroup not in seen:
                chosen.append(subgroup)
                seen |= {self._conjugated(subgroup, g) for g in by}
        return chosen

    def _conjugated(self, subgroup: Subgroup, by: int) -> Subgroup:
        product, back = self.product, self.inverse[by]
        return frozenset(product[product[by][h]][back] for h in subgroup)

    @cached_property
    def conjugate(self) -> list[int]:
        """Of the elements that conjugates of each are, the first."""
        every = range(len(self.elements))
        product, inverse = self.product, self.inverse
        return [min(product[product[g][h]][inverse[g]] for g in every) for h in every]

    def cyclic_action(self, element: int, words: tuple[int, ...]) -> WordAction:
        """The action of the powers of an element that acts like this; ``words`` must allow it."""
        powers = {0: tuple(range(len(words)))}
        power = 0
        while (following := self.product[element][power]) != 0:
            powers[following] = tuple(words[word] for word in powers[power])
            power = following
        return WordAction(powers)

    def right_cosets(self, subgroup: Subgroup) -> list[Ints]:
        """One element ``g`` of each coset ``subgroup g``."""
        seen: set[int] = set()
        chosen = []
        for number, element in enumerate(self.elements):
            if number not in seen:
                chosen.append(element)
                seen |= {self.product[h][number] for h in subgroup}
        return chosen

    def word_actions(self, subgroup: Subgroup, size: int, most: int) -> Iterator[WordAction]:
        """The ways in which a subgroup can act on ``size`` words, up to names of words.

        Each is the union of orbits, which are like the cosets of a subgroup's subgroup, taken up
        to conjugation.
        """
        kinds = self.up_to_conjugation(self.subgroups(subgroup, most), subgroup)
        orbits = sorted((self._orbit(subgroup, kind) for kind in kinds), key=lambda o: len(o[0]))
        for chosen in _sums([len(orbit[0]) for orbit in orbits], size):
            words: dict[int, tuple[int, ...]] = dict.fromkeys(subgroup, ())
            for number in chosen:
                before = len(words[0])
                for h, to in orbits[number].items():
                    words[h] += tuple(before + word for word in to)
            yield WordAction(words)

    def _orbit(self, subgroup: Subgroup, kind: Subgroup) -> dict[int, list[int]]:
        """How a subgroup acts on the cosets of a subgroup of it: where each element takes them."""
        coset: dict[int, int] = {}
        chosen: list[int] = []
        for element in sorted(subgroup):
            if element not in coset:
                coset |= {self.product[element][u]: len(chosen) for u in kind}
                chosen.append(element)
        return {h: [coset[self.product[h][c]] for c in chosen] for h in sorted(subgroup)}


def cycle_type(words: Sequence[int]) -> tuple[int, ...]:
    """The lengths of the cycles of a permutation, sorted."""
    lengths, seen = [], set[int]()
    for first in range(len(words)):
        length, word = 0, first
        while word not in seen:
            seen.add(word)
            length, word = length + 1, words[word]
        if length:
            lengths.append(length)
    return tuple(sorted(lengths))


def _by_size(subgroup: Subgroup) -> tuple[int, list[int]]:
    return len(subgroup), sorted(subgroup)


def _sums(sizes: Sequence[int], total: int, first: int = 0) -> Iterator[list[int]]:
    """All ways to reach a total with the sizes from ``first`` on, as often as one likes."""
    if total == 0:
        yield []
    elif first < len(sizes):
        for times in range(total // sizes[first], -1, -1):
            for rest in _sums(sizes, total - times * sizes[first], first + 1):
                yield [first] * times + rest


def group_table(elements: Sequence[Ints]) -> GroupTable:
    """The table of a group, given with the identity anywhere or not at all."""
    identity = np.arange(len(elements[0])) if len(elements) else np.zeros(1, np.int64)
    others = [element for element in elements if not np.array_equal(element, identity)]
    return GroupTable([identity, *others])
