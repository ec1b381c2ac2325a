# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk that gets full at any write of any command: the documented exit code, the old files as
they were, and nothing else left behind.
"""

from __future__ import annotations

import errno
import os
import re
import resource
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from planners.system.errors import UsageError
from planners.system.writing import copy_folders
from tests.support.command import Outcome
from tests.support.domains import DOMAINS
from tests.support.forks import fork, fork_command
from tests.support.writing_commands import OLD, WRITING, Writing, given, normal

QUICK = ("certificate", "tasks", "export")
GRID = DOMAINS / "grid"
TWO = ("t-map", "three-cells")


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A language, its certificate and a sentence; what commands use is loaded then."""
    return given(tmp_path_factory.mktemp("given"))


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


def run(
    writing: Writing, said: dict[str, str], folder: Path, limit: Callable[[], object]
) -> tuple[Outcome, dict[str, bytes], set[str]]:
    """Run a command on old outputs: how it ended, its outputs, and the names of other files."""
    work, other = folder / "work", folder / "tmp"
    work.mkdir(parents=True)
    other.mkdir()
    for name in writing.outputs:
        (work / name).write_bytes(OLD)

    def before() -> None:
        os.chdir(work)
        os.environ["TMPDIR"] = str(other)
        tempfile.tempdir = str(other)  # by itself Python looks for another one with space
        limit()

    arguments = [said.get(argument, argument) for argument in writing.arguments]
    ended = fork_command(*arguments, before=before).join(300)
    found = {str(p.relative_to(root)) for root in (work, other) for p in root.rglob("*")}
    outputs = {name: (work / name).read_bytes() for name in writing.outputs if name in found}
    return ended, outputs, found - {*outputs}


def check(
    name: str, said: dict[str, str], folder: Path, limit: Callable[[], object], whole: Outputs
) -> int:
    """Run it under a limit; its exit code."""
    ended, outputs, others = run(WRITING[name], said, folder, limit)
    if ended.code == 0:
        assert {at: normal(at, held) for at, held in outputs.items()} == whole
    else:
        assert ended.code == (3 if name == "check" else 2), ended
        assert ended.err.startswith("coordlang: ")
        assert re.search("No space left on device|File too large|is full", ended.err), ended
        assert "Traceback" not in ended.err
        for at, held in outputs.items():
            assert held == OLD or normal(at, held) == whole[at]
        replaced = {*WRITING[name].outputs}
        if name == "certificate":  # the old one never stands beside a new language
            assert {at for at, held in outputs.items() if held == OLD} in (replaced, set())
            assert replaced - {*outputs} <= {"c.json.gz"}
        else:
            assert replaced <= {*outputs}
            assert OLD in outputs.values() or not replaced
    assert others == set()
    return ended.code


Outputs = dict[str, bytes]


def fill_at_every_change(name: str, said: dict[str, str], folder: Path) -> int:
    """The number of runs that met the full disk."""
    ended, outputs, _ = run(WRITING[name], said, folder / "whole", lambda: None)
    assert ended.code == 0, ended
    whole = {at: normal(at, held) for at, held in outputs.items()}
    for number in range(1, 1000):
        disk = FullDisk(number, folder)
        if check(name, said, folder / str(number), disk.begin, whole) == 0:
            return number - 1
    raise AssertionError("more than 1,000 changes")


def fill_at_every_length(name: str, said: dict[str, str], folder: Path, steps: int) -> int:
    """The number of runs that met the limit on the size of a file."""
    ended, outputs, _ = run(WRITING[name], said, folder / "whole", lambda: None)
    assert ended.code == 0, ended
    whole = {at: normal(at, held) for at, held in outputs.items()}
    most = max(map(len, outputs.values()))
    met = 0
    for number in range(steps):
        size = most * number // steps

        def limit(size: int = size) -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

        met += check(name, said, folder / str(number), limit, whole) != 0
    return met


@pytest.mark.parametrize("name", QUICK)
def test_the_disk_is_full_at_a_change(name: str, said: dict[str, str], tmp_path: Path) -> None:
    assert fill_at_every_change(name, said, tmp_path) >= 3


def test_domains_are_copied_whole_or_not_at_all(tmp_path: Path) -> None:
    """Two of them: neither is there without the other."""
    for number in range(1, 1000):
        folder = tmp_path / str(number)
        folder.mkdir()
        disk = FullDisk(number, folder)
        ended = fork(partial(copied_until, disk, folder)).join()
        found = sorted(p.relative_to(folder) for p in folder.rglob("*"))
        if ended.code == 0:
            break
        assert (ended.code, "No space left on device" in ended.err) == (2, True), ended
        assert found == []
    whole = [
        p.relative_to(DOMAINS) for name in TWO for p in [DOMAINS / name, *DOMAINS.glob(f"{name}/*")]
    ]
    assert found == sorted(whole)
    assert all((folder / p).read_bytes() == (DOMAINS / p).read_bytes() for p in found if p.suffix)
    assert number > 2 * (len(whole) - 2)  # each is opened and flushed


def copied_until(disk: FullDisk, folder: Path) -> None:
    """Copy domains to a disk that gets full."""
    disk.begin()
    try:
        copy_folders([DOMAINS / name for name in TWO], folder)
    except UsageError as error:
        print(error, file=sys.stderr)
        sys.exit(2)


@pytest.mark.parametrize("name", QUICK[:2])
def test_an_output_is_whole_or_none(name: str, said: dict[str, str], tmp_path: Path) -> None:
    assert fill_at_every_length(name, said, tmp_path, 5) == 5


@pytest.mark.usefixtures("said")
@pytest.mark.parametrize(("problem", "count"), [("corners-10x10", 1_756_863_020), ("gw4-3x3", 18)])
def test_plans_write_nothing(problem: str, count: int, tmp_path: Path) -> None:
    """Not even a temporary file: it has no folder, and no file may have a byte."""

    def before() -> None:
        os.environ["TMPDIR"] = tempfile.tempdir = str(tmp_path / "none")
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    files = GRID / "domain.pddl", GRID / f"{problem}.pddl"
    ended = fork_command("plans", *files, "--count", before=before).join()
    assert (ended.code, ended.out) == (0, f"{count}\n"), ended


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITING)
def test_the_disk_is_full_at_every_change_of_every_command(
    name: str, said: dict[str, str], tmp_path: Path
) -> None:
    met = fill_at_every_change(name, said, tmp_path)
    print(f"{name}: {met} changes")
    assert met >= 3


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in WRITING if WRITING[name].outputs])
def test_the_disk_is_full_at_fifty_lengths_of_every_output(
    name: str, said: dict[str, str], tmp_path: Path
) -> None:
    met = fill_at_every_length(name, said, tmp_path, 50)
    print(f"{name}: {met} lengths")
    assert met >= 5
