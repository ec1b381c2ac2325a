# SPDX-License-Identifier: GPL-3.0-or-later
"""Full disks and answers that are cut off: the right answer or an error, and never another one."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import coordlang
from coordlang.commands.main import run
from tests.support.domains import DOMAINS
from tests.support.forks import fork_command

GRID = DOMAINS / "grid"
GW1 = (GRID / "domain.pddl", GRID / "gw1-2x2.pddl")
GW4 = (GRID / "domain.pddl", GRID / "gw4-3x3.pddl")
MINIMAL = ("--tasks", "all", "--method", "minimal")
#: No file may be longer, in bytes.
QUICK, ALL = (0, 1, 700, 1866, 4096), range(4097)


@pytest.fixture(scope="module")
def language(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What ``build`` writes on an empty disk; all libraries are loaded then."""
    path = tmp_path_factory.mktemp("whole") / "l.json"
    assert run(["build", *map(str, GW1), *MINIMAL, "-o", str(path)]) == 0
    assert coordlang.plans(*GW4).count == 18
    return path.read_bytes()


def at_most(size: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


@pytest.fixture
def full_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a file system of 40 kB without a free byte."""
    folder = tmp_path / "full"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=40k", "tmpfs", folder], capture_output=True, text=True
    )
    if mounted.returncode != 0:
        pytest.skip(f"no file system can be mounted: {mounted.stderr.strip()}")
    try:
        with open(folder / "fill", "wb", 0) as file, suppress(OSError):
            while True:
                file.write(b"x" * 4096)
        assert os.statvfs(folder).f_bfree == 0
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


@pytest.mark.usefixtures("language")
@pytest.mark.parametrize(("problem", "count"), [("corners-10x10", 1_756_863_020), ("gw4-3x3", 18)])
def test_plans_need_no_temporary_directory(problem: str, count: int, full_disk: Path) -> None:
    ended = fork_command(
        *("plans", GRID / "domain.pddl", GRID / f"{problem}.pddl", "--count"),
        before=lambda: temporary(full_disk),
    ).join()
    assert (ended.code, ended.out) == (0, f"{count}\n"), ended


def temporary(folder: Path) -> None:
    os.environ["TMPDIR"] = str(folder)
    tempfile.tempdir = None


def count_plans(sizes: Iterator[int]) -> int:
    number = 0
    for size in sizes:
        number += 1
        ended = fork_command("plans", *GW4, "--count", before=at_most(size)).join()
        assert (ended.code, ended.out) == (0, "18\n"), (size, ended)
    return number


@pytest.mark.usefixtures("language")
def test_plans_are_counted_whatever_is_cut_off() -> None:
    assert count_plans(iter(QUICK)) == len(QUICK)


@pytest.mark.slow
@pytest.mark.usefixtures("language")
def test_plans_are_counted_whatever_is_cut_off_at_every_length() -> None:
    assert count_plans(iter(ALL)) == 4097


def content(language: bytes) -> dict[str, Any]:
    return {k: v for k, v in json.loads(language).items() if k != "producer"}


def build(sizes: Iterator[int], language: bytes, folder: Path) -> dict[int, int]:
    """How often each exit code was met."""
    folder /= "work"
    folder.mkdir()
    path, codes = folder / "l.json", {0: 0, 2: 0}
    for size in sizes:
        ended = fork_command("build", *GW1, *MINIMAL, "-o", path, before=at_most(size)).join()
        codes[ended.code] += 1
        if ended.code == 0:
            assert content(path.read_bytes()) == content(language)
            path.unlink()
        else:
            assert (
                size < len(language) + 500
            )  # its producer names the file, and the seconds it took
            assert ended.err.startswith(f"coordlang: {path} cannot be written: File too large\n")
        assert list(folder.iterdir()) == []
    return codes


def test_a_language_is_whole_or_none(language: bytes, tmp_path: Path) -> None:
    codes = build(iter((*QUICK, len(language) - 200, len(language) + 500)), language, tmp_path)
    assert all(codes.values())


@pytest.mark.slow
def test_a_language_is_whole_or_none_at_every_length(language: bytes, tmp_path: Path) -> None:
    codes = build(iter(ALL), language, tmp_path)
    print(codes)
    assert codes[0] > 1000
    assert codes[2] > 1000
