# SPDX-License-Identifier: GPL-3.0-or-later
"""Outputs: known to be unwritable before the work; a language and its certificate belong together."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from coordlang.commands.built import Built
from coordlang.language.file import read_language
from coordlang.verification.certificate_file import read_certificate
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.minimal import MinimalSearch
from planners.system.errors import OutOfTime, UsageError
from planners.system.writing import write_atomically
from tests.support.command import Command, in_shell
from tests.support.domains import DOMAINS
from tests.support.forks import fork_command

CELLS = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]
BUILD = ("build", *CELLS, "--method", "minimal")
#: The longest name of a file.
NAME_MAX = os.pathconf("/", "PC_NAME_MAX")


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coordlang.commands.inputs.read_domain", lambda *_: pytest.fail("no work"))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("output", "reason"),
    [
        ("", "its name is empty"),
        ("newdir/", "this names a folder, and there is none"),
        ("newdir/.", "this names a folder, and there is none"),
        ("plan/", "this names a folder, and there is none"),
        ("x" * (NAME_MAX + 1), "File name too long"),
        ("loop", "Too many levels of symbolic links"),
        ("readonly", "the file is read-only"),
        ("link-to-readonly", "the file is read-only"),
    ],
)
@pytest.mark.parametrize(
    "command",
    [
        (*BUILD, "-o"),
        (*BUILD, "-o", "l.json", "--certificate"),
        ("tasks", *CELLS, "-o"),
    ],
    ids=["build", "certificate", "tasks"],
)
def test_what_cannot_be_written_is_refused_before_the_work(
    command: tuple[object, ...],
    output: str,
    reason: str,
    coordlang: Command,
    here: Path,
    no_work: None,
) -> None:
    Path("plan").write_text("")
    Path("loop").symlink_to("loop")
    Path("readonly").write_text("precious")
    Path("readonly").chmod(0o444)
    Path("link-to-readonly").symlink_to("readonly")
    before = sorted(here.rglob("*"))
    outcome = coordlang(*command, output)
    assert (outcome.code, outcome.out) == (2, "")
    assert f"{command[-1]} {output} cannot be written: {reason}\n  Name a file" in outcome.err
    assert sorted(here.rglob("*")) == before
    assert Path("readonly").read_text() == "precious"


@pytest.mark.parametrize("output", ["", "x" * (NAME_MAX + 1)])
def test_a_folder_that_cannot_be_made_is_refused_before_the_work(
    output: str, coordlang: Command, language: Path, here: Path, no_work: None
) -> None:
    for command in (
        ("export", language, *CELLS, "w0", "-o"),
        ("inspect", *CELLS, "--write"),
        ("domains", "--copy", "grid"),
    ):
        outcome = coordlang(*command, output)
        assert (outcome.code, outcome.out) == (2, "")
        assert "cannot be written" in outcome.err
    assert list(here.iterdir()) == [language]


@pytest.mark.parametrize("path", ["", "newdir/", "readonly", "x" * (NAME_MAX + 1)])
def test_python_refuses_the_same(path: str, here: Path) -> None:
    Path("readonly").touch(0o444)
    with pytest.raises(UsageError, match="cannot be written"):
        write_atomically(path, b"new")
    assert list(here.iterdir()) == [here / "readonly"]
    assert Path("readonly").read_bytes() == b""


@pytest.mark.parametrize("letter", ["x", "\N{LATIN SMALL LETTER E WITH ACUTE}", "\N{ROBOT FACE}"])
@pytest.mark.parametrize("less", range(4))
def test_names_of_every_length_are_written(letter: str, less: int, here: Path) -> None:
    name = letter * ((NAME_MAX - less) // len(letter.encode()))
    write_atomically(name, b"new")
    assert os.listdir() == [name]
    assert Path(name).read_bytes() == b"new"


def test_process_substitution_and_pipes_are_written_to(here: Path) -> None:
    done = in_shell("COORDLANG -o >(cat > got.json; echo done > end) && while [ ! -e end ]; do "
                  "sleep 0.1; done", "tasks", *CELLS)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert '"coordlang/tasks"' in Path("got.json").read_text()
    piped = in_shell("COORDLANG -o /dev/stdout | cat", "tasks", *CELLS)
    assert piped.returncode == 0
    assert piped.stdout.startswith(Path("got.json").read_text())


def test_a_pipe_whose_reader_has_gone(here: Path) -> None:
    done = in_shell("COORDLANG -o /dev/stdout | true", "tasks", *CELLS)
    assert done.returncode == 141, done.stderr
    assert done.stderr == ""


def test_data_is_on_the_disk_before_the_name_is(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    sync, replace = os.fsync, os.replace

    def synced(file: int) -> None:
        done.append("fsync")
        sync(file)

    def replaced(source: str, target: str) -> None:
        done.append("replace")
        replace(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    write_atomically("x", b"new")
    assert done == ["fsync", "replace"]


@pytest.mark.parametrize("step", ["fsync", "replace", "fchmod"])
def test_a_file_that_cannot_be_written_stays_as_it_was(
    step: str, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("x").write_text("old")
    Path("c").write_text("its certificate")
    monkeypatch.setattr(os, step, _failing)
    with pytest.raises(UsageError, match="x cannot be written: No space left on device"):
        write_atomically("x", b"new", outdated="c")
    monkeypatch.undo()
    os.chdir(here)
    assert {p.name: p.read_text() for p in here.iterdir()} == {"x": "old", "c": "its certificate"}


def _failing(*_: object) -> None:
    raise OSError(28, os.strerror(28))


#: What stands there before: a language and its certificate.
OLD = {"l.json": "old language", "c.json": "old certificate"}
PAIR = ("-o", "l.json", "--certificate", "c.json")


@pytest.fixture
def old_pair(here: Path) -> Path:
    for name, text in OLD.items():
        Path(name).write_text(text)
    return here


def _pair(folder: Path) -> str:
    """Which pair stands there: old, new, or a new language alone."""
    names = {path.name for path in folder.iterdir() if not path.name.startswith(".")}
    texts = {name: (folder / name).read_text() for name in names}
    if texts == OLD:
        return "old"
    if texts == {"l.json": OLD["l.json"]}:
        return "old, alone"
    assert read_language(folder / "l.json").guarantee.proved_minimal
    if names == {"l.json"}:
        return "new, alone"
    assert names == {"l.json", "c.json"}
    assert read_certificate(folder / "c.json").refuted >= 1
    return "new"


def test_a_new_pair_replaces_the_old_one(coordlang: Command, old_pair: Path) -> None:
    assert coordlang(*BUILD, *PAIR).code == 0
    assert _pair(old_pair) == "new"
    assert sorted(os.listdir()) == ["c.json", "l.json"]


@pytest.mark.parametrize("limit", [KeyboardInterrupt, MemoryError])
def test_a_certificate_that_is_not_made_leaves_no_old_one(
    limit: type[BaseException],
    coordlang: Command,
    old_pair: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stop(_: object) -> None:
        raise limit

    monkeypatch.setattr(Built, "certificate", stop)
    outcome = coordlang(*BUILD, *PAIR)
    assert _pair(old_pair) == "new, alone"
    if limit is KeyboardInterrupt:
        assert outcome.code == 130
        assert outcome.err == (
            "coordlang: interrupted; the language is written to l.json: it is verified and proved "
            "minimal; no certificate is written\n"
        )
    else:
        assert outcome.code == 3


@pytest.mark.parametrize(("error", "code"), [(OutOfTime("late"), 3), (KeyboardInterrupt(), 130)])
def test_a_search_that_is_stopped_leaves_no_old_certificate(
    error: BaseException,
    code: int,
    coordlang: Command,
    old_pair: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In place of the old certificate is that of the bound that was proved."""

    decide = MinimalSearch.decide

    def late(search: MinimalSearch, size: int, budget: Budget) -> bool:
        if size > 1:  # that one word is not enough is known
            raise error
        return decide(search, size, budget)

    monkeypatch.setattr(MinimalSearch, "decide", late)
    tasks = [DOMAINS / "grid" / name for name in ("domain.pddl", "gw2-2x3.pddl")]
    arguments = "--tasks", "all", "--method", "minimal"
    outcome = coordlang("build", *tasks, *arguments, *PAIR)
    assert outcome.code == code
    guarantee = read_language(old_pair / "l.json").guarantee
    assert (guarantee.lower_bound, guarantee.proved_minimal) == (2, False)
    if code == 130:
        assert "it is verified; no certificate is written\n" in outcome.err
        assert os.listdir() == ["l.json"]
    else:
        assert sorted(os.listdir()) == ["c.json", "l.json"]
        assert read_certificate("c.json").refuted == 1


