# SPDX-License-Identifier: GPL-3.0-or-later
"""The page's data against plans that are listed one by one."""

from __future__ import annotations

from collections import Counter
from math import prod
from pathlib import Path
from random import Random
from typing import Any

import pytest

from coordlang.commands.building import build_language
from coordlang.execution.task_language import language_in_task
from coordlang.language.candidates import all_pairs, from_problems
from coordlang.language.sentences import sentence
from coordlang.report import graph
from coordlang.report.data import page_data
from coordlang.report.page import make_report
from coordlang.report.shown import select_tasks
from coordlang.report.task import task_part
from coordlang.required.miscoordination import Inseparable
from planners.search.plans import Plans
from planners.system.errors import ProvedImpossible, UsageError
from tests.coordlang.report.conftest import data_of, make_language, make_world, refuted
from tests.support.random_models import random_model

WORLDS = [
    ("t-map", "problem", "all"),
    ("lock", "both-in", "all"),
    ("handover", "two-doors", "all"),
    ("elevator", "two-calls", "all"),
    ("grid", "three-robots-3x3", None),
]


def listed_plans(task: dict[str, Any]) -> list[tuple[list[int], list[int]]]:
    """All ways through the graph of the page: (edges, nodes)."""
    found = []
    todo: list[tuple[list[int], list[int]]] = [([], [0])]
    while todo:
        edges, nodes = todo.pop()
        if len(edges) == task["steps"]:
            found.append((edges, nodes))
        first = task["first"]
        todo += [
            ([*edges, e], [*nodes, task["target"][e]])
            for e in range(first[nodes[-1]], first[nodes[-1] + 1])
        ]
    return found


@pytest.mark.parametrize(("domain", "problem", "tasks"), WORLDS)
def test_plans_and_sentences(domain: str, problem: str, tasks: str | None) -> None:
    world = make_world(domain, problem, tasks)
    data = world.data
    assert sum(t["name"] is not None for t in data["tasks"]) == 1
    for task in data["tasks"]:
        plans = listed_plans(task)
        assert task["plans"] == str(len(plans))
        assert task["complete"]
        said = Counter(
            sentence(data["state_words"][task["nodes"]["state"][n]] for n in nodes)
            for _, nodes in plans
        )
        assert task["all_sentences"] == len(said)
        for entry in task["sentences"]:
            words = tuple(entry["words"])
            assert entry["plans"] == str(said[words])
            mine = [
                edges
                for edges, nodes in plans
                if sentence(data["state_words"][task["nodes"]["state"][n]] for n in nodes) == words
            ]
            own = [
                len({tuple(labels[edge] for edge in edges) for edges in mine})
                for labels in task["labels"]
            ]
            assert entry["own"] == [str(number) for number in own]
            assert prod(own) >= len(mine)
        assert [int(s["plans"]) for s in task["sentences"]] == sorted(
            (said[tuple(s["words"])] for s in task["sentences"]), reverse=True
        )


def test_ranks_are_those_of_the_planner() -> None:
    """Plan number k of the page (edges in order) is plan number k of the planner: same labels, same
    states.
    """
    for domain, problem, tasks in WORLDS:
        world = make_world(domain, problem, tasks)
        data, task = world.data, world.data["tasks"][0]
        spoken = language_in_task(world.language, world.domain, world.problem)
        plans = Plans.of(spoken.space)

        def by_labels(way: tuple[list[int], list[int]], task: dict[str, Any] = task) -> list[int]:
            # Edges of a node are in the order of labels, so that ways are ordered by their choices
            # of edge.
            return [edge - task["first"][node] for edge, node in zip(way[0], way[1], strict=False)]

        for rank, (edges, nodes) in enumerate(sorted(listed_plans(task), key=by_labels)):
            plan = plans.unrank(rank)
            texts = [spoken.model.texts(step) for step in plan]
            assert [
                tuple(
                    data["labels"][robot][own[edge]]["text"]
                    for robot, own in enumerate(task["labels"])
                )
                for edge in edges
            ] == [tuple(text or "idle" for text in step) for step in texts]
            keys = [spoken.model.codec.key(spoken.space.rows[s]) for s in plans.states(plan)]
            assert [key_of(data, task["nodes"]["state"][n]) for n in nodes] == keys


def key_of(data: dict[str, Any], state: int) -> str:
    return " ".join(sorted(data["facts"][f]["text"] for f in data["states"][state]))


