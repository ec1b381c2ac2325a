# SPDX-License-Identifier: GPL-3.0-or-later
"""Fewer words: classes of states that one word may have, by SAT, for all known problems at once.

A clause over pairs of states is one over pairs of classes, for states of one class cannot be
separated.  From one word for each class downwards: a partition of the classes that satisfies all
clauses, what refutes it, and so on (as in `coordlang.vocabulary.minimal`, over classes).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coordlang.language.warping import Clause, pair
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.joint.tables import Ints

#: Conflicts that the solver may spend on one partition.
_CONFLICTS = 100_000


@dataclass(frozen=True, slots=True)
class Merged:
    """A word for each class, by number.

    ``proved``: no partition of these classes into fewer words is a language for the problems.
    """

    words: tuple[int, ...]
    proved: bool


def merge_classes(
    count: int,
    classes: Sequence[Ints],
    known: Sequence[Iterable[Clause]],
    refuting: Callable[[int, Ints], Mapping[Clause, object]],
    progress: Callable[[str], None],
) -> Merged:
    """As few words as are found.

    Parameters
    ----------
    count
        How many classes there are.
    classes
        Per problem the class of each state; one word for each class is a language.
    known
        Per problem clauses that every language satisfies.
    refuting
        ``refuting(problem, words of states)``: clauses that these words violate; none if they are a
        language for the problem.
    """
    clauses = dict.fromkeys(
        _over_classes(clause, own)
        for own, some in zip(classes, known, strict=True)
        for clause in some
    )
    best, proved = tuple(range(count)), count < 2
    while not proved:
        size = len(set(best)) - 1
        problem = PartitionProblem(range(count), max(1, size))
        try:
            for clause in clauses:
                problem.separate_one(clause)
            found = _partition(problem, classes, clauses, refuting)
        except Undecided:
            break
        finally:
            problem.close()
        if found is None:
            proved = True
        else:
            best = tuple(found[k] for k in range(count))
            progress(f"merging words: {len(set(best))} suffice")
            proved = len(set(best)) == 1
    return Merged(best, proved)


def _partition(
    problem: PartitionProblem,
    classes: Sequence[Ints],
    clauses: dict[Clause, None],
    refuting: Callable[[int, Ints], Mapping[Clause, object]],
) -> dict[int, int] | None:
    """A partition of the classes that nothing refutes; None if there is none of this size."""
    while (found := problem.solve(_CONFLICTS)) is not None:
        for number, own in enumerate(classes):
            violated = refuting(number, np.array([found[k] for k in own.tolist()], np.int64))
            if violated:
                for clause in violated:
                    over = _over_classes(clause, own)
                    if over not in clauses:
                        clauses[over] = None
                        problem.separate_one(over)
                break
        else:
            return found
    return None


def _over_classes(clause: Clause, classes: Ints) -> Clause:
    pairs = ((int(classes[a]), int(classes[b])) for a, b in clause)
    return frozenset(pair(a, b) for a, b in pairs if a != b)
