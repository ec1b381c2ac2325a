# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors, limits, signals, files in and out, messages."""
