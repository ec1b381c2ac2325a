# SPDX-License-Identifier: GPL-3.0-or-later
"""Odd surroundings, and faults of the streams: the documented exit code (docs/cli.md)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from tests.support.command import in_shell, own_process
from tests.support.domains import DOMAINS, ROOT
from tests.support.forks import fork_command

CELLS = [str(DOMAINS / "three-cells" / name) for name in ("domain.pddl", "problem.pddl")]
COUNT = ("plans", *CELLS, "--count")
BUILD = ("build", *CELLS, "--method", "minimal", "-o", "-")


@pytest.mark.parametrize(
    ("redirection", "arguments", "code", "said"),
    [
        # Without stderr an error keeps its code.
        ("2>&-", ("plans", "missing", "x"), 31, ""),
        ("2>/dev/full", ("plans", "--missing"), 2, ""),
        (">/dev/full 2>/dev/full", COUNT, 2, ""),
        ("2>/dev/full >/dev/null", BUILD, 0, ""),  # an answer needs no stderr
        (">/dev/full", COUNT, 2, "coordlang: the output cannot be written"),
        (">&-", COUNT, 2, "coordlang: stdout is closed"),
        (">&-", BUILD, 2, "coordlang: stdout is closed"),
        ("<&-", ("plans", "-", CELLS[1]), 31, "coordlang: -: cannot be read: stdin is closed"),
        ("<&-", ("verify", "-", *CELLS), 31, "coordlang: -: cannot be read: stdin is closed"),
    ],
)
def test_streams_that_are_closed_or_full(
    redirection: str, arguments: tuple[str, ...], code: int, said: str
) -> None:
    done = in_shell(f"exec COORDLANG {redirection}", *arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith(said)
    assert bool(done.stderr) == bool(said)


def test_the_working_directory_is_removed(tmp_path: Path) -> None:
    gone = f"mkdir {tmp_path}/gone; cd {tmp_path}/gone; rmdir {tmp_path}/gone;"
    assert in_shell("exec COORDLANG", *COUNT, before=gone).stdout == "4\n"
    refused = in_shell("exec COORDLANG", "tasks", *CELLS, "-o", "t.json", before=gone)
    assert refused.returncode == 2
    assert "cannot be written: the working directory has been removed" in refused.stderr


UNICODE = "ünïcödé"


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        (UNICODE, {}),
        *((name, None) for name in ("two words", "two\nlines", "-o", "--help", "'\"$(x)`*")),
        (UNICODE, {"HOME": None}),
        (UNICODE, {"HOME": "/no/such/home"}),
        (UNICODE, {"TMPDIR": "/no/such/folder"}),
    ],
)
def test_names_of_files_and_the_environment(
    name: str, changes: dict[str, str | None] | None, tmp_path: Path
) -> None:
    """All files have names that begin with ``name``."""
    domain, problem, language, page = (f"{name}{end}" for end in (".d", ".p", ".json", ".html"))
    shutil.copy(DOMAINS / "grid" / "domain.pddl", tmp_path / domain)
    shutil.copy(DOMAINS / "grid" / "gw1-2x2.pddl", tmp_path / problem)

    def before() -> None:
        os.chdir(tmp_path)
        tempfile.tempdir = None
        for variable, value in (changes or {}).items():
            os.environ.pop(variable, None)
            os.environ |= {} if value is None else {variable: value}

    for arguments in (
        ("build", f"--output={language}", "--", domain, problem),
        ("verify", "--", language, domain, problem),
        ("report", f"--output={page}", "--", language, domain, problem),
    ):
        assert fork_command(*arguments, before=before).join().code == 0
    if changes == {}:  # nor does any need a locale
        bare = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
        done = subprocess.run(own_process(*arguments), cwd=tmp_path, env={**os.environ, **bare})
        assert done.returncode == 0
    found = {path.name for path in tmp_path.iterdir()}
    assert found == {domain, problem, language, page}


@pytest.mark.parametrize(
    "system", ["sys.platform = 'win32'", "sys.modules['resource'] = sys.modules['fcntl'] = None"]
)
@pytest.mark.parametrize(
    ("program", "code", "before"),
    [
        ("from coordlang.__main__ import main; main()", 32, "coordlang: "),
        ("import coordlang; coordlang.plans('d.pddl', 'p.pddl')", 1, "OSError: "),
    ],
)
def test_a_system_without_posix_limits_is_refused(
    system: str, program: str, code: int, before: str
) -> None:
    """One clear message, no ImportError."""
    command = [sys.executable, "-c", f"import sys; {system}; {program}"]
    env = dict(os.environ, PYTHONPATH=str(ROOT))
    done = subprocess.run(command, env=env, text=True, capture_output=True)
    assert (done.returncode, done.stdout) == (code, "")
    assert f"{before}coordlang runs on Linux and macOS, not on this system" in done.stderr
    assert "\n  On Windows use WSL" in done.stderr
    assert not {"ImportError", "ModuleNotFoundError"} & {*done.stderr.replace(":", " ").split()}
