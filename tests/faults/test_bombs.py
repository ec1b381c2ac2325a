# SPDX-License-Identifier: GPL-3.0-or-later
"""Small inputs that ask for much: refused, or stopped at a limit, before they take the machine."""

from __future__ import annotations

import gzip
import subprocess
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path

import msgspec
import pytest

from coordlang.commands.building import build_language
from coordlang.commands.built import Built
from coordlang.language.file import read_language
from coordlang.language.task_file import read_task_file
from coordlang.verification.certificate_clauses import encode
from coordlang.verification.certificate_file import Certificate, read_certificate
from coordlang.verification.check_certificate import check
from planners.pddl import parse_domain
from planners.pddl.sexpr import Source
from planners.search.plan_file import read_plans
from planners.system.errors import BadInput, OutOfMemory, Refuted
from planners.system.files import read_bytes
from planners.system.limits import time_limit
from tests.support.command import Command, own_process
from tests.support.domains import DOMAINS, all_tasks
from tests.support.forks import fork_command

MIB = 2**20


@contextmanager
def at_most(mib: int) -> Iterator[None]:
    """The block allocates no more."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < mib * MIB
    finally:
        tracemalloc.stop()


def bomb(folder: Path, mib: int) -> Path:
    """A file of gzip that holds so many MiB."""
    path = folder / "bomb.json.gz"
    path.write_bytes(gzip.compress(b" " * MIB) * mib)
    return path


# Sizes


def test_a_gzip_bomb_is_refused_before_it_takes_memory(tmp_path: Path) -> None:
    path = bomb(tmp_path, 65)
    with at_most(16), pytest.raises(BadInput, match="more than 64 MiB"):
        read_bytes(path, most=64 * MIB)


@pytest.mark.slow
def test_a_large_gzip_bomb_is_refused(tmp_path: Path) -> None:
    path = bomb(tmp_path, 1025)
    assert path.stat().st_size < 2 * MIB
    with pytest.raises(BadInput, match=r"bomb\.json\.gz: the file holds more than 1,024 MiB"):
        read_language(path)


def test_a_file_without_end_is_refused(tmp_path: Path) -> None:
    for path in (Path("/dev/zero"), bomb(tmp_path, 3)):
        with pytest.raises(BadInput, match="more than 2 MiB"):
            read_bytes(path, most=2 * MIB)
    assert len(read_bytes(bomb(tmp_path, 2), most=2 * MIB)) == 2 * MIB


def test_what_would_not_fit_is_out_of_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planners.system.files.memory_left", lambda: 64 * MIB)
    assert read_bytes(bomb(tmp_path, 16))
    with pytest.raises(OutOfMemory, match=r"bomb.*\.gz: reading 17 MiB takes 68 MiB.* 64 MiB are"):
        read_bytes(bomb(tmp_path, 17))


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data,
        lambda data: data + b"\0" * 700,  # gzip pads with zeros
        lambda data: data + data,
        lambda data: data[:-9],
        lambda data: data[:30] + b"??" + data[32:],
        lambda data: data + b"x",
    ],
)
def test_other_gzip_is_read_as_python_reads_it(
    change: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    data = change(gzip.compress(bytes(range(256)) * 20_000))
    (tmp_path / "f.gz").write_bytes(data)
    try:
        expected = gzip.decompress(data)
    except Exception:
        with pytest.raises(BadInput, match="cannot be read"):
            read_bytes(tmp_path / "f.gz")
    else:
        assert read_bytes(tmp_path / "f.gz") == expected


# Nesting

SHELLS: dict[str, tuple[Callable[[Path], object], str]] = {
    "language": (
        read_language,
        '{"format": "coordlang/language", "version": 1, "words": ["a"], "default": "a", '
        '"states": {}, "producer": {"x": %s}}',
    ),
    "certificate": (
        read_certificate,
        '{"format": "coordlang/certificate", "version": 1, "domain": "grid", '
        '"robots": ["r1", "r2"], "refuted": 0, "reasons": [], "producer": {"x": %s}}',
    ),
    "tasks": (
        read_task_file,
        '{"format": "coordlang/tasks", "version": 1, "x": %s, '
        '"tasks": [{"init": ["(p)"], "goal": ["(q)"]}]}',
    ),
    "plans": (
        lambda path: read_plans(path, all_tasks("grid", "gw1-2x2").model),
        '{"x": %s, "plans": [{"actions": [[null, null]]}]}',
    ),
}


@pytest.mark.parametrize(("opening", "inside", "closing"), [("[", "", "]"), ('{"k":', "0", "}")])
@pytest.mark.parametrize("kind", SHELLS)
def test_deep_nesting_is_refused(
    kind: str, opening: str, inside: str, closing: str, tmp_path: Path
) -> None:
    read, shell = SHELLS[kind]
    path = tmp_path / "deep.json"
    path.write_text(shell % (opening * 100_000 + inside + closing * 100_000))
    with pytest.raises(BadInput, match=r"deep\.json: this is no JSON, or it is cut off: "):
        read(path)
    path.write_text(shell % ("[" * 150 + "]" * 150))
    assert read(path)


# Certificates


@pytest.fixture(scope="module")
def built() -> Built:
    return build_language(all_tasks("grid", "gw1-2x2"), "minimal")


@pytest.fixture(scope="module")
def certificate(built: Built) -> Certificate:
    return built.certificate()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"refuted": 1_000_000}, "leave languages with 1000000 words"),
        ({"refuted": 10**30}, f"leave languages with {10**30} words"),
        ({"refuted": 12}, "leave languages with 12 words"),  # there are 12 states
        ({"refuted": 11}, "leave languages with 11 words"),
        ({"reasons": [], "refuted": 1_000_000}, "0 reasons leave languages with 1000000 words"),
        ({"domain": "t-map"}, "about the domain 't-map', not 'grid'"),
    ],
)
def test_a_false_claim_is_refuted_before_it_takes_memory(
    change: dict[str, object], said: str, built: Built, certificate: Certificate
) -> None:
    claim = msgspec.structs.replace(certificate, **change)
    with at_most(16), pytest.raises(Refuted, match=said):
        check(claim, built.job.candidates)


@pytest.mark.parametrize(
    ("before", "twice", "key"),
    [
        ('"refuted":2', '"refuted":1,"refuted":2', "refuted"),
        ('"init":', '"init":[],"init":', "init"),
        ('"producer":{}', '"producer":{"a":1,"a":2}', "a"),
    ],
)
def test_keys_that_occur_twice(
    before: str, twice: str, key: str, certificate: Certificate, tmp_path: Path
) -> None:
    text, path = msgspec.json.encode(certificate).decode(), tmp_path / "twice.json"
    assert before in text
    path.write_text(text.replace(before, twice, 1))
    with pytest.raises(BadInput, match=rf"twice\.json: the key '{key}' occurs twice"):
        read_certificate(path)


def test_a_formula_that_would_not_fit_is_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimate has room for the solver, and is of the right size."""
    left = 60 * MIB
    monkeypatch.setattr("coordlang.verification.certificate_clauses.memory_left", lambda: left)
    clauses = [frozenset({two}) for two in combinations(range(80), 2)]
    with at_most(32):
        with pytest.raises(OutOfMemory, match=r"79 words for 80 states has [\d,]+ clauses"):
            encode(clauses, 79)
        cnf = encode(clauses, 20)
        made = tracemalloc.get_traced_memory()[0]
    left = made
    with pytest.raises(OutOfMemory, match="20 words for 80 states"):
        encode(clauses, 20)
    left = 4 * made
    assert encode(clauses, 20) == cnf


