# SPDX-License-Identifier: GPL-3.0-or-later
"""The page's data against plans that are listed one by one; the command that writes it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import prod
from pathlib import Path
from random import Random

import numpy as np
import pytest

import coordlang as door
from coordlang.commands.building import build_language
from coordlang.execution.task_language import language_in_task
from coordlang.language.candidates import all_pairs, describe, from_problems
from coordlang.language.sentences import sentence
from coordlang.report import task as page_task
from coordlang.report.page import make_report, page_data
from coordlang.report.task import select_tasks
from coordlang.required.miscoordination import Inseparable
from planners.search.kept_plans import keeping_plans, plan_store
from planners.search.plans import Plans
from planners.system.errors import ProvedImpossible, UsageError
from tests.coordlang.report.conftest import (
    data_of,
    listed_plans,
    make_language,
    make_world,
    refuted,
)
from tests.support import thorough
from tests.support.command import Command
from tests.support.domains import T_MAP, files_of
from tests.support.random_models import random_model

WORLDS: list[tuple[str, str, str | None]] = [
    ("t-map", "problem", "all"),
    ("handover", "two-doors", "all"),
    ("grid", "three-robots-3x3", None),
]
MORE = thorough(("lock", "both-in", "all"), ("elevator", "two-calls", "all"))


@pytest.fixture(autouse=True)
def kept(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A test searches each task once, for several pages too: commands, and functions."""
    folder = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as patch, keeping_plans(plan_store(folder)):
        patch.setenv("COORDLANG_CACHE", str(folder))
        yield


@pytest.mark.parametrize(("domain", "problem", "tasks"), [*WORLDS, *MORE])
def test_plans_and_sentences(domain: str, problem: str, tasks: str | None) -> None:
    data = make_world(domain, problem, tasks).data
    assert sum(t["name"] is not None for t in data["tasks"]) == 1
    for task in data["tasks"]:
        said: dict[tuple[int, ...], list[list[int]]] = {}
        for edges, nodes in listed_plans(task):
            words = sentence(data["state_words"][task["nodes"]["state"][n]] for n in nodes)
            said.setdefault(words, []).append(edges)
        assert task["plans"] == str(sum(map(len, said.values())))
        assert task["complete"]
        assert task["all_sentences"] == len(said)
        shown = [said[tuple(entry["words"])] for entry in task["sentences"]]
        assert shown == sorted(shown, key=len, reverse=True)
        for entry, plans in zip(task["sentences"], shown, strict=True):
            assert entry["plans"] == str(len(plans))
            own = [len({tuple(o[e] for e in edges) for edges in plans}) for o in task["labels"]]
            assert entry["own"] == [str(number) for number in own]
            assert prod(own) >= len(plans)


def test_ranks_are_those_of_the_planner() -> None:
    """Plan number k of the page (edges in order) is that of the planner: labels and states."""
    for domain, problem, tasks in WORLDS:
        world = make_world(domain, problem, tasks)
        data, task = world.data, world.data["tasks"][0]
        spoken = language_in_task(world.language, world.domain, world.problem)
        plans = Plans.of(spoken.space)
        first = task["first"]  # edges of a node are in the order of labels
        ways = [([e - first[n] for e, n in zip(*w, strict=False)], w) for w in listed_plans(task)]
        for rank, (_, (edges, nodes)) in enumerate(sorted(ways)):
            plan = plans.unrank(rank)
            assert [
                tuple(data["labels"][r][own[edge]]["text"] for r, own in enumerate(task["labels"]))
                for edge in edges
            ] == [tuple(t or "idle" for t in spoken.model.texts(step)) for step in plan]
            keys = [spoken.model.codec.key(spoken.space.rows[s]) for s in plans.states(plan)]
            states = [data["states"][task["nodes"]["state"][n]] for n in nodes]
            facts = [sorted(data["facts"][f]["text"] for f in state) for state in states]
            assert [*map(" ".join, facts)] == keys


