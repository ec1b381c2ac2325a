"""Broken and odd PDDL against the command line: no traceback, no hang, a documented exit code, a
useful message.

Takes the PDDL files in ``domains/`` (and ``../shared/data/foreign`` where it is there), breaks them
in many ways, and runs ``plans --count``, ``coordination`` or ``build -o`` on the result, under
limits.  Most mutants share one worker process; every `_FRESH`-th one gets a process of its own,
which also shows what goes wrong when a process ends.  Prints a table of exit codes and every
failure, whose files are kept in a folder of their own.

    python benchmarks/fuzz.py [--number N] [--seed S] [--start K] [--keep FOLDER]

Mutant K of a seed is the same file whatever N is, so a long run can be cut in pieces.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
FOREIGN = ROOT.parent / "shared" / "data" / "foreign"

#: docs/cli.md.  32 is left out: no external program should fail here.
DOCUMENTED = frozenset({0, 1, 2, 3, 11, 22, 23, 31, 34, 130})
TIME_LIMIT = 5
MEMORY_LIMIT = "2G"
#: Seconds beyond the limit before a run counts as a hang.
GRACE = 3
_FRESH = 25
#: Runs after which the worker is replaced, so that memory it has kept does not count as a mutant's.
_WORKER_LIFE = 150

_TOKEN = re.compile(r";[^\n\r]*|[()]|[^\s();]+|\s+")
_PLACE = re.compile(r":\d+:\d+: ")
#: Errors of a PDDL file that have no place inside it.
_PLACELESS = ("no such file", "found an empty file", "binary file")


# ---- the files to break
# ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """A domain and a problem that are read without an error, with the options they need."""

    name: str
    domain: str
    problem: str
    options: tuple[str, ...] = ()


_SHIPPED = (
    ("three-cells", "problem.pddl"),
    ("t-map", "problem.pddl"),
    ("corridor", "problem.pddl"),
    ("grid", "gw1-2x2.pddl"),
    ("grid", "three-robots-3x3.pddl"),
    ("grid-joint", "three-cells.pddl"),
)
_FOREIGN: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("blocks-arms", "original_domain.pddl", "original_problem_3.pddl", ()),
    ("boxpushing", "domain.pddl", "p2_3_2_1_1_0.pddl", ()),
    ("depot", "domain.pddl", "pfile1.pddl", ()),
    ("driverlog", "domain.pddl", "pfile1.pddl", ()),
    (
        "gripper",
        "domain.pddl",
        "prob01.pddl",
        ("--robot-type", "gripper", "--unowned", "environment"),
    ),
    ("mapf", "mapf-domain.pddl", "mapf-problem2.pddl", ()),
    ("storage", "domain.pddl", "p05.pddl", ("--robot-type", "hoist")),
    ("taxi", "domain.pddl", "p01.pddl", ()),
    (
        "transport",
        "p11.DOMAIN.pddl",
        "p11.pddl",
        ("--robot-type", "vehicle", "--cost", "makespan+cost"),
    ),
    ("workshop", "workshop_dom_cal.pddl", "workshop2_1_2_2_2.pddl", ()),
    ("workshop", "workshop_dom_cn.pddl", "workshop2_1_2_2_2.pddl", ()),
)


def pairs(*, foreign: bool = True) -> list[Pair]:
    """The files to break; without ``foreign`` only those that come with the project."""
    found = [
        Pair(
            folder,
            _read(ROOT / "domains" / folder / "domain.pddl"),
            _read(ROOT / "domains" / folder / problem),
        )
        for folder, problem in _SHIPPED
    ]
    if foreign and FOREIGN.is_dir():
        found += [
            Pair(
                folder, _read(FOREIGN / folder / domain), _read(FOREIGN / folder / problem), options
            )
            for folder, domain, problem, options in _FOREIGN
        ]
    return found


def _read(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "surrogateescape")


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogateescape")


# ---- ways to break a text
# ------------------------------------------------------------------------------

Mutation = Callable[[str, Random], str]


def _tokens(text: str) -> list[str]:
    return _TOKEN.findall(text)


def _visible(tokens: Sequence[str]) -> list[int]:
    return [n for n, token in enumerate(tokens) if not token.isspace() and token[0] != ";"]


def _edit_tokens(text: str, random: Random, edit: Callable[[list[str], list[int]], None]) -> str:
    """Apply an edit of the token list (and numbers of its visible tokens) one to three times."""
    tokens = _tokens(text)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        numbers = _visible(tokens)
        if numbers:
            edit(tokens, numbers)
    return "".join(tokens)


def drop(text: str, random: Random) -> str:
    def edit(tokens: list[str], numbers: list[int]) -> None:
        del tokens[random.choice(numbers)]

    return _edit_tokens(text, random, edit)


def double(text: str, random: Random) -> str:
    def edit(tokens: list[str], numbers: list[int]) -> None:
        n = random.choice(numbers)
        tokens.insert(n, tokens[n] + " ")

    return _edit_tokens(text, random, edit)


def swap(text: str, random: Random) -> str:
    def edit(tokens: list[str], numbers: list[int]) -> None:
        a, b = random.choice(numbers), random.choice(numbers)
        tokens[a], tokens[b] = tokens[b], tokens[a]

    return _edit_tokens(text, random, edit)


def replace_token(text: str, random: Random) -> str:
    """A word takes the place of another: wrong kinds, but mostly balanced parentheses."""

    def edit(tokens: list[str], numbers: list[int]) -> None:
        words = [n for n in numbers if tokens[n] not in "()"]
        if words:
            tokens[random.choice(words)] = random.choice(
                (*(tokens[n] for n in words), *_ODD, "and", "not", "forall")
            )

    return _edit_tokens(text, random, edit)


def _groups(text: str) -> list[tuple[int, int]]:
    """The spans of all parenthesised groups."""
    spans, opened, at = [], [], 0
    for token in _tokens(text):
        if token == "(":
            opened.append(at)
        elif token == ")" and opened:
            spans.append((opened.pop(), at + 1))
        at += len(token)
    return spans


def drop_group(text: str, random: Random) -> str:
    spans = _groups(text)[:-1]
    if not spans:
        return text
    start, end = random.choice(spans)
    return text[:start] + random.choice(("", "()")) + text[end:]


def swap_groups(text: str, random: Random) -> str:
    spans = _groups(text)[:-1]
    if len(spans) < 2:
        return text
    (a, b), (c, d) = sorted(random.sample(spans, 2))
    if d <= b:  # one inside the other: the inner one takes the place of the outer one
        return text[:a] + text[c:d] + text[b:]
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


def wrap_group(text: str, random: Random) -> str:
    """A group becomes part of another connective or quantifier."""
    spans = _groups(text)
    if not spans:
        return text
    start, end = random.choice(spans)
    before, after = random.choice(
        (
            ("(not ", ")"),
            ("(and ", ")"),
            ("(or ", ")"),
            ("(imply (and) ", ")"),
            ("(when (and) ", ")"),
            ("(", ")"),
            ("(forall (?r ?o ?x) ", ")"),
            ("(exists (?from ?a) ", ")"),
            ("(forall () ", ")"),
            ("(increase ", " 1)"),
            ("(when ", " (and))"),
            ("(preference p ", ")"),
            ("(at 5 ", ")"),
            ("(= ", " 1)"),
            ("(:private ", ")"),
            ("(either ", ")"),
            ("(oneof ", ")"),
        )
    )
    return text[:start] + before + text[start:end] + after + text[end:]


def _literals(text: str) -> list[tuple[int, int]]:
    """The spans of groups without groups inside that stand in another one: atoms, mostly."""
    groups = _groups(text)
    return [(a, b) for a, b in groups if "(" not in text[a + 1 : b] and (a, b) != groups[-1]]


def edit_literal(text: str, random: Random) -> str:
    """One to three atoms are left out, negated, said twice, or get their words in another order."""
    for _ in range(random.choice((1, 1, 2, 3))):
        spans = _literals(text)
        if not spans:
            return text
        start, end = random.choice(spans)
        atom = text[start:end]
        words = atom[1:-1].split()
        if len(words) > 2:
            first, *rest = words
            random.shuffle(rest)
            words = [first, *rest]
        other = text[slice(*random.choice(spans))]
        new = random.choice(
            (
                "",
                f"(not {atom})",
                f"{atom} {atom}",
                f"({' '.join(words)})",
                other,
                f"{atom} {other}",
                f"(or {atom} {other})",
                f"(imply {atom} {other})",
                f"(when {atom} {other})",
            )
        )
        text = text[:start] + new + text[end:]
    return text


def other_variable(text: str, random: Random) -> str:
    """A variable gives its place to another one, once or twice."""

    def edit(tokens: list[str], numbers: list[int]) -> None:
        found = [n for n in numbers if tokens[n][0] == "?"]
        if found:
            tokens[random.choice(found)] = tokens[random.choice(found)]

    return _edit_tokens(text, random, edit)


def truncate(text: str, random: Random) -> str:
    return text[: random.randrange(len(text) + 1)]


def random_bytes(text: str, random: Random) -> str:
    data = bytearray(_bytes(text))
    for _ in range(random.choice((1, 2, 10, 200))):
        if data:
            data[random.randrange(len(data))] = random.randrange(256)
    return data.decode("utf-8", "surrogateescape")


def unbalance(text: str, random: Random) -> str:
    at = random.randrange(len(text) + 1)
    return text[:at] + random.choice("()") * random.choice((1, 1, 2, 500)) + text[at:]


def nest(text: str, random: Random) -> str:
    """10,000 levels (or just below the reader's limit) around a group."""
    depth = random.choice((10_000, 180, 30))
    spans = _groups(text)
    if not spans:
        return text
    start, end = random.choice(spans)
    head = random.choice(
        ("(not ", "(and ", "(or ", "(forall (?r) ", "(when (and) ", "(imply (and) ", "(")
    )
    return text[:start] + head * depth + text[start:end] + ")" * depth + text[end:]


def many_objects(text: str, random: Random) -> str:
    number = random.choice((300, 20_000, 1_000_000))
    kind = random.choice(("", "", " - robot", " - cell", " - object", " - agent"))
    names = " ".join(f"zz{n}" for n in range(number)) + kind
    if re.search(r"\(:objects", text, re.IGNORECASE):
        return re.sub(r"\(:objects", f"(:objects {names} ", text, count=1, flags=re.IGNORECASE)
    return _insert_section(text, f"(:constants {names})", random)


def many_sections(text: str, random: Random) -> str:
    number = random.choice((50, 2_000))
    section = random.choice(
        (
            "(:action a{n} :parameters (?r - robot))",
            "(:action a{n} :parameters () :effect (p{n}))",
            "(:predicates (p{n}) (q{n} ?x))",
            "(:types t{n} - t{m})",
            "(:constants c{n})",
            "(:init)",
            "(:requirements :r{n})",
        )
    )
    return _insert_section(
        text, " ".join(section.format(n=n, m=n + 1) for n in range(number)), random
    )


_ODD = (
    "9",
    "9x",
    "-",
    "--",
    "-1",
    "1.5",
    "=",
    "?",
    "?x",
    "??",
    ":x",
    "object",
    "either",
    "and",
    "not",
    "when",
    "forall",
    "idle",
    "none",
    "last",
    "environment",
    "robot",
    "agent",
    "total-cost",
    "define",
    "nan",
    "inf",
    "1e999",
    "x@y",
    "x.y_z+1",
    "a,b",
    "a'b",
    '"',
    "\\",
    "%s",
    "{0}",
    "é",
    "\u0130",
    "\u00b2",
    "\u0663",
    "\u200b",
    "\x00",
    "\x1b[31m",
    "x" * 5_000,
    "9" * 5_000,
    "None",
    "../../x",
    "$HOME",
    "`id`",
    "#",
    "_",
    "@",
    "o0",
    "p0",
    "v0",
)


def _names(text: str) -> list[str]:
    found = {t for t in _tokens(text) if not t.isspace() and t[0] not in "();" and t != "-"}
    return sorted(found)


def odd_name(text: str, random: Random) -> str:
    """One name becomes odd wherever it occurs."""
    names = _names(text)
    return _renamed(text, {random.choice(names): random.choice(_ODD)}) if names else text


def one_name(text: str, random: Random) -> str:
    """Several names become one: predicate, type, object and action alike."""
    plain = [name for name in _names(text) if name[0] not in ":?"]
    if len(plain) < 2:
        return text
    target = random.choice(plain)
    return _renamed(
        text, dict.fromkeys(random.sample(plain, min(len(plain), random.choice((1, 2, 4)))), target)
    )


def upper_case(text: str, random: Random) -> str:
    share = random.choice((0.1, 0.5, 1.0))
    return "".join(
        t.upper() if t[0] != ";" and random.random() < share else t for t in _tokens(text)
    )


def shadow(text: str, random: Random) -> str:
    """Variables take the names of other variables."""
    names = [name for name in _names(text) if name[0] == "?"]
    if len(names) < 2:
        return wrap_group(text, random)
    a, b = random.sample(names, 2)
    tokens = _tokens(text)
    share = random.choice((0.2, 0.5, 1.0))
    return "".join(b if t == a and random.random() < share else t for t in tokens)


def _renamed(text: str, names: dict[str, str]) -> str:
    return "".join(names.get(t, t) for t in _tokens(text))


def long_line(text: str, random: Random) -> str:
    joined = " ".join(t for t in _tokens(text) if not t.isspace() and t[0] != ";")
    at = random.randrange(len(joined) + 1)
    return joined[:at] + " " * random.choice((0, 1_000_000)) + joined[at:]


def line_ends(text: str, random: Random) -> str:
    return text.replace("\n", random.choice(("\r\n", "\r", "\r\r\n", "\v", "\f", "\u2028", "\x85")))


def marked(text: str, random: Random) -> str:
    """A byte order mark at the start or elsewhere, or another encoding."""
    kind = random.randrange(4)
    if kind == 0:
        return "\ufeff" + text
    if kind == 1:
        at = random.randrange(len(text) + 1)
        return text[:at] + "\ufeff" + text[at:]
    encoded = text.encode("utf-16" if kind == 2 else "utf-16-be", "surrogatepass")
    return encoded.decode("utf-8", "surrogateescape")


def _sections(text: str) -> list[tuple[int, int]]:
    return [(a, b) for a, b in _groups(text) if text[a + 1 : a + 2] == ":"]


def empty_section(text: str, random: Random) -> str:
    sections = _sections(text)
    if not sections:
        return text
    start, end = random.choice(sections)
    head = _tokens(text[start + 1 : end])[0]
    return text[:start] + f"({head})" + text[end:]


def double_section(text: str, random: Random) -> str:
    sections = _sections(text)
    if not sections:
        return text
    start, end = random.choice(sections)
    return text[:end] + text[start:end] * random.choice((1, 1, 30)) + text[end:]


def foreign_section(text: str, random: Random) -> str:
    return _insert_section(
        text,
        random.choice(
            (
                "(:durative-action x)",
                "(:derived (p ?x) (q ?x))",
                "(:constraints (and))",
                "(:functions (f) - number)",
                "(:metric minimize (total-time))",
                "(:objects a b)",
                "(:goal (and))",
                "(:init)",
                "(:types a - b b - a)",
                "(:types object)",
                "(:types a - (either b c) object)",
                "(:predicates (= ?a ?b))",
                "(:predicates ())",
                "(:predicates p)",
                "(:action)",
                "(:action x)",
                "(:action x y)",
                "(:action x :parameters)",
                "(:action (x))",
                "(:action x :agent)",
                "(:action x :agent ?a :parameters (?x))",
                "(:functions)",
                "(:functions (total-cost))",
                "(:constants)",
                "(:constants a - )",
                "(:constants - a)",
                "()",
                "x",
                "(x)",
                "(:domain)",
                "(:domain x y)",
                "(:length)",
                "(:private)",
                "; subaction\n",
                "(:action x ; subaction r1 (x)\n)",
                "(:concurrency-constraint v)",
                "(:action x :parameters (?x) :effect (increase (total-cost) 1e400))",
                "(:action x :parameters (?r - robot) :effect (increase (total-cost) "
                + "9" * 400
                + "))",
                "(:action x :parameters (?r - robot) :effect (increase (total-cost) "
                "99999999999999999999))",
                "(:action x :parameters (?a ?b ?c ?d ?e ?f ?g ?h) :effect (and))",
            )
        ),
        random,
    )


def _insert_section(text: str, section: str, random: Random) -> str:
    sections = _sections(text)
    at = random.choice(sections)[0] if sections else len(text)
    return text[:at] + section + " " + text[at:]


def numbers(text: str, random: Random) -> str:
    """Numbers become strange; where there are none, a cost is added."""
    tokens = _tokens(text)
    places = [n for n, t in enumerate(tokens) if re.fullmatch(r"-?\d+(\.\d+)?", t)]
    if not places:
        return foreign_section(text, random)
    odd = (
        "-1",
        "0.5",
        "1e9",
        "9" * 400,
        "99999999999999999999",
        "\u0663",
        "x",
        "+3",
        ".5",
        "5.",
        "007",
    )
    tokens[random.choice(places)] = random.choice(odd)
    return "".join(tokens)


def comments(text: str, random: Random) -> str:
    """A comment behind a random token, among them such as mean something."""
    tokens = _tokens(text)
    said = random.choice(
        (
            "; x",
            ";;;;",
            ";",
            "; subaction",
            "; subaction r1",
            "; subaction r1 idle",
            "; subaction r1 (move ?from ?to)",
            "; subaction r1 (",
            "; subaction r1 ()",
            "; subactions follow",
            "; (((",
            "; )))",
            "; \x00",
        )
    )
    for _ in range(random.choice((1, 5))):
        tokens.insert(random.randrange(len(tokens) + 1), f" {said}\n")
    return "".join(tokens)


def nothing(text: str, random: Random) -> str:
    return random.choice(
        (
            "",
            " \n",
            "; nothing\n",
            "()",
            "(define)",
            "(define (domain x))",
            "(define ())",
            "\x00",
            "x",
            ")",
        )
    )


MUTATIONS: tuple[Mutation, ...] = (
    drop,
    double,
    swap,
    replace_token,
    drop_group,
    swap_groups,
    wrap_group,
    truncate,
    random_bytes,
    unbalance,
    nest,
    many_objects,
    many_sections,
    odd_name,
    one_name,
    upper_case,
    shadow,
    long_line,
    line_ends,
    marked,
    empty_section,
    double_section,
    foreign_section,
    numbers,
    comments,
    nothing,
    edit_literal,
    other_variable,
)
#: How often each is used: the quiet ones get past the reader and are worth more.
_WEIGHT: dict[Mutation, float] = {
    edit_literal: 16,
    other_variable: 8,
    wrap_group: 8,
    drop_group: 6,
    replace_token: 5,
    one_name: 5,
    odd_name: 5,
    swap_groups: 4,
    shadow: 4,
    drop: 3,
    numbers: 2,
    nest: 2,
    many_objects: 0.7,
    many_sections: 0.7,
    nothing: 0.5,
}


# ---- mutants
# ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mutant:
    """A broken pair of files and the command to run on it."""

    number: int
    what: str
    pair: Pair
    domain: bytes
    problem: bytes
    command: str

    @property
    def light(self) -> bool:
        """Whether it stays small: what the quick run in the tests keeps to."""
        return len(self.domain) + len(self.problem) < 100_000


def mutant(number: int, seed: int, sources: Sequence[Pair]) -> Mutant:
    """Mutant ``number`` of a seed."""
    random = Random(f"{seed}/{number}")
    pair = random.choice(sources)
    domain, problem = pair.domain, pair.problem
    done = []
    for _ in range(random.choice((1, 1, 1, 2))):
        change = random.choices(MUTATIONS, [_WEIGHT.get(m, 1) for m in MUTATIONS])[0]
        which = random.choice(("domain", "domain", "problem", "both"))
        if change is many_objects:
            which = "problem"
        if change in (odd_name, one_name, shadow, upper_case) and which == "both":
            # The same change in both files, so that they still fit.
            joined = change(f"{domain}\x01{problem}", random)
            domain, _, problem = joined.partition("\x01")
        else:
            if which != "problem":
                domain = change(domain, random)
            if which != "domain":
                problem = change(problem, random)
        done.append(f"{change.__name__} ({which})")
    command = ("plans", "coordination", "build")[number % 3]
    return Mutant(number, ", ".join(done), pair, _bytes(domain), _bytes(problem), command)


# ---- running them
# ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Outcome:
    """What a run did; ``code`` is None for one that had to be killed or that died."""

    code: int | None
    out: str
    err: str
    seconds: float
    left: tuple[str, ...] = ()


@dataclass(frozen=True)
class Failure:
    mutant: Mutant
    outcome: Outcome
    why: str


@dataclass
class Report:
    """The sum of a run."""

    codes: Counter[tuple[str, str]] = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)
    slowest: list[tuple[float, str]] = field(default_factory=list)

    def text(self) -> str:
        columns = sorted(
            {code for _, code in self.codes}, key=lambda c: (not c.isdigit(), c.zfill(4))
        )
        commands = sorted({command for command, _ in self.codes})
        rows = [["command", *columns, "all"]]
        for command in commands:
            counts = [self.codes[command, code] for code in columns]
            rows.append([command, *map(str, counts), str(sum(counts))])
        total = [sum(self.codes[command, code] for command in commands) for code in columns]
        rows.append(["all", *map(str, total), str(sum(total))])
        lines = [
            "exit codes",
            *("  " + "".join(f"{cell:>9}" for cell in row) for row in rows),
            "",
            "slowest",
        ]
        lines += [
            f"  {seconds:6.2f} s  {what}"
            for seconds, what in sorted(self.slowest, reverse=True)[:5]
        ]
        lines += ["", f"{len(self.failures)} failures"]
        for failure in self.failures:
            m = failure.mutant
            lines.append(f"  #{m.number} {m.pair.name}, {m.what}, {m.command}: {failure.why}")
            lines += [
                f"      {line}" for line in failure.outcome.err.strip()[-600:].splitlines()[-4:]
            ]
        return "\n".join(lines)


