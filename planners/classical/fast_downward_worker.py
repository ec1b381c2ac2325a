# SPDX-License-Identifier: GPL-3.0-or-later
"""The process group in which Fast Downward runs: it ends with the process that began it.

``python -P fast_downward_worker.py COMMAND ..`` runs the command and ends with its exit code.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading


def main(command: list[str]) -> int:
    """Run a command; return its exit code, as a shell would say it."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    return subprocess.call(command, stdin=subprocess.DEVNULL) % 256


def _end_with_parent() -> None:
    """End the whole process group when the parent's end of our standard input closes."""
    os.read(0, 1)
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
