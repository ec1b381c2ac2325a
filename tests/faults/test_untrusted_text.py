# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of others: whatever names, words, tasks, plans and paths hold, nothing raw is written."""

from __future__ import annotations

import gzip
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterable
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from coordlang.commands.main import run
from planners.system.errors import BadInput, Position
from planners.system.messages import UNSEEN, echoed, sentence, visible
from tests.fuzz.pieces import renamed
from tests.support.classical_models import CORRIDOR, CORRIDOR_TASK
from tests.support.command import Command, Outcome

#: Characters that must never be written as they are, and more of their kind.
BAD = (
    *("\x00", "\x07", "\x08", "\x1b", "\x1b[2J", "\x1b]0;x\x07", "\x7f", "\x9b", "\x9b31m", "\xad"),
    *("\u200b", "\u200e", "\u202a", "\u202e", "\u2066", "\u2069", "\ufeff", "\U000e0041"),
)

#: Names that other languages may take for something of their own.
MARKUP = {
    "corridor": "</title><script>alert`1`</script>",
    "swap": '"><img/src=x/onerror=alert`1`>',
    "robot": "<!--",
    "place": "]]>",
    "at": "&ltat&amp",
    "next": "'\"`",
    "move": "</script>",
    "r1": '"r1\\',
    "r2": "\\n\\N\\",
    "a": "<b>",
    "b": "</svg>",
    "c": "{{7*7}}",
    "d": "${x}",
}
#: Names that are words of PDDL, of Python and of JavaScript, and names that are alike.
WORDS = {
    "corridor": "define",
    "swap": "domain",
    "robot": "either-or",
    "place": "number",
    "at": "increase",
    "next": "=x",
    "move": "total-cost",
    "r1": "__proto__",
    "r2": "constructor",
    "a": "x_y",
    "b": "x.y",
    "c": "x,y",
    "d": "\u00e9\u540d\u2603",
}
NAMES: dict[str, dict[str, str]] = {"plain": {}, "markup": MARKUP, "words": WORDS}


class World:
    """A small world with other names, and its files."""

    def __init__(self, folder: Path, names: dict[str, str]) -> None:
        self.names = names
        self.domain, self.problem = folder / "d.pddl", folder / "p.pddl"
        self.language, self.plan = folder / "l.json", folder / "plan"
        self.tasks, self.certificate = folder / "tasks.json", folder / "c.json"
        self.coordinates, self.lifted = folder / "coordinates.json", folder / "lifted.json"
        self.domain.write_text(renamed(CORRIDOR, names))
        self.problem.write_text(renamed(CORRIDOR_TASK, names))

    @property
    def pddl(self) -> tuple[Path, Path]:
        return self.domain, self.problem

    def write(self, coordlang: Command) -> World:
        """Write the files that commands read, by commands."""
        minimal = ("--tasks", "all", "--method", "minimal")
        outputs = ("-o", self.language, "--certificate", self.certificate)
        built = coordlang("build", *self.pddl, *minimal, *outputs)
        assert built.code == 0, built.err
        self.plan.write_text(coordlang("plans", *self.pddl, "--max", 1).out)
        assert coordlang("tasks", *self.pddl, "-o", self.tasks).code == 0
        lifted = coordlang("lift", *self.pddl, "--complexity", 5, "-o", self.lifted, "--jobs", 1)
        assert lifted.code == 0, lifted.err
        places = {self.names.get(name, name): [x, x % 2] for x, name in enumerate("abcd")}
        self.coordinates.write_text(json.dumps({"coordinates": places}))
        return self

    def sentence(self, coordlang: Command) -> str:
        return coordlang("say", self.language, *self.pddl, self.plan).out.split("\n")[0]


@pytest.fixture(scope="module")
def written() -> dict[str, dict[str, bytes]]:
    """The files of worlds that a test of this module wrote already, by the kind of names."""
    return {}


@pytest.fixture
def world_of(
    coordlang: Command, tmp_path: Path, written: dict[str, dict[str, bytes]]
) -> Callable[[str], World]:
    def make(kind: str) -> World:
        world = World(tmp_path, NAMES[kind])
        if kind not in written:
            world.write(coordlang)
            written[kind] = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
        for name, data in written[kind].items():
            (tmp_path / name).write_bytes(data)
        return world

    return make


@pytest.fixture
def corridor(world_of: Callable[[str], World]) -> World:
    return world_of("plain")


def clean(text: str) -> bool:
    """Whether no character but newlines and tabs is one that steers, reorders or hides."""
    return not UNSEEN.search(text.replace("\n", "").replace("\t", ""))


