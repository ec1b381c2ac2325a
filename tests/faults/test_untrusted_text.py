# SPDX-License-Identifier: GPL-3.0-or-later
"""Text of others: whatever names, words, tasks, plans and paths hold, nothing raw is written."""

from __future__ import annotations

import gzip
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from importlib.resources import files
from itertools import chain, pairwise
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from planners.system.errors import BadInput, Position
from planners.system.messages import UNSEEN, echoed, sentence, visible
from tests.fuzz.mutations import renamed
from tests.support import thorough
from tests.support.classical_models import CORRIDOR, CORRIDOR_TASK
from tests.support.command import Command, Outcome

#: Characters that must never be written as they are, and more of their kind.
BAD = (
    *("\x00", "\x07", "\x08", "\x1b", "\x1b[2J", "\x1b]0;x\x07", "\x7f", "\x9b", "\x9b31m", "\xad"),
    *("\u200b", "\u200e", "\u202a", "\u202e", "\u2066", "\u2069", "\ufeff", "\U000e0041"),
)
#: Texts that stand for these, and one that is only long.
SOME_BAD = pytest.mark.parametrize(
    "bad", ["x" * 20_000, *thorough("\x1b[31m", "\x9b", "\u202e")], ids=lambda b: ascii(b[:6])
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
    *("x,y", "x_y", "x.y", "constructor", "\u00e9\u540d\u2603"),
)
NAMES: dict[str, dict[str, str]] = {
    "plain": {},
    "markup": dict(zip(OWN, MARKUP, strict=True)),
    "words": dict(zip(OWN, WORDS, strict=True)),
}
#: The files of a world, by the words that stand for them in its commands.
FILES = {
    "DOMAIN": "d.pddl",
    "PROBLEM": "p.pddl",
    "LANGUAGE": "l.json",
    "LIFTED": "f.json",
    "PLAN": "plan",
    "TASKS": "t.json",
    "CERTIFICATE": "c.json",
    "COORDINATES": "xy.json",
}
WRITING = """
build PDDL --tasks all --method minimal -o LANGUAGE --certificate CERTIFICATE
tasks PDDL -o TASKS
lift PDDL --complexity 5 -o LIFTED --jobs 1
"""
#: The sentence and the files of a world that was written, by its names.
_WRITTEN: dict[tuple[tuple[str, str], ...], tuple[list[str], dict[str, bytes]]] = {}


class World:
    """The corridor with other names, in a folder whose own name would steer a terminal."""

    def __init__(self, coordlang: Command, folder: Path, names: dict[str, str]) -> None:
        folder /= "a\x1b[31m\nb\u202e"
        folder.mkdir(exist_ok=True)
        self.coordlang, self.names = coordlang, names
        self.path = {word: folder / name for word, name in FILES.items()}
        self.words = {word: [str(path)] for word, path in self.path.items()}
        self.words["PDDL"] = [*self.words["DOMAIN"], *self.words["PROBLEM"]]
        self.words["SPOKEN"] = [*self.words["LANGUAGE"], *self.words["PDDL"]]
        self.write(DOMAIN=renamed(CORRIDOR, names), PROBLEM=renamed(CORRIDOR_TASK, names))

    def write(self, **texts: str) -> None:
        for word, text in texts.items():
            self.path[word].write_text(text)

    def written(self) -> World:
        """With the files that commands read, written by commands: once for the same names."""
        key = tuple(self.names.items())
        if key not in _WRITTEN:
            self._write_all()
            _WRITTEN[key] = (
                self.words["SENTENCE"],
                {word: path.read_bytes() for word, path in self.path.items()},
            )
        self.words["SENTENCE"], written = _WRITTEN[key]
        for word, content in written.items():
            self.path[word].write_bytes(content)
        return self

    def _write_all(self) -> None:
        for line in WRITING.strip().splitlines():
            done = self.run(line)
            assert (done.code, clean(done.out + done.err)) == (0, True), line
        for word in ("LANGUAGE", "TASKS", "LIFTED"):
            assert clean(self.path[word].read_text()), word
        places = {self.names.get(name, name): [x, x % 2] for x, name in enumerate("abcd")}
        plan = self.run("plans PDDL --max 1").out
        self.write(COORDINATES=json.dumps({"coordinates": places}), PLAN=plan)
        self.words["SENTENCE"] = [self.run("say SPOKEN PLAN").out.split("\n")[0]]

    def run(self, line: str, bad: str = "") -> Outcome:
        """Run a command, in which words in capitals stand for files and BAD for a text."""
        words = [self.words.get(w, [w.replace("BAD", bad)]) for w in shlex.split(line)]
        return self.coordlang(*chain.from_iterable(words))

    def refuses(self, line: str, bad: str) -> Outcome:
        """The input is refused, with a message that has nothing raw and is not long."""
        done = self.run(line, bad)
        assert done.code in (1, 2, 31), (line, done)
        assert clean(done.out + done.err), line
        assert len(done.err) < 5_000
        assert "internal error" not in done.err
        return done


