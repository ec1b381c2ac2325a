# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference numbers of the PDDL that others wrote, computed again; see `foreign`."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

from foreign_rows import Row, load
from printed_table import PrintedTable
from processes import MOST, coordlang, run_python

#: Numbers of plans beyond which K* is not run.
MOST_LISTED = 20_000
COLUMNS = (
    ("row", -13),
    ("states", -8),
    ("", -14),
    ("makespan", -8),
    ("plans", -18),
    ("", -14),
    ("fewest actions", -14),
    ("", -14),
    ("Fast Downward", -13),
    ("", -14),
)
K_STAR_COLUMNS = (("K* plans", -18), ("K* fewest actions", -18))


@dataclass(slots=True)
class Comparison:
    """What is found, compared with the reference; ``wrong`` are the differences, as text."""

    wrong: list[str] = field(default_factory=list)

    def judged(self, row: Row, what: str, found: object, expected: int) -> object:
        """Compare a number with the reference; the number."""
        same = found == expected
        if row.approximate and what == "plans" and isinstance(found, int):
            same = abs(found - expected) <= 0.05 * expected
        if not same:
            self.wrong.append(f"{row.name}: {what} {found}, the reference has {expected}")
        return found

    def cells(self, row: Row) -> list[object]:
        """The line of a row."""
        by_cost = ("--json", "--cost", "makespan+actions")
        states = coordlang("inspect", *row.arguments, "--states", "--json")
        plans = coordlang("plans", *row.arguments, "--count", "--json")
        fewest = coordlang("plans", *row.arguments, "--count", *by_cost)
        check = coordlang("check", *row.arguments, *by_cost)
        cost, ours = check.data.get("fast_downward"), check.data.get("coordlang")
        if not check.data.get("agree"):
            self.wrong.append(f"{row.name}: Fast Downward {cost}, coordlang {ours}")
        return [
            row.name,
            self.judged(row, "states", states.data.get("states"), row.states),
            states.cost,
            self.judged(row, "makespan", plans.data.get("optimal_cost"), row.makespan),
            self.judged(row, "plans", _number(plans.data.get("count")), row.plans),
            plans.cost,
            self.judged(row, "fewest", _number(fewest.data.get("count")), row.fewest),
            fewest.cost,
            f"{cost[0]}, {cost[1]}" if cost else "none",
            check.cost,
        ]

    def by_k_star(self, row: Row, cost: str) -> str:
        """The number of plans by K*, in a process of its own."""
        script = str(Path(__file__).with_name("foreign.py"))
        done = run_python((script, "--k-star", row.name, "--cost", cost))
        if done.code != 0 or "plans" not in done.data:
            failed = f"did not finish in {MOST} s" if done.code < 0 else "failed"
            return str(done.data.get("why", failed))
        plans, ours = done.data["plans"], done.data["ours"]
        if plans != ours:
            self.wrong.append(f"{row.name}: K* counts {plans} plans under {cost}, coordlang {ours}")
        return f"{plans:,} ({done.seconds:.1f} s)"


def print_numbers(rows: Sequence[Row], *, oracles: bool) -> int:
    """Print the reference table again; the number of cells that differ."""
    table = PrintedTable(*COLUMNS, *(K_STAR_COLUMNS if oracles else ()))
    comparison = Comparison()
    for row in rows:
        cells = comparison.cells(row)
        if oracles:
            cells += [comparison.by_k_star(row, cost) for cost in ("makespan", "makespan+actions")]
        table.print(*cells)
    print(f"\n{len(comparison.wrong)} differences", *comparison.wrong, sep="\n  ")
    return len(comparison.wrong)


def _number(count: object) -> object:
    """A count of plans; those above 2^53 are texts in JSON."""
    return int(count) if isinstance(count, str) else count


def k_star(row: Row, cost: str) -> dict[str, object]:
    """Count the optimal plans with K*, from the plain PDDL of the joint model."""
    from planners.classical import compile_classical, to_pddl
    from planners.search.optimal_plans import search
    from planners.search.plans import Plans

    loaded = load(row, cost)
    space = search(loaded.model, loaded.tasks[0])
    ours = Plans.of(space).count
    if ours > MOST_LISTED:
        return {"why": f"not run ({ours:.3g})"}
    plain = compile_classical(loaded.model, loaded.tasks[0], limit=MOST_LISTED)
    found = _listed(to_pddl(plain), ours + 100)
    if not found:
        return {"why": "did not finish"}
    best = min(cost for cost, _ in found)
    different = {actions for cost, actions in found if cost == best}
    # All optimal plans are listed if worse ones follow, or some come twice, or as many as wanted.
    if len(different) == len(found) < ours + 100:
        return {"why": f"stopped at {len(different):,}"}
    return {"plans": len(different), "ours": ours, "form": plain.form}


def _listed(texts: Sequence[str], number: int) -> list[tuple[int, tuple[str, ...]]]:
    """The plans that K* lists for a domain and a problem: costs and actions."""
    from kstar_planner.planners import plan_topk

    with tempfile.TemporaryDirectory() as name, redirect_stdout(sys.stderr):
        files = Path(name) / "domain.pddl", Path(name) / "problem.pddl"
        for path, text in zip(files, texts, strict=True):
            path.write_text(text)
        os.chdir(name)
        answer = plan_topk(*files, number_of_plans_bound=number, timeout=120)
        os.chdir("/")
    return [(plan["cost"], tuple(plan["actions"])) for plan in answer.get("plans") or []]
