# SPDX-License-Identifier: GPL-3.0-or-later
"""Means, shares and their confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from statistics import fmean

#: The two-sided 95 % quantile of the normal distribution.
_Z = 1.959963984540054


def wilson(successes: int, runs: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a proportion, by Wilson's score (1927).

    It stays within 0 .. 1 and is not degenerate where all runs or none succeed.

    Raises
    ------
    ValueError
        Without runs, or if there are not between 0 and ``runs`` successes.
    """
    if runs < 1 or not 0 <= successes <= runs:
        raise ValueError(f"{successes} successes in {runs} runs")
    share, weight = successes / runs, _Z**2 / runs
    middle = (share + weight / 2) / (1 + weight)
    half = _Z / (1 + weight) * sqrt(share * (1 - share) / runs + weight / (4 * runs))
    # Without these the ends miss 0 and 1 by a rounding error.
    low = 0.0 if successes == 0 else middle - half
    high = 1.0 if successes == runs else middle + half
    return low, high


def mean_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % confidence interval of a mean, by the normal approximation.

    For a single value both ends are that value.
    """
    number = len(values)
    mean = sum(values) / number
    if number < 2:
        return mean, mean
    spread = sqrt(sum((v - mean) ** 2 for v in values) / (number - 1) / number)
    return mean - _Z * spread, mean + _Z * spread


def rounded_mean(values: Sequence[float], digits: int) -> float:
    """Return the mean as it is written into results; 0 of no values."""
    return round(fmean(values), digits) if values else 0.0
