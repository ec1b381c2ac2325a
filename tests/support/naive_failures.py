# SPDX-License-Identifier: GPL-3.0-or-later
"""Failure probabilities from their definition: all plans are listed, all tuples of them mixed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from fractions import Fraction
from itertools import product

from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan
from tests.support import naive


def failure(space: PlanSpace, task: int, word: Sequence[int] | None, most: int) -> Fraction:
    """``word`` gives each *state* its word; None: silence."""
    plans = naive.listed(space, task, most)
    said: dict[tuple[int, ...], list[Plan]] = defaultdict(list)
    for plan in plans:
        states = naive.states(space, task, plan)
        said[naive.sentence([word[s] if word is not None else 0 for s in states])].append(plan)
    found = Fraction(0)
    for group in said.values():
        tuples = list(product(group, repeat=space.robots))
        good = sum(naive.mixture(chosen) in set(plans) for chosen in tuples)
        found += Fraction(len(group), len(plans)) * (1 - Fraction(good, len(tuples)))
    return found
