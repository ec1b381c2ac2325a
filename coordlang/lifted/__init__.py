# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that carry over: features of PDDL states -> words, for every problem of a domain."""
