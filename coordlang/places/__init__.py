# SPDX-License-Identifier: GPL-3.0-or-later
"""Where things are: which atoms of a domain say it, and what moves between places."""
