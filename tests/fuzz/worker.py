# SPDX-License-Identifier: GPL-3.0-or-later
"""A process that serves commands of the fuzzer, one after the other."""

from __future__ import annotations

import json
import os
import sys
import traceback
from typing import Any


def serve() -> None:
    """Serve requests, one JSON line each, on stdin and stdout; a run's own output goes to files."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    # `run` is imported before any memory limit is set.
    from coordlang.commands.main import run

    def reply(data: dict[str, Any]) -> None:
        answers.write(json.dumps(data) + "\n")
        answers.flush()

    reply({"ready": True})
    for line in sys.stdin:
        request = json.loads(line)
        for number, key in ((1, "out"), (2, "err")):
            target = os.open(request[key], os.O_WRONLY | os.O_TRUNC)
            os.dup2(target, number)
            os.close(target)
        try:
            code = run(request["arguments"])
        except BaseException:  # what the interpreter would do with it
            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
        reply({"code": code})


if __name__ == "__main__":
    serve()
