# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits and interrupts: the best language so far is kept, with what is proved of it."""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path

import pytest

from coordlang.language.file import read_language
from tests.support.command import Outcome, on_a_terminal, own_process
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


def stopped(number: signal.Signals, *arguments: str) -> Outcome:
    """Build, and send the signal once the first language is found: the progress tells when."""
    sent: list[int] = []

    def heard(said: str, process: subprocess.Popen[str]) -> None:
        if not sent and " needed: round " in said:
            process.send_signal(number)
            sent.append(number)

    return on_a_terminal(own_process("build", *HARD, *arguments), heard)


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
    ended = stopped(number, "-o", str(path), "--json", *arguments)
    assert ended.code == code, ended
    assert f"{said}language so far is written" in ended.err
    assert json.loads(ended.out)["proved_minimal"] is False
    guarantee = read_language(path).guarantee
    assert guarantee.method == "minimal"
    assert 2 <= guarantee.lower_bound < guarantee.size
    assert not guarantee.proved_minimal
    assert [p.name for p in path.parent.iterdir()] == [path.name]
