# SPDX-License-Identifier: GPL-3.0-or-later
"""Words, sentences and language files."""
