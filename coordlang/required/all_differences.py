# SPDX-License-Identifier: GPL-3.0-or-later
"""Required coordination of many tasks, by goals.

Divergences at a node depend on its goal only, so the goals are cut into portions, and each is a
job (`planners.parallel`).  Of goals that are images of each other under a symmetry one is
looked at (`coordlang.symmetry.goals`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np

from coordlang.language.candidates import Candidates
from coordlang.required.divergences import Divergences, FirstDifferences, first_differences, minimal
from coordlang.required.miscoordination import Inseparable, inseparable, separable
from coordlang.symmetry.goals import SymmetricGoals, symmetric_goals
from planners.joint.tables import Ints
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.workers import Workers
from planners.search.portions import PORTION, Explored, Source, cut
from planners.system.limits import reaching


def differences(
    candidates: Candidates,
    workers: Workers,
    progress: Callable[[str], None] = lambda _: None,
    portion: float = PORTION,
) -> FirstDifferences:
    """Find them for tasks without inseparable plans, in jobs of about ``portion`` effort.

    Raises `Inseparable` with the plans of the first portion that has some.
    """
    source = candidates.source
    goals = symmetric_goals(candidates)
    if goals is not None and isinstance(source, Explored):
        progress(f"looking at {len(goals.chosen):,} of {len(source.goals):,} goals, by symmetry")
        some = source.only(goals.chosen), goals.spoken_for[goals.chosen]
        tables_of_some = _tables(some, workers, progress, portion)
        if not _inseparable(tables_of_some):
            return _spread(_together(tables_of_some), goals)
    found = _tables((source, None), workers, progress, portion)
    if _inseparable(found):
        witness = inseparable(source.portion(cut(source.efforts, portion)[len(found) - 1]))
        assert witness is not None
        raise Inseparable(witness)
    return _together(found)


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


def _inseparable(found: Sequence[Table]) -> bool:
    return bool(found[-1]["inseparable"])


def _spread(found: FirstDifferences, goals: SymmetricGoals) -> FirstDifferences:
    """What the chosen goals say, for all goals (Proposition 15 of docs/concepts.md).

    The numbers of tasks, nodes and edges are those of all goals already.
    """
    rows = np.column_stack((found.divergences.last, found.divergences.following))
    rows = minimal(goals.images_of_rows(rows))
    states = goals.images_of_states(found.states)
    return replace(found, divergences=Divergences(rows[:, 0], rows[:, 1:]), states=states)


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


def _together(found: Sequence[Table]) -> FirstDifferences:
    """What jobs found as one: sets and mixtures are counted anew in each."""
    rows = minimal(np.concatenate([table["divergences"] for table in found]))
    states = np.unique(np.concatenate([table["states"] for table in found]))
    figures = np.stack([table["figures"] for table in found]).sum(axis=0)
    return FirstDifferences(Divergences(rows[:, 0], rows[:, 1:]), states, *figures.tolist())
