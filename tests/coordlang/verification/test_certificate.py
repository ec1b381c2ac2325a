# SPDX-License-Identifier: GPL-3.0-or-later
"""Certificates of lower bounds: what is written holds, and what was tampered with does not."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest

from coordlang.commands.building import Built, build_language
from coordlang.language.file import read_language
from coordlang.verification.certificate_file import (
    Certificate,
    Cnf,
    Reason,
    WarpingPath,
    read_certificate,
    write_certificate,
)
from coordlang.verification.check_certificate import check
from coordlang.verification.make_certificate import core
from coordlang.vocabulary.loop import Budget
from coordlang.vocabulary.minimal import MinimalSearch, refuting_clauses
from planners.system.errors import OutOfTime, Refuted
from planners.system.limits import time_left
from tests.support import thorough
from tests.support.candidates import small_candidates
from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.task_languages import built_for


@pytest.fixture(scope="module")
def built() -> Built:
    return built_for("grid", "gw1-2x2")


@pytest.fixture(scope="module")
def certificate(built: Built) -> Certificate:
    return built.certificate()


def test_proves_the_minimum(built: Built, certificate: Certificate, tmp_path: Path) -> None:
    write_certificate(certificate, tmp_path / "c.json.gz")
    again = read_certificate(tmp_path / "c.json.gz")
    assert again == certificate
    checked = check(again, built.job.candidates)
    assert checked.lower_bound == built.language.guarantee.size == 3
    assert checked.reasons == len(certificate.reasons) > 1


def test_any_solver_refutes_the_dimacs(built: Built, certificate: Certificate) -> None:
    from pysat.formula import CNF
    from pysat.solvers import Solver

    text = check(certificate, built.job.candidates).dimacs()
    assert "c 1: word 0 holds (at r1 c" in text
    formula = CNF(from_string=text)
    assert len(formula.clauses) > 20
    for name in ("minisat22", "lingeling"):
        with Solver(name=name, bootstrap_with=formula) as solver:
            assert solver.solve() is False


Meaning = Callable[[dict[str, int]], bool]


def meaning_of(comment: str, states: list[str]) -> tuple[int, Meaning]:
    """A variable, and what it says of a partition (state -> word), by its comment."""
    number, _, text = comment.removeprefix("c ").partition(": ")
    if found := re.fullmatch(r"word (\d+) holds one of the first (\d+) states", text):
        word, first = int(found[1]), states[: int(found[2])]
        return int(number), lambda words: any(words[s] == word for s in first)
    if found := re.fullmatch(r"word (\d+) holds (.*)", text):
        word, state = int(found[1]), found[2]
        return int(number), lambda words: words[state] == word
    one, other = text.removesuffix(" have different words").split(" and ")
    return int(number), lambda words: words[one] != words[other]


def passed(reason: Reason, plan: int) -> list[str]:
    """The states that a plan of the grid passes through."""
    cells = {atom.split()[1]: atom.split()[2][:-1] for atom in reason.init}
    states = [f"(at r1 {cells['r1']}) (at r2 {cells['r2']})"]
    for step in reason.plans[plan]:
        for subaction in filter(None, step):
            _, robot, _, to = subaction[1:-1].split()
            cells[robot] = to
        states.append(f"(at r1 {cells['r1']}) (at r2 {cells['r2']})")
    return states


def separated(reason: Reason, words: dict[str, int]) -> bool:
    """Whether two states on a cell of the reason's paths have different words."""
    cells = [(path.plans, cell) for path in reason.paths for cell in path.cells]
    pairs = [(passed(reason, a)[i], passed(reason, b)[j]) for (a, b), (i, j) in cells]
    return any(words[one] != words[other] for one, other in pairs if one != other)


