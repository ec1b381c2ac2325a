# SPDX-License-Identifier: GPL-3.0-or-later
"""Each fault ends with the documented exit code (docs/cli.md): 1 means *refuted*, nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.support.command import Command, in_shell
from tests.support.domains import DOMAINS

CELLS = [str(DOMAINS / "three-cells" / name) for name in ("domain.pddl", "problem.pddl")]
COUNT = ("plans", *CELLS, "--count")


@pytest.mark.parametrize(
    ("redirection", "arguments", "code"),
    [("2>&-", ("plans", "missing", "x"), 31), ("2>/dev/full", ("plans", "--missing"), 2)],
)
def test_without_stderr_an_error_keeps_its_code(
    redirection: str, arguments: tuple[str, ...], code: int
) -> None:
    done = in_shell(f"exec COORDLANG {redirection}", *arguments)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", "")


@pytest.mark.parametrize("redirection", [">/dev/full", ">/dev/full 2>/dev/full"])
def test_a_full_stdout(redirection: str) -> None:
    assert in_shell(f"exec COORDLANG {redirection}", *COUNT).returncode == 2


def test_an_answer_needs_no_stderr(tmp_path: Path) -> None:
    output = str(tmp_path / "l.json")
    build = ("build", *CELLS, "--unsolvable", "skip", "-o", output)
    done = in_shell("exec COORDLANG 2>/dev/full", *build)
    assert done.returncode == 0
    assert done.stdout.endswith(f"written to {output}\n")


def test_the_working_directory_is_removed(tmp_path: Path) -> None:
    gone = f"mkdir {tmp_path}/gone; cd {tmp_path}/gone; rmdir {tmp_path}/gone;"
    assert in_shell("exec COORDLANG", *COUNT, before=gone).stdout == "4\n"
    refused = in_shell("exec COORDLANG", "tasks", *CELLS, "-o", "t.json", before=gone)
    assert refused.returncode == 2
    assert "cannot be written: the working directory has been removed" in refused.stderr


@pytest.mark.parametrize("robots", [["r1", "r3"], ["r1"], ["a", "b"]])
@pytest.mark.parametrize("place", ["t-map", "three-cells"])
def test_robots_of_a_language_file_that_contradict_the_domain(
    place: str, robots: list[str], coordlang: Command, tmp_path: Path
) -> None:
    files = [DOMAINS / place / name for name in ("domain.pddl", "problem.pddl")]
    path = tmp_path / "l.json"
    assert coordlang("build", *files, "--method", "greedy", "-o", path).code == 0
    path.write_text(json.dumps(json.loads(path.read_text()) | {"robots": robots}))
    outcome = coordlang("verify", path, *files)
    assert outcome.code == 31, outcome.err
    assert "--robots" not in outcome.err
