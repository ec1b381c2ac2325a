# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetries of a joint model and its candidate tasks."""