def test_comments_say_what_variables_and_clauses_mean(
    built: Built, certificate: Certificate
) -> None:
    lines = check(certificate, built.job.candidates).dimacs().splitlines()
    header = next(number for number, line in enumerate(lines) if line.startswith("p cnf"))
    comments = lines[1:header]
    states = [m[1] for line in comments if (m := re.fullmatch(r"c \d+: word 0 holds (\(.*)", line))]
    meaning = dict(meaning_of(line, states) for line in comments if re.match(r"c \d+: ", line))
    clauses = [[int(literal) for literal in line.split()[:-1]] for line in lines[header + 1 :]]
    assert lines[header] == f"p cnf {len(meaning)} {len(clauses)}"
    assert sorted(meaning) == [*range(1, len(meaning) + 1)]
    kinds = [m for line in comments if (m := re.match(r"c clauses (\d+) to (\d+): ", line))]
    reasons = [m for line in comments if (m := re.match(r"c clause (\d+): reason (\d+)$", line))]
    numbers = [n for m in kinds for n in range(int(m[1]), int(m[2]) + 1)]
    assert numbers + [int(m[1]) for m in reasons] == [*range(1, len(clauses) + 1)]
    assert [int(m[2]) for m in reasons] == [*range(1, len(certificate.reasons) + 1)]
    random = Random(0)
    for _ in range(50):  # partitions whose words are named in the order of the states
        words = {state: random.randrange(2) if n else 0 for n, state in enumerate(states)}
        true = {v if says(words) else -v for v, says in meaning.items()}
        holds = [not true.isdisjoint(clause) for clause in clauses]
        assert all(holds[: len(numbers)])
        assert holds[len(numbers) :] == [separated(r, words) for r in certificate.reasons]


def same_plan(reason: Reason) -> dict[str, object]:
    cells = [(k, k) for k in range(len(reason.plans[0]) + 1)]
    return {"plans": [reason.plans[0]] * 2, "paths": [WarpingPath((0, 1), cells)]}


def path(reason: Reason, *cells: tuple[int, int], plans: tuple[int, int] = (0, 1)) -> object:
    return {"paths": [WarpingPath(plans, list(cells))]}


TAMPERED: list[tuple[str, Callable[[Reason], Any]]] = [
    ("is no optimal plan", lambda r: {"plans": [r.plans[0][:-1], r.plans[1]]}),
    (
        "is no optimal plan",
        lambda r: {"plans": [r.plans[0], [["(move r1 c9 c9)", None], *r.plans[1][1:]]]},
    ),
    ("is no optimal plan", lambda r: {"plans": [r.plans[0], [step[:1] for step in r.plans[1]]]}),
    ("the mixture of its plans is one of the optimal plans", same_plan),
    ("expected a plan for each of 2 robots", lambda r: {"plans": [*r.plans, r.plans[0]]}),
    ("do not join all of its plans", lambda r: {"paths": []}),
    ("is no warping path", lambda r: path(r, *r.paths[0].cells[1:])),
    ("is no warping path", lambda r: path(r, *r.paths[0].cells[:-1])),
    ("is no warping path", lambda r: path(r, r.paths[0].cells[0], r.paths[0].cells[-1])),
    ("there are no plans", lambda r: path(r, *r.paths[0].cells, plans=(0, 2))),
    ("is no candidate task", lambda r: {"goal": r.init}),
    ("is no candidate task", lambda r: {"goal": r.goal[:1]}),
    ("can never be true", lambda r: {"init": ["(at r1 nowhere)"]}),
]


@pytest.mark.parametrize(("what", "change"), TAMPERED)
def test_tampered(
    built: Built, certificate: Certificate, what: str, change: Callable[[Reason], Any]
) -> None:
    number = next(n for n, r in enumerate(certificate.reasons) if len(r.paths[0].cells) > 2)
    reasons = list(certificate.reasons)
    reasons[number] = msgspec.structs.replace(reasons[number], **change(reasons[number]))
    bad = msgspec.structs.replace(certificate, reasons=reasons)
    with pytest.raises(Refuted, match=f"reason {number + 1} of the certificate is wrong.*{what}"):
        check(bad, built.job.candidates)


