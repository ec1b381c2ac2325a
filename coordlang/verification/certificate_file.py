# SPDX-License-Identifier: GPL-3.0-or-later
"""Certificate files (docs/formats.md), and what they say as a plain CNF."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, islice, pairwise
from pathlib import Path
from typing import Annotated, Any

import msgspec

from coordlang.language.file import refuse_duplicates
from coordlang.language.warping import Clause
from coordlang.vocabulary.sat import most_constrained_first
from planners.search.sat import sat_solver, solve_slice
from planners.system.errors import OutOfMemory, Position
from planners.system.files import FileFormat, doc, read_bytes
from planners.system.limits import memory_left, more_memory
from planners.system.writing import write_compressed

FORMAT = "coordlang/certificate"

#: One plan: for each joint step each robot's subaction, None for idling.
PlanTexts = list[list[str | None]]


class WarpingPath(msgspec.Struct, frozen=True):
    """A warping path of the states of two plans of a reason."""

    plans: Annotated[tuple[int, int], doc("The numbers of the plans, from 0.")]
    cells: Annotated[
        list[tuple[int, int]],
        doc("Its cells: a step of the one plan and a step of the other, from 0."),
    ]


class Reason(msgspec.Struct, frozen=True):
    """One necessary clause.

    Plans of a task, whose mixture - robot i does its part of ``plans[i]`` - is no optimal plan, and
    warping paths that join all of them.  On some cell of these paths the two states need different
    words.
    """

    init: Annotated[list[str], doc("The fluents that are true at the start, as PDDL atoms.")]
    goal: Annotated[
        list[str],
        doc(
            "PDDL literals or formulas that must all hold at the end; with --tasks all the "
            "fluents that are true there, and no others are."
        ),
    ]
    plans: Annotated[
        list[PlanTexts],
        doc("Optimal plans, one for each robot: its subactions by step, null for idling."),
    ]
    paths: Annotated[list[WarpingPath], doc("Warping paths that join all of the plans.")]


class Certificate(msgspec.Struct, frozen=True):
    """Why every coordination language for the candidate tasks has more than ``refuted`` words."""

    domain: Annotated[str, doc("The domain's name.")]
    robots: Annotated[list[str], doc("The robots, in the order of joint actions.")]
    refuted: Annotated[int, doc("A number of words that is too small.")]
    reasons: Annotated[list[Reason], doc("Why it is, all together.")]
    format: Annotated[str, doc("What kind of file this is.")] = FORMAT
    version: Annotated[int, doc("Readers refuse a version that they do not know.")] = 1
    producer: Annotated[dict[str, Any], doc("Who wrote it; for information.")] = {}


CERTIFICATE = FileFormat("certificate", "certificate", Certificate, FORMAT)


def write_certificate(certificate: Certificate, path: str | Path) -> None:
    """Write a certificate file (gzip for ``.gz``), completely or not at all."""
    write_compressed(path, msgspec.json.encode(certificate) + b"\n")


def read_certificate(path: str | Path) -> Certificate:
    """Read a certificate file.

    Raises `BadInput` for anything else, and for a key that occurs twice: readers disagree about
    which of two entries counts.
    """
    data, position = read_bytes(path), Position(str(path))
    certificate = CERTIFICATE.decode(data, position)
    refuse_duplicates(data, position)
    return certificate


#: Conflicts after which the checking solver comes back.
_SLICE = 10_000
#: Bytes that a clause and each of its literals take, here and in a solver.
_CLAUSE, _LITERAL = 120, 48


class Cnf:
    """A CNF: "the states can be given ``size`` words so that every necessary clause holds".

    Words are interchangeable: a state may have word w only if a state before it, in the order of
    ``word``, has word w - 1.  Any partition can be named like that, so the formula stays
    satisfiable if it was.  The last of its ``clauses`` are the necessary ones, in their order.

    Raises `OutOfMemory` for a formula that would not fit into what is left, before it is made.
    """

    def __init__(self, clauses: Sequence[Clause], size: int) -> None:
        states, pairs = states_of(clauses), sorted(set().union(*clauses))
        _require_memory(len(states), len(pairs), clauses, size)
        counter = iter(range(1, 2**62))
        self.size = size
        #: By state the variables "the state has word 0, 1, ..".
        self.word = {state: tuple(islice(counter, size)) for state in states}
        #: By pair of states the variable "the two have different words".
        self._separated = dict(zip(pairs, counter, strict=False))
        one_word = [
            clause
            for own in self.word.values()
            for clause in (own, *((-a, -b) for a, b in combinations(own, 2)))
        ] or [()] * (not size)  # there is some state, and it has a word
        apart = [
            (-variable, -x, -y)
            for (a, b), variable in self._separated.items()
            for x, y in zip(self.word[a], self.word[b], strict=True)
        ]
        self._so_far, in_order = _words_in_order(list(self.word.values()), size, counter)
        reasons = [tuple(self._separated[p] for p in sorted(clause)) for clause in clauses]
        #: What the clauses say, in their order, and how many do.
        self._kinds = (
            ("every state has exactly one word", len(one_word)),
            ("states with different words share none", len(apart)),
            ("words are named in the order of the states", len(in_order)),
        )
        self.clauses = (*one_word, *apart, *in_order, *reasons)
        self.variables = next(counter) - 1

    def dimacs(self, names: Mapping[int, str]) -> str:
        """DIMACS text.  ``names`` are the states' keys, for the comments."""
        return "\n".join(
            [
                f"c Unsatisfiable iff no {self.size} words satisfy the reasons of a coordlang "
                "certificate.",
                *self._variables_explained(names),
                *self._clauses_explained(),
                f"p cnf {self.variables} {len(self.clauses)}",
                *(" ".join(map(str, (*clause, 0))) for clause in self.clauses),
                "",
            ]
        )

    def _variables_explained(self, names: Mapping[int, str]) -> Iterator[str]:
        for state, variables in self.word.items():
            for n, v in enumerate(variables):
                yield f"c {v}: word {n} holds {names[state]}"
        for (a, b), v in self._separated.items():
            yield f"c {v}: {names[a]} and {names[b]} have different words"
        for states, variables in enumerate(self._so_far, 2):
            for n, v in enumerate(variables):
                yield f"c {v}: word {n} holds one of the first {states} states"

    def _clauses_explained(self) -> Iterator[str]:
        first = 1
        for kind, count in self._kinds:
            if count:
                yield f"c clauses {first} to {first + count - 1}: {kind}"
            first += count
        for reason, clause in enumerate(range(first, len(self.clauses) + 1), 1):
            yield f"c clause {clause}: reason {reason}"

    def refuted(self) -> bool:
        """Whether the formula is unsatisfiable, by a solver and a loop that builders do not use."""
        with sat_solver("maplesat", self.clauses) as sat:
            answer = None
            while answer is None:
                answer = solve_slice(sat, _SLICE)
            return answer is False