class Runner:
    """Runs commands in a worker process, or now and then in one of their own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._worker: subprocess.Popen[str] | None = None
        self._age = 0
        for name in ("work", "tmp"):
            (folder / name).mkdir()

    def close(self) -> None:
        if self._worker is not None:
            self._worker.kill()
            self._worker.communicate()
            self._worker = None

    def run(self, arguments: Sequence[str], *, fresh: bool) -> Outcome:
        """Run ``coordlang ARGUMENTS`` in the folder ``work``."""
        out, err = self._folder / "out", self._folder / "err"
        for path in (out, err):
            path.write_bytes(b"")
        start = time.perf_counter()
        code = self._once(arguments, out, err) if fresh else self._ask(arguments, out, err)
        seconds = time.perf_counter() - start
        return Outcome(code, _text(out), _text(err), seconds, tuple(self._leftovers()))

    def _environment(self) -> dict[str, str]:
        return {
            **os.environ,
            "TMPDIR": str(self._folder / "tmp"),
            "PYTHONPATH": str(ROOT),
            "PYTHONFAULTHANDLER": "1",
        }

    def _once(self, arguments: Sequence[str], out: Path, err: Path) -> int | None:
        command = [sys.executable, "-c", "from coordlang.cli import main; main()", *arguments]
        with out.open("wb") as to, err.open("wb") as errors:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=to,
                stderr=errors,
                cwd=self._folder / "work",
                env=self._environment(),
                start_new_session=True,
            )
            try:
                return process.wait(TIME_LIMIT + GRACE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                return None

    def _ask(self, arguments: Sequence[str], out: Path, err: Path) -> int | None:
        self._age += 1
        if self._age > _WORKER_LIFE:
            self.close()
        if self._worker is None:
            self._age = 0
            self._worker = subprocess.Popen(
                [sys.executable, str(Path(__file__).resolve()), "--worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                cwd=self._folder / "work",
                env=self._environment(),
            )
            self._answer(30)
        worker = self._worker
        assert worker.stdin is not None
        worker.stdin.write(
            json.dumps({"arguments": list(arguments), "out": str(out), "err": str(err)}) + "\n"
        )
        worker.stdin.flush()
        answer = self._answer(TIME_LIMIT + GRACE)
        if answer is None:
            self.close()
            return None
        return int(answer["code"])

    def _answer(self, seconds: float) -> dict[str, Any] | None:
        assert self._worker is not None
        assert self._worker.stdout is not None
        ready, _, _ = select.select([self._worker.stdout], [], [], seconds)
        line = self._worker.stdout.readline() if ready else ""
        return json.loads(line) if line else None

    def _leftovers(self) -> Iterator[str]:
        for path in (self._folder / "tmp").iterdir():
            yield f"tmp/{path.name}"
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        for path in (self._folder / "work").iterdir():
            if path.name not in ("domain.pddl", "problem.pddl", "language.json"):
                yield f"work/{path.name}"
                path.unlink()
        if self._worker is not None and self._worker.poll() is None:
            try:
                children = (
                    Path(f"/proc/{self._worker.pid}/task/{self._worker.pid}/children")
                    .read_text()
                    .split()
                )
            except OSError:
                children = []
            yield from (f"process {pid}" for pid in children)


def _text(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "replace")


def worker() -> None:
    """Serve requests, one JSON line each, on stdin and stdout; a run's own output goes to files."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    # `run` is imported before any memory limit is set.
    from coordlang.cli import run

    def reply(data: dict[str, Any]) -> None:
        answers.write(json.dumps(data) + "\n")
        answers.flush()

    reply({"ready": True})
    for line in sys.stdin:
        request = json.loads(line)
        for number, key in ((1, "out"), (2, "err")):
            target = os.open(request[key], os.O_WRONLY | os.O_TRUNC)
            os.dup2(target, number)
            os.close(target)
        try:
            code = run(request["arguments"])
        except BaseException:  # what the interpreter would do with it
            traceback.print_exc()
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
        reply({"code": code})