def test_what_proves_nothing(built: Built, certificate: Certificate) -> None:
    """One word more must be satisfiable by the same reasons: else the encoding refutes anything."""
    for changes, match in (
        ({"reasons": certificate.reasons[:1]}, "leave languages with 2 words"),
        ({"robots": ["a", "b"]}, "other robots"),
        ({"refuted": 3}, "leave languages with 3 words"),
    ):
        with pytest.raises(Refuted, match=match):
            check(msgspec.structs.replace(certificate, **changes), built.job.candidates)


@pytest.mark.parametrize("method", ["greedy", "separating", "exhaustive"])
def test_other_methods(method: str) -> None:
    """A certificate for what the method proves, also where it met no counterexamples itself."""
    built, least = built_for("three-cells", method=method), 3 if method == "exhaustive" else 2
    checked = check(built.certificate(), built.job.candidates)
    assert checked.lower_bound == built.language.guarantee.lower_bound == least


def test_nothing_to_refute() -> None:
    built = built_for("grid", "gw1-2x2", "greedy")
    with pytest.raises(ValueError, match="there is a language with 3 words"):
        refuting_clauses(built.job, 3)
    with pytest.raises(ValueError, match="leave a partition into 1 words"):
        core([], 1)
    assert all(Cnf(*own).refuted() for own in (([frozenset({(0, 1)})], 1), ([], 0)))
    assert not Cnf([frozenset({(0, 1)})], 2).refuted()


@pytest.mark.parametrize(("robots", "number"), [(2, 3), (3, 3), *thorough((2, 12), (3, 9))])
def test_random_models(robots: int, number: int) -> None:
    """Every minimum of random models is proved by its certificate, and of none a larger one."""
    bounds: list[int] = []
    for seed, candidates in small_candidates(robots, states=12):
        built = build_language(candidates, "minimal")
        if built.language.guarantee.size == 1 and seed % 50:
            continue
        certificate = built.certificate()
        assert check(certificate, candidates).lower_bound == built.language.guarantee.size
        with pytest.raises(Refuted, match="leave languages"):
            check(msgspec.structs.replace(certificate, refuted=certificate.refuted + 1), candidates)
        bounds.append(built.language.guarantee.size)
        if len(bounds) == number:
            break
    assert max(bounds) > 2


# A search that is stopped proves a bound


#: The search is stopped when it comes to this number of words; fewer are refuted.
STOPPED_AT = 4
GW2 = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "gw2-2x3.pddl"
MINIMAL = ("--tasks", "all", "--method", "minimal")


