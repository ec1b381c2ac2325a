# SPDX-License-Identifier: GPL-3.0-or-later
"""Outputs: names, permissions and pipes; a language and its certificate belong together."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable
from functools import partial
from itertools import chain
from pathlib import Path
from unittest.mock import Mock

import pytest

from coordlang.commands.building import Built
from coordlang.language import file
from coordlang.language.file import read_language
from coordlang.language.words import Language
from coordlang.verification.certificate_file import read_certificate
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.minimal import MinimalSearch
from planners.system.errors import OutOfTime
from planners.system.writing import write_atomically
from tests.support.command import Command, in_shell
from tests.support.domains import DOMAINS
from tests.support.forks import fork_command

CELLS = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]
BUILD = ("build", *CELLS, "--method", "minimal")
#: The longest name of a file.
NAME_MAX = os.pathconf("/", "PC_NAME_MAX")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("letter", ["x", "\N{LATIN SMALL LETTER E WITH ACUTE}", "\N{ROBOT FACE}"])
def test_names_of_every_length_are_written(letter: str, here: Path) -> None:
    for less in range(4):
        name = letter * ((NAME_MAX - less) // len(letter.encode()))
        write_atomically(name, b"new")
        assert os.listdir() == [name]
        assert Path(name).read_bytes() == b"new"
        Path(name).unlink()


def test_process_substitution_and_pipes_are_written_to(here: Path) -> None:
    done = in_shell("COORDLANG -o >(cat > got.json; echo done > end) && while [ ! -e end ]; do "
                  "sleep 0.1; done", "tasks", *CELLS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert '"coordlang/tasks"' in Path("got.json").read_text()
    piped = in_shell("COORDLANG -o /dev/stdout | cat", "tasks", *CELLS)
    assert piped.returncode == 0
    assert piped.stdout.startswith(Path("got.json").read_text())
    gone = in_shell("COORDLANG -o /dev/stdout | true", "tasks", *CELLS)
    assert (gone.returncode, gone.stderr) == (141, "")


def test_data_is_on_the_disk_before_the_name_is(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []

    def noted(name: str, real: Callable[..., None], *given: object) -> None:
        done.append(name)
        real(*given)

    for name in ("fsync", "replace"):
        monkeypatch.setattr(os, name, partial(noted, name, getattr(os, name)))
    write_atomically("x", b"new")
    assert done == ["fsync", "replace"]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666, 0o755])
def test_a_file_that_is_replaced_keeps_its_permissions(
    mode: int, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And a new one has those of every new file; the mask of the process is never touched."""
    path = Path("kept")
    path.touch()
    path.chmod(mode)
    before = os.umask(0o077)
    try:
        with monkeypatch.context() as patched:
            patched.setattr("os.umask", lambda _: pytest.fail("other threads see it"))
            write_atomically(path, b"new")
            write_atomically("made", b"new")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == mode
    assert Path("made").stat().st_mode & 0o777 == 0o600
    assert len(list(here.iterdir())) == 2


# A language and its certificate

#: What stands there before.
OLD = {"l.json": "old language", "c.json": "old certificate"}
PAIR = ("-o", "l.json", "--certificate", "c.json")


@pytest.fixture
def old_pair(here: Path) -> Path:
    for name, text in OLD.items():
        Path(name).write_text(text)
    return here


def _pair(folder: Path) -> str:
    """Which pair stands there: old, new, or a language alone."""
    texts = {p.name: p.read_text() for p in folder.iterdir() if not p.name.startswith(".")}
    if texts == OLD:
        return "old"
    if texts == {"l.json": OLD["l.json"]}:
        return "old, alone"
    assert read_language(folder / "l.json").guarantee.proved_minimal
    if texts.keys() == {"l.json"}:
        return "new, alone"
    assert texts.keys() == OLD.keys()
    assert read_certificate(folder / "c.json").refuted >= 1
    return "new"


