# SPDX-License-Identifier: GPL-3.0-or-later
"""The reachable space, bounds, and all optimal plans of tasks as paths of a plan space."""

from typing import Literal

#: The heuristics of A*, and what a search for all optimal plans takes: ``auto`` chooses one.
HeuristicName = Literal["relaxed", "projections", "blind"]
SearchHeuristic = Literal["auto", "relaxed", "projections", "blind"]