def test_random_models() -> None:
    """Models that nobody wrote for a page: it is made, and its numbers add up."""
    made = requiring = unmapped = 0
    for seed in range(12):
        random = Random(seed)
        domain, problem, options = random_model(seed, random.choice([2, 2, 3]))
        try:
            candidates = (all_pairs if random.random() < 0.5 else from_problems)(
                domain, [problem], options
            )
            if not candidates.count or candidates.count > 400:
                continue
            language = build_language(candidates, "greedy").language
            selection = select_tasks(language, domain, [problem], 4, seed)
        except (Inseparable, ProvedImpossible):
            continue
        data = page_data(selection, seed, {})
        made += 1
        unmapped += not data["places"]
        for task, shown in zip(data["tasks"], selection.tasks, strict=True):
            of_sentences = sum(int(s["plans"]) for s in task["sentences"])
            assert int(task["plans"]) == len(listed_plans(task)) == of_sentences
            assert not shown.language.covered or task["verified"]
            if task["witness"]:
                requiring += 1
                assert task["witness"]["breaks"] <= task["steps"]
                assert not task["witness"]["reaches"] or options.cost != "makespan"
    assert made >= 4
    assert requiring >= 2
    assert unmapped >= 1


def test_large_tasks_are_drawn() -> None:
    spoken = language_in_task(*make_language("grid", "three-robots-3x3", None))
    part = page_task.drawn_part(spoken, 0, most=60)
    assert page_task.drawn_part(spoken, 0) is spoken.space
    assert 10 < len(part.target) <= 60
    # Every node but the start is led to, and every node but the goal's leads on: each way is a
    # whole plan.
    nodes, (start,) = set(range(len(part))), part.starts.tolist()
    assert set(part.target.tolist()) | {start} == nodes
    assert set(part.sources.tolist()) | set(np.flatnonzero(part.layer == 0).tolist()) == nodes


def test_selection() -> None:
    language, domain, problem = make_language("three-cells", "problem")
    every = select_tasks(language, domain, [problem], 200, 0)
    assert (len(every.tasks), every.complete) == (30, True)
    assert sum(task.witness is not None for task in every.tasks) == 6
    fewer = replace(language, states=dict([*language.states.items()][1:]))
    assert not select_tasks(fewer, domain, [problem], 200, 0).complete
    assert b"of these tasks" not in make_report(fewer, domain, [problem], tasks_shown=1).html
    assert "of these tasks leaves" not in str(door.explain(fewer, domain, problem))
    for more in ({"remember_actions": True}, {"slack": 1, "words_see_slack": True}):
        built = door.build(domain, problem, tasks="all", method="greedy", **more)
        every = select_tasks(built.language, domain, [problem], 200, 0)
        assert (len(every.tasks), every.complete) == (30, True)
    domain, problem, options = random_model(37, 3)  # one of its states leads nowhere
    pairs = all_pairs(domain, [problem], replace(options, remember_actions=True))
    every = select_tasks(build_language(pairs, "greedy").language, domain, [problem], 200, 0)
    assert (len(every.tasks), every.complete) == (35, True)
    assert all(task["title"] != "nothing to do" for task in page_data(every, 0, {})["tasks"])
    language, domain, problem = make_language("t-map", "problem")

    def some(seed: int) -> tuple[str, ...]:
        found = select_tasks(language, domain, [problem], 10, seed)
        assert (len(found.tasks), found.complete) == (10, False)
        assert sum(task.witness is not None for task in found.tasks[1:]) == round(9 * 0.75)
        return tuple(describe(task.language.space, task.language.task) for task in found.tasks)

    assert some(0) == some(0) != some(1)
    with pytest.raises(UsageError):
        select_tasks(language, domain, [problem, problem], 1, 0)


