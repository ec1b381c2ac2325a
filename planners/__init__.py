# SPDX-License-Identifier: GPL-3.0-or-later
"""Planning for several robots: PDDL -> joint model -> all optimal plans.  No languages here."""
