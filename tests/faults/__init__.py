# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever breaks: hostile text, files and surroundings (docs/reliability.md)."""
