# SPDX-License-Identifier: GPL-3.0-or-later
"""Task and sentence for the programs of others: plain PDDL for planners, a formula for checkers."""
