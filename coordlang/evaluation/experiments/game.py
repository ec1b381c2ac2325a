"""A coordination game: the speaker proposes until the listener accepts.

It proposes plans in one game, sentences in the other.

The listener likes ``k`` of the task's optimal plans, drawn at random.  It accepts a plan that it
likes, and a sentence that some plan which it likes has.  The speaker does not know them and
proposes nothing twice.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from math import comb
from random import Random
from statistics import fmean
from typing import Any

from coordlang.evaluation.lab.plots import Series, lines
from coordlang.evaluation.lab.recipe import (
    Figure,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    done,
    table,
)
from coordlang.evaluation.lab.statistics import mean_interval
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.sentence_counts import sentence_counts_in
from coordlang.evaluation.material.suite import OTHERS, WORLDS

#: The row of Table 1 that the paper plays on.
ROW = "GWB5"
METHODS = ("greedy", "separating", "minimal")
#: How many plans the listener likes.
LIKED = (1, 2, 3, 4, 5)


def units(settings: Settings) -> list[Unit]:
    """The pieces of work, with all their parameters."""
    found = []
    for name in (ROW, *(world.name for world in OTHERS[: 1 if settings.quick else None])):
        for method in METHODS:
            parameters = {"world": name, "method": method, "runs": settings.samples}
            found.append(Unit("game", f"{name}/{method}", parameters, WORLDS[name].files, 5.0))
    return found


def run(unit: Unit, settings: Settings) -> Result:
    """One piece of work, as JSON data."""
    world = WORLDS[unit.parameters["world"]]
    candidates, language = language_for(world, unit.parameters["method"], settings)
    # A task's game depends on its numbers of plans alone; a language makes few different ones.
    tasks = [
        tuple(sorted(task.plans.values(), reverse=True))
        for task in sentence_counts_in(candidates, language)
    ]
    result: Result = {"words": len(language.words), "tasks": len(tasks), "liked": list(LIKED)}
    different = Counter(tasks)
    exact: dict[str, list[float]] = {"plan": [], "sentence": [], "widest": []}
    played: dict[str, list[list[int]]] = {"plan": [], "sentence": []}
    for liked in LIKED:
        sums = [Fraction(0)] * 3
        for sizes, number in different.items():
            k = min(liked, sum(sizes))
            values = (
                expected_for_plans(sum(sizes), k),
                expected_for_sentences(sizes, k),
                expected_widest_first(sizes, k),
            )
            sums = [total + number * value for total, value in zip(sums, values, strict=True)]
        for name, total in zip(exact, sums, strict=True):
            exact[name].append(round(float(total / len(tasks)), 6))
        games = []
        for number in range(settings.samples):
            random = Random(
                f"{settings.seed} {world.name} {liked} {number}"
            )  # the same games for every language
            games.append(play(random.choice(tasks), liked, random))
        played["plan"].append([plan for plan, _ in games])
        played["sentence"].append([sentence for _, sentence in games])
    return result | {"exact": exact, "played": played}


def play(sizes: Sequence[int], liked: int, random: Random) -> tuple[int, int]:
    """Proposals of one game each, with plans and with sentences.

    ``sizes``: the numbers of plans of the sentences.
    """
    owner = [sentence for sentence, number in enumerate(sizes) for _ in range(number)]
    likes = set(random.sample(range(len(owner)), min(liked, len(owner))))
    plans = random.sample(range(len(owner)), len(owner))
    sentences = random.sample(range(len(sizes)), len(sizes))
    accepted = {owner[plan] for plan in likes}
    by_plan = next(turn for turn, plan in enumerate(plans, 1) if plan in likes)
    by_sentence = next(turn for turn, sentence in enumerate(sentences, 1) if sentence in accepted)
    return by_plan, by_sentence


def expected_for_plans(plans: int, liked: int) -> Fraction:
    """Expected proposals until one of ``liked`` plans among ``plans`` is proposed, in random order.

    (N + 1) / (k + 1).
    """
    return Fraction(plans + 1, liked + 1)


def expected_for_sentences(sizes: Sequence[int], liked: int) -> Fraction:
    """The same for sentences in random order.

    With m of D sentences acceptable it is (D + 1) / (m + 1).

    How many of the sets of ``liked`` plans meet exactly m sentences is the coefficient of ``x^liked
    y^m`` in the product of ``1 + y ((1 + x)^n - 1)`` over the sentences with n plans each.
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


