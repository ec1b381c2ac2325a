# SPDX-License-Identifier: GPL-3.0-or-later
"""``python -m coordlang`` and the program ``coordlang``: the command line.

Signals are looked after before anything else of the packages is imported.
"""

from __future__ import annotations

import gc
import os
import sys
from typing import NoReturn

import coordlang
from planners.system.signals import Interruptions

#: Digits of a number of plans: more than there are plans of any space that fits into memory.
_DIGITS = 100_000

#: New containers after which Python looks for garbage in cycles (700 if nothing is said): modules,
#: ground actions and tables make many that stay, and hardly a cycle (55,000 for the smallest task).
_CONTAINERS = 100_000

#: The exit code on a system that coordlang does not run on: that of what it relies on.
_NOT_HERE = 32


def main() -> NoReturn:
    """Run the command line and end the process with its exit code.

    Ctrl-C (SIGINT), SIGTERM and SIGHUP end the work at any moment, imports included: what is half
    done is removed, and the exit code is 128 and the number of the signal.
    """
    interruptions = Interruptions()
    gc.set_threshold(_CONTAINERS)
    # numpy's BLAS would start a thread for each core; what is multiplied here is small.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if 0 < sys.get_int_max_str_digits() < _DIGITS:  # 0: there is no limit
        sys.set_int_max_str_digits(_DIGITS)
    code = 0
    try:
        try:
            code = _run(interruptions)
        finally:
            interruptions.end()
    except Exception:
        if interruptions.first is None:
            raise
        # A library that was being imported has made another error of the interrupt.
    except KeyboardInterrupt:
        pass
    if interruptions.first is not None:
        code = 128 + interruptions.first
    gc.freeze()  # the process ends: no look for garbage among all that it has
    sys.exit(code)


def _run(interruptions: Interruptions) -> int:
    if why_not := coordlang.why_not_here():
        print(f"coordlang: {why_not}", file=sys.stderr)
        return _NOT_HERE
    from coordlang.commands.main import run
    from coordlang.commands.terminal import flush_stdout, whatever_stderr

    sys.stderr = whatever_stderr()
    if (out := sys.stdout) is not None:  # without a buffer (-u) what one write leaves is lost
        sys.stdout = os.fdopen(1, "w", encoding=out.encoding, errors=out.errors, closefd=False)
    code = run(sys.argv[1:], interruptions)
    flush_stdout()
    return code


if __name__ == "__main__":
    main()
