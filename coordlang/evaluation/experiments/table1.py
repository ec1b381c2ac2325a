"""Table 1 of the paper: how many words the candidate tasks of a map need, by every method."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

from coordlang.building import build_language
from coordlang.evaluation.lab.plots import Series, by_category
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
from coordlang.evaluation.material.paper import TABLE_1
from coordlang.evaluation.material.state_orders import ORDERS, greedy_in_orders
from coordlang.evaluation.material.suite import OTHERS, ROWS, WORLDS
from coordlang.tasks.candidates import Candidates
from planners.errors import OutOfTime
from planners.limits import time_limit
from planners.search.plans import counts

#: A column: its name, the method, and whether only first differences count (alpha).
METHODS = (
    ("greedy", "greedy", True),
    ("least alpha", "separating", True),
    ("separating", "separating", False),
    ("minimal", "minimal", False),
    ("exhaustive", "exhaustive", False),
)
QUICK = ("GW1", "GW2", "GWB5", "tray")
#: Brute force, which mixes all pairs of plans, is begun up to so many of them, and ended after so
#: many seconds.
MOST_PAIRS, BRUTE_SECONDS = 500_000, 10.0
#: Seconds that the slow rows take with SAT, roughly; the others are done in a second or two.
_SLOW = {"GW4": 60.0, "GW3": 10.0, "GWB4": 8.0, "GWB3": 8.0}


def units(settings: Settings) -> list[Unit]:
    """The pieces of work, with all their parameters."""
    found = []
    for world in (*ROWS, *OTHERS):
        if settings.quick and world.name not in QUICK:
            continue
        for name, method, alpha_only in METHODS:
            parameters = {
                "world": world.name,
                "column": name,
                "method": method,
                "alpha_only": alpha_only,
            }
            effort = 0.5 if method == "greedy" else _SLOW.get(world.name, 1.0)
            if method == "exhaustive":
                if world not in ROWS:
                    continue
                parameters["seconds"] = min(BRUTE_SECONDS, settings.unit_limit)
                effort = BRUTE_SECONDS
            found.append(Unit("table1", f"{world.name}/{name}", parameters, world.files, effort))
        parameters = {
            "world": world.name,
            "column": "orders",
            "orders": 10 if settings.quick else ORDERS,
        }
        found.append(Unit("table1", f"{world.name}/orders", parameters, world.files, 2.0))
    return found


def run(unit: Unit, settings: Settings) -> Result:
    """One piece of work, as JSON data."""
    asked = unit.parameters
    candidates = WORLDS[asked["world"]].candidates(settings.domains)
    if asked["column"] == "orders":
        orders = greedy_in_orders(candidates, asked["orders"], unit.random(settings.seed))
        return {"words": {name: int(words.max()) + 1 for name, words in orders}}
    if asked["method"] == "exhaustive":
        return brute_force(candidates, asked["seconds"], settings.seed)
    built = build_language(
        candidates,
        asked["method"],
        seed=settings.seed,
        alpha_only=asked["alpha_only"] and asked["method"] != "greedy",
    )
    guarantee = built.language.guarantee
    return {
        "tasks": candidates.count,
        "states": candidates.states,
        "divergences": len(built.first_differences.divergences),
        "requiring": built.first_differences.requiring,
        "words": guarantee.size,
        "lower_bound": guarantee.lower_bound,
        "proved_minimal": guarantee.proved_minimal,
        "verified": built.verdict.holds,
        "stopped": built.stopped is not None,
        "work": {name: int(value) for name, value in sorted(built.figures.items())},
    }


def brute_force(candidates: Candidates, seconds: float, seed: int) -> Result:
    """The paper's exhaustive method where it ends; else why it does not."""
    pairs = pairs_of_plans(candidates)
    found: Result = {"pairs": pairs, "words": None}
    if pairs > MOST_PAIRS:
        return found | {"why": "too many pairs of plans"}
    try:
        with time_limit(seconds):
            built = build_language(candidates, "exhaustive", seed=seed)
    except OutOfTime:
        return found | {"why": "out of time"}
    if built.stopped is not None:
        return found | {
            "why": "out of time" if isinstance(built.stopped, OutOfTime) else "out of memory"
        }
    return found | {
        "words": built.language.guarantee.size,
        "partitions": int(built.figures["partitions"]),
    }


