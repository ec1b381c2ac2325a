# SPDX-License-Identifier: GPL-3.0-or-later
"""What each further word buys: how often robots fail in silence, with few words, with enough."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import log2
from statistics import fmean
from typing import Any

from benchmarks.frame import markdown
from benchmarks.paper.plots import MARKERS, Lines, Series, lines
from benchmarks.paper.recipe import Figure, Recipe, Record, Result, Section, Settings, Unit
from benchmarks.paper.suite import CORRIDOR, OTHERS, ROWS, World
from coordlang.commands.building import Making, build_language, job_for_few_words
from coordlang.language.candidates import Candidates
from coordlang.language.provenance import percent
from coordlang.language.sentences import sentence_counts
from coordlang.required.miscoordination import Inseparable
from coordlang.vocabulary.few_words import few_words
from coordlang.vocabulary.flexible import largest_boxes
from coordlang.vocabulary.job import Assignment, words_of_states
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts

#: Worlds besides the rows of Table 1; those of three robots last.
WORLDS = (
    CORRIDOR,
    *OTHERS,
    World("handover, 3 robots", "handover", "three-rooms"),
    World("charger, 3 robots", "charger", "three-robots", "problem"),
    World("push-box, 3 robots", "push-box", "three-robots", "problem"),
    World("3x3, 3 robots", "grid", "three-robots-3x3", "problem"),
)
#: Words up to which the curve is drawn where no language is found before.
_MOST = 8
#: Plans measured for each number of words.
_WORK = 5_000_000


def units(settings: Settings) -> list[Unit]:
    """List a unit for each world."""
    worlds = (ROWS[0], OTHERS[2]) if settings.quick else (*ROWS, *WORLDS)
    names = ("folder", "problem", "tasks")
    return [Unit("silence", w.name, {name: getattr(w, name) for name in names}) for w in worlds]


def run(unit: Unit, settings: Settings) -> Result:
    """Find the best words of each number until no robot fails."""
    return curve(World(unit.key, **unit.parameters), settings.seed)


def curve(world: World, seed: int, most: int = _MOST) -> Result:
    """How often robots fail with 1, 2, .. words, at most so many, and what is said with them."""
    candidates = world.candidates()
    spaces = list(candidates.spaces)
    return {
        "robots": len(candidates.model.robots),
        "tasks": candidates.count,
        "plan_bits": round(fmean(plan_bits(spaces)), 4),
        "least_bits": round(fmean(bits_bounds(spaces)), 4),
        "points": list(_points(candidates, spaces, seed, most)),
    }


def bits_bounds(spaces: Sequence[PlanSpace]) -> list[float]:
    """For each task a lower bound on the bits that must be said, so that no mixture fails.

    A plan in a set of n_s of N plans takes ``log2(N / n_s)`` bits, and n_s is at most the size of
    its largest box (Proposition 26 of docs/concepts.md); 0 where there are too many plans.
    """
    return [
        0.0 if sizes is None else fmean(log2(count / size) for size in sizes)
        for count, sizes in largest_boxes(spaces)
    ]


def _points(
    candidates: Candidates, spaces: Sequence[PlanSpace], seed: int, most: int
) -> Iterator[Result]:
    """One number of words after the other; the last is that of a coordination language."""
    job = job_for_few_words(Making(candidates), seed)
    language, size = _language(candidates, job.states, seed)
    job = replace(job, incumbent=language)
    start: Assignment | None = None
    for words in range(1, most + 1):
        if words == size and language is not None:
            yield _point(candidates, spaces, language, words, 0.0, 0.0, is_best=True)
            return
        found, failures = few_words(job, words, start=start, work=_WORK)
        if found.stopped is not None:
            raise found.stopped
        start = found.partition
        mean, worst = float(failures.mean), float(failures.worst)
        is_best = bool(found.figures["least_of_all_partitions"])
        yield _point(candidates, spaces, start, words, mean, worst, is_best=is_best)
        if not worst:
            return


def _language(
    candidates: Candidates, states: Sequence[int], seed: int
) -> tuple[Assignment | None, int]:
    """A language with the fewest words, as states and words, and how many words it has.

    None, and 0 words, where plans are inseparable: then there is none.
    """
    try:
        built = build_language(candidates, "minimal", seed=seed)
    except Inseparable:
        return None, 0
    if built.stopped is not None:
        raise built.stopped
    word = built.language.partition(candidates.model).word_of(candidates.rows)
    found = {state: int(word[state]) for state in states}
    return found, len(built.language.words)


def _point(
    candidates: Candidates,
    spaces: Sequence[PlanSpace],
    partition: Assignment,
    words: int,
    mean: float,
    worst: float,
    *,
    is_best: bool,
) -> Result:
    word = words_of_states(partition, len(candidates.rows))
    bits = sentence_bits(spaces, [word[space.state] for space in spaces])
    return {
        "words": words,
        "mean": mean,
        "worst": worst,
        "bits": round(fmean(bits), 4),
        "is_best": is_best,
    }


def sentence_bits(spaces: Sequence[PlanSpace], words: Sequence[Ints]) -> list[float]:
    """Return the entropy ``sum_s n_s / N * log2(N / n_s)`` of each task's sentences, in bits.

    The plan is drawn uniformly; ``words`` holds the word number of each node of each plan space.
    """
    found = []
    for space, word in zip(spaces, words, strict=True):
        said = sentence_counts(space, word)
        for start in space.starts.tolist():
            sizes = said[start].values()
            total = sum(sizes)
            found.append(sum(n / total * (log2(total) - log2(n)) for n in sizes))
    return found


def plan_bits(spaces: Sequence[PlanSpace]) -> list[float]:
    """Return ``log2 N`` for each task, the bits that say which of its N plans is meant."""
    counted = [(space.starts.tolist(), counts(space)) for space in spaces]
    return [log2(number[start]) for starts, number in counted for start in starts]


def section(records: Sequence[Record]) -> Section:
    """Render the curves as a table and two figures."""
    fails, bits = "robots fail (% of runs)", "bits of a sentence, mean"
    both = {"mean": fails, "worst": "in the worst task (% of runs)"}
    words_alt = "How often robots fail, by the number of words"
    bits_alt = "How often robots fail, by the bits of a sentence"
    words = partial(_drawn, records, "words", "words", both)
    sentences = partial(_drawn, records, "bits", bits, {"mean": fails})
    return Section(
        [
            _DEFINITION,
            _table([record for record in records if record.key not in _ALIKE]),
            Figure("silence-words", words_alt, words),
            Figure("silence-bits", bits_alt, sentences),
        ]
    )


_DEFINITION = """\
The speaker says the sentence of an optimal plan drawn uniformly; each robot then draws a plan with
that sentence. Columns 1, 2, ..: how often, in percent, the mixture is no optimal plan with the best
partition found into so many words, counted exactly: the mean over the tasks (the figure also has
the worst). A star: no such partition is better. *Bits*: the mean entropy of a sentence, with one
word less than a language and with a language. *At least*: a lower bound for every division into
sets that mix freely. *Plan*: bits that say which plan is meant. GWB2, GWB4 and GWB8 are rings of as
many cells as GWB1, GWB3 and GWB7."""

#: Rows that the table leaves out: rings of as many cells as other rows.
_ALIKE = ("GWB2", "GWB4", "GWB8")


def _table(records: Sequence[Record]) -> str:
    most = max(len(record.result["points"]) for record in records)
    head = ["tasks", *(f"{n + 1}" for n in range(most)), "bits", "at least", "plan"]
    rows = []
    for record in records:
        r = record.result
        points = r["points"]
        cells: list[object] = [_fails(point) for point in points]
        bits = [f"{point['bits']:.2f}" for point in points[-2:]]
        rows.append(
            [
                record.key,
                *cells,
                *([None] * (most - len(cells))),
                ", ".join(bits),
                f"{r['least_bits']:.2f}",
                f"{r['plan_bits']:.2f}",
            ]
        )
    return markdown(head, rows)


def _fails(point: Result) -> str:
    mark = "*" if point["is_best"] else ""
    if not point["worst"]:
        return f"0{mark}"
    return f"{percent(point['mean']).removesuffix(' %')}{mark}"


def _drawn(records: Sequence[Record], x: str, x_label: str, units: dict[str, str]) -> Any:
    """A row for each unit, with a panel for open grids, one for rings, one for the other worlds."""
    groups: dict[str, list[Record]] = {"open grids, all pairs": [], "rings": [], "other worlds": []}
    for record in records:
        ring, row = record.key.startswith("GWB"), record.key.startswith("GW")
        groups["rings" if ring else "open grids, all pairs" if row else "other worlds"] += [record]
    panels = []
    for what, unit in units.items():
        for title, here in groups.items():
            series = [
                Series(
                    kind,
                    record.key,
                    [100 * point[what] for point in record.result["points"]],
                    x=[point[x] for point in record.result["points"]],
                )
                for record, kind in zip(here, _KINDS, strict=False)
            ]
            panels.append(Lines(title, unit, series))
    return lines(panels, range(1, _MOST + 1) if x == "words" else (), x_label, len(groups))


#: One kind of series for each colour.
_KINDS = list({hue: kind for kind, (hue, _) in MARKERS.items()}.values())

RECIPE = Recipe("silence", "What each word buys: silence, few words, enough", units, run, section)
