# SPDX-License-Identifier: GPL-3.0-or-later
"""How often robots miscoordinate under words that are too few: what communication is worth."""