Make = Callable[[dict[str, str]], World]


@pytest.fixture
def bare(coordlang: Command, tmp_path: Path) -> Make:
    """A world of PDDL files only."""
    return lambda names: World(coordlang, tmp_path, names)


@pytest.fixture
def corridor(bare: Make) -> World:
    return bare({}).written()


def clean(text: str) -> bool:
    """Whether no character but newlines and tabs is one that steers, reorders or hides."""
    return not re.search(UNSEEN, text.replace("\n", "").replace("\t", ""))


# ---- what is written

#: Every command that shows something of a world, those of the first lines as JSON, too.
IN_BOTH_FORMS = """
inspect PDDL
plans PDDL
coordination PDDL
verify SPOKEN
say SPOKEN PLAN
plan SPOKEN SENTENCE
export SPOKEN SENTENCE
explain SPOKEN
"""
SHOWING = """
verify SPOKEN --tasks TASKS
verify SPOKEN --certificate CERTIFICATE
understand SPOKEN SENTENCE --format ipc
understand SPOKEN SENTENCE --format json
choices SPOKEN SENTENCE --format text
choices SPOKEN SENTENCE --format json
choices SPOKEN SENTENCE --robot R1
export SPOKEN SENTENCE --to ltlf
explain SPOKEN --task
plans PDDL --robots BAD --json
report SPOKEN -o - --coordinates COORDINATES
ground LIFTED PDDL --tasks own -o -
explain LIFTED PDDL
report LIFTED PDDL -o -
"""


@pytest.mark.parametrize("kind", ["markup", *thorough("words")])
def test_names_are_quoted_wherever_they_are_written(bare: Make, kind: str, tmp_path: Path) -> None:
    world = bare(NAMES[kind]).written()
    world.words["R1"] = [world.names["r1"]]
    both = IN_BOTH_FORMS.strip().splitlines()
    for line in (*both, *(f"{line} --json" for line in both), *SHOWING.strip().splitlines()):
        done = world.run(line, f"{world.names['r1']},x")
        assert done.code in ((2,) if "BAD" in line else (0, 1)), (line, done.err)
        assert "internal error" not in done.err
        assert clean(done.out + done.err), line
        if line.endswith("json"):
            json.loads(done.out)
        elif line.startswith("report"):
            check_page(done.out)
    out = tmp_path / "out"  # PDDL that is written again has the same names
    assert world.run(f"inspect PDDL --write {out}").code == 0
    again = world.run(f"plans {out}/domain.pddl {out}/problem.pddl")
    assert (again.code, again.out) == (0, world.run("plans PDDL").out)