def _require_memory(states: int, pairs: int, clauses: Sequence[Clause], size: int) -> None:
    """Raise `OutOfMemory` before a formula is made that would not fit."""
    count = states * (size * (size - 1) // 2 + 4 * size) + pairs * size + len(clauses)
    literals = states * (size * size + 9 * size) + 3 * pairs * size + sum(map(len, clauses))
    needed = _CLAUSE * count + _LITERAL * literals
    if needed > (left := memory_left()):
        raise OutOfMemory(
            f"the formula about {size:,} words for {states:,} states has {count:,} clauses: they "
            f"take {needed / 2**20:,.0f} MiB, {left / 2**20:,.0f} MiB are left",
            remedy=f"Use {more_memory()}, or a certificate about fewer words.",
        )


def states_of(clauses: Sequence[Clause]) -> list[int]:
    """The states that clauses speak of, the most constrained first."""
    states = {state for clause in clauses for two in clause for state in two}
    return most_constrained_first(states, clauses)


def _words_in_order(
    words: Sequence[tuple[int, ...]], size: int, counter: Iterator[int]
) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """For each state but the first the variables "some state so far has word w"; their clauses."""
    so_far: list[tuple[int, ...]] = []
    cnf: list[tuple[int, ...]] = [(-v,) for own in words[:1] for v in own[1:]]
    for before, own in pairwise(words):
        used = so_far[-1] if so_far else before
        cnf += [(-own[w], used[w - 1]) for w in range(1, size)]
        after = tuple(islice(counter, size))
        for w in range(size):
            cnf += [(-after[w], used[w], own[w]), (after[w], -used[w]), (after[w], -own[w])]
        so_far.append(after)
    return so_far, cnf
