# SPDX-License-Identifier: GPL-3.0-or-later
"""The values that the paper reports (Yu Zhang, arXiv 1905.00517v3)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A row of Table 1: tasks, states, and words and seconds of the greedy and the exact method."""

    tasks: int
    states: int
    words: int
    seconds: float
    exact: int | None = None
    exact_seconds: float | None = None


TABLE_1 = {
    "GW1": PaperRow(132, 12, 7, 0.1, 3, 26.2),
    "GW2": PaperRow(870, 30, 13, 0.9),
    "GW3": PaperRow(3080, 56, 18, 19.5),
    "GW4": PaperRow(5112, 72, 22, 86.2),
    "GWB1": PaperRow(3080, 56, 10, 100.6),
    "GWB2": PaperRow(3080, 56, 11, 92.9),
    "GWB3": PaperRow(8010, 90, 12, 18890.9),
    "GWB4": PaperRow(8010, 90, 13, 19557.3),
    "GWB5": PaperRow(380, 56, 4, 1.4),
    "GWB6": PaperRow(636, 90, 4, 11.5),
    "GWB7": PaperRow(956, 132, 4, 132.5),
    "GWB8": PaperRow(956, 132, 4, 140.3),
}
#: GWB7: mean communication saving over the tasks whose sentence is shorter than the plan, how many
#: those are, and over all.
SAVING_DIFFERING, DIFFERING, SAVING_ALL = 0.333, 784, 0.273
#: GWB7: plans open to the listener, averaged over all tasks, and over those with more than one, and
#: how many those are.
OPEN_ALL, OPEN_SEVERAL, SEVERAL = 12.1, 14.7, 774
#: A* without a sentence expands so many times the nodes that it expands with one.
PLANNING_RATIO = 1.6
