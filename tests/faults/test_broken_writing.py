# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that write, killed at random moments or with a disk that gets full at any write: the
documented exit code, an output is the old file or the new one, and nothing else is left behind.
"""

from __future__ import annotations

import errno
import json
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from planners.system.errors import UsageError
from planners.system.writing import copy_folders
from tests.support.domains import DOMAINS
from tests.support.forks import fork, fork_command
from tests.support.writing import OLD, WRITING, Stage, given

TWO = ("t-map", "three-cells")
QUICK = ("certificate", "tasks", "export")
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in WRITING if name not in QUICK]
Fault = Callable[[], object]


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return given(tmp_path_factory.mktemp("given"))


# ---- a full disk


class FullDisk:
    """The ``number``-th change of a folder fails, and all later ones that need space.

    A change is a file that is opened for writing, written to the disk, or renamed, or a new folder.
    """

    def __init__(self, number: int, folder: Path) -> None:
        self.left, self.folder = number, str(folder)

    def begin(self) -> None:
        real = os.fsync

        def fsync(handle: Any) -> None:
            self.change()
            real(handle)

        os.fsync = fsync  # type: ignore[assignment]
        sys.addaudithook(self.hear)  # in a fork: nothing takes it away again

    def hear(self, event: str, arguments: tuple[object, ...]) -> None:
        if event == "open":
            flags = arguments[2]
            if not isinstance(flags, int) or not flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                return
        elif event not in ("os.rename", "os.mkdir", "os.link", "os.symlink"):
            return
        path = arguments[0]
        if isinstance(path, (str, bytes)) and os.path.abspath(os.fsdecode(path)).startswith(
            self.folder
        ):
            self.change(needs_space=event != "os.rename")

    def change(self, *, needs_space: bool = True) -> None:
        self.left -= 1
        if self.left == 0 or (self.left < 0 and needs_space):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def ends(name: str, said: dict[str, str], folder: Path, faults: Iterator[Fault]) -> Iterator[int]:
    """The exit code of a command on old outputs under each fault; everything else is checked."""
    undisturbed = Stage(name, folder / "whole", said)
    assert undisturbed.start().join(300).code == 0
    whole = undisturbed.outputs()
    for number, fault in enumerate(faults):
        stage = Stage(name, folder / f"{number}", said)
        for output in WRITING[name][1]:
            stage.make_old(output)
        ended, found = stage.start(fault).join(300), stage.outputs()
        assert stage.others() == set()
        if ended.code == 0:
            assert found == whole
        else:
            assert ended.code == (3 if name == "check" else 2), ended
            assert re.match(
                "coordlang: .*(No space left on device|File too large|is full)", ended.err
            )
            assert "Traceback" not in ended.err
            assert all(held in (OLD, whole[output]) for output, held in found.items())
            if name == "certificate":  # the old one never stands beside a new language
                assert (OLD in found.values()) == ([*found.values()] == [OLD, OLD])
                assert "l.json.gz" in found
            else:
                assert [*found] == [*WRITING[name][1]]
                assert OLD in found.values() or not found
        yield ended.code


@pytest.mark.parametrize("name", [*QUICK, *SLOW])
def test_the_disk_is_full_at_every_change(name: str, said: dict[str, str], tmp_path: Path) -> None:
    faults = (FullDisk(number, tmp_path).begin for number in range(1, 1000))
    met = 0
    for code in ends(name, said, tmp_path, faults):
        if code == 0:
            break
        met += 1
    assert 3 <= met < 999


@pytest.mark.parametrize("name", QUICK[:2])
def test_an_output_is_whole_or_none_at_every_length(
    name: str, said: dict[str, str], tmp_path: Path
) -> None:
    whole = Stage(name, tmp_path / "once", said)
    assert whole.start().join(300).code == 0
    most = max((tmp_path / "once" / "work" / output).stat().st_size for output in WRITING[name][1])

    def at_most(size: int) -> Fault:
        return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    sizes = (at_most(most * number // 5) for number in range(5))
    assert sum(code != 0 for code in ends(name, said, tmp_path, sizes)) == 5


def test_domains_are_copied_whole_or_not_at_all(tmp_path: Path) -> None:
    """Two of them: neither is there without the other."""
    for number in range(1, 1000):
        folder = tmp_path / str(number)
        folder.mkdir()

        def copy(number: int = number, folder: Path = folder) -> None:
            FullDisk(number, folder).begin()
            try:
                copy_folders([DOMAINS / name for name in TWO], folder)
            except UsageError as error:
                sys.exit(2 if "No space left on device" in str(error) else 1)

        code = fork(copy).join().code
        found = {str(p.relative_to(folder)): p for p in folder.rglob("*")}
        if code == 0:
            break
        assert (code, found) == (2, {})
    whole = {str(p.relative_to(DOMAINS)): p for name in TWO for p in DOMAINS.glob(f"{name}/*")}
    assert found.keys() == whole.keys() | {*TWO}
    assert all(found[name].read_bytes() == whole[name].read_bytes() for name in whole)
    assert number > 2 * len(whole)  # each is opened and flushed


@pytest.mark.usefixtures("said")
def test_plans_write_nothing(tmp_path: Path) -> None:
    """Not even a temporary file: it has no folder, and no file may have a byte."""

    def before() -> None:
        os.environ["TMPDIR"] = tempfile.tempdir = str(tmp_path / "none")
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    files = [DOMAINS / "grid" / name for name in ("domain.pddl", "corners-10x10.pddl")]
    ended = fork_command("plans", *files, "--count", before=before).join()
    assert (ended.code, ended.out) == (0, "1756863020\n"), ended


# ---- kills

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: What a kill that nobody can hear may leave, beside an output and in the temporary directory:
#: there is also a file with which Python tries whether it can write to that directory.
LEFT = re.compile(r"[a-z0-9_]{8}|\.[^/]{1,16}\.[a-z0-9_]{8}|coordlang-[a-z0-9_]{8}(/.*)?|\.lock")


@pytest.mark.parametrize("name", WRITING)
def test_kills(name: str, tmp_path: Path, said: dict[str, str]) -> None:
    """A signal at a random moment, or when something in the folder changes."""
    stage, choice = Stage(name, tmp_path, said), random.Random(name)
    seen: set[tuple[str, bytes]] = set()
    for turn in range(2):
        number = SIGNALS[(turn + len(name)) % len(SIGNALS)]
        for output in WRITING[name][1]:
            if choice.random() < 0.5:
                stage.make_old(output)
        before, process = stage.others(), stage.start()
        end = time.monotonic() + (60 if choice.random() < 0.4 else choice.uniform(0.0, 1.5))
        while time.monotonic() < end and not process.ended() and stage.others() == before:
            time.sleep(0.0003)
        process.send(number)
        ended, left = process.join(), stage.others() - before
        assert ended.code in (0, 128 + number, -number), ended
        if number == signal.SIGKILL:
            assert all(map(LEFT.fullmatch, left)), left
        else:
            assert left == set(), (left, number, ended)
            assert ended.code != 128 + number or "Traceback" not in ended.err
        seen |= {*stage.outputs().items()}
    ended = stage.start().join(300)
    assert ended.code == 0, ended
    new = stage.outputs()
    for output, held in seen:
        if b'"proved_minimal": false' in held:  # the best language at that moment
            assert json.loads(held)["guarantee"]["lower_bound"] <= 3
        else:
            assert held in (OLD, new[output]), (output, held[:300])


def test_two_processes_write_one_output(tmp_path: Path, said: dict[str, str]) -> None:
    stage = Stage("tasks", tmp_path, said)
    both = [stage.start(), stage.start()]
    assert [process.join().code for process in both] == [0, 0]
    assert stage.others() == set()
    written = stage.outputs()
    assert stage.start().join().code == 0
    assert stage.outputs() == written