def test_random_models() -> None:
    """Models that nobody wrote for a page: it is made, and its numbers add up."""
    made = requiring = unmapped = 0
    for seed in range(26):
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
        parts = [task_part(shown, seed) for shown in selection.tasks]
        data = page_data(language, selection, parts)
        made += 1
        unmapped += not data["places"]
        for task, part in zip(data["tasks"], parts, strict=True):
            plans = listed_plans(task)
            assert (
                task["plans"]
                == str(len(plans))
                == str(sum(int(s["plans"]) for s in task["sentences"]))
            )
            assert not part.shown.language.covered or task["verified"]
            if task["witness"]:
                requiring += 1
                assert task["witness"]["breaks"] <= task["steps"]
                assert not task["witness"]["reaches"] or options.cost != "makespan"
    assert made >= 8
    assert requiring >= 3
    assert unmapped >= 2


def test_large_tasks_are_drawn() -> None:
    spoken = language_in_task(*make_language("grid", "three-robots-3x3", None))
    whole = graph.plan_graph(spoken, 0)
    exact = {s.words: s.plans for s in graph.shown_sentences(spoken, whole, 0).listed}
    part = graph.plan_graph(spoken, 0, most=60)
    assert whole.complete
    assert not part.complete
    assert 10 < len(part.edges) <= 60
    space, nodes = spoken.space, set(part.nodes.tolist())
    sources, targets = space.sources[part.edges].tolist(), space.target[part.edges].tolist()
    # Every node but the start is led to, and every node but the goal's leads on: each way is a
    # whole plan.
    assert set(targets) | {spoken.start} == nodes
    assert set(sources) | {n for n in nodes if space.layer[n] == 0} == nodes
    drawn = graph.shown_sentences(spoken, part, 0, most=60)
    assert drawn.total is None
    assert drawn.listed
    assert all(exact.get(s.words, s.plans) == s.plans for s in drawn.listed)


def test_selection() -> None:
    language, domain, problem = make_language("t-map", "problem")
    every = select_tasks(language, domain, [problem], 200, 0)
    assert every.complete
    # The problem's own task is the pair of its start and the only state with its goal: 131 further
    # pairs.
    assert len(every.tasks) == 132 or len(every.tasks) == 133
    assert sum(task.witness is not None for task in every.tasks) in (12, 13)
    some = select_tasks(language, domain, [problem], 10, 0)
    assert len(some.tasks) == 10
    assert not some.complete
    assert sum(task.witness is not None for task in some.tasks[1:]) == round(9 * 0.75)
    other = select_tasks(language, domain, [problem], 10, 1)

    def texts(selection: Any) -> list[Any]:
        return [
            task.language.space.rows[task.language.space.state[task.language.start]].tolist()
            for task in selection.tasks
        ]

    assert texts(some) == texts(select_tasks(language, domain, [problem], 10, 0))
    assert texts(some) != texts(other)
    with pytest.raises(UsageError):
        select_tasks(language, domain, [problem, problem], 1, 0)


def test_a_page_is_the_same_each_time_and_opens_offline() -> None:
    language, domain, problem = make_language("t-map", "problem")
    one = make_report(language, domain, [problem], tasks_shown=5, seed=3)
    assert one.html == make_report(language, domain, [problem], tasks_shown=5, seed=3).html
    assert one.html != make_report(language, domain, [problem], tasks_shown=5, seed=4).html
    text = one.html.decode().replace("http://www.w3.org/2000/svg", "")
    assert "http:" not in text
    assert "https:" not in text
    assert str(Path.cwd()) not in text


def test_pages_that_would_be_too_large_show_fewer_tasks() -> None:
    language, domain, problem = make_language("t-map", "problem")
    full = make_report(language, domain, [problem], tasks_shown=12)
    less = make_report(language, domain, [problem], tasks_shown=12, largest=len(full.html) - 1)
    assert less.tasks == full.tasks // 2
    assert not data_of(less.html)["candidates"]["complete"]


def test_without_a_map() -> None:
    language, domain, problem = make_language("t-map", "problem")
    shown = data_of(make_report(language, domain, [problem], tasks_shown=1, most_places=3).html)
    assert shown["places"] == []
    assert {fact["role"][0] for fact in shown["facts"]} == {"other"}
    assert all(label["moves"] == [] for own in shown["labels"] for label in own)


def test_a_language_that_is_none_is_said_to_be_none() -> None:
    language, domain, problem = make_language("t-map", "problem")
    task = data_of(make_report(refuted(language), domain, [problem], tasks_shown=2).html)["tasks"][
        0
    ]
    assert task["verified"] is False
    assert task["violation"]["stops"] is not None
    assert (
        data_of(make_report(language, domain, [problem], tasks_shown=2).html)["tasks"][0][
            "violation"
        ]
        is None
    )
