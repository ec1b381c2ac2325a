# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination of many tasks, by goals.

Divergences at a node depend on its goal only, so the goals are cut into portions, and each is a
job (`planners.parallel`).  A symmetry takes the optimal plans to a goal to those to the goal's
image, mixtures to mixtures and failing ones to failing ones (Proposition 15 of docs/concepts.md):
of goals that are images of each other one is looked at, and speaks for all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.required.divergences import Divergences, FirstDifferences, first_differences, minimal
from coordlang.required.miscoordination import Inseparable, inseparable, separable
from coordlang.symmetry.group import checked_generators
from planners.joint.tables import Ints, find_rows, unique_rows
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.workers import Workers
from planners.search.graphs import parts_of_graph
from planners.search.portions import PORTION, Explored, Source, cut
from planners.system.limits import reaching

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
    """The goals "every state", of which some speak for all.

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
