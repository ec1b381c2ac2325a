# SPDX-License-Identifier: GPL-3.0-or-later
"""A coordination game: the speaker proposes plans, or sentences, until the listener accepts.

The listener likes ``k`` of the task's optimal plans, drawn at random.  It accepts a plan that it
likes, and a sentence that some plan which it likes has.  The speaker does not know these plans and
proposes nothing twice.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from math import comb
from typing import Any

from benchmarks.frame import markdown
from benchmarks.paper.plots import Lines, Series, lines
from benchmarks.paper.recipe import Figure, Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.suite import METHODS, OTHERS, TITLES, WORLDS, language_for, method_of
from benchmarks.paper.tables import Columns, elsewhere
from coordlang.language.sentences import sentence_counts

#: The row of Table 1 that the paper plays on.
ROW = "GWB5"
#: How many plans the listener likes.
LIKED = (1, 2, 3, 4, 5)


def units(settings: Settings) -> list[Unit]:
    """List a unit for each method and world."""
    worlds = (ROW, *(world.name for world in OTHERS[: 1 if settings.quick else None]))
    return [
        Unit("game", f"{name}/{method}", {"world": name, "method": method})
        for name in worlds
        for method in METHODS
    ]


def run(unit: Unit, settings: Settings) -> Result:
    """Compute the expectations of one language in one world."""
    world = WORLDS[unit.parameters["world"]]
    candidates, language = language_for(world, unit.parameters["method"], settings.seed)
    # A task's game depends on its numbers of plans alone; a language makes few different ones.
    partition, tasks = language.partition(candidates.model), []
    for space in candidates.spaces:
        said = sentence_counts(space, partition.word_of(space.rows)[space.state])
        tasks += [tuple(sorted(said[node].values(), reverse=True)) for node in space.starts]
    exact = [_expectations(Counter(tasks), liked) for liked in LIKED]
    return {
        "words": len(language.words),
        "tasks": len(tasks),
        "liked": list(LIKED),
        "exact": {
            name: [values[n] for values in exact] for n, name in enumerate(("plan", "sentence"))
        },
    }


def _expectations(tasks: Counter[tuple[int, ...]], liked: int) -> list[float]:
    """The mean expectations over tasks, of plans and of sentences."""
    sums = [Fraction(0)] * 2
    for sizes, number in tasks.items():
        k = min(liked, sum(sizes))
        values = expected_for_plans(sum(sizes), k), expected_for_sentences(sizes, k)
        sums = [total + number * value for total, value in zip(sums, values, strict=True)]
    return [round(float(total / tasks.total()), 6) for total in sums]


def expected_for_plans(plans: int, liked: int) -> Fraction:
    """Return the expected proposals until one of k liked plans among N is proposed.

    In random order it is (N + 1) / (k + 1).
    """
    return Fraction(plans + 1, liked + 1)


def expected_for_sentences(sizes: Sequence[int], liked: int) -> Fraction:
    """Return the expected proposals of sentences in random order.

    With m of D sentences acceptable it is (D + 1) / (m + 1).  How many of the sets of ``liked``
    plans meet exactly m sentences is the coefficient of ``x^liked y^m`` in the product of ``1 + y
    ((1 + x)^n - 1)`` over the sentences with n plans each.
    """
    ways = {(0, 0): 1}
    for n in sizes:
        after: dict[tuple[int, int], int] = dict(ways)
        for (taken, met), number in ways.items():
            for more in range(1, min(n, liked - taken) + 1):
                key = (taken + more, met + 1)
                after[key] = after.get(key, 0) + number * comb(n, more)
        ways = after
    shares = (
        number * Fraction(len(sizes) + 1, met + 1)
        for (taken, met), number in ways.items()
        if taken == liked
    )
    return sum(shares, Fraction(0)) / comb(sum(sizes), liked)


def section(records: Sequence[Record]) -> Section:
    """Render the numbers of proposals."""
    mine = [record for record in records if record.parameters["world"] == ROW]
    others = [record for record in records if record.parameters["world"] != ROW]
    columns: Columns = {
        "proposals": lambda r: ", ".join(
            f"{r.result['exact'][what][0]:.2f}" for what in ("plan", "sentence")
        )
    }
    found = elsewhere(columns, others)
    if not mine:
        return Section([_DEFINITION], elsewhere=found)
    tasks = mine[0].result["tasks"]
    alt = f"Proposals until accepted on {ROW}, by liked plans"
    figure = Figure("game", alt, partial(_figure, mine))
    text = f"{ROW}, {tasks:,} tasks:"
    return Section([_DEFINITION, text, _table(mine), figure], _DIFFERENCES, elsewhere=found)


_DEFINITION = """\
The listener likes k of the task's optimal plans, drawn at random. The speaker proposes plans in
random order until the listener likes one, or sentences until a liked plan has the sentence. Cells:
the mean of the expectations, exactly; for N plans it is (N + 1) / (k + 1)."""


_DIFFERENCES = (
    "**Coordination game.** The paper gives neither the order of its proposals nor the values of "
    "its figure.",
)


def _table(records: Sequence[Record]) -> str:
    plan = records[0].result
    kinds = [("plan", plan, "plan")]
    kinds += [(f"sentence, {method_of(r)}", r.result, "sentence") for r in records]
    rows = []
    for label, result, what in kinds:
        rows.append([label, *(f"{mean:.2f}" for mean in result["exact"][what])])
    return markdown(("proposals of", *(f"k = {k}" for k in plan["liked"])), rows)


def _figure(records: Sequence[Record]) -> Any:
    first = records[0].result
    shown = [Series("plan", "plan", first["exact"]["plan"])]
    for record in records:
        method = record.parameters["method"]
        shown.append(
            Series(method, f"sentence, {TITLES[method]}", record.result["exact"]["sentence"])
        )
    panel = Lines("", "expected proposals until accepted", shown)
    return lines([panel], first["liked"], "plans that the listener likes (k)")


RECIPE = Recipe("game", "Coordination game: proposals until accepted", units, run, section)
