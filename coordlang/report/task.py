"""What a report page needs of one task: its plans, its sentences, what goes wrong without them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from coordlang.language.partition import Partition
from coordlang.report.graph import Graph, ShownSentences, plan_graph, shown_sentences
from coordlang.report.played import Played, play
from coordlang.report.shown import ShownTask
from coordlang.report.world import World
from coordlang.required.miscoordination import Miscoordination
from coordlang.tasks.listed import goal_text
from coordlang.use.sentence.task_language import TaskLanguage
from coordlang.verification.by_definition import verify
from planners.errors import OutOfMemory
from planners.joint.model import JointModel
from planners.joint.states import split_atoms
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts

#: Plan-space edges beyond which a task is not verified once more for the page.
_VERIFIED = 20_000


@dataclass(frozen=True, slots=True)
class TaskPart:
    """Everything about one shown task.

    ``violation`` shows plans of one sentence that miscoordinate: the language is none.
    ``verified`` is None where that was not checked.
    """

    shown: ShownTask
    graph: Graph
    sentences: ShownSentences
    played: Played | None
    verified: bool | None
    violation: Miscoordination | None
    violation_played: Played | None


def task_part(shown: ShownTask, seed: int) -> TaskPart:
    """Compute what is shown of a task."""
    spoken = shown.spoken
    graph = plan_graph(spoken, seed)
    verified, violation = _verified(spoken)
    return TaskPart(
        shown,
        graph,
        shown_sentences(spoken, graph, seed),
        play(spoken, shown.witness) if shown.witness else None,
        verified,
        violation,
        play(spoken, violation) if violation else None,
    )


def _verified(spoken: TaskLanguage) -> tuple[bool | None, Miscoordination | None]:
    if len(spoken.space.target) > _VERIFIED:
        return None, None
    try:
        verdict = verify(spoken.partition, [spoken.space])
    except OutOfMemory:
        return None, None
    return verdict.holds, verdict.witness


class Tables:
    """States and labels that the page mentions, numbered.

    In the order in which they are first mentioned.
    """

    def __init__(self, model: JointModel, partition: Partition) -> None:
        self.model = model
        self.partition = partition
        self.states: dict[str, int] = {}
        self.words: list[int] = []
        self.labels: list[dict[str | None, int]] = [{None: 0} for _ in model.robots]

    def state(self, key: str) -> int:
        if key not in self.states:
            self.states[key] = len(self.states)
            row = self.model.codec.parse_key(key)
            self.words.append(int(self.partition.word_of(row[None, :])[0]))
        return self.states[key]

    def label(self, robot: int, text: str | None) -> int:
        own = self.labels[robot]
        return own.setdefault(text, len(own))


def task_data(part: TaskPart, tables: Tables) -> dict[str, Any]:
    spoken, graph = part.shown.spoken, part.graph
    space, model = spoken.space, spoken.model
    makespan, second = space.cost_of(spoken.task)
    keys = [model.codec.key(space.rows[state]) for state in space.state[graph.nodes].tolist()]
    step = (makespan - space.layer[graph.nodes]).tolist()
    place = np.full(len(space), -1)
    place[graph.nodes] = np.arange(len(graph.nodes))
    source = place[space.sources[graph.edges]]
    first = np.searchsorted(source, np.arange(len(graph.nodes) + 1))
    labels = space.labels[graph.edges]
    return {
        "name": part.shown.name,
        "covered": spoken.covered,
        "requires": part.shown.witness is not None if part.shown.decided else None,
        "verified": part.verified,
        "steps": makespan,
        "second": second if model.cost != "makespan" else None,
        "plans": str(counts(space)[spoken.start]),
        "complete": graph.complete,
        "all_nodes": len(space),
        "all_edges": len(space.target),
        "nodes": {
            "state": [tables.state(key) for key in keys],
            "step": step,
            "order": list(graph.order),
        },
        "first": first.tolist(),
        "target": place[space.target[graph.edges]].tolist(),
        "labels": [
            [
                tables.label(robot, model.labels[robot][number] if number else None)
                for number in labels[:, robot].tolist()
            ]
            for robot in range(len(model.robots))
        ],
        "sentences": [
            {
                "words": list(s.words),
                "plans": str(s.plans),
                "own": [str(number) if number is not None else None for number in s.own],
            }
            for s in part.sentences.listed
        ],
        "all_sentences": part.sentences.total,
        "witness": _witness_data(part.shown.witness, part.played, tables),
        "violation": _witness_data(part.violation, part.violation_played, tables),
    }


def _witness_data(
    witness: Miscoordination | None, played: Played | None, tables: Tables
) -> dict[str, Any] | None:
    if witness is None or played is None:
        return None
    return {
        "plans": [
            [[tables.label(robot, text) for robot, text in enumerate(step)] for step in plan]
            for plan in witness.plans
        ],
        "states": [[tables.state(key) for key in states] for states in witness.states],
        "breaks": witness.step,
        "reason": witness.reason,
        "together": [tables.state(key) for key in played.states],
        "stops": played.stops,
        "why": played.why,
        "reaches": played.reaches,
    }


def told(part: TaskPart, world: World) -> dict[str, Any]:
    """The start and goal of a task in words and on the map."""
    space: PlanSpace = part.shown.spoken.space
    model = space.model
    init = model.codec.decode(space.rows[space.state[part.shown.spoken.start]])
    text = goal_text(model, space.goals[space.goal[part.shown.spoken.start]])
    goal = split_atoms(text)
    start_of = {
        role[1]: role[2] for role in (world.roles.get(a, ("",)) for a in init) if role[0] == "at"
    }
    goals = {
        role[1]: role[2] for role in (world.roles.get(a, ("",)) for a in goal) if role[0] == "at"
    }
    moves = [
        f"{t} {start_of[t]} → {p}"
        for t, p in _in_order(goals.items(), world)
        if t in start_of and start_of[t] != p
    ]
    arrives = [f"{t} at {p}" for t, p in _in_order(goals.items(), world) if t not in start_of]
    others = [
        a.strip("()") if a.count("(") == 1 else a
        for a in goal
        if world.roles.get(a, ("",))[0] != "at" and a not in init
    ]
    stays = [f"{t} back at {p}" for t, p in _in_order(goals.items(), world) if start_of.get(t) == p]
    said = moves + arrives + others
    return {
        "title": ", ".join(said or stays) or "nothing to do",
        "goal_text": text,
        "goals": [
            [world.things.index(t), world.places.index(p)]
            for t, p in _in_order(goals.items(), world)
        ],
    }


def _in_order(pairs: Iterable[tuple[str, str]], world: World) -> list[tuple[str, str]]:
    return sorted(pairs, key=lambda pair: world.things.index(pair[0]))
