# SPDX-License-Identifier: GPL-3.0-or-later
"""How many plans fit a sentence: by our graph, by listing all plans, and by K*, SymK and Fast
Downward, which read the exported problem (`pip install '.[oracles]'`).
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from coordlang.commands.building import build_language
from coordlang.execution.task_language import TaskLanguage, languages_in_tasks
from coordlang.exports.pddl import PddlExport, export_pddl, plan_names
from coordlang.language.sentences import sentence, task_sentences
from coordlang.required.miscoordination import Inseparable
from planners.classical.fast_downward import total_cost
from planners.pddl.model_options import ModelOptions
from planners.search.plans import Plans
from planners.system.errors import CoordlangError, OutOfMemory
from planners.system.limits import time_limit
from tests.support.domains import DOMAINS, own_task

#: More plans than this are not listed by others; 40 times as many not by us.
MOST = 5_000
#: A search for invariants among facts without arguments takes seconds and gains nothing.
TRANSLATE = ("--translate-options", "--invariant-generation-max-time", "0", "--search-options")


@dataclass(frozen=True, slots=True)
class Row:
    """The answers for one sentence of one problem, exported in one form; None: no answer."""

    problem: str
    form: str
    graph: int
    listing: int | None
    cost: int
    kstar: int | None = None
    symk: int | None = None
    fast_downward: int | None = None

    @property
    def agrees(self) -> bool:
        """Whether all answers are the same."""
        counts = {n for n in (self.graph, self.listing, self.kstar, self.symk) if n is not None}
        return len(counts) == 1 and self.fast_downward in (None, self.cost)


def rows(folder: str, seconds: float, *, other: bool = True) -> Iterator[Row]:
    """Two sentences, in both forms, of every problem in a folder whose plans can be told apart."""
    for path in sorted((DOMAINS / folder).glob("*.pddl")):
        with suppress(Inseparable, OutOfMemory):
            if path.name == "domain.pddl":
                continue
            spoken = _spoken(folder, path.stem)
            for words in _two_sentences(spoken):
                exports = [export_pddl(spoken, words, limit) for limit in (0, 2000)]
                for exported in {e.classical.form: e for e in exports}.values():
                    row = _ours(path.stem, spoken, words, exported)
                    yield _with_others(row, exported, seconds) if other else row


def _spoken(folder: str, stem: str) -> TaskLanguage:
    """The greedy language; if no state tells plans apart, the last actions do."""
    try:
        candidates = own_task(folder, stem)
        language = build_language(candidates, "greedy").language
    except Inseparable:
        candidates = own_task(folder, stem, ModelOptions(remember_actions=True))
        language = build_language(candidates, "greedy").language
    return next(languages_in_tasks(language, candidates))


def _two_sentences(spoken: TaskLanguage) -> list[tuple[int, ...]]:
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


def _ours(stem: str, spoken: TaskLanguage, words: tuple[int, ...], exported: PddlExport) -> Row:
    """By the graph, and by definition: all plans are listed."""
    plans, listing = Plans.of(spoken.space, spoken.task), None
    if plans.count <= 40 * MOST:
        word = spoken.partition.word_of(plans.space.rows).tolist()
        listing = sum(sentence(word[s] for s in plans.states(plan)) == words for plan in plans)
    fits = Plans.of(spoken.plans_with(words)).count
    return Row(stem, exported.classical.form, fits, listing, exported.cost)


def _with_others(row: Row, exported: PddlExport, seconds: float) -> Row:
    with tempfile.TemporaryDirectory(prefix="coordlang-") as directory:
        folder = Path(directory)
        (folder / "domain.pddl").write_text(exported.domain)
        (folder / "problem.pddl").write_text(exported.problem)
        if row.graph <= MOST:
            row = replace(row, kstar=by_kstar(folder, exported, seconds))
            row = replace(row, symk=by_symk(folder, exported, seconds))
    with suppress(CoordlangError), time_limit(seconds):
        row = replace(row, fast_downward=total_cost(exported.classical))
    return row


def by_kstar(folder: Path, exported: PddlExport, seconds: float) -> int | None:
    """The number of optimal plans that K* lists, read back as joint plans, all different."""
    try:
        from kstar_planner.planners import run_planner
    except ImportError:
        return None
    search = (
        f"kstar(blind(transform=undo_to_origin()), q=1.0, k={10 * MOST}, max_time={seconds}, "
        "find_unordered_plans=false, dump_plan_files=false, json_file_to_dump=PLANS_JSON_NAME)"
    )
    files = [str(folder / "domain.pddl"), str(folder / "problem.pddl")]
    limit = ["--sas-file", str(folder / "kstar.sas"), "--overall-time-limit", f"{int(seconds)}s"]
    try:
        answer = run_planner([*limit, *files, *TRANSLATE, "--search", search])
    except json.JSONDecodeError:  # it was stopped while it wrote
        return None
    if answer["timeout_triggered"] or "search exit code: 0" not in answer["planner_output"]:
        return None
    assert all(plan["cost"] == exported.cost for plan in answer["plans"])
    return _different(exported, [[a.strip() for a in p["actions"]] for p in answer["plans"]])


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
    limit = ["--plan-file", "plan", "--overall-time-limit", f"{int(seconds)}s"]
    command = [sys.executable, get_resource_path(), *limit, "domain.pddl", "problem.pddl"]
    done = subprocess.run(
        [*command, *TRANSLATE, "--search", search], cwd=folder, capture_output=True, text=True
    )
    if done.returncode != 0:
        return None
    texts = [path.read_text() for path in folder.glob("plan*")]
    assert all(f"; cost = {exported.cost} " in text for text in texts)
    return _different(exported, [plan_names(text) for text in texts])


def _different(exported: PddlExport, plans: Sequence[list[str]]) -> int:
    found = [exported.joint_plan(names) for names in plans]
    assert len(set(found)) == len(found), "one plan in two guises"
    return len(found)
