# SPDX-License-Identifier: GPL-3.0-or-later
"""Abstractions of the states: a few abstract states, by which words may be given.

"Where robot 1 is", "where robot 1 is, and whether robot 2 is on a black or a white square".  Where
states are many, languages whose words say no more than that are found at once where a search among
all partitions finds none.  An abstraction is a choice of what is looked at and proves nothing:
whether a partition is a language is decided elsewhere.

What is looked at are the state variables (`planners.search.state_variables`), and of the graph of a
variable's values, which actions join: two colours, and nearness.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import networkx as nx
import numpy as np

from coordlang.language.candidates import Candidates
from planners.joint.tables import Bools, Ints, unique_rows
from planners.search.state_variables import StateVariable, state_variables

#: Variables that are looked at, and values of one for which distances are taken, at most.
_VARIABLES, _VALUES = 12, 200
#: States beyond which nothing is looked for.
_STATES = 20_000
#: A distance between values that nothing joins.
_FAR = np.iinfo(np.int64).max


@dataclass(frozen=True)
class _Values:
    """The values of a state variable in all states, and the undirected graph of its values.

    ``of_state``: (states) the number of the value, -1 where none of its facts is true.  ``names``:
    each value's fact, without the objects that all facts of the variable name: what two robots have
    in common that are in the same place.  ``graph``: values are neighbours if an action takes one
    to the other.
    """

    of_state: Ints
    names: tuple[str, ...]
    graph: nx.Graph[int]

    @classmethod
    def of(cls, variable: StateVariable, candidates: Candidates) -> _Values:
        codec = candidates.model.codec
        atoms = [codec.facts.atoms[fact] for fact in variable.facts]
        own = set.intersection(*(set(atom.args) for atom in atoms))
        of_state = np.full(len(candidates.rows), -1)
        for number, fact in enumerate(variable.facts):
            of_state[codec.column(candidates.rows, fact)] = number
        number_of = {fact: number for number, fact in enumerate(variable.facts)}
        graph: nx.Graph[int] = nx.empty_graph(len(atoms))
        for before, after in variable.changes.values():
            graph.add_edge(number_of[before], number_of[after])
        names = (
            " ".join((atom.predicate, *("?" if a in own else a for a in atom.args)))
            for atom in atoms
        )
        return cls(of_state, tuple(names), graph)

    @cached_property
    def away(self) -> Ints:
        """(values, values) how many actions lie between two values."""
        found = np.full((len(self.names),) * 2, _FAR)
        for value, lengths in nx.all_pairs_shortest_path_length(self.graph):
            found[value, list(lengths)] = list(lengths.values())
        return found

    @cached_property
    def colours(self) -> Ints:
        """(states) two colours: whether the first value, or a part's, is an odd number away."""
        first = (self.away < _FAR).argmax(axis=1)
        colour = self.away[first, np.arange(len(first))] % 2
        return np.append(colour, 0)[self.of_state]  # the last: no value

    def of_other(self, other: _Values) -> Ints:
        """(states) the value that has the other one's name, -1 where there is none."""
        number_of = {name: number for number, name in enumerate(self.names)}
        return np.array([*(number_of.get(name, -1) for name in other.names), -1])[other.of_state]

    def is_near(self, other: Ints) -> Bools:
        """(states) whether another value is this one or one beside it."""
        known = (self.of_state >= 0) & (other >= 0)
        return known & (self.away[self.of_state, other] <= 1)


def abstractions(candidates: Candidates, states: Sequence[int]) -> list[Ints]:
    """Abstractions of the states.

    In each one variable is told, or a second one besides; and of the others colours, with nearness
    as seen from the first one.

    Each is (states of the table of the ``candidates``) the number of the abstract state of each.
    All of them merge some of the ``states`` that matter, given by number, and no two are the same.
    """
    if not 0 < len(candidates.rows) <= _STATES:
        return []
    mine = np.array(states)
    found: dict[bytes, Ints] = {}
    for columns in _chosen(_variables(candidates)):
        classes = unique_rows(np.column_stack(columns).astype(np.int64) + 1)[1]
        if 1 < len(np.unique(classes[mine])) < len(mine):
            found.setdefault(_as_key(classes[mine]), classes)
    return list(found.values())


def up_to_symmetry(classes: Sequence[Ints], images: Sequence[Ints]) -> list[Ints]:
    """Abstractions without those that a symmetry makes of an earlier one.

    ``classes``: (states) the abstract state of each state, of each abstraction.  ``images``:
    (states) where symmetries take every state.
    """
    met: set[bytes] = set()
    chosen = []
    for abstract in classes:
        if _as_key(abstract) not in met:
            chosen.append(abstract)
            met.update(_as_key(abstract[to]) for to in images)
    return chosen


def _variables(candidates: Candidates) -> list[_Values]:
    """The variables that change, those with many values first."""
    found = [
        _Values.of(variable, candidates)
        for variable in state_variables(candidates.model, candidates.rows[0])
        if len(variable.facts) <= _VALUES
    ]
    return [values for values in found if np.ptp(values.of_state)][:_VARIABLES]


def _chosen(variables: Sequence[_Values]) -> Iterator[Sequence[Ints | Bools]]:
    """What is looked at in each abstraction: a list of columns (states)."""
    for told in variables:
        yield from _as_seen_from(told, [values for values in variables if values is not told])
    for one, other in combinations(variables, 2):
        rest = [v.colours for v in variables if v is not one and v is not other]
        if rest:  # two variables alone are all that there is
            yield [one.of_state, other.of_state]
            yield [one.of_state, other.of_state, *rest]


def _as_seen_from(told: _Values, others: Sequence[_Values]) -> Iterator[Sequence[Ints | Bools]]:
    """The same where one variable is told."""
    base = [told.of_state, *(values.colours for values in others)]
    places = [told.of_other(values) for values in others]
    near = [told.is_near(at) for at in places]
    yield [told.of_state]
    yield base
    yield [*base, *near]
    yield [*base, *(np.where(close, at, -1) for close, at in zip(near, places, strict=True))]


def _as_key(classes: Ints) -> bytes:
    """The same for the same partition, whatever the numbers of its classes (n) are."""
    _, first, number = np.unique(classes, return_index=True, return_inverse=True)
    return first[number].tobytes()