def test_a_page_is_the_same_each_time_opens_offline_and_shows_fewer_tasks_if_too_large(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    language, domain, problem = make_language("t-map", "problem")
    pages = [make_report(language, domain, [problem], tasks_shown=4, seed=s) for s in (3, 3, 4)]
    one, again, other = (page.html for page in pages)
    assert one == again != other
    text = one.decode().replace("http://www.w3.org/2000/svg", "")
    assert [part for part in ("http:", "https:", str(Path.cwd())) if part in text] == []
    monkeypatch.setattr("coordlang.report.page.LARGEST", len(one) - 1)
    less = make_report(language, domain, [problem], tasks_shown=4, seed=3)
    assert len(less.selection.tasks) == 2
    assert not data_of(less.html)["candidates"]["complete"]
    monkeypatch.setattr("coordlang.report.page._ATOMS_LISTED", 1)  # no picture of unlisted states
    data = data_of(make_report(language, domain, [problem], tasks_shown=1).html)
    assert (data["mapped"], data["state_graph"]) == (0, None)


def test_a_language_that_is_none_is_said_to_be_none() -> None:
    language, domain, problem = make_language("t-map", "problem")
    for shown, holds in ((language, True), (refuted(language), False)):
        for task in data_of(make_report(shown, domain, [problem], tasks_shown=2).html)["tasks"]:
            assert task["covered"] is task["verified"] is holds
            assert (task["violation"] is None) == holds


def test_a_file_need_not_name_the_robots() -> None:
    language, domain, problem = make_language("t-map", "problem")
    unnamed = replace(language, provenance=replace(language.provenance, robots=()))
    pages = {make_report(one, domain, [problem], tasks_shown=1).html for one in (language, unnamed)}
    assert len(pages) == 1


def test_plans_within_slack_are_called_so() -> None:
    """The page says "optimal plan" of no other plans."""
    built = door.build(*files_of("three-cells"), slack=2, words_see_slack=True, method="separating")
    _, domain, problem = make_language("three-cells", "problem", None)
    html = make_report(built.language, domain, [problem], tasks_shown=1).html
    kept = data_of(html)["kept"]
    assert kept["one"] == "a plan within 2 steps of the optimum"
    assert b"optimal plan" not in html
    assert f"follows any {kept['plan']} with that sentence" in " ".join(html.decode().split())


# ---- ``coordlang report``


def test_a_page_is_written(coordlang: Command, language: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    outcome = coordlang("report", language, *T_MAP, "-o", page)
    assert outcome.code == 0
    assert outcome.out == f"30 tasks of 132, {page.stat().st_size:,} bytes, written to {page}\n"
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert len(data_of(page.read_bytes())["tasks"]) == 30
    to_stdout = coordlang("report", language, *T_MAP, "-o", "-")
    assert to_stdout.out == page.read_text()
    assert "written to stdout" in to_stdout.err
    other = tmp_path / "other.pddl"  # no candidate: plans to part of a state
    goal = "(:goal (and (not (at r2 c1-2)) (at r1 c1-2)))\n)"
    other.write_text(T_MAP[1].read_text().partition("(:goal")[0] + goal)
    outcome = coordlang("report", language, T_MAP[0], other, "-o", page)
    assert outcome.out.startswith("29 tasks of 132 and 1 other, ")
    assert data_of(page.read_bytes())["tasks"][0]["title"] == "r1 c0-1 → c1-2"


@pytest.mark.thorough
def test_coordinates(coordlang: Command, language: Path, tmp_path: Path) -> None:
    sidecar = tmp_path / "mine.json"
    places = '{"c0-1": [9, 0], "c1-0": [0, 5], "c1-1": [9, 5], "c1-2": [20, 5]}'
    sidecar.write_text(f'{{"coordinates": {places}}}')
    page = tmp_path / "report.html"
    one = ("-o", page)
    assert coordlang("report", language, *T_MAP, *one, "--coordinates", sidecar).code == 0
    assert data_of(page.read_bytes())["places"][0] == {"name": "c0-1", "x": 9, "y": 0}
    # Beside the problem it needs no option.
    copy = tmp_path / "problem.pddl"
    copy.write_text(T_MAP[1].read_text())
    sidecar.rename(tmp_path / "coordinates.json")
    assert coordlang("report", language, T_MAP[0], copy, *one).code == 0
    assert data_of(page.read_bytes())["places"][0]["x"] == 9
    (tmp_path / "coordinates.json").write_text("[]")
    assert coordlang("report", language, T_MAP[0], copy, *one).code == 31
    assert coordlang("report", language, *T_MAP, *one, "--coordinates", sidecar).code == 31