def arguments_of(m: Mutant) -> list[str]:
    """The command line for a mutant."""
    own = {"plans": ["--count"], "coordination": [], "build": ["-o", "language.json"]}[m.command]
    limits = ["--time-limit", str(TIME_LIMIT), "--memory-limit", MEMORY_LIMIT]
    return [m.command, "domain.pddl", "problem.pddl", *own, *m.pair.options, *limits]


def complaint(m: Mutant, outcome: Outcome, written: bool) -> str | None:
    """What is wrong with an outcome, or None."""
    code, err = outcome.code, outcome.err
    for sign in ("Traceback", "Exception ignored", "Fatal Python error"):
        if sign in err:
            return f"{sign!r} on stderr (exit {code})"
    if code is None:
        return f"no answer after {outcome.seconds:.1f} s: a hang, or the process died"
    if code not in DOCUMENTED:
        return f"exit code {code}"
    if outcome.left:
        return f"left behind: {', '.join(outcome.left)}"
    if written != (m.command == "build" and code in (0, 3)):
        return f"exit code {code} and {'a' if written else 'no'} language file"
    if code == 0:
        return None if outcome.out.strip() else "no output"
    if code == 2 and m.pair.options:
        return None  # --robot-type of a type that the mutation took away
    if not re.search(r"^coordlang: (?!note: )\S", err, re.MULTILINE):
        return f"exit code {code} without a message"
    if code in (31, 34):
        if "domain.pddl" not in err and "problem.pddl" not in err:
            return f"exit code {code}: the message names no file"
        if not _PLACE.search(err) and not any(text in err for text in _PLACELESS):
            return f"exit code {code}: the message names no line"
    return None


