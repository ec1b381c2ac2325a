"""PDDL that others wrote (../shared/data): the reference numbers again, and a language for each
domain.

    python benchmarks/foreign.py --numbers [--oracles] [ROW ..]   # states, makespan, plans; beside
    the reference python benchmarks/foreign.py [--time-limit S] [ROW ..]        # languages over
    varied tasks, and what their words say python benchmarks/foreign.py --refused
    # what is refused, and with which message

Every figure is the work of a process of its own, whose seconds (whole process) and peak memory are
shown.  With ``--oracles`` K* counts the plans, too (it has to be installed: the extra ``oracles``).
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

from foreign_rows import BY_NAME, LANGUAGE_BY_NAME, LANGUAGES, ROWS, SHARED, Language, Row
from telling import said

#: Seconds after which a process is ended.
MOST = 600


@dataclass(frozen=True, slots=True)
class Done:
    """What a process printed (JSON), its exit code, seconds and peak memory in MiB."""

    data: dict[str, Any]
    code: int
    seconds: float
    memory: int
    errors: str

    @property
    def cost(self) -> str:
        return f"{self.seconds:.1f} s {self.memory} MB"


def coordlang(*arguments: str) -> Done:
    """Run ``coordlang ARGUMENTS --json`` as a process of its own."""
    return _process(("-c", "from coordlang.cli import main; main()", *arguments))


def _process(arguments: Sequence[str]) -> Done:
    start = perf_counter()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            stdout=out,
            stderr=err,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
        )
        pid = 0
        while pid == 0:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid == 0:
                sleep(0.02)
                if perf_counter() - start > MOST:
                    os.killpg(process.pid, signal.SIGKILL)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = perf_counter() - start
        texts = []
        for stream in (out, err):
            stream.seek(0)
            texts.append(stream.read().decode())
    data = json.loads(texts[0]) if texts[0].startswith("{") else {}
    return Done(data, process.returncode, seconds, usage.ru_maxrss // 1024, texts[1])


def table(header: Sequence[str], lines: Iterable[Sequence[object]], widths: Sequence[int]) -> None:
    """Print rows as they come."""
    for cells in (header, *lines) if isinstance(lines, list) else _chain(header, lines):
        texts = [
            f"{cell:,}" if isinstance(cell, int) and not isinstance(cell, bool) else str(cell)
            for cell in cells
        ]
        print(
            "  ".join(f"{text:<{w}}" for text, w in zip(texts, widths, strict=True)).rstrip(),
            flush=True,
        )


def _chain(header: Sequence[str], lines: Iterable[Sequence[object]]) -> Iterable[Sequence[object]]:
    yield header
    yield from lines


# ---- the numbers
# ------------------------------------------------------------------------------


def numbers(rows: Sequence[Row], *, oracles: bool) -> int:
    """The reference table again; the number of cells that differ."""
    wrong: list[str] = []

    def judged(row: Row, what: str, found: object, expected: object) -> str:
        same = found == expected
        if (
            row.approximate
            and what == "plans"
            and isinstance(found, int)
            and isinstance(expected, int)
        ):
            same = abs(found - expected) <= 0.05 * expected
        if not same:
            wrong.append(f"{row.name}: {what} {found}, the reference has {expected}")
        return f"{found:,}" if isinstance(found, int) else str(found)

    def lines() -> Iterable[Sequence[object]]:
        for row in rows:
            states = coordlang("inspect", *row.arguments, "--states", "--json")
            all_plans = coordlang("plans", *row.arguments, "--count", "--json")
            fewest = coordlang(
                "plans", *row.arguments, "--count", "--json", "--cost", "makespan+actions"
            )
            check = coordlang("check", *row.arguments, "--json", "--cost", "makespan+actions")
            cost = check.data.get("fast_downward")
            if not check.data.get("agree"):
                wrong.append(
                    f"{row.name}: Fast Downward {cost}, coordlang {check.data.get('coordlang')}"
                )
            cells = [
                row.name,
                judged(row, "states", states.data.get("states"), row.states),
                states.cost,
                judged(row, "makespan", all_plans.data.get("optimal_cost"), row.makespan),
                judged(row, "plans", _number(all_plans.data.get("count")), row.plans),
                all_plans.cost,
                judged(row, "fewest", _number(fewest.data.get("count")), row.fewest),
                fewest.cost,
                f"{cost[0]}, {cost[1]}" if cost else "none",
                check.cost,
            ]
            if oracles:
                cells += [
                    _counted(row, "makespan", wrong),
                    _counted(row, "makespan+actions", wrong),
                ]
            yield cells

    header = [
        "row",
        "states",
        "",
        "makespan",
        "plans",
        "",
        "fewest actions",
        "",
        "Fast Downward",
        "",
    ]
    widths = [13, 8, 14, 8, 18, 14, 14, 14, 13, 14]
    if oracles:
        header += ["K* plans", "K* fewest actions"]
        widths += [18, 18]
    table(header, lines(), widths)
    print(f"\n{len(wrong)} differences", *wrong, sep="\n  ")
    return len(wrong)


def _number(count: object) -> object:
    """A count of plans; those above 2^53 are texts in JSON."""
    return int(count) if isinstance(count, str) else count


def _counted(row: Row, cost: str, wrong: list[str]) -> str:
    done = _process((__file__, "--k-star", row.name, "--cost", cost))
    if done.code != 0 or "plans" not in done.data:
        return str(
            done.data.get("why", f"did not finish in {MOST} s" if done.code < 0 else "failed")
        )
    if done.data["plans"] != done.data["ours"]:
        wrong.append(
            f"{row.name}: K* counts {done.data['plans']} plans under {cost}, "
            f"coordlang {done.data['ours']}"
        )
    return f"{done.data['plans']:,} ({done.seconds:.1f} s)"


def k_star(row: Row, cost: str) -> dict[str, object]:
    """Count the optimal plans with K*, from the plain PDDL of the joint model."""
    from contextlib import redirect_stdout

    from kstar_planner.planners import plan_topk

    from planners.classical import compile_classical, to_pddl
    from planners.search.plans import Plans

    loaded = load(row, cost)
    from planners.search.optimal_plans import search

    space = search(loaded.model, loaded.tasks[0])
    ours = Plans.of(space).count
    if ours > 20_000:
        return {"why": f"not asked ({ours:.3g})"}
    plain = compile_classical(loaded.model, loaded.tasks[0], limit=20_000)
    with tempfile.TemporaryDirectory() as name, redirect_stdout(sys.stderr):
        files = Path(name) / "domain.pddl", Path(name) / "problem.pddl"
        for path, text in zip(files, to_pddl(plain), strict=True):
            path.write_text(text)
        os.chdir(name)
        found = plan_topk(*files, number_of_plans_bound=ours + 100, timeout=120).get("plans") or []
        os.chdir("/")
    if not found:
        return {"why": "did not finish"}
    best = min(plan["cost"] for plan in found)
    different = {tuple(plan["actions"]) for plan in found if plan["cost"] == best}
    if (
        not any(plan["cost"] > best for plan in found)
        and len(different) == len(found)
        and len(found) < ours + 100
    ):
        return {"why": f"stopped at {len(different):,}"}
    return {"plans": len(different), "ours": ours, "form": plain.form}


def load(row: Row, cost: str, *, remember_actions: bool = False) -> Any:
    """The joint model of a row."""
    from planners.loading import ModelOptions, build
    from planners.pddl import read_domain, read_problem
    from planners.pddl.factored import read_factored
    from planners.pddl.robots import RobotSelection

    words = dict(zip(row.options[::2], row.options[1::2], strict=True))
    choice = RobotSelection(
        tuple(words["--robots"].split(",")) if "--robots" in words else (),
        words.get("--robot-type"),
        words.get("--unowned", "error"),  # type: ignore[arg-type]
    )
    if row.factored:
        domain, problem = read_factored(str(SHARED / "foreign" / row.folder))
    else:
        domain = read_domain(row.arguments[0])
        problem = read_problem(row.arguments[1], domain)
    return build(domain, [problem], ModelOptions(choice, cost, remember_actions))  # type: ignore[arg-type]


# ---- a language for each
# ------------------------------------------------------------------------------


def languages(chosen: Sequence[Language], seconds: float) -> int:
    """A language for each; how many failed, or do not say what they are said to say."""
    wrong: list[str] = []

    def lines() -> Iterable[Sequence[object]]:
        for language in chosen:
            done = _process((__file__, "--one", language.name, "--time-limit", str(seconds)))
            figures = done.data
            if done.code != 0:
                wrong.append(f"{language.name}: {done.errors.strip()[-300:]}")
                continue
            if figures["told"] < language.agree * figures["different"] or not figures["different"]:
                wrong.append(
                    f"{language.name}: told in {figures['told']} of {figures['different']} tasks"
                )
            bound = "proved" if figures["proved"] else f"at least {figures['bound']}"
            options = language.cost.removeprefix("makespan").lstrip("+") or "-"
            yield [
                language.name,
                figures["tasks"],
                figures["requiring"],
                figures["states"],
                figures["greedy"],
                f"{figures['words']} {bound}",
                options + (", remembered" if language.remember_actions else ""),
                f"{figures['told']}/{figures['different']}",
                f"{figures['left']}/{figures['open']}",
                done.cost,
                language.means,
            ]

    header = [
        "language",
        "tasks",
        "requiring",
        "states",
        "greedy",
        "minimal",
        "cost",
        "told",
        "left",
        "process",
        "words say",
    ]
    table(header, lines(), [13, 6, 9, 7, 6, 12, 8, 8, 8, 14, 20])
    print(f"\n{len(wrong)} wrong", *wrong, sep="\n  ")
    return len(wrong)


def build(language: Language, seconds: float) -> dict[str, object]:
    """Build and verify the two languages of a row, and see what the smaller one says."""
    from coordlang.building import build_language
    from coordlang.tasks.candidates import from_listed
    from coordlang.tasks.patterns import varied_tasks
    from planners.limits import time_limit

    row = BY_NAME[language.row]
    loaded = load(row, language.cost)
    tasks = varied_tasks(loaded, language.starts, language.goals)
    options = replace(loaded.options, remember_actions=language.remember_actions)
    candidates = from_listed(loaded.domain, loaded.problems, tasks, options)
    first = build_language(candidates)
    with time_limit(seconds):
        built = build_language(candidates, "minimal")
    guarantee = built.language.guarantee
    return {
        "tasks": candidates.count,
        "requiring": built.first_differences.requiring,
        "states": candidates.states,
        "greedy": first.language.guarantee.size,
        "words": guarantee.size,
        "bound": guarantee.lower_bound,
        "proved": guarantee.proved_minimal,
        "verified": built.verdict.holds,
        **said(built.language, candidates, language.told, language.left),
    }


# ---- what is refused
# ------------------------------------------------------------------------------


def refused() -> int:
    """Run everything in ``refuse/``; how many runs ended otherwise than expected.

    ``numeric`` holds no numeric feature (`tests/foreign` goes through its words), so it is read,
    told who the robots are.
    """
    place = SHARED / "refuse"
    wrong = 0
    for folder in sorted(path for path in place.iterdir() if path.is_dir()):
        domain = next(iter(sorted(folder.glob("domain*.pddl"))))
        problem = next(iter(sorted(set(folder.glob("*.pddl")) - {domain})), domain)
        robots = ("--robots", "driver,truck") if folder.name == "numeric" else ()
        done = coordlang("plans", str(domain), str(problem), "--count", "--json", *robots)
        said = (
            done.errors.strip().splitlines()[0].replace(str(place) + "/", "")
            if done.errors.strip()
            else done.data
        )
        print(f"{folder.name:<16} exit {done.code}  {said}")
        wrong += done.code != (0 if robots else 34)
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help=f"of {', '.join(BY_NAME)}")
    parser.add_argument("--numbers", action="store_true", help="the reference table again")
    parser.add_argument(
        "--oracles", action="store_true", help="with --numbers: K* counts the plans, too"
    )
    parser.add_argument("--refused", action="store_true", help="what is refused")
    parser.add_argument("--k-star", metavar="ROW", help=argparse.SUPPRESS)
    parser.add_argument("--one", metavar="LANGUAGE", help=argparse.SUPPRESS)
    parser.add_argument(
        "--time-limit", type=float, default=120, help="seconds for each minimal language (120)"
    )
    parser.add_argument("--cost", default="makespan", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if unknown := set(given.rows) - {*BY_NAME, *LANGUAGE_BY_NAME}:
        parser.error(f"no such row: {', '.join(sorted(unknown))}")
    if not SHARED.is_dir():
        parser.error(f"the inputs that others wrote are not here: {SHARED}")
    if given.k_star:
        print(json.dumps(k_star(BY_NAME[given.k_star], given.cost)))
        return 0
    rows = [row for row in ROWS if not given.rows or row.name in given.rows]
    if given.numbers:
        return int(numbers(rows, oracles=given.oracles) > 0)
    if given.refused:
        return int(refused() > 0)
    if given.one:
        print(json.dumps(build(LANGUAGE_BY_NAME[given.one], given.time_limit)))
        return 0
    chosen = [one for one in LANGUAGES if not given.rows or {one.name, one.row} & set(given.rows)]
    return int(languages(chosen, given.time_limit) > 0)


if __name__ == "__main__":
    sys.exit(main())