def pairs_of_plans(candidates: Candidates) -> int:
    """How many pairs of optimal plans all tasks have: what brute force mixes."""
    return sum(
        counted[n] ** 2
        for space in candidates.spaces
        for counted in (counts(space),)
        for n in space.starts
    )


def section(records: Sequence[Record]) -> Section:
    """The results, as this section of the page."""
    of: dict[str, dict[str, Record]] = {}
    for record in done(records):
        of.setdefault(record.unit.parameters["world"], {})[record.unit.parameters["column"]] = (
            record
        )
    rows = [world.name for world in ROWS if "greedy" in of.get(world.name, {})]
    others = [world.name for world in OTHERS if "greedy" in of.get(world.name, {})]
    blocks: list[str | Figure] = [
        _DEFINITION,
        _words(rows, of),
        Figure(
            "table1-words",
            "Words of every row of Table 1, by method, beside the paper's",
            lambda: _drawn(rows, of),
        ),
        "Seconds of processor time, from the PDDL text to the verified language (the paper's on "
        "its author's machine):",
        _seconds(rows, of),
    ]
    stopped = [
        f"{name} {column} ({found[column].result['words']} words so far)"
        for name, found in of.items()
        for column in ("least alpha", "separating", "minimal")
        if column in found and found[column].result["stopped"]
    ]
    if stopped:
        blocks.append(f"Stopped by its limit before its proof was complete: {', '.join(stopped)}.")
    if others:
        blocks += ["Worlds that are no grids, all tasks:", _words(others, of)]
    headlines = tuple(
        (
            f"{name}: words",
            f"{TABLE_1[name].words}",
            f"{of[name]['greedy'].result['words']}",
            _starred(of[name].get("minimal")) or "–",
        )
        for name in rows
    )
    return Section(tuple(blocks), _differences(rows, of), headlines)


_DEFINITION = """\
Tasks and states must be the paper's exactly. *Greedy* is the paper's method: fill a word with every state that still fits;
beside it the least and the most words that it needs when the states come in other orders. *Least alpha* is the fewest words
that separate all first differences, which is what greedy words do (`--method separating --alpha-only`); *separating* the
fewest that separate first or last differences (Theorem 3); *minimal* the fewest that any partition needs, by definition;
*exhaustive* the paper's brute force, where it ends. A star: proved to be the least of its kind. Every language is verified
by definition."""


def _words(names: Sequence[str], of: dict[str, dict[str, Record]]) -> str:
    rows = []
    for name in names:
        greedy, paper = of[name]["greedy"].result, TABLE_1.get(name)
        orders = _in_orders(of[name])
        words: list[object] = [paper.words if paper else None]
        if paper and paper.exact:
            words = [f"{paper.words} (exact {paper.exact})"]
        words += [greedy["words"], f"{min(orders)} to {max(orders)}" if orders else None]
        words += [
            _starred(of[name].get(column)) for column in ("least alpha", "separating", "minimal")
        ]
        if paper:
            brute = of[name].get("exhaustive")
            words.append(brute.result["words"] if brute else None)
        counted = [greedy["tasks"], greedy["states"], greedy["divergences"]]
        rows.append([name, *counted, *words])
    head = [
        "row",
        "tasks",
        "states",
        "divergences",
        "paper",
        "greedy",
        "greedy, orders",
        "least alpha",
        "separating",
        "minimal",
    ]
    return table(head + ["exhaustive"] * any(name in TABLE_1 for name in names), rows)


def _in_orders(columns: dict[str, Record]) -> list[int]:
    """The greedy method's numbers of words in all orders tried."""
    return list(columns["orders"].result["words"].values()) if "orders" in columns else []


def _starred(record: Record | None) -> str | None:
    return None if record is None else f"{record.result['words']}{'*' if _proved(record) else ''}"


def _proved(record: Record) -> bool:
    """Whether it is proved that no language of the method's kind has fewer words."""
    r = record.result
    separating = r["work"].get("separating_lower_bound") == r["words"] and not r["stopped"]
    return bool(r["proved_minimal"] or separating)


