# SPDX-License-Identifier: GPL-3.0-or-later
"""A language in use: say, understand, plan, act; and other planners join in."""
