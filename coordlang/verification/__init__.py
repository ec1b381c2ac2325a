# SPDX-License-Identifier: GPL-3.0-or-later
"""Is it a coordination language?  By definition; and why fewer words do not suffice."""
