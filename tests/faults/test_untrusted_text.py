# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of others: whatever names, words, tasks, plans and paths hold, nothing raw is written."""

from __future__ import annotations

import gzip
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from coordlang.commands.main import run
from planners.system.errors import BadInput, Position
from planners.system.messages import UNSEEN, echoed, sentence, visible
from tests.fuzz.mutations import renamed
from tests.support.classical_models import CORRIDOR, CORRIDOR_TASK
from tests.support.command import Command, Outcome

#: Characters that must never be written as they are, and more of their kind.
BAD = (
    *("\x00", "\x07", "\x08", "\x1b", "\x1b[2J", "\x1b]0;x\x07", "\x7f", "\x9b", "\x9b31m", "\xad"),
    *("\u200b", "\u200e", "\u202a", "\u202e", "\u2066", "\u2069", "\ufeff", "\U000e0041"),
)
OWN = ["corridor", "swap", "robot", "place", "at", "next", "move", "r1", "r2", "a", "b", "c", "d"]
#: Names that other languages may take for something of their own; names that are words of PDDL, of
#: Python and of JavaScript, and names that are alike.
MARKUP = (
    *("</title><script>alert`1`</script>", '"><img/src=x/onerror=alert`1`>', "<!--", "]]>"),
    *("&ltat&amp", "'\"`", "</script>", '"r1\\', "\\n\\N\\", "<b>", "</svg>", "{{7*7}}", "${x}"),
)
WORDS = (
    *("define", "domain", "either-or", "number", "increase", "=x", "total-cost", "__proto__"),
    *("constructor", "x_y", "x.y", "x,y", "\u00e9\u540d\u2603"),
)
NAMES: dict[str, dict[str, str]] = {
    "plain": {},
    "markup": dict(zip(OWN, MARKUP, strict=True)),
    "words": dict(zip(OWN, WORDS, strict=True)),
}


class World:
    """A small world with other names, and its files."""

    def __init__(self, folder: Path, names: dict[str, str]) -> None:
        self.folder, self.names = folder, names
        self.domain, self.problem = self.pddl = folder / "d.pddl", folder / "p.pddl"
        self.domain.write_text(renamed(CORRIDOR, names))
        self.problem.write_text(renamed(CORRIDOR_TASK, names))
        self.language, self.plan, self.tasks = (folder / n for n in ("l.json", "plan", "t.json"))
        self.certificate, self.coordinates = folder / "c.json", folder / "xy.json"
        self.lifted, self.spoken = folder / "f.json", (self.language, *self.pddl)

    def write(self, coordlang: Command) -> World:
        """Write the files that commands read, by commands."""
        minimal = ("--tasks", "all", "--method", "minimal")
        outputs = ("-o", self.language, "--certificate", self.certificate)
        assert coordlang("build", *self.pddl, *minimal, *outputs).code == 0
        self.plan.write_text(coordlang("plans", *self.pddl, "--max", 1).out)
        assert coordlang("tasks", *self.pddl, "-o", self.tasks).code == 0
        lifted = ("--complexity", 5, "-o", self.lifted, "--jobs", 1)
        assert coordlang("lift", *self.pddl, *lifted).code == 0
        places = {self.names.get(name, name): [x, x % 2] for x, name in enumerate("abcd")}
        self.coordinates.write_text(json.dumps({"coordinates": places}))
        return self

    def commands(self, coordlang: Command, lines: str, bad: str = "") -> Iterator[list[str]]:
        """Commands, in which words in capitals stand for files and names of this world."""
        words: dict[str, Sequence[object]] = {
            **{name.upper(): [path] for name, path in vars(self).items() if name != "names"},
            "SPOKEN": self.spoken,
            "PDDL": self.pddl,
            "R1": [self.names.get("r1", "r1")],
            "SENTENCE": [self.sentence(coordlang)],
        }
        for line in lines.strip().splitlines():
            found = [words.get(w, [w.replace("BAD", bad)]) for w in shlex.split(line)]
            yield [str(word) for several in found for word in several]

    def sentence(self, coordlang: Command) -> str:
        return coordlang("say", *self.spoken, self.plan).out.split("\n")[0]


