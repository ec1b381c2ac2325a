# SPDX-License-Identifier: GPL-3.0-or-later
"""First differences: where plans that introduce RC part, over all candidate tasks.

The sets ``alpha*`` of the paper's Theorem 3: Proposition 3 of docs/concepts.md.

At a node ``p`` a set of two or more different next nodes is a divergence iff for some way to give
each robot one of them, all of them used, some choice of labels into these nodes, and of sequences
from there on, is no optimal plan.  Minimal sets say all.  A set of states that is known to be a
divergence, from another goal, is not looked at again.

Whole tables are handled at a time: that there is no mixed step, or that a robot's choices are none
where the mixed step leads, decides nearly all sets, and only the others are looked at one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coordlang.language.candidates import Candidates
from coordlang.required.choices import Choices, LabelSets
from coordlang.required.miscoordination import Inseparable, inseparable, separable
from coordlang.symmetry.group import checked_generators
from planners.joint.tables import (
    Bools,
    Ints,
    Rows,
    find_rows,
    ranges,
    spans,
    unique_rows,
    unique_tuples,
)
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.workers import Workers
from planners.search.edge_index import EdgeIndex
from planners.search.graphs import parts_of_graph
from planners.search.plan_space import PlanSpace
from planners.search.portions import PORTION, Explored, Source, cut
from planners.system.limits import reaching


@dataclass(frozen=True, slots=True)
class Divergences:
    """First differences of sets of plans that introduce RC.

    ``last`` (k): the last shared state; ``following`` (k, robots): the different next states,
    sorted, filled up with -1. States are numbers in the plan space's table.  With two robots a row
    is ``alpha* = {last, s1, s2}``.
    """

    last: Ints
    following: Ints

    def __len__(self) -> int:
        return len(self.last)


@dataclass(frozen=True, slots=True)
class FirstDifferences:
    """The first differences of all candidate tasks (the paper's ``alpha*``, each once).

    ``states`` are the numbers of the states on their plans, sorted.  ``requiring`` counts the tasks
    that require coordination.  ``nodes`` and ``edges`` are those of the plan spaces; ``sets``
    counts the different sets of a robot's label sequences and ``evaluations`` the mixtures of such
    sets that were looked at: the work.
    """

    divergences: Divergences
    states: Ints
    requiring: int
    nodes: int
    edges: int
    sets: int
    evaluations: int


def first_differences(
    spaces: Sequence[PlanSpace], spoken_for: Sequence[Ints] | None = None
) -> FirstDifferences:
    """Find them from the robots' choices, one look at each node (`coordlang.required.choices`).

    Where no plans are inseparable, the divergences at a node depend on that node only, whatever was
    done before: Proposition 2 of docs/concepts.md.

    ``spaces`` are over one table of states; ``spoken_for`` says for each of them for how many goals
    each of its goals counts (default: for itself): tasks, nodes and edges are counted so often.
    """
    sets = LabelSets()
    search = DivergenceSearch(spaces[0].robots)
    requiring = nodes = edges = evaluations = 0
    for number, space in enumerate(spaces):
        choices = Choices(space, sets)
        times = np.ones(len(space.goals), np.int64) if spoken_for is None else spoken_for[number]
        counts = times[space.goal]
        requiring += int(counts[space.starts][choices.requires[space.starts]].sum())
        nodes += int(counts.sum())
        edges += int((counts * space.out_degrees).sum())
        search.add(choices)
        evaluations += choices.evaluations
    table = search.table()
    return FirstDifferences(
        Divergences(table[:, 0], table[:, 1:]),
        states_on_plans(spaces),
        requiring,
        nodes,
        edges,
        len(sets),
        evaluations,
    )


def without_divergences(spaces: Sequence[PlanSpace]) -> FirstDifferences:
    """Where coordination is required, of plans whose divergences are not defined."""
    return FirstDifferences(
        Divergences(np.zeros(0, np.int64), np.zeros((0, spaces[0].robots), np.int64)),
        states_on_plans(spaces),
        requiring=sum(int(required_nodes(space)[space.starts].sum()) for space in spaces),
        nodes=sum(map(len, spaces)),
        edges=sum(len(space.target) for space in spaces),
        sets=0,
        evaluations=0,
    )


def required_nodes(space: PlanSpace) -> Bools:
    """Say of each node whether some plans from it introduce RC."""
    return Choices(space).requires


def states_on_plans(spaces: Sequence[PlanSpace]) -> Ints:
    """The numbers of the states that lie on some optimal plan of some candidate task, sorted."""
    return np.unique(np.concatenate([space.state for space in spaces]))


#: Rows of a table handled together.
_CHUNK = 1_000_000


class DivergenceSearch:
    """The divergences found so far, over as many plan spaces of one table of states as are added.

    They are sets of up to as many next states as there are robots.
    """

    def __init__(self, robots: int, chunk: int = _CHUNK) -> None:
        self._robots, self._chunk = robots, chunk
        #: For each number of next states a sorted table of (state, next states).
        self._known = {size: np.zeros((0, 1 + size), np.uint64) for size in range(2, robots + 1)}

    def add(self, choices: Choices) -> None:
        """Look for divergences at the nodes of a plan space that require coordination."""
        space = choices.space
        nodes = np.flatnonzero(choices.requires)
        index = EdgeIndex.of(space)
        for span in spans(space.out_degrees[nodes].astype(np.float64) ** 2, self._chunk):
            here = _Mixing(choices, index, nodes[span])
            self._look(here, here.pairs())

    def _look(self, here: _Mixing, sets: Ints) -> None:
        """Look at sets of next nodes of one size, then at larger ones without a divergence."""
        size = sets.shape[1]
        rows = here.states_of(sets)
        open_rows = ~_among(self._known[size], rows)
        sets = sets[open_rows]
        different, number = unique_rows(rows[open_rows].astype(np.uint64))
        fails = here.failing(sets, number, len(different))
        self._known[size], _ = unique_rows(np.concatenate((self._known[size], different[fails])))
        if size == self._robots:
            return
        good = sets[~fails[number]]
        for span in spans(here.nodes_after(good).astype(np.float64), self._chunk):
            larger = here.extended(good[span])
            self._look(here, larger[self._minimal(here, larger)])

    def _minimal(self, here: _Mixing, sets: Ints) -> Bools:
        """Which sets hold no smaller known divergence that has their last next node."""
        keep = np.ones(len(sets), np.bool_)
        last = sets.shape[1] - 1
        for size in range(2, sets.shape[1]):
            for others in combinations(range(last), size - 1):
                left = np.flatnonzero(keep)
                some = sets[left][:, [*others, last]]
                keep[left] = ~_among(self._known[size], here.states_of(some))
        return keep

    def table(self) -> Ints:
        """The divergences, (k, 1 + robots): the last shared state, then next states, sorted.

        Filled up with -1; only those that no other one implies.
        """
        filled = [_filled(own, self._robots) for own in self._known.values()]
        return minimal(np.concatenate([np.zeros((0, 1 + self._robots), np.int64), *filled]))


def minimal(rows: Ints) -> Ints:
    """The divergences (as in `DivergenceSearch.table`) that no other one implies, sorted."""
    robots = rows.shape[1] - 1
    sizes = (rows[:, 1:] >= 0).sum(axis=1)
    known: dict[int, Rows] = {}
    kept = [rows[:0]]
    for size in np.unique(sizes).tolist():
        own, _ = unique_rows(rows[sizes == size][:, : 1 + size].astype(np.uint64))
        implied = np.zeros(len(own), np.bool_)
        for smaller, table in known.items():
            for some in combinations(range(1, 1 + size), smaller):
                implied |= _among(table, own[:, [0, *some]])
        known[size] = own
        kept.append(_filled(own[~implied], robots))
    found = np.concatenate(kept)
    return found[np.lexsort(found.T[::-1])]


def _filled(rows: Rows, robots: int) -> Ints:
    """Rows (state, next states) filled up with -1."""
    filled = np.full((len(rows), 1 + robots), -1)
    filled[:, : rows.shape[1]] = rows
    return filled


def _among(table: Rows, rows: NDArray[np.integer[Any]]) -> Bools:
    """Which rows are in a sorted table."""
    found: Bools = find_rows(table, rows.astype(np.uint64)) >= 0
    return found


class _Mixing:
    """Mixtures of edges out of some nodes of a plan space.

    A *way* is a pair of a node and the target of some of its edges: ways are numbered by node, then
    by the target's state.  ``_labels[i]`` delimits, for each way, the labels of robot i on its
    edges.
    """

    def __init__(self, choices: Choices, index: EdgeIndex, nodes: Ints) -> None:
        self._choices, self._index = choices, index
        space = self._space = choices.space
        position, edges = space.edges_from(nodes)
        target = space.targets(edges)
        order = np.lexsort((space.state[target], position))
        position, edges, target = position[order], edges[order], target[order]
        fresh = np.ones(len(edges), np.bool_)
        fresh[1:] = (position[1:] != position[:-1]) | (target[1:] != target[:-1])
        way = np.cumsum(fresh) - 1
        self._node = nodes[position[fresh]]
        self._target = target[fresh]
        #: One more than the last way out of the same node.
        self._end = np.searchsorted(position[fresh], position[fresh], side="right")
        self._labels: list[tuple[Ints, Ints]] = []
        for robot in range(space.robots):
            own = np.column_stack((way, space.robot_labels(robot, edges)))
            pairs, _ = unique_tuples(own, [int(column.max(initial=0)) + 1 for column in own.T])
            first = np.searchsorted(pairs[:, 0], np.arange(len(self._node) + 1))
            self._labels.append((first, pairs[:, 1]))

    def pairs(self) -> Ints:
        """All pairs of ways out of one node, the first before the second."""
        return self.extended(np.arange(len(self._node))[:, None])

    def nodes_after(self, sets: Ints) -> Ints:
        """How many ways out of the same node come after the last one of each set."""
        after: Ints = self._end[sets[:, -1]] - sets[:, -1] - 1
        return after

    def extended(self, sets: Ints) -> Ints:
        """The sets with one more way out of the same node, after all that they have."""
        counts = self.nodes_after(sets)
        more = ranges(sets[:, -1] + 1, counts)
        return np.column_stack((np.repeat(sets, counts, axis=0), more))

    def states_of(self, sets: Ints) -> Ints:
        """(state of the node, states of the ways' targets) of each set."""
        state = self._space.state
        return np.column_stack((state[self._node[sets[:, 0]]], state[self._target[sets]]))

    def failing(self, sets: Ints, number: Ints, count: int) -> Bools:
        """Which of ``count`` sets of states fail in some way; ``number`` says which each set is."""
        fails = np.zeros(count, np.bool_)
        size, robots = sets.shape[1], self._space.robots
        for assigned in product(range(size), repeat=robots):
            if len(set(assigned)) < size:
                continue
            rows = np.flatnonzero(~fails[number])
            row, nodes, missing = self._mixed(sets[rows][:, assigned])
            fails[number[rows[missing]]] = True
            which = number[rows[row]]
            left = np.flatnonzero(~fails[which])
            fails[which[left[self._choices.fails_each(nodes[left])]]] = True
        return fails

    def _mixed(self, ways: Ints) -> tuple[Ints, Ints, Ints]:
        """The edges that mix the ways given to the robots.

        (numbers of the rows that they are for, the nodes that the robots were given and where the
        edges lead, the rows where an edge is missing).
        """
        row = np.arange(len(ways))
        prefix = self._node[ways[:, 0]]
        missing = [row[:0]]
        for robot, (first, labels) in enumerate(self._labels):
            own = ways[row, robot]
            if len(labels) > len(self._node):  # more than one label on some way
                counts = first[own + 1] - first[own]
                own = ranges(first[own], counts)
                row, prefix = np.repeat(row, counts), np.repeat(prefix, counts)
            prefix = self._index.follow(robot, prefix, labels[own])
            missing.append(row[prefix < 0])
            row, prefix = row[prefix >= 0], prefix[prefix >= 0]
        nodes = np.column_stack((self._target[ways[row]], self._space.targets(prefix)))
        return row, nodes, np.concatenate(missing)


#: Pairs of a goal and a state, times robots, from which on symmetries are looked for: below, what
#: they save takes no longer than to find them.
LEAST_WORK = 50_000
#: So many pairs for each ground action and fact, which symmetries are checked on.
PAIRS_FOR_ACTION = 10


def differences(
    candidates: Candidates,
    workers: Workers,
    progress: Callable[[str], None] = lambda _: None,
    portion: float = PORTION,
) -> FirstDifferences:
    """Find them for tasks without inseparable plans, in jobs of about ``portion`` effort.

    Raises `Inseparable` with the plans of the first portion that has some.
    """
    source, spoken_for = candidates.source, None
    goals = symmetric_goals(candidates)
    if goals is not None and isinstance(source, Explored):
        progress(f"looking at {len(goals.chosen):,} of {len(source.goals):,} goals, by symmetry")
        source, spoken_for = source.only(goals.chosen), goals.spoken_for[goals.chosen]
    found = _tables((source, spoken_for), workers, progress, portion)
    if found[-1]["inseparable"]:
        witness = inseparable(source.portion(cut(source.efforts, portion)[len(found) - 1]))
        assert witness is not None
        raise Inseparable(witness)
    return _together(found, goals)


#: Goals that are looked at, and for how many goals each counts (None: for itself).
_Goals = tuple[Source, Ints | None]


def _tables(
    goals: _Goals, workers: Workers, progress: Callable[[str], None], portion: float
) -> list[Table]:
    """What the portions of the goals say, up to the first with inseparable plans."""
    source, spoken_for = goals
    portions = cut(source.efforts, portion)
    if len(portions) == 1:
        return [_differences(goals, portions[0])]
    efforts = [float(source.efforts[own.start : own.stop].sum()) for own in portions]
    identity = digest(source.identity, spoken_for)
    batch = Batch("first differences", _differences, goals, portions, identity, efforts)
    found: list[Table] = []

    def so_far() -> str:
        return f"{len(found):,} of {len(portions):,} portions of the goals"

    with reaching(so_far, "fewer candidate tasks"), closing(workers.tables(batch)) as found_tables:
        for table in found_tables:
            found.append(table)
            if table["inseparable"]:
                break
            progress(f"looking where coordination is required: {so_far()}")
    return found


def _differences(shared: _Goals, goals: range) -> Table:
    """One job: the tasks of some goals."""
    source, spoken_for = shared
    space = source.portion(goals)
    if not separable(space):
        return {"inseparable": np.array(True)}
    times = None if spoken_for is None else [spoken_for[goals.start : goals.stop]]
    found = first_differences([space], times)
    figures = [found.requiring, found.nodes, found.edges, found.sets, found.evaluations]
    return {
        "inseparable": np.array(False),
        "divergences": np.column_stack((found.divergences.last, found.divergences.following)),
        "figures": np.array(figures, np.int64),
        "states": found.states,
    }


def _together(found: Sequence[Table], goals: SymmetricGoals | None = None) -> FirstDifferences:
    """What jobs found as one: sets and mixtures are counted anew in each.

    Where the ``goals`` are some that speak for all, the other figures are those of all already.
    """
    rows = minimal(np.concatenate([table["divergences"] for table in found]))
    states = np.unique(np.concatenate([table["states"] for table in found]))
    if goals is not None:
        rows, states = minimal(goals.images_of_rows(rows)), goals.images_of_states(states)
    figures = np.stack([table["figures"] for table in found]).sum(axis=0)
    return FirstDifferences(Divergences(rows[:, 0], rows[:, 1:]), states, *figures.tolist())


# ---- goals up to symmetry


@dataclass(frozen=True, slots=True)
class SymmetricGoals:
    """The goals "every state", of which some speak for all (Proposition 15 of docs/concepts.md).

    ``generators`` (states) say where each state number goes, for a group of symmetries;
    ``representative`` (states) is for each goal, by the number of its state, the least goal that a
    symmetry takes to it.
    """

    generators: tuple[Ints, ...]
    representative: Ints

    @classmethod
    def of(cls, generators: Sequence[Ints], states: int) -> SymmetricGoals:
        """Find the orbits of the group that permutations of state numbers generate."""
        here = np.tile(np.arange(states), len(generators))
        count, orbit = parts_of_graph(states, here, np.concatenate(generators))
        least = np.full(count, states)
        np.minimum.at(least, orbit, np.arange(states))
        return cls(tuple(generators), least[orbit])

    @property
    def chosen(self) -> Ints:
        """The goals that speak for all, sorted."""
        return np.unique(self.representative)

    @property
    def spoken_for(self) -> Ints:
        """(goals) for how many goals each speaks: 0 for those that are not chosen."""
        return np.bincount(self.representative, minlength=len(self.representative))

    def images_of_states(self, states: Ints) -> Ints:
        """The images of states under all symmetries of the group, sorted."""
        return np.flatnonzero(np.isin(self.representative, self.representative[states]))

    def images_of_rows(self, rows: Ints) -> Ints:
        """The images of rows (state, other states sorted, -1 to fill up), sorted, each once."""
        known, _ = unique_rows(rows.astype(np.uint64))
        new = known
        while len(new):
            images = [_image(new.astype(np.int64), to) for to in self.generators]
            images_once, _ = unique_rows(np.concatenate(images).astype(np.uint64))
            new = images_once[find_rows(known, images_once) < 0]
            known, _ = unique_rows(np.concatenate((known, new)))
        return known.astype(np.int64)


def _image(rows: Ints, to: Ints) -> Ints:
    most = len(to)
    image = np.append(to, most)[rows]  # -1 is the last entry: beyond all states
    image[:, 1:].sort(axis=1)
    return np.where(image == most, -1, image)


def symmetric_goals(
    candidates: Candidates, least: int = LEAST_WORK, for_action: int = PAIRS_FOR_ACTION
) -> SymmetricGoals | None:
    """The goals of all pairs of states up to symmetry; None where one speaks for itself only.

    None, too, where it is not worth the while: for tasks of other kinds, under
    ``--remember-actions`` and slack, for less work than ``least``, and for fewer than
    ``for_action`` pairs of states for each ground action and fact.
    """
    model = candidates.model
    states = len(candidates.rows)
    if candidates.kind != "all" or model.remembers or model.slack:
        return None
    if states**2 * len(model.robots) < least:
        return None
    if states**2 < for_action * (len(model.actions) + len(model.codec.facts)):
        return None
    found, _ = checked_generators(candidates, with_tasks=False)
    generators = [s.states for s in found if (s.states != np.arange(states)).any()]
    return SymmetricGoals.of(generators, states) if generators else None