@pytest.mark.parametrize("at", range(1, 4))
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
@pytest.mark.parametrize("after", [False, True])
def test_every_rename_may_be_the_last_one(
    at: int,
    error: type[BaseException],
    after: bool,
    coordlang: Command,
    old_pair: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Renames: the old certificate goes aside, the language, the certificate."""
    replace, calls = os.replace, 0

    def ending(source: str, target: str) -> None:
        nonlocal calls
        calls += 1
        if calls == at and not after:
            raise error(28, os.strerror(28))
        replace(source, target)
        if calls == at:
            raise error(28, os.strerror(28))

    monkeypatch.setattr(os, "replace", ending)
    outcome = coordlang(*BUILD, *PAIR)
    pair = _pair(old_pair)
    assert sorted(os.listdir()) == sorted({"old": OLD, "new": OLD}.get(pair, ["l.json"]))
    if error is KeyboardInterrupt:  # the language is saved all the same
        assert outcome.code == 130
        assert pair == ("new" if (at, after) == (3, True) else "new, alone")
        assert "the language is written to l.json: it is verified and proved min" in outcome.err
        said = "and so is its certificate" if pair == "new" else "no certificate is written"
        assert said in outcome.err
    else:
        assert outcome.code == 2
        assert "cannot be written: No space left" in outcome.err
        assert pair == ("old" if at == 1 or (at, after) == (2, False) else pair)
        if at == 3:
            assert "the language is written to l.json: it is verified and proved m" in outcome.err


@pytest.mark.parametrize("at", range(1, 4))
@pytest.mark.parametrize("after", [False, True])
def test_killed_at_every_rename(at: int, after: bool, old_pair: Path) -> None:
    replace, calls = os.replace, 0

    def ending(source: str, target: str) -> None:
        nonlocal calls
        calls += 1
        if calls == at and not after:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(source, target)
        if calls == at:
            os.kill(os.getpid(), signal.SIGKILL)

    def before() -> None:
        os.replace = ending  # type: ignore[assignment]

    assert fork_command(*BUILD, *PAIR, before=before).join().code == -signal.SIGKILL
    expected = {
        (1, False): "old",
        (1, True): "old, alone",
        (2, False): "old, alone",
        (2, True): "new, alone",
        (3, False): "new, alone",
        (3, True): "new",
    }
    assert _pair(old_pair) == expected[at, after]


def test_a_file_that_goes_while_it_is_asked_for_denies_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two processes with one cache: one lets an entry go that the other has just seen there."""
    path = tmp_path / "entry"
    path.write_text("old")
    access = os.access

    def gone_first(asked: str | Path, mode: int) -> bool:
        path.unlink(missing_ok=True)
        return access(asked, mode)

    monkeypatch.setattr(os, "access", gone_first)
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"


def test_a_language_and_its_certificate_are_written_together(
    coordlang: Command, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another command writes to the same file while this one works out its certificate."""
    own = Built.certificate

    def meanwhile(built: Built) -> object:
        write_atomically("l.json", b"a language of others")
        return own(built)

    monkeypatch.setattr(Built, "certificate", meanwhile)
    assert coordlang(*BUILD, "-o", "l.json", "--certificate", "c.json").code == 0
    verified = coordlang("verify", "l.json", *CELLS, "--certificate", "c.json")
    assert verified.code == 0, verified.err


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


@pytest.mark.parametrize(
    ("arguments", "closed", "code", "message"),
    [
        ((*BUILD, "-o", "-"), ">&-", 2, "stdout is closed"),
        (("plans", *CELLS, "--count"), ">&-", 2, "stdout is closed"),
        (("plans", "-", CELLS[1]), "<&-", 31, "-: cannot be read: stdin is closed"),
        (("verify", "-", *CELLS), "<&-", 31, "-: cannot be read: stdin is closed"),
    ],
)
def test_closed_streams_are_said(
    arguments: tuple[object, ...], closed: str, code: int, message: str
) -> None:
    done = in_shell(f"exec COORDLANG {closed}", *arguments)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith(f"coordlang: {message}")