# PDDL


def typed(types: str, predicates: str = "(p)") -> Source:
    action = "(:action act :parameters () :effect (p))"
    return Source("d", f"(define (domain d) (:types {types}) (:predicates {predicates}) {action})")


def test_ten_thousand_types_one_below_the_other() -> None:
    types = " ".join(f"t{n} - t{n + 1}" for n in range(10_000))
    with time_limit(15):  # with a look at all types above each type: minutes
        domain = parse_domain(typed(types, "(p) (q ?x - t10000)"))
        assert len(domain.supertypes("t0")) == 10_002
        with pytest.raises(BadInput, match="the types form a cycle: t4000 - t4001 - "):
            parse_domain(typed(types.replace("t9999 - t10000", "t9999 - t4000")))


@pytest.mark.parametrize(
    ("types", "cycle"),
    [
        ("a - b b - c c - a", "a - b - c - a"),
        ("x - a a - b b - (either c a) c - d", "a - b - a"),
        ("d - (either b c) b - a c - a e - (either d a)", None),
        ("a - a", None),
    ],
)
def test_cycles_of_types(types: str, cycle: str | None) -> None:
    if cycle is None:
        assert parse_domain(typed(types))
    else:
        with pytest.raises(BadInput, match=rf"the types form a cycle: {cycle}(\n|$)"):
            parse_domain(typed(types))


