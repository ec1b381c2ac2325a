# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands: each an options record, a Python function, and how its result is shown."""
