# SPDX-License-Identifier: GPL-3.0-or-later
"""The fuzzer: broken PDDL against the command line."""
