# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots with wheels in a simulator, each by its own logic, under a sentence or without one."""
