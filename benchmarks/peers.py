# SPDX-License-Identifier: GPL-3.0-or-later
"""The same tasks, solved by planners of others that list all optimal plans: K* and SymK.

    python benchmarks/peers.py [--limit SECONDS] [--kept FILE] [--cost COST] [--first N]
                               [--python PYTHON] [ROW ..]

Rows are those of coverage.py.  Each planner gets what ``coordlang export`` writes for planners: the
joint model as plain PDDL, whose optimal plans stand one to one for the joint ones.  ``--limit`` are
CPU seconds (60) of each of its processes, translation and search, with 8 GB of address space each.
``--python`` is a Python that has both (``pip install '.[oracles]'``).  Columns: CPU seconds, peak
memory, cost and number of the optimal plans; no number where a planner did not end by itself.
K* is asked for all plans of the best cost (``topq`` with q = 1 and its own default heuristic), SymK
for the same by bidirectional symbolic search (``symq_bd``, quality 1).
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import coverage
from kept_rows import KeptRows, asked_for
from printed_table import PrintedTable

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
driver = Path(find_spec("up_symk").origin).parent / "symk" / "fast-downward.py"
plans = "plan_selection=top_k(num_plans=infinity,dump_plans=false)"
search = f"symq_bd(simple=false,{plans},quality=1.0)"
subprocess.run([sys.executable, driver, "domain.pddl", "problem.pddl", "--search", search])
"""
PLANNERS = {"K*": KSTAR, "SymK": SYMK}


def limited(limit: int) -> None:
    """What a planner's processes may take."""
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    resource.setrlimit(resource.RLIMIT_AS, (coverage.MEMORY, coverage.MEMORY))


def asked(python: str, planner: str, folder: Path, limit: int) -> dict[str, Any]:
    """What a planner answers about the files in a folder."""
    with (folder / f"{planner[0]}.txt").open("w+") as out:
        process = subprocess.Popen(
            [python, "-c", PLANNERS[planner]],
            cwd=folder,
            stdout=out,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            preexec_fn=partial(limited, limit),
        )
        _, _, usage = os.wait4(process.pid, 0)
        out.seek(0)
        text = out.read()
    count, cost = re.search(r"Number of plans: (\d+)", text), re.search(r"Plan cost: (\d+)", text)
    return {
        "seconds": round(usage.ru_utime + usage.ru_stime, 2),
        "memory": usage.ru_maxrss // 1024,
        "plans": int(count[1]) if count and cost else None,
        "cost": int(cost[1]) if count and cost else None,
    }


def measured(name: str, given: argparse.Namespace) -> dict[str, Any]:
    """The figures of a row."""
    from planners.classical import compile_classical, to_pddl

    loaded = coverage.load(name, given.cost)
    compiled = compile_classical(loaded.model, loaded.tasks[0])
    figures: dict[str, Any] = {"row": name, "form": compiled.form, "actions": len(compiled.actions)}
    with tempfile.TemporaryDirectory() as folder:
        for file, text in zip(("domain", "problem"), to_pddl(compiled), strict=True):
            (Path(folder) / f"{file}.pddl").write_text(text)
        for planner in PLANNERS:
            figures[planner] = asked(given.python, planner, Path(folder), given.limit)
    return figures


def main() -> None:
    """Print what the arguments say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help="rows, or beginnings of their names")
    parser.add_argument("--first", type=int, default=3, metavar="N", help="problems of a domain")
    parser.add_argument("--limit", type=int, default=60, metavar="SECONDS", help="CPU seconds (60)")
    parser.add_argument("--cost", default="makespan+actions", help="of CoDMAP's tasks")
    parser.add_argument("--kept", type=Path, metavar="FILE", help="where lines are kept")
    parser.add_argument("--python", default=sys.executable, help="a Python that has the planners")
    given = parser.parse_args()
    known = KeptRows(given.kept)
    columns = [("row", -38), ("form", -17), ("actions", 8)]
    for planner in PLANNERS:
        columns += [(planner, 7), ("MB", 5), ("plans", 9)]
    table = PrintedTable(*columns)
    for name in asked_for(coverage.rows(given.first), given.rows):
        found = known.get(name, partial(measured, name, given))
        cells = [found["row"], found["form"], found["actions"]]
        for planner in PLANNERS:
            cells += [found[planner][key] for key in ("seconds", "memory", "plans")]
        table.print(*cells)
    for planner in PLANNERS:
        print(planner, sum(found[planner]["plans"] is not None for found in known.rows.values()))


if __name__ == "__main__":
    main()
