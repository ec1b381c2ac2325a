# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits and interrupts: the best language so far is kept, with what is proved of it."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import time
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from coordlang.commands.building import build_language
from coordlang.commands.built import Built
from coordlang.language.file import read_language
from coordlang.vocabulary.sat import PartitionProblem
from planners.system.errors import OutOfTime
from planners.system.limits import time_limit
from tests.support.command import Command, own_process
from tests.support.domains import DOMAINS, all_tasks

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


def check_file(path: Path) -> None:
    guarantee = read_language(path).guarantee
    assert guarantee.method == "minimal"
    assert 2 <= guarantee.lower_bound < guarantee.size
    assert not guarantee.proved_minimal
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_time_limit_writes_the_best_language(tmp_path: Path) -> None:
    """The alarm comes early: how soon the first language is found depends on the machine."""
    path = tmp_path / "language.json"
    code, out, said = stopped(signal.SIGALRM, "-o", str(path), "--time-limit", "100", "--json")
    assert code == 3, said
    assert (
        "the time limit of 100 s is over; the best language so far is written, without proof"
        in said
    )
    assert json.loads(out)["proved_minimal"] is False
    check_file(path)


def test_an_interrupt_writes_the_best_language(tmp_path: Path) -> None:
    path = tmp_path / "language.json"
    code, _, said = stopped(signal.SIGINT, "-o", str(path))
    assert code == 130, said
    assert "interrupted; the best language so far is written to" in said
    check_file(path)


def test_a_better_partition_found_on_the_way_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Time is over before the bounds are closed for good: `minimal` returns what it has."""

    def late(*_: object) -> bool:
        raise OutOfTime("late")

    monkeypatch.setattr(import_module("coordlang.vocabulary.minimal"), "close_bounds", late)
    built = build_language(all_tasks("grid", "gw2-2x3"), "minimal")
    assert isinstance(built.stopped, OutOfTime)
    assert (
        len(built.language.words)
        < build_language(all_tasks("grid", "gw2-2x3"), "greedy").language.guarantee.size
    )


@pytest.mark.parametrize(
    ("error", "code"), [(OutOfTime("the time limit is over"), 3), (KeyboardInterrupt(), 130)]
)
def test_the_language_is_written_without_its_certificate(
    error: BaseException,
    code: int,
    coordlang: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stop(_: object) -> None:
        raise error

    monkeypatch.setattr(Built, "certificate", stop)
    path, proof = tmp_path / "l.json", tmp_path / "c.json"
    files = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]
    outcome = coordlang("build", *files, "--method", "minimal", "-o", path, "--certificate", proof)
    assert outcome.code == code
    assert "no certificate is written" in outcome.err
    assert read_language(path).guarantee.proved_minimal
    assert [p.name for p in tmp_path.iterdir()] == ["l.json"]


def test_the_solver_hears_the_clock() -> None:
    """Eleven pigeons in ten holes take the solver very long."""
    problem = PartitionProblem([0], 1)
    hole = [[100 + 10 * pigeon + h for h in range(10)] for pigeon in range(11)]
    for pigeon in range(11):
        problem._solver.add_clause(hole[pigeon])
        for other in range(pigeon):
            for h in range(10):
                problem._solver.add_clause([-hole[pigeon][h], -hole[other][h]])
    begin = time.monotonic()
    with pytest.raises(OutOfTime), time_limit(1):
        problem.solve()
    problem.close()
    assert time.monotonic() - begin < 20
