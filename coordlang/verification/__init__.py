# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether words are a coordination language, by definition, in code of its own."""
