# SPDX-License-Identifier: GPL-3.0-or-later
"""Kills at random moments: an output is the old file or the new one, and nothing else is left."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.support.domains import DOMAINS
from tests.support.forks import Fork, fork_command, fresh_command
from tests.support.writing_commands import OLD, WRITING, Writing, given, normal

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: What a kill that nobody can hear may leave, beside an output and in the temporary directory:
#: there is also a file with which Python tries whether it can write to that directory.
LEFT = re.compile(r"[a-z0-9_]{8}|\.[^/]{1,16}\.[a-z0-9_]{8}|coordlang-[a-z0-9_]{8}(/.*)?|\.lock")


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What `WRITING` has names for."""
    return given(tmp_path_factory.mktemp("given"))


@dataclass
class Kills:
    """One command, killed again and again in one folder."""

    writing: Writing
    folder: Path
    said: dict[str, str]
    fresh: bool
    seen: set[tuple[str, bytes]] = field(default_factory=set)

    def __post_init__(self) -> None:
        for name in ("work", "tmp"):
            (self.folder / name).mkdir()

    def start(self) -> Fork:
        arguments = [self.said.get(argument, argument) for argument in self.writing.arguments]
        command = fresh_command if self.fresh else fork_command
        return command(*arguments, before=self.enter)

    def enter(self) -> None:
        os.chdir(self.folder / "work")
        os.environ["TMPDIR"] = str(self.folder / "tmp")
        tempfile.tempdir = None

    def files(self) -> set[str]:
        """All files and folders there are, the outputs and stored languages apart."""
        roots = (self.folder / "work", self.folder / "tmp")
        found = {str(p.relative_to(root)) for root in roots for p in root.rglob("*")}
        return found - {*self.writing.outputs}

    def note(self) -> None:
        """Keep what the outputs hold."""
        for name in self.writing.outputs:
            path = self.folder / "work" / name
            if path.exists():
                self.seen.add((name, normal(name, path.read_bytes())))

    def kill(self, number: signal.Signals, choice: random.Random) -> int:
        """Send the signal at a random moment, or when something in the folder changes."""
        for name in self.writing.outputs:
            if choice.random() < 0.5:
                (self.folder / "work" / name).write_bytes(OLD)
        before = self.files()
        process = self.start()
        end = time.monotonic() + (60 if choice.random() < 0.4 else choice.uniform(0.0, 1.5))
        while time.monotonic() < end and not process.ended() and self.files() == before:
            time.sleep(0.0003)
        process.send(number)
        ended = process.join()
        self.note()
        left = self.files() - before
        if number == signal.SIGKILL:
            assert ended.code in (0, -number), ended
            assert all(map(LEFT.fullmatch, left)), left
        else:
            # Before the first line of the program the system or Python hears the signal.
            codes = [0, 128 + number, -number]
            if number == signal.SIGINT and ended.err.startswith("Fatal Python error: init_import_"):
                codes.append(1)  # Python's own end where it cannot load its module `site`
            assert ended.code in codes, ended
            assert left == set(), (left, number, ended)
            if ended.code == 128 + number:
                assert "Traceback" not in ended.err
        return ended.code

    def finish(self) -> None:
        """What a run writes that nobody disturbs, and that each file seen was this or the old."""
        ended = self.start().join(300)
        assert ended.code == 0, ended
        for name in self.writing.outputs:
            new = normal(name, (self.folder / "work" / name).read_bytes())
            for other in (held for at, held in self.seen if at == name):
                if b'"proved_minimal": false' in other:  # the best language at that moment
                    assert json.loads(other)["guarantee"]["lower_bound"] <= 3
                else:
                    assert other in (OLD, new), (name, other[:300], new[:300])


def killed(
    name: str, number: int, folder: Path, said: dict[str, str], *, fresh: bool = False
) -> None:
    kills, choice = Kills(WRITING[name], folder, said, fresh), random.Random(name)
    signals = [SIGNALS[(k + len(name)) % len(SIGNALS)] for k in range(number)]
    for which in signals:
        kills.kill(which, choice)
    kills.finish()


@pytest.mark.parametrize("name", WRITING)
def test_some_kills(name: str, tmp_path: Path, said: dict[str, str]) -> None:
    killed(name, 2, tmp_path, said)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITING)
def test_many_kills(name: str, tmp_path: Path, said: dict[str, str]) -> None:
    killed(name, 40, tmp_path, said, fresh=True)


def copies_killed(number: int, folder: Path, *, fresh: bool) -> int:
    """How many copies of a domain were there at the end, each whole."""
    choice, command = random.Random(2), fresh_command if fresh else fork_command
    whole = {p.name: p.read_bytes() for p in (DOMAINS / "grid").iterdir()}
    copies = 0
    for k in range(number):
        target = folder / str(k)
        process = command("domains", "--copy", "grid", target)
        end = time.monotonic() + (60 if choice.random() < 0.6 else choice.uniform(0.0, 0.4))
        seen = choice.randrange(len(whole))  # files that are there
        while time.monotonic() < end and not process.ended():
            if len([name for _, _, names in os.walk(target) for name in names]) > seen:
                break
        process.send(SIGNALS[k % len(SIGNALS)])
        ended = process.join()
        assert ended.code in (0, 128 + SIGNALS[k % 4], -SIGNALS[k % 4]), ended
        found = {p.name for p in target.iterdir()} if target.exists() else set()
        if "grid" in found:
            copies += 1
            assert {p.name: p.read_bytes() for p in (target / "grid").iterdir()} == whole
        assert found - {"grid"} == set() or SIGNALS[k % 4] == signal.SIGKILL
        assert all(re.fullmatch(r"\.coordlang\.[a-z0-9_]{8}", name) for name in found - {"grid"})
    return copies


def test_copies_of_domains_are_whole_or_not_there(tmp_path: Path) -> None:
    assert copies_killed(8, tmp_path, fresh=False) > 0


@pytest.mark.slow
def test_many_copies_of_domains(tmp_path: Path) -> None:
    assert 0 < copies_killed(80, tmp_path, fresh=True) < 80


def test_two_processes_write_one_output(tmp_path: Path, said: dict[str, str]) -> None:
    kills = Kills(WRITING["tasks"], tmp_path, said, fresh=False)
    for process in [kills.start(), kills.start()]:
        ended = process.join()
        assert ended.code == 0, ended
    kills.note()
    assert kills.files() == set()
    kills.finish()
