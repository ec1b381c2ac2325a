# SPDX-License-Identifier: GPL-3.0-or-later
"""The lock of a folder of results is held by one process at most."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from coordlang.evaluation.lab.results import Results
from planners.errors import UsageError

#: Locks the folder, and stops just before the lock's file is removed until there is a file "go".
_STOPS_BEFORE_REMOVING = """
import sys, time
from pathlib import Path
from coordlang.evaluation.lab.results import Results

folder, remove = Path(sys.argv[1]), Path.unlink

def late(path, *arguments, **keywords):
    (folder / "removing").touch()
    while not (folder / "go").exists():
        time.sleep(0.005)
    remove(path, *arguments, **keywords)

Path.unlink = late
with Results(folder).locked():
    pass
"""
#: Locks the folder until its standard input ends; says whether it could.
_HOLDS = """
import sys
from pathlib import Path
from coordlang.evaluation.lab.results import Results
from planners.errors import UsageError

try:
    with Results(Path(sys.argv[1])).locked():
        print("held", flush=True)
        sys.stdin.read()
except UsageError:
    print("refused", flush=True)
"""
#: Locks the folder again and again; while it does, a file of its own must be the only one.
_TAKES_TURNS = """
import sys, time
from pathlib import Path
from coordlang.evaluation.lab.results import Results
from planners.errors import UsageError

folder, held = Path(sys.argv[1]), 0
end = time.monotonic() + float(sys.argv[2])
while time.monotonic() < end:
    try:
        with Results(folder).locked():
            (folder / "holder").touch(exist_ok=False)
            (folder / "holder").unlink()
            held += 1
    except UsageError:
        pass
print(held)
"""


def python(code: str, *arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_no_two_hold_it_while_a_third_gives_it_back(tmp_path: Path) -> None:
    """A lock that is given up first and removed then is locked by one and removed under it."""
    first = python(_STOPS_BEFORE_REMOVING, tmp_path)
    while not (tmp_path / "removing").exists():
        assert first.poll() is None, first.communicate()
        time.sleep(0.005)
    second = python(_HOLDS, tmp_path)
    assert second.stdout is not None
    answer = second.stdout.readline()
    (tmp_path / "go").touch()
    first.communicate(timeout=60)
    third = python(_HOLDS, tmp_path)
    out, _ = third.communicate(timeout=60)  # its input has ended: it holds the lock for a moment
    second.communicate(timeout=60)
    assert [answer, out].count("held\n") == 1
    assert not (tmp_path / ".lock").exists()


def test_processes_take_turns(tmp_path: Path) -> None:
    processes = [python(_TAKES_TURNS, tmp_path, 1.0) for _ in range(3)]
    ended = [process.communicate(timeout=60) for process in processes]
    assert [error for _, error in ended] == ["", "", ""]
    assert sum(int(out) for out, _ in ended) > 10


def test_the_lock_of_a_process_that_was_killed_is_free(tmp_path: Path) -> None:
    process = python(_HOLDS, tmp_path)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    with pytest.raises(UsageError, match="another run"), Results(tmp_path).locked():
        pass
    process.kill()
    process.communicate()
    assert (tmp_path / ".lock").exists()
    with Results(tmp_path).locked():
        pass
    assert not (tmp_path / ".lock").exists()