#: The files of worlds that are written already, by the kind of names.
_WRITTEN: dict[str, dict[str, bytes]] = {}


@pytest.fixture
def world_of(coordlang: Command, tmp_path: Path) -> Callable[[str], World]:
    def make(kind: str) -> World:
        world = World(tmp_path, NAMES[kind])
        if kind not in _WRITTEN:
            world.write(coordlang)
            _WRITTEN[kind] = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
        for name, data in _WRITTEN[kind].items():
            (tmp_path / name).write_bytes(data)
        return world

    return make


@pytest.fixture
def corridor(world_of: Callable[[str], World]) -> World:
    return world_of("plain")


def clean(text: str) -> bool:
    """Whether no character but newlines and tabs is one that steers, reorders or hides."""
    return not UNSEEN.search(text.replace("\n", "").replace("\t", ""))


def refused(done: Outcome, bad: str) -> None:
    """The input was refused, with a message that has nothing raw and is not long."""
    assert done.code in (1, 2, 31), (bad, done)
    assert clean(done.out + done.err), bad
    assert len(done.err) < 5_000
    assert "internal error" not in done.err


# ---- what is written

#: Every command that shows something of a world.
SHOWING = """
inspect PDDL
inspect PDDL --json
plans PDDL
plans PDDL --json
coordination PDDL
coordination PDDL --json
tasks PDDL -o -
build PDDL -o -
verify SPOKEN
verify SPOKEN --json
verify SPOKEN --tasks TASKS
verify SPOKEN --certificate CERTIFICATE
say SPOKEN PLAN
say SPOKEN PLAN --json
understand SPOKEN SENTENCE --format ipc
understand SPOKEN SENTENCE --format json
understand SPOKEN SENTENCE --format dot
plan SPOKEN SENTENCE
plan SPOKEN SENTENCE --json
choices SPOKEN SENTENCE --format text
choices SPOKEN SENTENCE --format json
choices SPOKEN SENTENCE --format dot
choices SPOKEN SENTENCE --robot R1 --history idle --never '(* *)'
choices SPOKEN SENTENCE --check
export SPOKEN SENTENCE
export SPOKEN SENTENCE --json
export SPOKEN SENTENCE --to ltlf
explain SPOKEN
explain SPOKEN --json
explain SPOKEN --task
plans PDDL --robots BAD --json
report SPOKEN -o - --coordinates COORDINATES
lift PDDL --complexity 5 -o -
ground LIFTED PDDL --tasks own -o -
explain LIFTED PDDL
report LIFTED PDDL -o -
"""


@pytest.mark.parametrize("kind", ["markup", "words"])
def test_names_are_quoted_wherever_they_are_written(
    coordlang: Command, world_of: Callable[[str], World], kind: str
) -> None:
    world = world_of(kind)
    nobody = f"{world.names['r1']},x"
    for command in world.commands(coordlang, SHOWING, nobody):
        done = coordlang(*command)
        assert done.code in ((2,) if nobody in command else (0, 1)), (command, done.err)
        assert "internal error" not in done.err
        assert clean(done.out + done.err), command
        if "--json" in command or command[-2:] == ["--format", "json"]:
            json.loads(done.out)
        elif command[-1] == "dot":
            # Outside of its strings Graphviz text holds nothing but its own words.
            bare = re.sub(r'"(?:[^"\\\n]|\\.)*"', "", done.out)
            assert re.fullmatch(r"[\sa-zA-Z0-9_=\[\]{};,>-]*", bare), bare
            assert not re.search(r"&(?!amp;)", done.out)
        elif command[0] == "report":
            check_page(done.out)
    out = world.folder / "out"  # PDDL that is written again has the same names
    assert coordlang("inspect", *world.pddl, "--write", out).code == 0
    again = coordlang("plans", out / "domain.pddl", out / "problem.pddl")
    assert (again.code, again.out) == (0, coordlang("plans", *world.pddl).out)