DOMAIN = """(define (domain d) (:requirements :typing :multi-agent) (:types robot thing)
  (:constants o1 - thing)
  (:predicates (done ?r - robot) (linked ?a ?b - thing) (p ?a ?b ?c ?d ?e ?f - thing))
  (:action finish :agent ?r - robot :parameters () :effect (done ?r))
  (:action act :agent ?r - robot :parameters (%s) :precondition (and %s) :effect (and %s)))"""
SIX = "?a ?b ?c ?d ?e ?f - thing"
ATOM = "(p ?a ?b ?c ?d ?e ?f)"
NINE = "?a ?b ?c ?d ?e ?f ?g ?h ?i - thing"
CLIQUE = " ".join(f"(linked ?{a} ?{b})" for a, b in combinations("abcdefghi", 2))
#: Two hundred things and a predicate of six: all instances, all effects, all conditions; and eighty
#: things and nine parameters: a join that looks at 10^8 combinations and finds none.
LARGE = {
    "instances": DOMAIN % (SIX, "", ATOM),
    "effects": DOMAIN % ("", "", f"(forall ({SIX}) {ATOM})"),
    "conditions": DOMAIN % ("", f"(forall ({SIX}) (not {ATOM}))", "(p o1 o1 o1 o1 o1 o1)"),
    "join": DOMAIN % (NINE, CLIQUE, "(done ?r)"),
}


def large(name: str, folder: Path) -> list[str]:
    """The files of a domain with many objects."""
    number = 80 if name == "join" else 200
    names = " ".join(f"o{n}" for n in range(number))
    pairs = [(m, n) for m in range(number) for n in range(number) if m % 8 < n % 8]
    links = " ".join(f"(linked o{m} o{n})" for m, n in pairs) if name == "join" else ""
    domain, problem = folder / "domain.pddl", folder / "problem.pddl"
    domain.write_text(LARGE[name])
    problem.write_text(
        f"(define (problem large) (:domain d) (:objects r1 r2 - robot {names} - thing) "
        f"(:init {links}) (:goal (and (done r1) (done r2))))"
    )
    return [str(domain), str(problem)]


@pytest.mark.parametrize("name", ["effects", "conditions", "join"])
def test_six_parameters_and_two_hundred_objects_in_time(name: str, tmp_path: Path) -> None:
    done = fork_command("plans", *large(name, tmp_path), "--count", "--time-limit", 1).join(60)
    assert done.code == 23, done
    assert "the time limit of 1 s is over\n  Reached: " in done.err


def test_six_parameters_and_two_hundred_objects_in_memory(
    coordlang: Command, tmp_path: Path
) -> None:
    done = coordlang("plans", *large("instances", tmp_path), "--count", "--time-limit", 100)
    assert done.code == 22
    assert "action 'act' has 128,000,000,000,000 instances: they take" in done.err
    assert done.err.startswith(f"coordlang: {tmp_path}/domain.pddl:5:3: ")


@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
@pytest.mark.parametrize("limit", ["400M", "2G"])
def test_six_parameters_and_two_hundred_objects_under_a_limit(
    name: str, limit: str, tmp_path: Path
) -> None:
    limits = ("--memory-limit", limit, "--time-limit", 300)
    command = own_process("plans", *large(name, tmp_path), "--count", *limits)
    done = subprocess.run(command, capture_output=True, text=True, timeout=400)
    assert done.returncode in (22, 23), done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_ten_thousand_types_for_every_command(coordlang: Command, tmp_path: Path) -> None:
    """The grid, its cells at the foot of ten thousand types."""
    chain = " ".join(f"t{n} - t{n + 1}" for n in range(10_000))
    text = (DOMAINS / "grid" / "domain.pddl").read_text()
    domain, language = tmp_path / "domain.pddl", tmp_path / "l.json"
    domain.write_text(text.replace("(:types", f"(:types cell - t0 {chain}", 1))
    files = domain, DOMAINS / "grid" / "gw1-2x2.pddl"
    for command in ("inspect", "plans", "coordination", "check"):
        assert coordlang(command, *files).code == 0
    assert coordlang("build", *files, "--method", "greedy", "-o", language).code == 0
    assert coordlang("verify", language, *files).code == 0
