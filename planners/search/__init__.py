# SPDX-License-Identifier: GPL-3.0-or-later
"""The reachable space, bounds, and all optimal plans of tasks as paths of a plan space."""
