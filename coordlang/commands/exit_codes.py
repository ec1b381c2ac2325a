# SPDX-License-Identifier: GPL-3.0-or-later
"""Exit codes that are no errors of the one error tree (docs/cli.md, exit codes)."""

from __future__ import annotations

from planners.system.signals import Interrupted

#: The answer is no: refuted, or nothing is guaranteed.
REFUTED = 1
#: An answer without the proof that was asked for.
UNPROVED = 3
#: It is proved that there is no plan.
IMPOSSIBLE = 11
#: Interrupted from the keyboard.
INTERRUPTED = 130
#: As a shell reports a process whose reader has gone: the answer did not arrive.
BROKEN_PIPE = 141


def interrupted_by(number: int) -> int:
    """The exit code of a process that a signal has ended, as a shell reports it."""
    return 128 + number


def code_of_interrupt(stopped: KeyboardInterrupt) -> int:
    """The exit code after an interrupt, by the keyboard or by a signal."""
    return interrupted_by(stopped.number) if isinstance(stopped, Interrupted) else INTERRUPTED
