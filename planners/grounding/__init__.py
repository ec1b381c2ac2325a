# SPDX-License-Identifier: GPL-3.0-or-later
"""Lifted actions -> ground actions: Tarski finds reachable arguments, the rest is evaluated."""