def fuzz(
    numbers: Sequence[int],
    seed: int,
    sources: Sequence[Pair],
    *,
    keep: Path | None = None,
    only_light: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Report:
    """Run mutants and judge them; files of failures go to ``keep``.

    An interrupt (Ctrl-C) ends it early, with the report so far.
    """
    report = Report()
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-") as name,
        contextlib.suppress(KeyboardInterrupt),
    ):
        folder = Path(name)
        runner = Runner(folder)
        try:
            for done, number in enumerate(numbers):
                m = mutant(number, seed, sources)
                if only_light and not m.light:
                    continue
                _judge(m, runner, folder / "work", report, keep)
                if done % 20 == 0:
                    progress(f"{done} of {len(numbers)}")
        finally:
            runner.close()
    return report


def _judge(m: Mutant, runner: Runner, work: Path, report: Report, keep: Path | None) -> None:
    (work / "domain.pddl").write_bytes(m.domain)
    (work / "problem.pddl").write_bytes(m.problem)
    language = work / "language.json"
    language.unlink(missing_ok=True)
    outcome = runner.run(arguments_of(m), fresh=m.number % _FRESH == 0)
    report.codes[m.command, "killed" if outcome.code is None else str(outcome.code)] += 1
    report.slowest = sorted(
        [*report.slowest, (outcome.seconds, f"#{m.number} {m.pair.name}, {m.what}")]
    )[-5:]
    why = complaint(m, outcome, language.exists())
    if why is None:
        return
    report.failures.append(Failure(m, outcome, why))
    if keep is not None:
        target = keep / f"{m.number:06}"
        target.mkdir(parents=True, exist_ok=True)
        (target / "domain.pddl").write_bytes(m.domain)
        (target / "problem.pddl").write_bytes(m.problem)
        text = f"{why}\n{m.what}\n\ncoordlang {' '.join(arguments_of(m))}\n\n{outcome.err}"
        (target / "why.txt").write_text(text, errors="replace")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=2000, help="how many mutants")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=int, default=0, help="number of the first mutant")
    parser.add_argument(
        "--keep",
        type=Path,
        default=Path(tempfile.gettempdir()) / "coordlang-fuzz",
        help="for failures",
    )
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        worker()
        return 0

    def progress(text: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{text} ..", end="", file=sys.stderr, flush=True)

    start = time.perf_counter()
    chosen = range(given.start, given.start + given.number)
    report = fuzz(chosen, given.seed, pairs(), keep=given.keep, progress=progress)
    progress("done")
    print(report.text())
    done, seconds = sum(report.codes.values()), time.perf_counter() - start
    print(f"\n{done} mutants, seed {given.seed}, from {given.start}: {seconds:.0f} s")
    if report.failures:
        print(f"files in {given.keep}")
    return 1 if report.failures else 0


if __name__ == "__main__":
    sys.exit(main())
