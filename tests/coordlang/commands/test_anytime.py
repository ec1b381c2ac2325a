# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits and interrupts: the best language so far is kept, with what is proved of it."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest

from coordlang.language.file import read_language
from tests.support.command import own_process
from tests.support.domains import DOMAINS

HANDOVER = DOMAINS / "handover"
#: Three words are found soon; whether two suffice is open after minutes.
HARD = [
    str(HANDOVER / "domain.pddl"),
    str(HANDOVER / "exchange.pddl"),
    "--tasks",
    "all",
    "--method",
    "minimal",
]


def stopped(number: signal.Signals, *arguments: str) -> tuple[int, str, str]:
    """Build, and send the signal once the first language is found: exit code, stdout, stderr.

    Its stderr is a terminal, for the progress tells when that is.
    """
    terminal, end = pty.openpty()
    process = subprocess.Popen(
        own_process("build", *HARD, *arguments), stdout=subprocess.PIPE, stderr=end, text=True
    )
    os.close(end)
    said, sent = "", False
    with suppress(OSError):  # nobody has the other end of the terminal any more
        while piece := os.read(terminal, 4096):
            said += piece.decode()
            if not sent and " needed: round " in said:
                process.send_signal(number)
                sent = True
    os.close(terminal)
    out, _ = process.communicate(timeout=60)
    return process.returncode, out, said


@pytest.mark.parametrize(
    ("number", "arguments", "code", "said"),
    [
        # The alarm comes early: how soon the first language is found depends on the machine.
        (signal.SIGALRM, ["--time-limit", "100"], 3, "the time limit of 100 s is over; the best "),
        (signal.SIGINT, [], 130, "interrupted; the best "),
    ],
)
def test_the_best_language_is_written(
    number: signal.Signals, arguments: list[str], code: int, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "language.json"
    ended, out, told = stopped(number, "-o", str(path), "--json", *arguments)
    assert ended == code, told
    assert f"{said}language so far is written" in told
    assert json.loads(out)["proved_minimal"] is False
    guarantee = read_language(path).guarantee
    assert guarantee.method == "minimal"
    assert 2 <= guarantee.lower_bound < guarantee.size
    assert not guarantee.proved_minimal
    assert [p.name for p in path.parent.iterdir()] == [path.name]
