# SPDX-License-Identifier: GPL-3.0-or-later
"""A language as a person reads it, and a planner: words as short formulas, what sentences ask."""