def expected_widest_first(sizes: Sequence[int], liked: int) -> Fraction:
    """The same for sentences that leave most plans open first.

    The sum over j of the chance that the first j all fail.
    """
    left = sum(sizes)
    ways = comb(left, liked)
    result = Fraction(0)
    for n in sorted(sizes, reverse=True):
        result += Fraction(comb(left, liked), ways)
        left -= n
    return result


def section(records: Sequence[Record]) -> Section:
    """The results, as this section of the page."""
    found = done(records)
    blocks: list[str | Figure] = [_DEFINITION]
    for name in dict.fromkeys(r.unit.parameters["world"] for r in found):
        here = [r for r in found if r.unit.parameters["world"] == name]
        runs = here[0].unit.parameters["runs"]
        blocks += [
            f"{name}, {here[0].result['tasks']:,} tasks, means of {runs} games and exact "
            "expectations:",
            _table(here),
        ]
        if name == ROW:
            alt = f"Proposals until accepted on {ROW}, plans against sentences, by liked plans"
            blocks.append(Figure("game", alt, partial(_drawn, here)))
    return Section(
        tuple(blocks), _differences([r for r in found if r.unit.parameters["world"] == ROW])
    )


_DEFINITION = """\
The listener likes k of the task's optimal plans, drawn at random (all of them where there are fewer). The speaker, who does
not know them, proposes plans in random order until one is accepted; or sentences in random order, accepted when some liked
plan has the sentence; *widest first* proposes the sentences with most plans first. A task is drawn at random for each game.
*Exact* is the expectation over tasks, liked plans and orders, in closed form: (N + 1) / (k + 1) for N plans."""


def _table(records: Sequence[Record]) -> str:
    rows = []
    plan = records[0].result
    kinds: list[tuple[str, Result, str]] = [("plan", plan, "plan")]
    for record in records:
        title = TITLES[record.unit.parameters["method"]]
        kinds += [
            (f"sentence, {title}", record.result, "sentence"),
            (f"{title}, widest first", record.result, "widest"),
        ]
    for label, result, what in kinds:
        row: list[object] = [label]
        for n in range(len(result["liked"])):
            played = f"{fmean(result['played'][what][n]):.2f}, " if what in result["played"] else ""
            row.append(f"{played}exact {result['exact'][what][n]:.2f}")
        rows.append(row)
    return table(("proposals of", *(f"k = {k}" for k in plan["liked"])), rows)


def _drawn(records: Sequence[Record]) -> Any:
    liked = records[0].result["liked"]

    def played(kind: str, label: str, result: Result, what: str) -> Series:
        ends = [mean_interval(games) for games in result["played"][what]]
        return Series(
            kind,
            label,
            [fmean(g) for g in result["played"][what]],
            [e[0] for e in ends],
            [e[1] for e in ends],
        )

    runs = records[0].unit.parameters["runs"]
    first = records[0].result
    series = [played("plan", f"plan ({runs} games, 95 %)", first, "plan")]
    exact = [Series("plan", "plan, exact", first["exact"]["plan"])]
    for record in records:
        method = record.unit.parameters["method"]
        series.append(played(method, f"sentence, {TITLES[method]}", record.result, "sentence"))
        exact.append(Series(method, f"{TITLES[method]}, exact", record.result["exact"]["sentence"]))
    return lines(
        liked, series, "plans that the listener likes (k)", "proposals until accepted", exact
    )


def _differences(records: Sequence[Record]) -> tuple[str, ...]:
    if not records:
        return ()
    first = records[0].result
    return (
        "**Coordination game.** The order of the paper's proposals and the values of its figure "
        "are not known to us; our "
        f"expectations on {ROW} for k = 1 are {first['exact']['plan'][0]:.2f} plans against "
        + ", ".join(
            f"{r.result['exact']['sentence'][0]:.2f} sentences "
            f"({TITLES[r.unit.parameters['method']]})"
            for r in records
        )
        + ".",
    )


RECIPE = Recipe("game", "Coordination game: proposals until accepted", units, run, section)