def commands(world: World, sentence: str) -> list[tuple[Any, ...]]:
    """Every command that shows something of a world."""
    spoken = world.language, *world.pddl
    said = *spoken, sentence
    robot = world.names.get("r1", "r1")
    return [
        ("inspect", *world.pddl),
        ("inspect", *world.pddl, "--json"),
        ("plans", *world.pddl),
        ("plans", *world.pddl, "--json"),
        ("coordination", *world.pddl),
        ("coordination", *world.pddl, "--json"),
        ("tasks", *world.pddl, "-o", "-"),
        ("build", *world.pddl, "-o", "-"),
        ("verify", *spoken),
        ("verify", *spoken, "--json"),
        ("verify", *spoken, "--tasks", world.tasks),
        ("verify", *spoken, "--certificate", world.certificate),
        ("say", *spoken, world.plan),
        ("say", *spoken, world.plan, "--json"),
        *(("understand", *said, "--format", form) for form in ("ipc", "json", "dot")),
        ("plan", *said),
        *(("choices", *said, "--format", form) for form in ("text", "json", "dot")),
        ("choices", *said, "--robot", robot, "--history", "idle", "--never", "(* *)"),
        ("export", *said),
        ("export", *said, "--json"),
        ("export", *said, "--to", "ltlf"),
        ("explain", *spoken),
        ("explain", *spoken, "--json"),
        ("explain", *spoken, "--task"),
        ("plan", *said, "--json"),
        ("choices", *said, "--check"),
        ("coordination", *world.pddl, "--robots", f"{robot},x"),
        ("plans", *world.pddl, "--robots", f"{robot},x", "--json"),
        ("report", *spoken, "-o", "-", "--coordinates", world.coordinates),
        ("lift", *world.pddl, "--complexity", "5", "-o", "-"),
        ("ground", world.lifted, *world.pddl, "--tasks", "own", "-o", "-"),
        ("explain", world.lifted, *world.pddl),
        ("report", world.lifted, *world.pddl, "-o", "-"),
    ]


# ---- what is written


@pytest.mark.parametrize("kind", ["markup", "words"])
def test_names_are_quoted_wherever_they_are_written(
    coordlang: Command, world_of: Callable[[str], World], kind: str
) -> None:
    world = world_of(kind)
    sentence = world.sentence(coordlang)
    for command in commands(world, sentence):
        done = coordlang(*command)
        assert done.code == 2 if "--robots" in command else done.code in (0, 1), (command, done.err)
        assert "internal error" not in done.err
        assert clean(done.out), command
        assert clean(done.err), command
        check = FORMS.get(command[command.index("--format") + 1]) if "--format" in command else None
        if "--json" in command:
            check = json.loads
        if command[0] == "report":
            check = check_page
        if check is not None:
            check(done.out)


def check_dot(text: str) -> None:
    """Outside of its strings Graphviz text holds nothing but its own words."""
    bare = re.sub(r'"(?:[^"\\\n]|\\.)*"', "", text)
    assert re.fullmatch(r"[\sa-zA-Z0-9_=\[\]{};,>-]*", bare), bare
    assert not re.search(r"&(?!amp;)", text)


class _Page(HTMLParser):
    """The elements and attributes of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self.attributes += attrs


def check_page(text: str) -> None:
    page = _Page(text)
    assert page.elements.count("script") == 2
    assert not {"img", "b", "iframe"} & set(page.elements)
    assert not any(name.startswith("on") for name, _ in page.attributes)
    assert "<!--" not in text.split("<script", 1)[1].split("</script>")[0]


FORMS: dict[str, Callable[[str], Any]] = {
    "json": json.loads,
    "dot": check_dot,
}


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
    coordlang: Command,
    world_of: Callable[[str], World],
    tmp_path: Path,
    kind: str,
    form: tuple[str, str],
) -> None:
    world = world_of(kind)
    said = world.language, *world.pddl, world.sentence(coordlang), *form
    assert coordlang("export", *said, "-o", tmp_path / "out").code == 0
    fast_downward(tmp_path / "out")
    back = coordlang("export", *said, "--translate-plan", tmp_path / "out" / "sas_plan")
    assert (back.code, back.err) == (0, "")
    world.plan.write_text(back.out)
    again = coordlang("say", world.language, *world.pddl, world.plan)
    assert again.code == 0
    assert again.out.split("\n")[0] == said[3]


@pytest.mark.parametrize("kind", ["markup", "words"])
def test_pddl_that_is_written_again_has_the_same_names(
    coordlang: Command, world_of: Callable[[str], World], tmp_path: Path, kind: str
) -> None:
    world, out = world_of(kind), tmp_path / "out"
    assert coordlang("inspect", *world.pddl, "--write", out).code == 0
    again = coordlang("plans", out / "domain.pddl", out / "problem.pddl")
    assert (again.code, again.out) == (0, coordlang("plans", *world.pddl).out)


#: A world whose facts are atoms without arguments: their names are the exported ones.
BARE = """
(define (domain bare)
  (:types robot)
  (:predicates (p) (q) (done))
  (:action go :agent ?r - robot :parameters () :precondition (p) :effect (and (q) (not (p))))
  (:action end :agent ?r - robot :parameters () :precondition (q) :effect (done)))
