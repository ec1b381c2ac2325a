# SPDX-License-Identifier: GPL-3.0-or-later
"""The same tasks, solved by planners of others that list all optimal plans: K* and SymK.

    python -m benchmarks.peers [--limit SECONDS] [--kept FILE] [--cost COST] [--first N]
                               [--python PYTHON] [--markdown] [ROW ..]

Rows are those of `benchmarks.coverage`.  Each planner gets what ``coordlang export`` writes for
planners: the joint model as plain PDDL, whose optimal plans stand one to one for the joint ones.
Rows ``whole 4x4``, 5x5, 6x6 and 8x8 are robots that trade the corners of open grids: planners get
the joint-action PDDL of the grid (domains/grid-joint).  Beside them coordlang is a whole process,
too, ``coordlang plans .. --count --no-cache``, from the PDDL text on.  ``--markdown`` prints the
table at the top of docs/coverage.md: CPU seconds of a few rows.
``--limit`` are CPU seconds (60) of each of a planner's processes, with 8 GB of address space each.
``--python`` is a Python that has both (``pip install '.[oracles]'``).  Columns: CPU seconds, peak
memory and number of the optimal plans; no number where a planner did not end by itself.
K* is asked for all plans of the best cost (``topq`` with q = 1 and its own default heuristic), SymK
for the same by bidirectional symbolic search (``symq_bd``, quality 1).
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from benchmarks import coverage, frame
from benchmarks.frame import DOMAINS, Figures, KeptRows, PrintedTable, asked_for

KSTAR = """
import json
from pathlib import Path
from kstar_planner.planners import plan_topq
found = plan_topq(Path("domain.pddl"), Path("problem.pddl"), quality_bound=1.0)
ended = "search exit code: 0" in found["planner_output"]
costs = [plan["cost"] for plan in found.get("plans", ()) if ended]
print("Number of plans:", costs.count(min(costs)) if costs else "none")
print("Plan cost:", min(costs, default="none"))
"""
SYMK = """
import subprocess, sys
from importlib.util import find_spec
from pathlib import Path
found = find_spec("up_symk") or sys.exit("ModuleNotFoundError: No module named 'up_symk'")
driver = Path(found.origin).parent / "symk" / "fast-downward.py"
plans = "plan_selection=top_k(num_plans=infinity,dump_plans=false)"
search = f"symq_bd(simple=false,{plans},quality=1.0)"
subprocess.run([sys.executable, driver, "domain.pddl", "problem.pddl", "--search", search])
"""
PLANNERS = {"K*": KSTAR, "SymK": SYMK}
#: The rows of ``--markdown`` where none are asked for.
SHOWN = ("whole 4x4", "whole 5x5", "whole 6x6", "depot/pfile1", "logistics00/probLOGISTICS-4-0")
WHOLE = tuple(f"whole {size}" for size in ("4x4", "5x5", "6x6", "8x8"))


def asked(python: str, planner: str, folder: Path, limit: int) -> Figures:
    """What a planner answers about the files in a folder."""
    script = ("-c", PLANNERS[planner])
    done = frame.run_python(script, 20 * limit, python, cpu=limit, folder=folder)
    if "ModuleNotFoundError" in done.errors:
        sys.exit(f"{python} has no {planner} ({done.why}): pip install '.[oracles]', or --python")
    text = done.output
    count, cost = re.search(r"Number of plans: (\d+)", text), re.search(r"Plan cost: (\d+)", text)
    return {
        "seconds": done.cpu,
        "memory": done.memory,
        "plans": int(count[1]) if count and cost else None,
        "cost": int(cost[1]) if count and cost else None,
    }


def measured(name: str, given: argparse.Namespace) -> Figures:
    """The figures of a row."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        if name in WHOLE:
            task, cost = f"corners-{name.split()[1]}", "makespan"
            for file, origin in (("domain", "domain"), ("problem", task)):
                shutil.copy(DOMAINS / "grid-joint" / f"{origin}.pddl", folder / f"{file}.pddl")
            form: Figures = {"form": "joint actions"}
            files = tuple(DOMAINS / "grid" / f"{file}.pddl" for file in ("domain", task))
        else:
            form, cost = written(name, folder, given.cost), given.cost
            files = coverage.codmap(sys.maxsize).get(name, ()) if "/" in name else ()
        found = {planner: asked(given.python, planner, folder, given.limit) for planner in PLANNERS}
    row = {"row": f"{name} ({given.cost})", **form, **found}
    return {**row, "coordlang": ours(files, cost, given.limit)}