@pytest.fixture
def late(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Searches are stopped at `STOPPED_AT` words; the seconds that were left then."""
    decide, left = MinimalSearch.decide, list[float]()

    def decide_few(search: MinimalSearch, size: int, budget: Budget) -> bool:
        if size == STOPPED_AT:
            left.append(time_left())
            raise OutOfTime("late")
        return decide(search, size, budget)

    monkeypatch.setattr(MinimalSearch, "decide", decide_few)
    return left


@pytest.fixture
def pair(coordlang: Command, late: list[float], tmp_path: Path) -> tuple[Path, Path]:
    """The language and the certificate of a search that was stopped."""
    language, proof = tmp_path / "l.json", tmp_path / "c.json"
    made = coordlang("build", *GW2, *MINIMAL, "-o", language, "--certificate", proof)
    assert made.code == 3
    assert "the certificate proves a lower bound of 4 words, not that" in made.err
    return language, proof


def test_the_bound_of_a_search_that_was_stopped(
    pair: tuple[Path, Path], coordlang: Command
) -> None:
    """It is verified as a bound, and not as a proof that the language is minimal."""
    language, proof = pair
    assert read_certificate(proof).refuted == STOPPED_AT - 1
    found = coordlang("verify", language, *GW2, "--certificate", proof)
    assert found.code == 0
    bound, minimal = found.out.splitlines()[-2:]
    assert bound.startswith("lower bound 4: ")
    size = read_language(language).guarantee.size
    assert size > STOPPED_AT
    at_most = f"the least number of words is at least 4 and at most {size}"
    assert minimal == f"not proved minimal: {at_most}"
    data = json.loads(coordlang("verify", language, *GW2, "--certificate", proof, "--json").out)
    assert (data["lower_bound"], data["words"], data["proved_minimal"]) == (4, size, False)
    assert json.loads(coordlang("verify", language, *GW2, "--json").out)["proved_minimal"] is None


Data = dict[str, Any]


def claims(language: Data, bound: int, proved: bool = False) -> Data:
    language["guarantee"] |= {"lower_bound": bound, "proved_minimal": proved}
    return language


#: What is changed in a language of some size and in its certificate, and what is said of it.
FORGED: list[tuple[Callable[[Data, Data, int], object], str]] = [
    (lambda d, _, size: claims(d, size, True), " words are needed; the certificate proves 4"),
    (lambda d, c, _: (claims(d, 5), c.update(refuted=4)), "reasons leave languages with 4 words"),
    (
        lambda d, c, n: (claims(d, n, True), c.update(refuted=n - 1)),
        "reasons leave languages with ",
    ),
    (lambda _, c, __: c.update(reasons=c["reasons"][::2]), "leave languages with 3 words"),
    (lambda _, c, __: c.update(reasons=c["reasons"][:1] * 9), "leave languages with 3 words"),
    (
        lambda _, c, __: c.update(refuted=2),
        "that 4 words are needed; the certificate proves 3 only",
    ),
    (lambda d, *_: d.update(states={}), "note: the certificate was not checked"),
    (lambda d, _, __: claims(d, 4, True), "'proved_minimal' contradicts the lower bound"),
]


def test_forged_bounds(pair: tuple[Path, Path], coordlang: Command, tmp_path: Path) -> None:
    """A bound is never taken for more than its reasons prove."""
    for forge, said in FORGED:
        texts = [json.loads(path.read_bytes()) for path in pair]
        forge(texts[0], texts[1], texts[0]["guarantee"]["size"])
        files = [tmp_path / "forged.json", tmp_path / "forged-proof.json"]
        for path, text in zip(files, texts, strict=True):
            path.write_text(json.dumps(text))
        found = coordlang("verify", files[0], *GW2, "--certificate", files[1])
        assert found.code == (31 if "contradicts" in said else 1), found
        assert said in found.err


def test_a_part_of_the_time_is_left_for_the_certificate(
    late: list[float], coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[float] = []

    own = Built.certificate

    def noted(built: Built) -> Certificate:
        left.append(time_left())
        return own(built)

    monkeypatch.setattr(Built, "certificate", noted)
    output = "-o", tmp_path / "l.json", "--time-limit", "1000"
    made = coordlang("build", *GW2, *MINIMAL, *output, "--certificate", tmp_path / "c.json")
    assert made.code == 3
    assert "late, a part of it kept for the certificate; the best language so far is" in made.err
    assert 600 < late[0] <= 750  # of the search
    assert 850 < left[0] <= 1000  # the search came to an end long before
    assert coordlang("build", *GW2, *MINIMAL, *output).code == 3
    assert 850 < late[1] <= 1000


def test_no_time_is_left_for_the_certificate(
    late: list[float], coordlang: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock of the whole command rings while the certificate is made."""

    def endless(_: Built) -> Certificate:
        os.kill(os.getpid(), signal.SIGALRM)
        raise AssertionError

    monkeypatch.setattr(Built, "certificate", endless)
    output = "-o", tmp_path / "l.json", "--time-limit", "1000"
    made = coordlang("build", *GW2, *MINIMAL, *output, "--certificate", tmp_path / "c.json")
    assert (made.code, [p.name for p in tmp_path.iterdir()]) == (3, ["l.json"])
    assert "no certificate is written: there was no time or memory left for it" in made.err
    assert "the time limit of 1000 s is over; the best language so far is written" in made.err