"""
BARE_TASK = """
(define (problem bare) (:domain bare) (:objects r1 - robot) (:init (p)) (:goal (done)))
"""


@pytest.mark.parametrize(
    "name", ["increase", "at", "always", "when", "imply", "total-cost", "-x", "_", "9"]
)
def test_words_of_pddl_as_predicates_are_renamed(
    coordlang: Command, tmp_path: Path, name: str
) -> None:
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(BARE.replace("(q)", f"({name})"))
    problem.write_text(BARE_TASK)
    language = tmp_path / "l.json"
    built = coordlang("build", domain, problem, "--method", "greedy", "-o", language)
    assert built.code == 0, built.err
    out = tmp_path / "out"
    assert coordlang("export", language, domain, problem, "w0", "-o", out).code == 0
    assert len(fast_downward(out)) > 2


# ---- what is read


def everywhere(world: World, bad: str) -> Iterable[tuple[str, str, tuple[Any, ...]]]:
    """Each kind of name with a bad character in it: (what, names as they are written, ..)."""
    for name in ("corridor", "swap", "robot", "place", "at", "next", "move", "r1", "a"):
        names = {name: f"{name}{bad}x"}
        world.domain.write_text(renamed(CORRIDOR, names))
        world.problem.write_text(renamed(CORRIDOR_TASK, names))
        yield name, bad, ("plans", *world.pddl)


@pytest.mark.parametrize("bad", BAD, ids=ascii)
def test_names_with_such_characters_are_refused(
    coordlang: Command, tmp_path: Path, bad: str
) -> None:
    world = World(tmp_path, {})
    for name, _, command in everywhere(world, bad):
        refused(coordlang(*command), bad)
        place = world.problem if name == "swap" else world.domain
        if name not in ("r1", "a"):
            assert re.search(rf"{place.name}:\d+:\d+: ", coordlang(*command).err)


def test_such_characters_in_comments_are_no_names(coordlang: Command, tmp_path: Path) -> None:
    world = World(tmp_path, {})
    world.domain.write_text("; a title \x1b[1m \u202e\n" + CORRIDOR)
    assert coordlang("plans", *world.pddl, "--count").code == 0


def test_a_subaction_comment_is_text_like_any_other(coordlang: Command, tmp_path: Path) -> None:
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    domain.write_text(
        "(define (domain j) (:types robot) (:predicates (p))\n (:action go :parameters ()\n"
        "  ; subaction r1 (go\x1b[1m r1)\n  ; subaction r2 idle\n"
        "  :precondition () :effect (p)))"
    )
    problem.write_text(
        "(define (problem x) (:domain j) (:objects r1 r2 - robot) (:init) (:goal (p)))"
    )
    done = coordlang("plans", domain, problem)
    refused(done, "\x1b")
    assert "d.pddl:3:" in done.err


def refused(done: Outcome, bad: str) -> None:
    """Whether the input was refused, with a message that has nothing raw and is not long."""
    assert done.code in (1, 2, 31), (bad, done)
    assert clean(done.out), bad
    assert clean(done.err), bad
    assert len(done.err) < 5_000
    assert "internal error" not in done.err


def changed(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change the data of a JSON file."""
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


LANGUAGE_CHANGES: dict[str, Callable[[dict[str, Any], str], object]] = {
    "words": lambda data, bad: _rename_word(data, f"w0{bad}"),
    "robots": lambda data, bad: data.update(robots=[f"r1{bad}", "r2"]),
    "domain": lambda data, bad: data["domain"].update(name=f"corridor{bad}"),
    "method": lambda data, bad: data["guarantee"].update(method=f"minimal{bad}"),
    "state": lambda data, bad: data["states"].update({f"(at r1 a{bad}) (at r2 b)": "w0"}),
    "word of a state": lambda data, bad: data["states"].update({"(at r1 a) (at r2 b)": bad}),
    "default": lambda data, bad: data.update(default=f"w0{bad}"),
    "cost": lambda data, bad: data["model"].update(cost=f"makespan{bad}"),
    "version": lambda data, bad: data.update(version=f"1{bad}"),
    "format": lambda data, bad: data.update(format=f"coordlang/language{bad}"),
    "kind": lambda data, bad: data["tasks"].update(kind=f"all{bad}"),
}


