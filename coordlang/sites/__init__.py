# SPDX-License-Identifier: GPL-3.0-or-later
"""Places and their coordinates: maps of others, and the domains that come along."""