def check_page(text: str) -> None:
    found: list[str] = []

    class Page(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            found.extend((tag, *(name for name, _ in attrs)))

    Page().feed(text)
    assert found.count("script") == 2
    assert not [name for name in found if name in ("img", "b", "iframe") or name[:2] == "on"]
    assert "<!--" not in text.split("<script", 1)[1].split("</script>")[0]


def fast_downward(folder: Path) -> None:
    """Fast Downward, whose translator reads the two files, writes a plan."""
    driver = files("up_fast_downward") / "downward" / "fast-downward.py"
    options = (
        "--plan-file sas_plan domain.pddl problem.pddl --translate-options"
        " --invariant-generation-max-time 0 --search-options --search astar(blind())"
    )
    command = [sys.executable, str(driver), *options.split()]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    assert len((folder / "sas_plan").read_text().splitlines()) > 2


@pytest.mark.parametrize("kind", ["markup", *thorough("words")])
def test_exported_names_are_read_by_fast_downward(
    bare: Make, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = bare(NAMES[kind]).written()
    for n, (most, form) in enumerate(((2000, "fd"), (0, "fd"), (2000, "pyperplan"))):
        monkeypatch.setattr("coordlang.exports.pddl.MAX_ACTIONS", most)
        out, line = tmp_path / f"out{n}", f"export SPOKEN SENTENCE --for {form}"
        assert world.run(f"{line} -o {out}").code == 0
        fast_downward(out)
        back = world.run(f"{line} --translate-plan {out}/sas_plan")
        assert (back.code, back.err) == (0, "")
        world.write(PLAN=back.out)
        assert world.run("say SPOKEN PLAN").out.split("\n")[0] == world.words["SENTENCE"][0]


def test_words_of_pddl_as_predicates_are_renamed(bare: Make, tmp_path: Path) -> None:
    """Facts are atoms without arguments: their names are the exported ones."""
    names = ["p", "increase", "at", "always", "when", "imply", "total-cost", "-x", "_", "9"]
    actions = " ".join(
        f"(:action go{n} :agent ?r - robot :parameters () :precondition ({before})"
        f" :effect (and ({after}) (not ({before}))))"
        for n, (before, after) in enumerate(pairwise(names))
    )
    world = bare({})
    predicates = " ".join(f"({name})" for name in names)
    world.write(
        DOMAIN=f"(define (domain x) (:types robot) (:predicates {predicates}) {actions})",
        PROBLEM="(define (problem x) (:domain x) (:objects r1 - robot) (:init (p)) (:goal (9)))",
    )
    assert world.run("build PDDL -o LANGUAGE").code == 0
    assert world.run(f"export SPOKEN w0 -o {tmp_path}").code == 0
    fast_downward(tmp_path)


# ---- what is read


@pytest.mark.parametrize("bad", BAD, ids=ascii)
def test_names_with_such_characters_are_refused(bare: Make, bad: str) -> None:
    for name in (*OWN[:8], "a"):
        done = bare({name: f"{name}{bad}x"}).refuses("plans PDDL", bad)
        place = "p" if name == "swap" else "d"
        assert name in ("r1", "a") or re.search(rf"{place}\.pddl:\d+:\d+: ", done.err)


def test_a_comment_is_no_name_but_one_about_subactions_is(bare: Make) -> None:
    world = bare({})
    world.write(DOMAIN="; a title \x1b[1m \u202e\n" + CORRIDOR)
    assert world.run("plans PDDL --count").code == 0
    world.write(
        DOMAIN="(define (domain j) (:types robot) (:predicates (p))\n (:action go :parameters ()\n"
        "  ; subaction r1 (go\x1b[1m r1)\n  ; subaction r2 idle\n"
        "  :precondition () :effect (p)))",
        PROBLEM="(define (problem x) (:domain j) (:objects r1 r2 - robot) (:init) (:goal (p)))",
    )
    assert "d.pddl:3:" in world.refuses("plans PDDL", "\x1b").err


#: Texts of a language file: a word everywhere, names, what is chosen from a list, keys.
LANGUAGE_TEXTS = (
    *('"w0"', '"r1"', '"corridor"', '"minimal"', '"makespan"', '"coordlang/language"'),
    *('"kind": "all"', '"default": "w0"', '"(at r1 a) (at r2 b)"', '(at r1 b) (at r2 c)": "w1"'),
)
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
plan SPOKEN --prefer BAD
plan SPOKEN --prefer 'avoid:(at r1 BAD)'
plan SPOKEN --prefer 'first:BAD'
tasks PDDL --start '(at r1 BAD)' -o -
schema BAD
"""


@SOME_BAD
def test_files_and_arguments(corridor: World, bad: str) -> None:
    for line in ARGUMENTS.strip().splitlines():
        corridor.refuses(line, bad[:50_000])
    data = corridor.path["LANGUAGE"].read_text()
    for text in LANGUAGE_TEXTS:
        assert text in data
        corridor.write(LANGUAGE=data.replace(text, f"{text[:-1]}{json.dumps(bad)[1:]}"))
        if bad[0] == "x" and text in ('"w0"', '"corridor"', '"minimal"'):
            assert corridor.run("explain SPOKEN").code == 0  # a long name is a name
        else:
            corridor.refuses("explain SPOKEN", bad)
    corridor.write(LANGUAGE=data)
    for text in (f"0: (move{bad} r1 a b)\n", f"0: (move r1 a b){bad}\n", f'{{"plans": "{bad}"}}'):
        corridor.write(PLAN=text)
        corridor.refuses("say SPOKEN PLAN", bad)
        corridor.refuses("export SPOKEN SENTENCE --translate-plan PLAN", bad)
    for init in (f"(at r1 a{bad})", f"(at{bad} r1 a)", f"{bad}"):
        tasks = [{"init": [init], "goal": ["(at r1 b)"]}]
        told = {"format": "coordlang/tasks", "version": 1, "tasks": tasks}
        corridor.write(TASKS=json.dumps(told))
        corridor.refuses("verify SPOKEN --tasks TASKS", bad)
    proof = json.loads(corridor.path["CERTIFICATE"].read_text()) | {"robots": [bad, "r2"]}
    corridor.write(CERTIFICATE=json.dumps(proof))
    corridor.refuses("verify SPOKEN --certificate CERTIFICATE", bad)
    for places in ({bad: [1e9, 0]}, {"A": [0, 0], "a": [1, 1], "b": [2, 2]}):
        corridor.write(COORDINATES=json.dumps({"coordinates": places}))
        corridor.refuses("report SPOKEN -o - --coordinates COORDINATES", bad)


# ---- bytes that are no text

#: The file that is spoilt, and a command that reads it.
SPOILT = {
    "DOMAIN": "plans PDDL",
    "PROBLEM": "plans PDDL",
    "LANGUAGE": "explain SPOKEN",
    "LIFTED": "explain LIFTED PDDL",
    "PLAN": "say SPOKEN PLAN",
    "TASKS": "verify SPOKEN --tasks TASKS",
    "CERTIFICATE": "verify SPOKEN --certificate CERTIFICATE",
    "COORDINATES": "report SPOKEN -o - --coordinates COORDINATES",
}


def test_bad_utf8_is_bad_input_with_the_offset(corridor: World) -> None:
    for word, line in SPOILT.items():
        path = corridor.path[word]
        good = path.read_bytes()
        offset = good.index(b"r")
        bad = good[:offset] + b"\xff" + good[offset + 1 :]
        for data in (bad, gzip.compress(bad)) if path.suffix != ".pddl" else (bad,):
            path.write_bytes(data)
            done = corridor.refuses(line, "")
            assert done.code == 31, (line, done.err)
            assert f"byte 0xff at offset {offset}" in done.err, (line, done.err)
        path.write_bytes(good)


def test_latin_1_is_read_in_comments_of_pddl_only(bare: Make) -> None:
    world = bare({"r1": "\u00e9"})  # a name in UTF-8 beside comments in Latin 1
    domain, problem = world.path["DOMAIN"], world.path["PROBLEM"]
    problem.write_bytes(b"; \xfc\n" + problem.read_bytes())
    domain.write_bytes(b"; gr\xfc\xdfe, \x93quoted\x94\n" + CORRIDOR.encode())
    assert "\u00e9" in world.run("plans PDDL").out
    wrong = CORRIDOR.encode().replace(b"place", b"pl\xe4ce")
    domain.write_bytes(b"\xef\xbb\xbf; gr\xfc\xdfe\n" + wrong)
    done = world.refuses("plans PDDL --count", "")
    offset = domain.read_bytes().index(b"\xe4")
    assert f"byte 0xe4 at offset {offset}" in done.err
    assert re.search(r"d\.pddl:4:19: ", done.err), done.err


def test_arguments_that_are_no_text(bare: Make) -> None:
    world = bare({})
    for line in ("plans BAD BAD", "plans PDDL --robots BAD", "build PDDL -o /none/BAD.json"):
        world.refuses(line, "\udcff")


# ---- messages


@settings(max_examples=60)
@given(st.text())
@example("".join(BAD))
def test_nothing_unseen_is_left(text: str) -> None:
    shown = visible(text, keep="\n\t")
    assert clean(shown)
    assert visible(shown, keep="\n\t") == shown
    assert re.search(UNSEEN, text) or shown == text
    assert len(sentence(text * 100)) < 13_000
    assert clean(echoed(text))
    assert len(echoed(text * 100)) < 800
    error = BadInput(text, position=Position(text, 1, 2), remedy=text)
    assert clean(str(error))
    encoded = json.dumps([text], ensure_ascii=False)
    assert json.loads(visible(encoded)) == [text]