def _rename_word(data: dict[str, Any], name: str) -> None:
    data["words"][0] = name
    data["states"] = {k: name if w == "w0" else w for k, w in data["states"].items()}
    data["default"] = name if data["default"] == "w0" else data["default"]


LONG = "x" * 1_000_000


@pytest.mark.parametrize("bad", ["\x1b[31m", "\x9b", "\u202e", LONG], ids=lambda b: ascii(b[:6]))
@pytest.mark.parametrize("change", LANGUAGE_CHANGES)
def test_language_files(coordlang: Command, corridor: World, change: str, bad: str) -> None:
    changed(corridor.language, lambda data: LANGUAGE_CHANGES[change](data, bad))
    done = coordlang("explain", corridor.language, *corridor.pddl)
    if bad is LONG and change in ("words", "domain", "method"):
        assert done.code == 0  # a long name is a name
    else:
        refused(done, bad)


@pytest.mark.parametrize("bad", ["\x1b[31m", "\u202e", LONG], ids=lambda b: ascii(b[:6]))
def test_other_files_and_arguments(coordlang: Command, corridor: World, bad: str) -> None:
    spoken = corridor.language, *corridor.pddl
    sentence = corridor.sentence(coordlang)
    for text in (f"0: (move{bad} r1 a b)\n", f"0: (move r1 a b){bad}\n", f'{{"plans": "{bad}"}}'):
        corridor.plan.write_text(text)
        refused(coordlang("say", *spoken, corridor.plan), bad)
        refused(coordlang("export", *spoken, sentence, "--translate-plan", corridor.plan), bad)
    for init in (f"(at r1 a{bad})", f"(at{bad} r1 a)", f"{bad}"):
        tasks = [{"init": [init], "goal": ["(at r1 b)"]}]
        told = {"format": "coordlang/tasks", "version": 1, "tasks": tasks}
        corridor.tasks.write_text(json.dumps(told))
        refused(coordlang("verify", *spoken, "--tasks", corridor.tasks), bad)
    changed(corridor.certificate, lambda data: data.update(robots=[bad, "r2"]))
    refused(coordlang("verify", *spoken, "--certificate", corridor.certificate), bad)
    corridor.coordinates.write_text(json.dumps({"coordinates": {bad: [1e9, 0]}}))
    refused(coordlang("report", *spoken, "-o", "-", "--coordinates", corridor.coordinates), bad)
    short = bad[:50_000]
    for command in (
        (short,),
        ("plans", *corridor.pddl, f"--{short}"),
        ("plans", *corridor.pddl, "--cost", short),
        ("plans", *corridor.pddl, "--max", short),
        ("plans", *corridor.pddl, "--robots", short),
        ("plans", *corridor.pddl, "--robot-type", short),
        ("plans", short, short),
        ("understand", *spoken, short),
        ("understand", *spoken, sentence, "--max", "0", "-o", f"/none/{short}"),
        ("choices", *spoken, sentence, "--robot", short),
        ("choices", *spoken, sentence, "--robot", "r1", "--history", f"(move r1 {short})"),
        ("choices", *spoken, sentence, "--robot", "r1", "--visit", short),
        ("plan", *spoken, "--prefer", short),
        ("plan", *spoken, "--prefer", f"avoid:(at r1 {short})"),
        ("plan", *spoken, "--prefer", f"first:{short}"),
        ("tasks", *corridor.pddl, "--start", f"(at r1 {short})", "-o", "-"),
        ("schema", short),
    ):
        refused(coordlang(*command), bad)


@pytest.mark.thorough
def test_names_of_files(coordlang: Command, tmp_path: Path) -> None:
    folder = tmp_path / "a\x1b[31m\nb\u202e"
    folder.mkdir()
    world = World(folder, {}).write(coordlang)
    sentence = world.sentence(coordlang)
    for command in (
        *commands(world, sentence),
        ("plans", world.domain, folder / "none"),
        ("export", world.language, *world.pddl, sentence, "-o", folder / "out"),
        ("report", world.language, *world.pddl, "-o", folder / "page.html"),
        ("build", *world.pddl, "-o", folder / "other.json"),
    ):
        done = coordlang(*command)
        assert clean(done.out), command
        assert clean(done.err), command
    assert "\x1b" not in (folder / "other.json").read_text()


