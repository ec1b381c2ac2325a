# SPDX-License-Identifier: GPL-3.0-or-later
"""How commands end: signals at any moment, closed streams, odd names and surroundings."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from pathlib import Path
from types import FrameType
from typing import Any, get_args

import numpy as np
import pysolvers
import pytest

from coordlang.lifted.learning import simplest_hitting
from planners.search.sat import SolverName, sat_solver, solve_slice
from planners.system.errors import OutOfTime
from planners.system.limits import time_left, time_limit
from planners.system.signals import ENDING, Interrupted, Interruptions, postponed_signals
from planners.system.writing import write_atomically
from tests.support import thorough
from tests.support.command import in_shell, own_process
from tests.support.domains import DOMAINS, ROOT, files_of
from tests.support.forks import fork, fork_command

FILES = [str(DOMAINS / "grid" / name) for name in ("domain.pddl", "gw1-2x2.pddl")]
#: Runs the command line, and sends itself a signal when a module of this name is imported, or the
#: first module of all.
_AT_IMPORT = """
import os, signal, sys

signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)
number, at = int(sys.argv[1]), sys.argv[2]
sys.argv[1:] = sys.argv[3:]

class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if at in (name, "first"):
            os.kill(os.getpid(), number)

from coordlang.__main__ import main
sys.meta_path.insert(0, Finder)
main()
"""
#: Before the first line of `coordlang.__main__` it is Python that hears the signal.
_MODULES = ("first", "click", "coordlang.commands.main", "numpy", "tarski", "clingo")


@pytest.mark.parametrize("module", _MODULES)
def test_signals_while_modules_are_imported(module: str) -> None:
    number = ENDING[_MODULES.index(module) % len(ENDING)]
    program = [sys.executable, "-c", _AT_IMPORT, str(number), module, "plans", *FILES, "--count"]
    ended = subprocess.run(program, capture_output=True, text=True)
    assert "Traceback" not in ended.stderr
    assert ended.returncode == 128 + number


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
        (
            "import signal\nfrom planners.system.limits import time_limit\n"
            "try:\n  with time_limit(100):\n    try: signal.raise_signal(14)\n    except Exception: 1 / 0\n"
            "except Exception as end: print(type(end).__name__)",
            "OutOfTime\n",
        ),
    ],
    ids=["what is ignored stays so", "what a finalizer lost", "what a library made an error of"],
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

    with pytest.raises(Interrupted, match="SIGINT"):
        work()
    assert steps == ["not disturbed", "cleaned up"]
    with pytest.raises(Interrupted):
        signal.raise_signal(signal.SIGTERM)


# ---- SAT solvers

OURS: tuple[SolverName, ...] = ("cadical153", "glucose42", "maplesat")


@pytest.mark.parametrize("solver", get_args(SolverName))
def test_a_time_limit_is_heard_after_a_solver(solver: SolverName) -> None:
    """MapleChrono, which is not in use, sets an alarm and a handler below Python's."""
    php = [[6 * p + h + 1 for h in range(6)] for p in range(7)]
    php += [[-a, -b] for h in zip(*php, strict=True) for a, b in combinations(h, 2)]

    def work() -> None:
        with time_limit(100), sat_solver(solver, php) as sat:
            assert solve_slice(sat, 10_000_000) is False
            assert 50 < time_left() <= 100
            with pytest.raises(OutOfTime):
                signal.raise_signal(signal.SIGALRM)
        assert time_left() == float("inf")

    ended = fork(work).join()
    assert ended.code == 0, ended


def called(solver: str, what: str) -> str:
    """The function of python-sat's extension that does something with a solver."""
    return f"{'glucose421' if solver == 'glucose42' else solver}_{what}"


def lightest() -> None:
    """What is made of solvers: the set of least weight that hits others."""
    assert simplest_hitting([np.array([True, True, False])], np.array([2, 1, 1])) == [1]


def own(solver: SolverName) -> None:
    with sat_solver(solver, [[1, 2], [-1, 3], [-1, -3, 4]]) as sat:
        assert solve_slice(sat, 10) is True
        assert solve_slice(sat, 10, [1, -4]) is False


#: Work by the solver that does it.
WORK: dict[str, Callable[[], None]] = {solver: partial(own, solver) for solver in OURS}
WORK["minisat22"] = lightest


