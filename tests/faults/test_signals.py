# SPDX-License-Identifier: GPL-3.0-or-later
"""Signals that end the process: at every moment the exit code is that of the signal, and nothing is
left behind.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from planners.system.signals import ENDING, Interrupted, postponed_signals
from planners.system.writing import write_atomically
from tests.support.command import own_process
from tests.support.domains import DOMAINS
from tests.support.jobs import until

FILES = [str(DOMAINS / "grid" / name) for name in ("domain.pddl", "gw1-2x2.pddl")]
#: Runs the command line, and sends itself a signal when a module of this name is imported, or the
#: module of this number.
_AT_IMPORT = """
import os, signal, sys

signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
number, at = int(sys.argv[1]), sys.argv[2]
sys.argv[1:] = sys.argv[3:]
seen = 0

class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        global seen
        seen += 1
        if at in (name, str(seen)):
            os.kill(os.getpid(), number)

from coordlang.__main__ import main
sys.meta_path.insert(0, Finder)
main()
"""
#: Before the first line of `coordlang.__main__` it is Python that hears the signal.  1: the first
#: module of all that is looked for after it.
_MODULES = ("1", "click", "coordlang.commands.main", "msgspec", "numpy", "clingo")


def ended_at(number: int, at: object) -> int:
    """Count plans, and send the signal at an import; the exit code."""
    program = [sys.executable, "-c", _AT_IMPORT, str(number), str(at), "plans", *FILES, "--count"]
    ended = subprocess.run(program, capture_output=True, text=True)
    assert "Traceback" not in ended.stderr
    return ended.returncode


@pytest.mark.parametrize("module", _MODULES)
def test_signals_while_modules_are_imported(module: str) -> None:
    number = ENDING[_MODULES.index(module) % len(ENDING)]
    assert ended_at(number, module) == 128 + number


@pytest.mark.slow
@pytest.mark.parametrize("number", ENDING)
def test_signals_at_every_import(number: int) -> None:
    """A signal at the last import of all may come when the work is done."""
    codes = []
    for at in range(1, 2000, 7):
        code = ended_at(number, at)
        if code == 0:
            break
        codes.append(code)
    assert set(codes) == {128 + number}
    assert len(codes) > 40


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_fast_downward_leaves_nothing(number: signal.Signals, tmp_path: Path) -> None:
    process = subprocess.Popen(
        own_process("check", *FILES),
        env={**os.environ, "TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    until(lambda: list(tmp_path.glob("coordlang-*/problem.pddl")))
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (128 + number, "")
    assert err.strip() == f"coordlang: interrupted by {number.name}"
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (  # so start ``nohup`` and shells what is to go on
            "import os, signal\nfor n in (1, 2, 15): signal.signal(n, signal.SIG_IGN)\n"
            "from planners.system.signals import Interruptions\nfound = Interruptions()\n"
            "for n in (1, 2, 15): os.kill(os.getpid(), n)\nprint(found.first)",
            "None\n",
        ),
        (
            "import os, time\nfrom planners.system.signals import Interrupted, Interruptions\n"
            "Interruptions()\n"
            "class Loses:\n    def __del__(self): os.kill(os.getpid(), 15)\n"
            "try:\n    Loses()\n    time.sleep(30)\nexcept Interrupted as end:\n    print(end.number)",
            "15\n",
        ),
    ],
    ids=["what is ignored stays so", "what a finalizer lost is sent again"],
)
def test_signals_of_a_process(code: str, said: str) -> None:
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, said, "")


@pytest.fixture
def ending() -> Iterator[None]:
    """SIGTERM and SIGINT raise `Interrupted` in this process."""

    def end(number: int, _frame: FrameType | None) -> None:
        raise Interrupted(number)

    before = {n: signal.signal(n, end) for n in (signal.SIGTERM, signal.SIGINT)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("ending")
def test_no_file_is_left_between_two(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The signal comes when the file beside has just been made, and nobody knows its name yet."""
    (tmp_path / "file").write_text("old")
    make = os.open

    def interrupted(*arguments: Any, **keywords: Any) -> int:
        made = make(*arguments, **keywords)
        signal.raise_signal(signal.SIGTERM)
        return made

    monkeypatch.setattr(os, "open", interrupted)
    with pytest.raises(Interrupted):
        write_atomically(tmp_path / "file", b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_bytes() in (b"old", b"new")


@pytest.mark.usefixtures("ending")
def test_signals_wait() -> None:
    steps = []

    def work() -> None:
        with postponed_signals() as signals:
            signal.raise_signal(signal.SIGTERM)
            steps.append("not disturbed")
            try:
                with signals.heard():
                    steps.append("not reached")
            finally:
                signal.raise_signal(signal.SIGINT)
                steps.append("cleaned up")

    with pytest.raises(Interrupted) as raised:
        work()
    assert steps == ["not disturbed", "cleaned up"]
    assert raised.value.number == signal.SIGINT
    with pytest.raises(Interrupted):
        signal.raise_signal(signal.SIGTERM)