def test_a_pair_is_written_together(
    coordlang: Command, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another command writes to the same file while this one works out its certificate."""
    own = Built.certificate

    def meanwhile(built: Built) -> object:
        write_atomically("l.json", b"a language of others")
        return own(built)

    monkeypatch.setattr(Built, "certificate", meanwhile)
    assert coordlang(*BUILD, *PAIR).code == 0
    verified = coordlang("verify", "l.json", *CELLS, "--certificate", "c.json")
    assert verified.code == 0, verified.err


@pytest.mark.parametrize(
    ("error", "code"), [(KeyboardInterrupt(), 130), (MemoryError(), 3), (OutOfTime("late"), 3)]
)
def test_work_that_is_stopped_leaves_no_old_certificate(
    error: BaseException,
    code: int,
    coordlang: Command,
    old_pair: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """First the work on the certificate, then the search: its place takes that of the bound."""
    decide = MinimalSearch.decide

    def late(search: MinimalSearch, size: int, budget: Budget) -> bool:
        if size > 1:  # that one word is not enough is known
            raise error
        return decide(search, size, budget)

    with monkeypatch.context() as patched:
        patched.setattr(Built, "certificate", Mock(side_effect=error))
        outcome = coordlang(*BUILD, *PAIR)
    assert (_pair(old_pair), outcome.code) == ("new, alone", code)
    end = "it is verified{}; no certificate is written\n"
    assert code == 3 or outcome.err == (
        "coordlang: interrupted; the language is written to l.json: "
        + end.format(" and proved minimal")
    )
    if isinstance(error, MemoryError):
        return
    Path("c.json").write_text("old certificate")
    monkeypatch.setattr(MinimalSearch, "decide", late)
    tasks = [DOMAINS / "grid" / name for name in ("domain.pddl", "gw2-2x3.pddl")]
    outcome = coordlang("build", *tasks, "--tasks", "all", "--method", "minimal", *PAIR)
    assert outcome.code == code
    guarantee = read_language(old_pair / "l.json").guarantee
    assert (guarantee.lower_bound, guarantee.proved_minimal) == (2, False)
    assert sorted(os.listdir()) == (["c.json", "l.json"] if code == 3 else ["l.json"])
    assert end.format("") in outcome.err if code == 130 else read_certificate("c.json").refuted == 1


#: The last rename (the old certificate goes aside, the language, the certificate) comes, or ends
#: the command before it: what stands there if the command is killed then.  If it is interrupted,
#: all is written.  `test_broken_writing` fills the disk there.
LAST = {
    (1, False): "old",
    (1, True): "old, alone",
    (2, False): "old, alone",
    (2, True): "new, alone",
    (3, False): "new, alone",
    (3, True): "new",
}


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize(("at", "comes"), LAST)
def test_every_rename_may_be_the_last_one(
    number: signal.Signals, at: int, comes: bool, old_pair: Path
) -> None:
    replace, calls = os.replace, 0

    def ending(source: str, target: str) -> None:
        nonlocal calls
        calls += 1
        if calls == at and not comes:
            os.kill(os.getpid(), number)
        replace(source, target)
        if calls == at and comes:
            os.kill(os.getpid(), number)

    ended = fork_command(*BUILD, *PAIR, before=partial(setattr, os, "replace", ending)).join()
    if number == signal.SIGKILL:
        assert (ended.code, _pair(old_pair)) == (-number, LAST[at, comes])
        return
    assert (ended.code, _pair(old_pair)) == (130, "new")
    assert sorted(os.listdir()) == sorted(OLD)
    said = "the language is written to l.json: it is verified and proved minimal; and so is its"
    assert f"{said} certificate" in ended.err


def test_an_interrupt_of_a_full_disk_says_of_no_language_that_it_is_written(old_pair: Path) -> None:
    def fail(_source: str, _target: str) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    ended = fork_command(*BUILD, *PAIR, before=partial(setattr, os, "replace", fail)).join()
    assert (ended.code, _pair(old_pair)) == (130, "old")
    assert ended.err.strip() == "coordlang: interrupted"


@pytest.mark.parametrize("device", ["-o", "--certificate"])
def test_signals_are_heard_while_a_pipe_is_written_to(device: str, here: Path) -> None:
    """A language that goes into a file waits for no pipe, and is lost by no interrupt."""
    made = file.to_bytes

    def interrupted(language: Language) -> bytes:
        os.kill(os.getpid(), signal.SIGINT)
        return made(language)

    before = partial(setattr, file, "to_bytes", interrupted)
    places = {"-o": "l.json", "--certificate": "c.json", device: "/dev/null"}
    ended = fork_command(*BUILD, *chain(*places.items()), before=before).join()
    assert ended.code == 130
    assert os.listdir() == ([] if device == "-o" else ["l.json"])
    assert ("; the language is written to l.json" in ended.err) == (device == "--certificate")
