# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans within slack that no words tell apart, because states do not say what is left of it.

A robot may wait in one state or in another: the states that the plans pass through are the same,
each with its repetitions taken as one, and so are their sentences under any partition.  So plans
are inseparable iff they miscoordinate under the words that are one for each state (Proposition 23
of docs/concepts.md), and the verifier decides that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.required.divergences import (
    FirstDifferences,
    states_on_plans,
    without_divergences,
)
from coordlang.required.miscoordination import Inseparable
from coordlang.verification.by_definition import verify_candidates
from planners.parallel.workers import Workers


def hidden_differences(
    candidates: Candidates, workers: Workers, progress: Callable[[str], None] = lambda _: None
) -> FirstDifferences:
    """Count the tasks that require coordination, and the states on plans, of separable plans.

    There are no first differences of states to speak of: a plan may part from another one by
    waiting in the state that they share.

    Raises
    ------
    Inseparable
        With two plans (n for n robots) that no words tell apart.
    """
    progress("looking for inseparable plans")
    states = states_on_plans(candidates.spaces)
    apart = Partition.of_states(
        candidates.rows, {state: number for number, state in enumerate(states.tolist())}
    )
    verdict = verify_candidates(apart, candidates, workers, progress)
    if verdict.witness is not None:
        raise Inseparable(replace(verdict.witness, sentence=None), hides_slack=True)
    progress("looking where coordination is required")
    return replace(without_divergences(candidates.spaces), evaluations=verdict.nodes)
