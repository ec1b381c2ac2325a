# SPDX-License-Identifier: GPL-3.0-or-later
"""Plan spaces kept from one command to the next."""

from planners.cache.searching import keeping_plans, search, search_each, shared_folder

__all__ = ["keeping_plans", "search", "search_each", "shared_folder"]
