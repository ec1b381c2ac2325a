# SPDX-License-Identifier: GPL-3.0-or-later
"""First differences: where plans that introduce RC part, over all candidate tasks.

The sets ``alpha*`` of the paper's Theorem 3: Proposition 3 of docs/concepts.md.  Goals are cut into
portions, each a job; of goals that are images of each other under a symmetry one is looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from math import inf

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.required.choices import Choices
from coordlang.required.divergences import TooManyDivergences, divergences, minimal
from coordlang.required.miscoordination import Inseparable
from coordlang.symmetry.group import checked_generators, orbits
from coordlang.verification.by_definition import inseparable, refuting_goal
from planners.joint.tables import Ints, find_rows, unique_rows
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.workers import Workers
from planners.search.plan_space import PlanSpace
from planners.search.portions import PORTION, Explored, Source, cut
from planners.system.limits import reaching

#: Divergences of jobs that are kept before they are merged.
_ROWS = 2_000_000


@dataclass(frozen=True, slots=True)
class FirstDifferences:
    """The first differences of all candidate tasks (the paper's ``alpha*``, each once).

    ``divergences`` (k, 1 + robots) are the last shared state and the different next states, sorted,
    filled up with -1, or None where they were not listed; states are numbers in the plan spaces'
    table. With two robots a row is ``alpha* = {last, s1, s2}``. ``states`` are the numbers of the
    states on the tasks' plans, sorted. ``requiring`` counts the tasks that require coordination.
    ``nodes`` and ``edges`` are those of the plan spaces; ``sets`` counts the different sets of a
    robot's label sequences and ``evaluations`` the mixtures of such sets that were looked at: the
    work.
    """

    divergences: Ints | None
    states: Ints
    requiring: int
    nodes: int
    edges: int
    sets: int
    evaluations: int

    @property
    def listed(self) -> Ints:
        """The divergences, of methods for which all are listed."""
        assert self.divergences is not None
        return self.divergences


def first_differences(spaces: Iterable[PlanSpace], *, most: float = inf) -> FirstDifferences:
    """Find them in plan spaces over one table of states, without inseparable plans.

    Divergences are not listed for which more than ``most`` mixtures were to be looked at: 0 for
    spaces with inseparable plans, and where states hide slack.
    """
    return _read(_merged([_found(space, most) for space in spaces]))


def differences(
    candidates: Candidates,
    workers: Workers,
    progress: Callable[[str], None] = lambda _: None,
    portion: float = PORTION,
    most: float = inf,
) -> FirstDifferences:
    """`first_differences` of candidate tasks, in jobs of about ``portion`` effort.

    Where states hide slack divergences are not listed: a plan may part from another one in the
    state that they share, by waiting there.

    Raises `Inseparable` with the plans of the first portion that has some.
    """
    model, source, spoken_for = candidates.model, candidates.source, None
    goals = symmetric_goals(candidates)
    if goals is not None and isinstance(source, Explored):
        progress(f"looking at {len(goals.chosen):,} of {len(source.goals):,} goals, by symmetry")
        source = source.only(goals.chosen)
        spoken_for = np.bincount(goals.representative)[goals.chosen]
    portions = cut(source.efforts, portion)
    efforts = [float(source.efforts[own.start : own.stop].sum()) for own in portions]
    shared = source, spoken_for, 0 if model.hides_slack else most
    identity = digest(source.identity, *shared[1:])
    batch = Batch("first differences", _of_goals, shared, portions, identity, efforts)
    found: list[Table] = []
    done = rows = 0

    def so_far() -> str:
        return f"{done:,} of {len(portions):,} portions of the goals"

    with reaching(so_far, "fewer candidate tasks"), closing(workers.tables(batch)) as tables:
        for table in tables:
            if not table:
                witness = inseparable(source.portion(portions[done]))
                assert witness is not None
                raise Inseparable(witness, model)
            found.append(table)
            done, rows = done + 1, rows + len(table.get("divergences", ()))
            if rows > _ROWS:  # most of them are found again and again
                found, rows = [_merged(found)], 0
            progress(f"looking where coordination is required: {so_far()}")
    merged = _merged(found)
    return _read(merged if goals is None else merged | goals.images(merged))


def _of_goals(shared: tuple[Source, Ints | None, float], goals: range) -> Table:
    """One job: what the tasks of some goals say; nothing if some plans are inseparable."""
    source, spoken_for, most = shared
    space = source.portion(goals)
    if refuting_goal(space, np.arange(len(space.rows)))[0] is not None:
        return {}
    times = None if spoken_for is None else spoken_for[goals.start : goals.stop]
    return _found(space, most, times)


def _found(space: PlanSpace, most: float, times: Ints | None = None) -> Table:
    """What one plan space says; ``times`` (goals): for how many goals each counts, None: itself."""
    choices = Choices(space)
    counts = np.ones(len(space), np.int64) if times is None else times[space.goal]
    listed: Table = {}
    if most:
        with suppress(TooManyDivergences):
            listed = {"divergences": divergences(choices, most=most)}
    return {
        **listed,
        "states": np.unique(space.state),
        "figures": np.array(
            [
                counts[space.starts][choices.requires[space.starts]].sum(),
                counts.sum(),
                (counts * space.out_degrees).sum(),
                len(choices.sets),
                choices.evaluations,
            ]
        ),
    }


def _read(table: Table) -> FirstDifferences:
    """What the jobs found; sets and mixtures are counted anew in each."""
    figures = table["figures"].tolist()
    return FirstDifferences(table.get("divergences"), table["states"], *figures)


def _merged(found: Sequence[Table]) -> Table:
    """What some jobs found as one."""
    listed: Table = {}
    if all("divergences" in table for table in found):
        listed = {"divergences": minimal(np.concatenate([t["divergences"] for t in found]))}
    states = np.unique(np.concatenate([table["states"] for table in found]))
    figures = np.stack([table["figures"] for table in found]).sum(axis=0)
    return {**listed, "states": states, "figures": figures}


# ---- goals up to symmetry

#: Pairs of a goal and a state, times robots, from which on symmetries are looked for: below, what
#: they save takes no longer than to find them.
LEAST_WORK = 50_000
#: So many pairs for each ground action and fact, which symmetries are checked on.
PAIRS_FOR_ACTION = 10


@dataclass(frozen=True, slots=True)
class SymmetricGoals:
    """The goals "every state", of which some speak for all (Proposition 15 of docs/concepts.md).

    ``generators`` (states) say where each state number goes, for a group of symmetries;
    ``representative`` (states) is for each goal, by the number of its state, the least goal that a
    symmetry takes to it.
    """

    generators: tuple[Ints, ...]
    representative: Ints

    @property
    def chosen(self) -> Ints:
        """The goals that speak for all, sorted."""
        return np.unique(self.representative)

    def images(self, found: Table) -> Table:
        """States and divergences of all goals, from those chosen; figures are of all already."""
        alike = self.representative
        images = {"states": np.flatnonzero(np.isin(alike, alike[found["states"]]))}
        if "divergences" in found:
            images["divergences"] = minimal(self._images_of_rows(found["divergences"]))
        return images

    def _images_of_rows(self, rows: Ints) -> Ints:
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
    if not candidates.are_pairs_of_facts or states**2 * len(model.robots) < least:
        return None
    if states**2 < for_action * (len(model.actions) + len(model.codec.facts)):
        return None
    found = checked_generators(candidates, with_tasks=False)
    generators = [s.states for s in found if (s.states != np.arange(states)).any()]
    if not generators:
        return None
    return SymmetricGoals(tuple(generators), orbits(generators))
