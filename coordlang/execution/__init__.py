# SPDX-License-Identifier: GPL-3.0-or-later
"""A language in one task: saying, understanding, planning, choosing, watching a run."""