def _seconds(names: Sequence[str], of: dict[str, dict[str, Record]]) -> str:
    rows = []
    columns = ("greedy", "least alpha", "separating", "minimal")
    for name in names:
        found = [of[name].get(column) for column in columns]
        brute = of[name].get("exhaustive")
        told = (
            f"{brute.cpu:.2f}"
            if brute and brute.result["words"]
            else brute.result["why"]
            if brute
            else None
        )
        paper = TABLE_1[name]
        theirs = f"{paper.seconds:,.1f}" + (
            f" (exact {paper.exact_seconds})" if paper.exact_seconds else ""
        )
        rows.append([name, theirs, *(f"{r.cpu:.2f}" if r else None for r in found), told])
    return table(("row", "paper", *columns, "exhaustive"), rows)


def _drawn(names: Sequence[str], of: dict[str, dict[str, Record]]) -> Any:
    def words(column: str) -> list[float | None]:
        return [of[name][column].result["words"] if column in of[name] else None for name in names]

    orders = [_in_orders(of[name]) for name in names]
    series = [
        Series("paper", "paper (greedy)", [TABLE_1[name].words for name in names]),
        Series(
            "greedy",
            "greedy (line: other orders)",
            words("greedy"),
            [min(o) if o else None for o in orders],
            [max(o) if o else None for o in orders],
        ),
        Series("least alpha", "least alpha", words("least alpha")),
        Series("separating", "separating", words("separating")),
        Series("minimal", "minimal", words("minimal")),
    ]
    return by_category(names, series, "words")


def _differences(names: Sequence[str], of: dict[str, dict[str, Record]]) -> tuple[str, ...]:
    told = []
    wrong = [
        n
        for n in names
        if (of[n]["greedy"].result["tasks"], of[n]["greedy"].result["states"])
        != (TABLE_1[n].tasks, TABLE_1[n].states)
    ]
    if wrong:
        told.append(f"**Tasks or states** differ from the paper's on {', '.join(wrong)}.")
    told += _about_orders(names, of)
    told += _about_alpha(names, of)
    ratios = [
        TABLE_1[n].words / of[n]["minimal"].result["words"] for n in names if "minimal" in of[n]
    ]
    if ratios:
        exact = " and ".join(n for n, paper in TABLE_1.items() if paper.exact)
        told.append(
            f"**The least number of words** is {min(ratios):.1f} to {max(ratios):.1f} times "
            "smaller than the paper's (median "
            f"{median(ratios):.1f}), which has an exact value for {exact} only."
        )
    slow = [
        n for n in names if "exhaustive" in of[n] and of[n]["exhaustive"].result["words"] is None
    ]
    if slow:
        told.append(
            f"**Brute force** ends within {BRUTE_SECONDS:g} s on {len(names) - len(slow)} "
            f"of {len(names)} rows; where tasks "
            f"have more than {MOST_PAIRS:,} pairs of optimal plans together, it is not begun."
        )
    return tuple(told)


def _about_orders(names: Sequence[str], of: dict[str, dict[str, Record]]) -> list[str]:
    other = [n for n in names if of[n]["greedy"].result["words"] != TABLE_1[n].words]
    if not other:
        return []
    text = (
        f"**Words of the greedy method** differ from the paper's on {len(other)} of {len(names)} "
        f"rows ({', '.join(other)}). "
        "The method takes the states in an order, and the order decides; the paper's is not known."
    )
    orders = {n: _in_orders(of[n]) for n in other if "orders" in of[n]}
    beyond = [n for n, found in orders.items() if not min(found) <= TABLE_1[n].words <= max(found)]
    if beyond:
        text += (
            f" On {', '.join(beyond)} the paper's number is outside of "
            f"what {len(orders[beyond[0]])} orders gave."
        )
    return [text]


def _about_alpha(names: Sequence[str], of: dict[str, dict[str, Record]]) -> list[str]:
    least = {
        n: of[n]["least alpha"]
        for n in names
        if "least alpha" in of[n] and _proved(of[n]["least alpha"])
    }
    below = [n for n, record in least.items() if TABLE_1[n].words < record.result["words"]]
    if not below:
        return []
    listed = ", ".join(
        f"{n} ({TABLE_1[n].words} against {least[n].result['words']})" for n in below
    )
    return [
        f"**Fewer words than alpha allows.** On {listed} the paper's greedy method reports fewer "
        "words than any partition "
        "has that separates all first differences, as is proved. So its condition must be a "
        "weaker one there; with last "
        "differences, too, fewer words can do."
    ]


RECIPE = Recipe("table1", "Table 1: how many words", units, run, section)
