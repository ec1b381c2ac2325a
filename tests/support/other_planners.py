# SPDX-License-Identifier: GPL-3.0-or-later
"""How many plans fit a sentence: by our graph, by listing all plans, and by K*, SymK and Fast
Downward, which read the exported problem (`pip install '.[oracles]'`).
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from coordlang.commands.building import build_language
from coordlang.execution.task_language import TaskLanguage, languages_in_tasks
from coordlang.exports.pddl import PddlExport, export_pddl, plan_names
from coordlang.language.candidates import from_problems
from coordlang.language.sentences import sentence, task_sentences
from coordlang.required.miscoordination import Inseparable
from planners.classical.fast_downward import total_cost
from planners.pddl import read_domain, read_problem
from planners.pddl.model_options import ModelOptions
from planners.search.plans import Plans
from planners.system.errors import CoordlangError, OutOfMemory
from planners.system.limits import time_limit
from tests.support.domains import DOMAINS

#: More plans than this are not listed, neither by us nor by others.
MOST = 5_000
#: A search for invariants among facts without arguments takes seconds and gains nothing.
TRANSLATE = ("--translate-options", "--invariant-generation-max-time", "0", "--search-options")


@dataclass(frozen=True, slots=True)
class Row:
    """One sentence of one problem, exported in one form; None: no answer."""

    problem: str
    sentence: str
    form: str
    actions: int
    plans: int
    graph: int
    listing: int | None
    kstar: int | None
    symk: int | None
    cost: int
    fast_downward: int | None

    @property
    def agrees(self) -> bool:
        """Whether all answers are the same."""
        counts = {n for n in (self.graph, self.listing, self.kstar, self.symk) if n is not None}
        return len(counts) == 1 and self.fast_downward in (None, self.cost)


def rows(folder: str, seconds: float, *, other: bool = True) -> Iterator[Row]:
    """The rows of every problem in a folder whose plans can be told apart."""
    for path in sorted((DOMAINS / folder).glob("*.pddl")):
        if path.name != "domain.pddl":
            try:
                yield from problem_rows(path, seconds, other=other)
            except (Inseparable, OutOfMemory):
                continue


def problem_rows(path: Path, seconds: float, *, other: bool) -> Iterator[Row]:
    """Two sentences of a problem in both forms."""
    domain = read_domain(path.parent / "domain.pddl")
    problem = read_problem(path, domain)
    try:
        candidates = from_problems(domain, [problem])
        language = build_language(candidates, "greedy").language
    except Inseparable:  # no state tells its plans apart; the last actions do
        candidates = from_problems(domain, [problem], ModelOptions(remember_actions=True))
        language = build_language(candidates, "greedy").language
    spoken = next(languages_in_tasks(language, candidates))
    for words in two_sentences(spoken):
        last = None
        for limit in (2000, 0):
            exported = export_pddl(spoken, words, limit)
            if exported.classical.form != last:
                yield row(
                    f"{path.parent.name}/{path.stem}", spoken, words, exported, seconds, other=other
                )
            last = exported.classical.form


def two_sentences(spoken: TaskLanguage) -> list[tuple[int, ...]]:
    """The sentence of most and that of fewest plans.

    Those of the first and the last plan where there are too many sentences to compare.
    """
    try:
        listed = task_sentences(spoken.space, spoken.task, spoken.partition)
        found = [spoken.words_of(s.words) for s in (listed[0], listed[-1])]
    except OutOfMemory:
        plans = Plans.of(spoken.space, spoken.task)
        word = spoken.partition.word_of(spoken.space.rows)
        chosen = [plans.unrank(rank) for rank in (0, plans.count - 1)]
        found = [sentence(word[plans.states(plan)].tolist()) for plan in chosen]
    return list(dict.fromkeys(found))


def row(
    name: str,
    spoken: TaskLanguage,
    words: tuple[int, ...],
    exported: PddlExport,
    seconds: float,
    *,
    other: bool,
) -> Row:
    """All answers for one exported problem."""
    plans = Plans.of(spoken.space, spoken.task)
    fits = Plans.of(spoken.plans_with(words)).count
    found: dict[str, int | None] = dict.fromkeys(("kstar", "symk", "fast_downward"))
    if other:
        with tempfile.TemporaryDirectory(prefix="coordlang-") as directory:
            folder = Path(directory)
            (folder / "domain.pddl").write_text(exported.domain)
            (folder / "problem.pddl").write_text(exported.problem)
            if fits <= MOST:
                found["kstar"] = by_kstar(folder, exported, seconds)
                found["symk"] = by_symk(folder, exported, seconds)
            found["fast_downward"] = by_fast_downward(exported, seconds)
    return Row(
        name,
        spoken.text(words),
        exported.classical.form,
        len(exported.classical.actions),
        plans.count,
        fits,
        by_listing(spoken, plans, words),
        found["kstar"],
        found["symk"],
        exported.cost,
        found["fast_downward"],
    )


def by_listing(spoken: TaskLanguage, plans: Plans, words: tuple[int, ...]) -> int | None:
    """The number of optimal plans with the sentence, by definition: all plans are listed."""
    if plans.count > 40 * MOST:
        return None
    word = spoken.partition.word_of(plans.space.rows).tolist()
    return sum(sentence(word[state] for state in plans.states(plan)) == words for plan in plans)


def by_kstar(folder: Path, exported: PddlExport, seconds: float) -> int | None:
    """The number of optimal plans that K* lists, read back as joint plans, all different."""
    try:
        from kstar_planner.planners import run_planner
    except ImportError:
        return None
    search = (
        f"kstar(blind(transform=undo_to_origin()), q=1.0, k={10 * MOST}, max_time={seconds}, "
        "find_unordered_plans=false, "
        "dump_plan_files=false, json_file_to_dump=PLANS_JSON_NAME)"
    )
    files = [str(folder / "domain.pddl"), str(folder / "problem.pddl")]
    limit = ["--sas-file", str(folder / "kstar.sas"), "--overall-time-limit", f"{int(seconds)}s"]
    try:
        answer = run_planner([*limit, *files, *TRANSLATE, "--search", search])
    except json.JSONDecodeError:  # it was stopped while it wrote
        return None
    if answer["timeout_triggered"] or "search exit code: 0" not in answer["planner_output"]:
        return None
    found = [
        exported.joint_plan([name.strip() for name in plan["actions"]]) for plan in answer["plans"]
    ]
    assert all(plan["cost"] == exported.cost for plan in answer["plans"])
    return _distinct(found)


def by_symk(folder: Path, exported: PddlExport, seconds: float) -> int | None:
    """The number of optimal plans that SymK lists, read back as joint plans, all different."""
    try:
        from up_symk.symk_base import get_resource_path
    except ImportError:
        return None
    search = (
        "symq_bd(simple=false,plan_selection=top_k(num_plans=infinity,dump_plans=false),"
        "bound=infinity,quality=1.0)"
    )
    command = [
        sys.executable,
        get_resource_path(),
        "--plan-file",
        "plan",
        "--overall-time-limit",
        f"{int(seconds)}s",
    ]
    done = subprocess.run(
        [*command, "domain.pddl", "problem.pddl", *TRANSLATE, "--search", search],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        return None
    texts = [path.read_text() for path in folder.glob("plan*")]
    assert all(re.search(r"; cost = (\d+)", text)[1] == str(exported.cost) for text in texts)  # type: ignore[index]
    return _distinct([exported.joint_plan(plan_names(text)) for text in texts])


def by_fast_downward(exported: PddlExport, seconds: float) -> int | None:
    """The optimal cost by Fast Downward."""
    try:
        with time_limit(seconds):
            return total_cost(exported.classical)
    except CoordlangError:
        return None


def _distinct(plans: list[tuple[tuple[int, ...], ...]]) -> int:
    assert len(set(plans)) == len(plans), "one plan in two guises"
    return len(plans)