def test_coordinates_of_names_that_differ_in_case_only(coordlang: Command, corridor: World) -> None:
    corridor.coordinates.write_text('{"coordinates": {"A": [0, 0], "a": [1, 1], "b": [2, 2]}}')
    spoken = corridor.language, *corridor.pddl
    done = coordlang("report", *spoken, "-o", "-", "--coordinates", corridor.coordinates)
    assert done.code == 31
    assert "twice" in done.err


# ---- bytes that are no text


@pytest.mark.parametrize("packed", [False, True])
def test_bad_utf8_is_bad_input_with_the_offset(
    coordlang: Command, corridor: World, packed: bool
) -> None:
    spoken = corridor.language, *corridor.pddl
    sentence = corridor.sentence(coordlang)
    readers: list[tuple[Path, tuple[Any, ...]]] = [
        (corridor.plan, ("say", *spoken, corridor.plan)),
        (corridor.plan, ("export", *spoken, sentence, "--translate-plan", corridor.plan)),
        (corridor.tasks, ("verify", *spoken, "--tasks", corridor.tasks)),
        (corridor.certificate, ("verify", *spoken, "--certificate", corridor.certificate)),
        (
            corridor.coordinates,
            ("report", *spoken, "-o", "-", "--coordinates", corridor.coordinates),
        ),
        (corridor.language, ("explain", *spoken)),
        (corridor.lifted, ("explain", corridor.lifted, *corridor.pddl)),
    ]
    if not packed:
        readers += [(path, ("plans", *corridor.pddl)) for path in corridor.pddl]
    for path, command in readers:
        good = path.read_bytes()
        offset = good.index(b"r")
        bad = good[:offset] + b"\xff" + good[offset + 1 :]
        path.write_bytes(gzip.compress(bad) if packed else bad)
        done = coordlang(*command)
        assert done.code == 31, (command, done.err)
        assert f"byte 0xff at offset {offset}" in done.err, (command, done.err)
        assert str(path) in done.err
        path.write_bytes(good)


def test_latin_1_is_read_in_comments_of_pddl_only(coordlang: Command, tmp_path: Path) -> None:
    world = World(tmp_path, {})
    world.domain.write_bytes(b"; gr\xfc\xdfe, \x93quoted\x94\n" + CORRIDOR.encode())
    assert coordlang("plans", *world.pddl, "--count").code == 0
    world.domain.write_bytes(
        b"\xef\xbb\xbf; gr\xfc\xdfe\n" + CORRIDOR.encode().replace(b"place", b"pl\xe4ce")
    )
    done = coordlang("plans", *world.pddl, "--count")
    assert done.code == 31
    offset = world.domain.read_bytes().index(b"\xe4")
    assert f"byte 0xe4 at offset {offset}" in done.err
    assert re.search(r"d\.pddl:4:19: ", done.err), done.err


def test_names_in_utf8_beside_comments_in_latin_1(coordlang: Command, tmp_path: Path) -> None:
    world = World(tmp_path, {"r1": "\u00e9"})
    world.problem.write_bytes(b"; \xfc\n" + world.problem.read_bytes())
    assert "\u00e9" in coordlang("plans", *world.pddl).out


def test_arguments_that_are_no_text(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    world = World(tmp_path, {})
    for arguments in (
        ["plans", "\udcff", "\udcff"],
        ["plans", *map(str, world.pddl), "--robots", "\udcff"],
        ["build", *map(str, world.pddl), "-o", str(tmp_path / "\udcff.json")],
    ):
        assert run(arguments) in (0, 2, 31)
        out, err = capfd.readouterr()
        assert clean(out)
        assert clean(err)
        assert "internal error" not in err


# ---- messages


@given(st.text())
@example("".join(BAD))
def test_nothing_unseen_is_left(text: str) -> None:
    shown = visible(text, keep="\n\t")
    assert clean(shown)
    assert visible(shown, keep="\n\t") == shown
    if not UNSEEN.search(text):
        assert shown == text
    assert len(sentence(text * 100)) < 13_000
    assert clean(echoed(text))
    assert len(echoed(text * 100)) < 800


@given(st.text(st.characters(exclude_categories=["Cs"])))
@example("".join(BAD))
def test_json_with_escapes_is_the_same_json(text: str) -> None:
    assert json.loads(visible(json.dumps([text], ensure_ascii=False))) == [text]


@given(st.text(max_size=50), st.text(max_size=50), st.text(max_size=50))
def test_every_error_is_fit_to_be_shown(what: str, file: str, remedy: str) -> None:
    error = BadInput(what, position=Position(file, 1, 2), remedy=remedy)
    assert clean(str(error))
    assert "\n" not in str(BadInput(what, position=Position(file, 1, 2)))
