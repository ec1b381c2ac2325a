# SPDX-License-Identifier: GPL-3.0-or-later
"""Means, shares and their confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from statistics import fmean

#: The two-sided 95 % quantile of the normal distribution.
_Z = 1.959963984540054


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