def written(name: str, folder: Path, cost: str) -> Figures:
    """The form of the plain PDDL of a row, and its actions; its files are written to a folder."""
    from planners.classical import compile_classical
    from planners.classical.task import to_pddl

    loaded = coverage.load(name, cost)
    compiled = compile_classical(loaded.model, loaded.tasks[0])
    for file, text in zip(("domain", "problem"), to_pddl(compiled), strict=True):
        (folder / f"{file}.pddl").write_text(text)
    return {"form": compiled.form, "actions": len(compiled.actions)}


def ours(files: tuple[Path, ...], cost: str, limit: int) -> Figures:
    """What our process says of a domain and a problem; nothing without these."""
    if not files:
        return {}
    options = ("--cost", cost, "--count", "--no-cache", "--json")
    done = frame.run_python(("-m", "coordlang", "plans", *files, *options), cpu=limit)
    plans = int(done.data["count"]) if done.data else None
    return {"seconds": done.cpu, "memory": done.memory, "plans": plans}


def print_page(rows: Sequence[Figures]) -> None:
    """Print CPU seconds as Markdown, and in brackets those after which there was no answer."""
    lines = []
    for row in rows:
        answers = [row[name] for name in ("coordlang", *PLANNERS) if row[name]]
        counted = {answer["plans"] for answer in answers} - {None}
        if len(counted) > 1:
            sys.exit(f"{row['row']}: {counted} plans")
        seconds = [
            f"{answer['seconds']:.2f}"
            if answer["plans"] is not None
            else f"({answer['seconds']:.0f})"
            for answer in answers
        ]
        plans, missing = min(counted, default=None), [None] * (len(PLANNERS) + 1 - len(answers))
        lines.append([row["row"].rpartition(" (")[0], plans, *missing, *seconds])
    print(frame.markdown(["task", "optimal plans", "coordlang", *PLANNERS], lines))


def main() -> None:
    """Print what the arguments say."""
    parser = frame.arguments(__doc__)
    parser.add_argument("--first", type=int, default=3, metavar="N", help="problems of a domain")
    parser.add_argument("--cost", choices=frame.COSTS, default="makespan+actions")
    parser.add_argument("--python", default=sys.executable, help="a Python that has the planners")
    parser.add_argument("--markdown", action="store_true", help="the table of docs/coverage.md")
    given = parser.parse_args()
    known = KeptRows(given.kept)

    def kept(name: str) -> Figures:
        return known.get(f"{name} ({given.cost})", partial(measured, name, given))

    names = asked_for([*WHOLE, *coverage.rows(given.first)], given.rows or SHOWN * given.markdown)
    if given.markdown:
        print_page([kept(name) for name in names])
        return
    shown = (*PLANNERS, "coordlang")
    columns = [("row", -38), ("form", -17), ("actions", 8)]
    for planner in shown:
        columns += [(planner, 9), ("MB", 5), ("plans", 9)]
    table = PrintedTable(*columns)
    for name in names:
        found = kept(name)
        cells = [name, found["form"], found.get("actions")]
        for planner in shown:
            cells += [found.get(planner, {}).get(key) for key in ("seconds", "memory", "plans")]
        table.print(*cells)


if __name__ == "__main__":
    main()
