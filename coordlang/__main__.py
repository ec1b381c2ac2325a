# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m coordlang``: the command line."""

from coordlang.cli import main

if __name__ == "__main__":
    main()
