# SPDX-License-Identifier: GPL-3.0-or-later
"""Failure probabilities from their definition: all plans are listed, all tuples of them mixed."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

from planners.search.plan_space import PlanSpace
from tests.support import naive


def failure(space: PlanSpace, task: int, word: Sequence[int] | None, most: int) -> Fraction:
    """``word`` gives each *state* its word; None: silence."""
    plans = naive.listed(space, task, most)
    said = naive.by_sentence(space, task, lambda s: word[s] if word is not None else 0, most)
    found = Fraction(0)
    for group in said.values():
        tuples = list(product(group, repeat=space.robots))
        good = sum(naive.mixture(chosen) in set(plans) for chosen in tuples)
        found += Fraction(len(group), len(plans)) * (1 - Fraction(good, len(tuples)))
    return found