def check_page(text: str) -> None:
    found: list[str] = []

    class Page(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            found.extend((tag, *(name for name, _ in attrs)))

    Page().feed(text)
    assert found.count("script") == 2
    assert not [name for name in found if name in ("img", "b", "iframe") or name[:2] == "on"]
    assert "<!--" not in text.split("<script", 1)[1].split("</script>")[0]


# ---- exported PDDL


def fast_downward(folder: Path) -> list[str]:
    """The plan of Fast Downward, whose translator reads the two files, as its actions."""
    driver = files("up_fast_downward") / "downward" / "fast-downward.py"
    options = (
        "--plan-file sas_plan domain.pddl problem.pddl --translate-options"
        " --invariant-generation-max-time 0 --search-options --search astar(blind())"
    )
    command = [sys.executable, str(driver), *options.split()]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return (folder / "sas_plan").read_text().splitlines()


@pytest.mark.parametrize(
    "form", [("--max-actions", "2000"), ("--max-actions", "0"), ("--for", "pyperplan")], ids="".join
)
@pytest.mark.parametrize("kind", ["markup", "words"])
def test_exported_names_are_read_by_fast_downward(
    coordlang: Command, world_of: Callable[[str], World], kind: str, form: tuple[str, str]
) -> None:
    world = world_of(kind)
    out, words = world.folder / "out", world.sentence(coordlang)
    said = *world.spoken, words, *form
    assert coordlang("export", *said, "-o", out).code == 0
    fast_downward(out)
    back = coordlang("export", *said, "--translate-plan", out / "sas_plan")
    assert (back.code, back.err) == (0, "")
    world.plan.write_text(back.out)
    assert world.sentence(coordlang) == words


#: A world whose facts are atoms without arguments: their names are the exported ones.
BARE = """
(define (domain bare) (:types robot) (:predicates (p) (q) (done))
  (:action go :agent ?r - robot :parameters () :precondition (p) :effect (and (q) (not (p))))
  (:action end :agent ?r - robot :parameters () :precondition (q) :effect (done)))
"""
BARE_TASK = "(define (problem x) (:domain bare) (:objects r1 - robot) (:init (p)) (:goal (done)))"


@pytest.mark.parametrize(
    "name", ["increase", "at", "always", "when", "imply", "total-cost", "-x", "_", "9"]
)
def test_words_of_pddl_as_predicates_are_renamed(
    coordlang: Command, tmp_path: Path, name: str
) -> None:
    world, out = World(tmp_path, {}), tmp_path / "out"
    world.domain.write_text(BARE.replace("(q)", f"({name})"))
    world.problem.write_text(BARE_TASK)
    assert coordlang("build", *world.pddl, "-o", world.language).code == 0
    assert coordlang("export", *world.spoken, "w0", "-o", out).code == 0
    assert len(fast_downward(out)) > 2


# ---- what is read


@pytest.mark.parametrize("bad", BAD, ids=ascii)
def test_names_with_such_characters_are_refused(
    coordlang: Command, tmp_path: Path, bad: str
) -> None:
    for name in (*OWN[:8], "a"):
        world = World(tmp_path, {name: f"{name}{bad}x"})
        done = coordlang("plans", *world.pddl)
        refused(done, bad)
        place = world.problem if name == "swap" else world.domain
        assert name in ("r1", "a") or re.search(rf"{place.name}:\d+:\d+: ", done.err)


def test_a_comment_is_no_name_but_one_about_subactions_is(
    coordlang: Command, tmp_path: Path
) -> None:
    world = World(tmp_path, {})
    world.domain.write_text("; a title \x1b[1m \u202e\n" + CORRIDOR)
    assert coordlang("plans", *world.pddl, "--count").code == 0
    world.domain.write_text(
        "(define (domain j) (:types robot) (:predicates (p))\n (:action go :parameters ()\n"
        "  ; subaction r1 (go\x1b[1m r1)\n  ; subaction r2 idle\n"
        "  :precondition () :effect (p)))"
    )
    world.problem.write_text(
        "(define (problem x) (:domain j) (:objects r1 r2 - robot) (:init) (:goal (p)))"
    )
    done = coordlang("plans", *world.pddl)
    refused(done, "\x1b")
    assert "d.pddl:3:" in done.err


LONG = "x" * 1_000_000
#: Texts of a language file: a word everywhere, names, what is chosen from a list, keys.
LANGUAGE_TEXTS = (
    *('"w0"', '"r1"', '"corridor"', '"minimal"', '"makespan"', '"coordlang/language"'),
    *('"kind": "all"', '"default": "w0"', '"(at r1 a) (at r2 b)"', '(at r1 b) (at r2 c)": "w1"'),
)


@pytest.mark.parametrize("bad", ["\x1b[31m", "\x9b", "\u202e", LONG], ids=lambda b: ascii(b[:6]))
@pytest.mark.parametrize("text", LANGUAGE_TEXTS)
def test_language_files(coordlang: Command, corridor: World, text: str, bad: str) -> None:
    data = corridor.language.read_text()
    assert text in data
    corridor.language.write_text(data.replace(text, f"{text[:-1]}{json.dumps(bad)[1:]}"))
    done = coordlang("explain", *corridor.spoken)
    if bad is LONG and text in ('"w0"', '"corridor"', '"minimal"'):
        assert done.code == 0  # a long name is a name
    else:
        refused(done, bad)


#: BAD stands for text of others.
ARGUMENTS = """
BAD
plans PDDL --BAD
plans PDDL --cost BAD
plans PDDL --max BAD
plans PDDL --robots BAD
plans PDDL --robot-type BAD
plans BAD BAD
understand SPOKEN BAD
understand SPOKEN SENTENCE --max 0 -o /none/BAD
choices SPOKEN SENTENCE --robot BAD
choices SPOKEN SENTENCE --robot r1 --history '(move r1 BAD)'
choices SPOKEN SENTENCE --robot r1 --visit BAD
plan SPOKEN --prefer BAD
plan SPOKEN --prefer 'avoid:(at r1 BAD)'
plan SPOKEN --prefer 'first:BAD'
tasks PDDL --start '(at r1 BAD)' -o -
schema BAD
"""


@pytest.mark.parametrize("bad", ["\x1b[31m", "\u202e", LONG], ids=lambda b: ascii(b[:6]))
def test_other_files_and_arguments(coordlang: Command, corridor: World, bad: str) -> None:
    for command in [*corridor.commands(coordlang, ARGUMENTS, bad[:50_000])]:
        refused(coordlang(*command), bad)
    words, spoken = corridor.sentence(coordlang), corridor.spoken
    for text in (f"0: (move{bad} r1 a b)\n", f"0: (move r1 a b){bad}\n", f'{{"plans": "{bad}"}}'):
        corridor.plan.write_text(text)
        refused(coordlang("say", *spoken, corridor.plan), bad)
        refused(coordlang("export", *spoken, words, "--translate-plan", corridor.plan), bad)
    for init in (f"(at r1 a{bad})", f"(at{bad} r1 a)", f"{bad}"):
        tasks = [{"init": [init], "goal": ["(at r1 b)"]}]
        told = {"format": "coordlang/tasks", "version": 1, "tasks": tasks}
        corridor.tasks.write_text(json.dumps(told))
        refused(coordlang("verify", *spoken, "--tasks", corridor.tasks), bad)
    data = json.loads(corridor.certificate.read_text()) | {"robots": [bad, "r2"]}
    corridor.certificate.write_text(json.dumps(data))
    refused(coordlang("verify", *spoken, "--certificate", corridor.certificate), bad)
    for places in ({bad: [1e9, 0]}, {"A": [0, 0], "a": [1, 1], "b": [2, 2]}):
        corridor.coordinates.write_text(json.dumps({"coordinates": places}))
        refused(coordlang("report", *spoken, "-o", "-", "--coordinates", corridor.coordinates), bad)


@pytest.mark.thorough
def test_names_of_files(coordlang: Command, tmp_path: Path) -> None:
    folder = tmp_path / "a\x1b[31m\nb\u202e"
    folder.mkdir()
    world, other = World(folder, {}).write(coordlang), folder / "other.json"
    for command in [*world.commands(coordlang, SHOWING, "x")]:
        done = coordlang(*command)
        assert clean(done.out + done.err), command
    assert coordlang("build", *world.pddl, "-o", other).code == 0
    assert "\x1b" not in other.read_text()


# ---- bytes that are no text


#: The file that is spoilt, and a command that reads it.
SPOILT = """
DOMAIN plans PDDL
PROBLEM plans PDDL
LANGUAGE explain SPOKEN
LIFTED explain LIFTED PDDL
PLAN say SPOKEN PLAN
PLAN export SPOKEN SENTENCE --translate-plan PLAN
TASKS verify SPOKEN --tasks TASKS
CERTIFICATE verify SPOKEN --certificate CERTIFICATE
COORDINATES report SPOKEN -o - --coordinates COORDINATES
"""


@pytest.mark.parametrize("packed", [False, True])
def test_bad_utf8_is_bad_input_with_the_offset(
    coordlang: Command, corridor: World, packed: bool
) -> None:
    for name, *command in corridor.commands(coordlang, SPOILT):
        path = Path(name)
        if packed and path.suffix == ".pddl":
            continue
        good = path.read_bytes()
        offset = good.index(b"r")
        bad = good[:offset] + b"\xff" + good[offset + 1 :]
        path.write_bytes(gzip.compress(bad) if packed else bad)
        done = coordlang(*command)
        assert done.code == 31, (command, done.err)
        assert f"byte 0xff at offset {offset}" in done.err, (command, done.err)
        assert name in done.err
        path.write_bytes(good)


def test_latin_1_is_read_in_comments_of_pddl_only(coordlang: Command, tmp_path: Path) -> None:
    world = World(tmp_path, {"r1": "\u00e9"})  # a name in UTF-8 beside comments in Latin 1
    world.problem.write_bytes(b"; \xfc\n" + world.problem.read_bytes())
    world.domain.write_bytes(b"; gr\xfc\xdfe, \x93quoted\x94\n" + CORRIDOR.encode())
    assert "\u00e9" in coordlang("plans", *world.pddl).out
    world.domain.write_bytes(
        b"\xef\xbb\xbf; gr\xfc\xdfe\n" + CORRIDOR.encode().replace(b"place", b"pl\xe4ce")
    )
    done = coordlang("plans", *world.pddl, "--count")
    assert done.code == 31
    offset = world.domain.read_bytes().index(b"\xe4")
    assert f"byte 0xe4 at offset {offset}" in done.err
    assert re.search(r"d\.pddl:4:19: ", done.err), done.err


def test_arguments_that_are_no_text(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    world = World(tmp_path, {})
    for arguments in (
        ["plans", "\udcff", "\udcff"],
        ["plans", *map(str, world.pddl), "--robots", "\udcff"],
        ["build", *map(str, world.pddl), "-o", str(tmp_path / "\udcff.json")],
    ):
        assert run(arguments) in (0, 2, 31)
        said = "".join(capfd.readouterr())
        assert clean(said)
        assert "internal error" not in said


# ---- messages


@given(st.text())
@example("".join(BAD))
def test_nothing_unseen_is_left(text: str) -> None:
    shown = visible(text, keep="\n\t")
    assert clean(shown)
    assert visible(shown, keep="\n\t") == shown
    assert UNSEEN.search(text) or shown == text
    assert len(sentence(text * 100)) < 13_000
    assert clean(echoed(text))
    assert len(echoed(text * 100)) < 800


@given(st.text(st.characters(exclude_categories=["Cs"])))
@example("".join(BAD))
def test_json_with_escapes_is_the_same_json(text: str) -> None:
    assert json.loads(visible(json.dumps([text], ensure_ascii=False))) == [text]


@given(st.text(max_size=50), st.text(max_size=50), st.text(max_size=50))
def test_every_error_is_fit_to_be_shown(what: str, file: str, remedy: str) -> None:
    position = Position(file, 1, 2)
    assert clean(str(BadInput(what, position=position, remedy=remedy)))
    assert "\n" not in str(BadInput(what, position=position))
