# SPDX-License-Identifier: GPL-3.0-or-later
"""The fuzzer: broken PDDL against the command line. ``python -m tests.fuzz`` runs many mutants."""
