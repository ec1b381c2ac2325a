# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of plans of shipped problems within slack 0, 1 and 2, which K* and SymK confirm."""

#: Folder and stem of the problem, its least makespan, and the numbers by slack.  K* counts the
#: plans of every length up to the bound: the sum of these numbers (test_kstar_slack.py).
SLACK_COUNTS = [
    ("t-map", "problem", 4, (2, 18, 114)),
    ("three-cells", "problem", 2, (4, 20, 104)),
    ("grid", "gw1-2x2", 2, (2, 18, 140)),
    ("grid", "corners-3x3", 4, (18, 514, 11554)),
    ("grid", "corners-4x4", 6, (236, 12860, 500744)),
    ("corridor", "problem", 10, (32, 1920, 70680)),
    ("handover", "exchange", 10, (128, 3392, 55904)),
]
