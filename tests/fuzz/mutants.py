# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutant K of a seed: a broken pair of files, the same whatever else is run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random

from tests.fuzz.layout import line_ends, long_line, marked, nothing, random_bytes, truncate
from tests.fuzz.odd_names import odd_name, one_name, shadow, upper_case
from tests.fuzz.odd_sections import (
    comments,
    double_section,
    empty_section,
    foreign_section,
    many_objects,
    many_sections,
    numbers,
)
from tests.fuzz.pieces import Mutation
from tests.fuzz.sources import Pair, as_bytes
from tests.fuzz.structure import (
    double,
    drop,
    drop_group,
    edit_literal,
    nest,
    other_variable,
    replace_token,
    swap,
    swap_groups,
    unbalance,
    wrap_group,
)

TIME_LIMIT = 5
MEMORY_LIMIT = "2G"

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
    return Mutant(number, ", ".join(done), pair, as_bytes(domain), as_bytes(problem), command)


def arguments_of(m: Mutant) -> list[str]:
    """The command line for a mutant."""
    own = {"plans": ["--count"], "coordination": [], "build": ["-o", "language.json"]}[m.command]
    limits = ["--time-limit", str(TIME_LIMIT), "--memory-limit", MEMORY_LIMIT]
    return [m.command, "domain.pddl", "problem.pddl", *own, *m.pair.options, *limits]
