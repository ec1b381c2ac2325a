# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's exhaustive method, as far as it goes: it mixes all pairs of optimal plans."""

from __future__ import annotations

from coordlang.building import build_language
from coordlang.evaluation.lab.recipe import Result
from coordlang.tasks.candidates import Candidates
from planners.errors import OutOfTime
from planners.limits import time_limit
from planners.search.plans import counts

#: More pairs of plans than this are not mixed.
MOST_PAIRS = 500_000


def find_by_brute_force(candidates: Candidates, seconds: float, seed: int) -> Result:
    """Run the paper's exhaustive method; its number of words, or why there is none."""
    pairs = pairs_of_plans(candidates)
    found: Result = {"pairs": pairs, "words": None}
    if pairs > MOST_PAIRS:
        return found | {"why": "too many pairs of plans"}
    try:
        with time_limit(seconds):
            built = build_language(candidates, "exhaustive", seed=seed)
    except OutOfTime:
        return found | {"why": "out of time"}
    if built.stopped is not None:
        late = isinstance(built.stopped, OutOfTime)
        return found | {"why": "out of time" if late else "out of memory"}
    words, partitions = built.language.guarantee.size, int(built.figures["partitions"])
    return found | {"words": words, "partitions": partitions}


def pairs_of_plans(candidates: Candidates) -> int:
    """Return the number of pairs of optimal plans of all tasks: what brute force mixes."""
    return sum(
        counted[n] ** 2
        for space in candidates.spaces
        for counted in (counts(space),)
        for n in space.starts
    )
