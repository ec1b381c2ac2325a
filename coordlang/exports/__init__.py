# SPDX-License-Identifier: GPL-3.0-or-later
"""A task under a sentence for the programs of others: PDDL, LTLf, behaviour trees."""