@pytest.mark.parametrize(
    ("number", "said"),
    [(signal.SIGINT, "Interrupted: SIGINT"), (signal.SIGALRM, "OutOfTime: the time limit of")],
)
@pytest.mark.parametrize("solver", WORK)
def test_a_solver_is_freed_once(
    solver: str, number: signal.Signals, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The signal comes when the solver has been freed, and python-sat has not noted it yet."""
    free = getattr(pysolvers, called(solver, "del"))

    def freed(*arguments: object) -> None:
        free(*arguments)
        signal.raise_signal(number)

    def work() -> None:
        Interruptions()
        with time_limit(100):
            monkeypatch.setattr(pysolvers, called(solver, "del"), freed)
            WORK[solver]()

    ended = fork(work).join()
    assert (ended.code, said in ended.err) == (70, True), ended


@pytest.mark.parametrize("solver", WORK)
def test_no_solver_is_left_by_longjmp(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of its arguments says whether it takes SIGINT."""
    given = []
    real = getattr(pysolvers, called(solver, "solve_lim"))

    def noted(*arguments: object) -> object:
        given.append(arguments[2])
        return real(*arguments)

    monkeypatch.setattr(pysolvers, called(solver, "solve_lim"), noted)
    WORK[solver]()
    assert given
    assert given == [0] * (2 if solver in OURS else len(given))


# ---- streams, names and surroundings

CELLS = [str(DOMAINS / "three-cells" / name) for name in ("domain.pddl", "problem.pddl")]
COUNT = ("plans", *CELLS, "--count")
BUILD = ("build", *CELLS, "--method", "minimal", "-o", "-")
MANY = ("plans", *map(str, files_of("grid", "corners-5x5")), "--max", "1000")


@pytest.mark.parametrize(
    ("redirection", "arguments", "code", "said"),
    [
        # Without stderr an error keeps its code.
        ("2>&-", ("plans", "missing", "x"), 31, ""),
        ("2>/dev/full", ("plans", "--missing"), 2, ""),
        (">/dev/full 2>/dev/full", COUNT, 2, ""),
        ("2>/dev/full >/dev/null", BUILD, 0, ""),  # an answer needs no stderr
        (">/dev/full", COUNT, 2, "coordlang: the output cannot be written"),
        ("| (read -n 1)", MANY, 141, ""),  # it goes in the middle of a write
        (">&-", COUNT, 2, "coordlang: stdout is closed"),
        (">&-", BUILD, 2, "coordlang: stdout is closed"),
        ("<&-", ("plans", "-", CELLS[1]), 31, "coordlang: -: cannot be read: stdin is closed"),
        ("<&-", ("verify", "-", *CELLS), 31, "coordlang: -: cannot be read: stdin is closed"),
    ],
)
def test_streams_that_are_closed_or_full(
    redirection: str, arguments: tuple[str, ...], code: int, said: str
) -> None:
    done = in_shell(f"PYTHONUNBUFFERED=1 exec COORDLANG {redirection}", *arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith(said)
    assert bool(done.stderr) == bool(said)


def test_the_working_directory_is_removed(tmp_path: Path) -> None:
    gone = f"mkdir {tmp_path}/gone; cd {tmp_path}/gone; rmdir {tmp_path}/gone;"
    assert in_shell("exec COORDLANG", *COUNT, before=gone).stdout == "4\n"
    refused = in_shell("exec COORDLANG", "tasks", *CELLS, "-o", "t.json", before=gone)
    assert refused.returncode == 2
    assert "cannot be written: the working directory has been removed" in refused.stderr


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        *((name, None) for name in ("two\nlines", "--help", "'\"$(x)`*")),
        *(("ünïcö", new) for new in ({}, {"HOME": None})),
        *thorough(("two words", {"HOME": "/no/home"}), ("-o", {"TMPDIR": "/no"})),
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
    assert {*os.listdir(tmp_path)} == {domain, problem, language, page}


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
    assert f"{before}coordlang runs on Linux, not on this system" in done.stderr
    assert "\n  On Windows use WSL" in done.stderr
    assert not {"ImportError", "ModuleNotFoundError"} & {*done.stderr.replace(":", " ").split()}
