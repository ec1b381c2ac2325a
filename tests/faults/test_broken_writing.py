# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that write, killed at random moments or with a disk that gets full at any write: the
documented exit code, an output is the old file or the new one, and nothing else is left behind.
"""

from __future__ import annotations

import errno
import gzip
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

import coordlang
from coordlang.verification.certificate_file import write_certificate
from planners.system.errors import UsageError
from planners.system.writing import copy_folders
from tests.support import slow, thorough
from tests.support.domains import DOMAINS, files_of
from tests.support.forks import Fork, fork, fork_command

FILES = [*map(str, files_of("grid", "gw1-2x2"))]
OLD = b"the old file\n"
#: Commands, in which words in capitals stand for files and a sentence, and their outputs.
WRITING = {
    "build": ("build ALL -o l.json", "l.json"),
    "certificate": ("build ALL -o l.json.gz --certificate c.json.gz", "l.json.gz c.json.gz"),
    "tasks": ("tasks PDDL --start (at_r1_?) --goal (at_r1_?) -o t.json", "t.json"),
    "lift": ("lift PDDL --complexity 5 -o f.json.gz", "f.json.gz"),
    "ground": ("ground LIFTED PDDL -o l.json", "l.json"),
    "understand": ("understand LANGUAGE PDDL SENTENCE --max 5 -o p.txt", "p.txt"),
    "choices": ("choices LANGUAGE PDDL SENTENCE --json -o c.json", "c.json"),
    "export": ("export LANGUAGE PDDL SENTENCE -o .", "domain.pddl problem.pddl"),
    "inspect": ("inspect PDDL --write .", "domain.pddl problem.pddl"),
    "verify": ("verify LANGUAGE PDDL --certificate PROOF --dimacs f.cnf", "f.cnf"),
    "report": ("report LANGUAGE PDDL -o page.html", "page.html"),
    "check": ("check PDDL", ""),
}
QUICK = ("tasks", "export", "certificate")
SLOW = slow(*(name for name in WRITING if name not in QUICK))
Fault = Callable[[], object]


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """What `WRITING` has words for; the libraries that commands use are loaded then."""
    folder = tmp_path_factory.mktemp("given")
    files = {name: str(folder / f"{name}.json") for name in ("LANGUAGE", "PROOF", "LIFTED")}
    built = coordlang.build(*FILES, tasks="all", method="minimal")
    built.language.save(files["LANGUAGE"])
    write_certificate(built.certificate(), files["PROOF"])
    coordlang.lift(*FILES, tasks="all", jobs=1).save(files["LIFTED"])
    sentence = coordlang.plan(built.language, *FILES, prefer=["shortest"]).sentence
    every = [*map(str, files_of("three-cells")), "--tasks", "all", "--method", "minimal"]
    words = {name: [path] for name, path in files.items()}
    return {**words, "PDDL": FILES, "ALL": every, "SENTENCE": [sentence]}


class Stage:
    """A working directory and one for temporary files, in which one of `WRITING` is run."""

    def __init__(self, name: str, folder: Path, said: dict[str, list[str]]) -> None:
        line, names = WRITING[name]
        self.names, self.work, self.tmp = names.split(), folder / "work", folder / "tmp"
        found = [said.get(word, [word.replace("_", " ")]) for word in line.split()]
        self.arguments = [word for words in found for word in words]
        for made in (self.work, self.tmp):
            made.mkdir(parents=True)

    def start(self, fault: Fault = lambda: None) -> Fork:
        """Run it under a fault that is made in its process."""

        def before() -> None:
            os.chdir(self.work)
            os.environ["TMPDIR"] = tempfile.tempdir = str(self.tmp)
            fault()

        return fork_command(*self.arguments, before=before)

    def succeeds(self) -> dict[str, bytes]:
        """What it writes if nothing disturbs it."""
        ended = self.start().join(300)
        assert ended.code == 0, ended
        return self.outputs()

    def outputs(self) -> dict[str, bytes]:
        """What its outputs hold, but for what differs from run to run."""
        paths = {name: self.work / name for name in self.names}
        return {name: normal(path.read_bytes()) for name, path in paths.items() if path.exists()}

    def others(self) -> set[str]:
        """All other files and folders."""
        roots = (self.work, self.tmp)
        found = {str(p.relative_to(root)) for root in roots for p in root.rglob("*")}
        return found - {*self.names}


def normal(data: bytes) -> bytes:
    """The content, without the seconds that work took."""
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    data = re.sub(rb"\d+ seconds of processor time", b"0 seconds", data)
    return re.sub(rb"\d+\.\d+( s)?(?=\D)", b"0.0", data)


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
        if isinstance(path, (str, bytes)) and self.folder in os.path.abspath(os.fsdecode(path)):
            self.change(needs_space=event != "os.rename")

    def change(self, *, needs_space: bool = True) -> None:
        self.left -= 1
        if self.left == 0 or (self.left < 0 and needs_space):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def ends(
    name: str, said: dict[str, list[str]], folder: Path, faults: Iterator[Fault]
) -> Iterator[int]:
    """The exit code of a command on old outputs under each fault; everything else is checked."""
    whole, mixed = Stage(name, folder / "whole", said).succeeds(), 0
    for number, fault in enumerate(faults):
        stage = Stage(name, folder / f"{number}", said)
        for output in stage.names:
            (stage.work / output).write_bytes(OLD)
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
                assert [*found] == stage.names
                assert OLD in found.values() or not found
                mixed += len({*found.values()}) > 1
                assert mixed <= 1, "not only where the second rename fails"
        yield ended.code


@pytest.mark.parametrize("name", [*QUICK[:2], *thorough(QUICK[2]), *SLOW])
def test_the_disk_is_full_at_every_change(
    name: str, said: dict[str, list[str]], tmp_path: Path
) -> None:
    faults = (FullDisk(number, tmp_path).begin for number in range(1, 1000))
    met = 0
    for code in ends(name, said, tmp_path, faults):
        if code == 0:
            break
        met += 1
    assert 3 <= met < 999


@pytest.mark.parametrize("name", [QUICK[0], *thorough(QUICK[2])])
def test_an_output_is_whole_or_none_at_every_length(
    name: str, said: dict[str, list[str]], tmp_path: Path
) -> None:
    once = Stage(name, tmp_path / "once", said)
    once.succeeds()
    most = max((once.work / output).stat().st_size for output in once.names)

    def at_most(size: int) -> Fault:
        return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    sizes = (at_most(most * number // 5) for number in range(5))
    assert sum(code != 0 for code in ends(name, said, tmp_path, sizes)) == 5


def test_domains_are_copied_whole_or_not_at_all(tmp_path: Path) -> None:
    """Two of them: neither is there without the other."""
    two = ("t-map", "three-cells")
    whole = {str(p.relative_to(DOMAINS)): p for name in two for p in DOMAINS.glob(f"{name}/*")}
    for number in range(1, 1000):
        folder = tmp_path / str(number)
        folder.mkdir()

        def copy(number: int = number, folder: Path = folder) -> None:
            FullDisk(number, folder).begin()
            try:
                copy_folders([DOMAINS / name for name in two], folder)
            except UsageError as error:
                sys.exit(2 if "written: No space left" in str(error) else 1)

        code = fork(copy).join().code
        found = {str(p.relative_to(folder)): p for p in folder.rglob("*")}
        if code == 0:
            break
        assert (code, found) == (2, {})
    assert found.keys() == whole.keys() | {*two}
    assert all(found[name].read_bytes() == whole[name].read_bytes() for name in whole)
    assert number > 2 * len(whole)  # each is opened and flushed


@pytest.mark.usefixtures("said")
def test_plans_write_nothing(tmp_path: Path) -> None:
    """Not even a temporary file: it has no folder, and no file may have a byte."""

    def before() -> None:
        os.environ["TMPDIR"] = tempfile.tempdir = str(tmp_path / "none")
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    files = files_of("grid", "corners-6x6")
    ended = fork_command("plans", *files, "--count", before=before).join()
    assert (ended.code, ended.out) == (0, "42252\n"), ended


# ---- kills

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: What a kill that nobody can hear may leave, beside an output and in the temporary directory:
#: there is also a file with which Python tries whether it can write to that directory.
LEFT = re.compile(r"[a-z0-9_]{8}|\.[^/]{1,16}\.[a-z0-9_]{8}|coordlang-[a-z0-9_]{8}(/.*)?|\.lock")


#: They write as others do.
ALIKE = ("ground", "understand", "choices", "inspect", "report", "check", "export", "verify")


@pytest.mark.parametrize("name", [*sorted({*WRITING} - {*ALIKE}), *thorough(*ALIKE)])
def test_kills(name: str, tmp_path: Path, said: dict[str, list[str]]) -> None:
    """A signal at a random moment, or when something in the folder changes."""
    stage, choice = Stage(name, tmp_path, said), random.Random(name)
    seen: set[tuple[str, bytes]] = set()
    for turn in range(2):
        number = SIGNALS[(turn + len(name)) % len(SIGNALS)]
        for output in stage.names:
            if choice.random() < 0.5:
                (stage.work / output).write_bytes(OLD)
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
    new = stage.succeeds()
    for output, held in seen:
        if b'"proved_minimal": false' in held:  # the best language at that moment
            assert json.loads(held)["guarantee"]["lower_bound"] <= 3
        else:
            assert held in (OLD, new[output]), (output, held[:300])


def test_two_processes_write_one_output(tmp_path: Path, said: dict[str, list[str]]) -> None:
    stage = Stage("tasks", tmp_path, said)
    both = [stage.start(), stage.start()]
    assert [process.join().code for process in both] == [0, 0]
    assert stage.others() == set()
    assert stage.outputs() == stage.succeeds()
