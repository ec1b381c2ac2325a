# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report page needs of one task: its plans, its sentences, what goes wrong without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.language.listed import goal_text
from coordlang.language.partition import Partition
from coordlang.report.graph import Graph, ShownSentences, plan_graph, shown_sentences
from coordlang.report.shown import ShownTask
from coordlang.required.failure import TooManyToCount, failure_probability
from coordlang.required.miscoordination import Miscoordination
from coordlang.sites.world import World
from coordlang.verification.by_definition import verify
from planners.joint.model import JointModel
from planners.joint.states import split_atoms
from planners.joint.tables import Ints, Rows
from planners.search.plans import counts
from planners.system.errors import OutOfMemory

#: Additions beyond which it is not counted how often robots fail in a task.
_ADDITIONS = 300_000
#: Plan-space edges beyond which a task is not verified again for the page.
_VERIFIED = 20_000


@dataclass(frozen=True, slots=True)
class Played:
    """The execution of a mixture of plans.

    ``states`` are the keys of those passed, the start first; ``stops`` is the number of the first
    step that is not applicable (None: all are), and ``why``; ``reaches``: the goal holds at last.
    """

    states: tuple[str, ...]
    stops: int | None
    why: str | None
    reaches: bool


@dataclass(frozen=True, slots=True)
class TaskPage:
    """Everything about one shown task: its plans and its sentences, and what goes wrong.

    ``played`` is what happens without a language, if plans of the task miscoordinate; ``verified``:
    the language coordinates the task (None: not checked); ``violation``: plans of one sentence that
    miscoordinate, so that it is none.
    """

    shown: ShownTask
    graph: Graph
    sentences: ShownSentences
    played: Played | None
    verified: bool | None
    violation: Miscoordination | None
    violation_played: Played | None


def task_page(shown: ShownTask, seed: int) -> TaskPage:
    """Compute what is shown of a task."""
    language = shown.language
    graph = plan_graph(language, seed)
    verified, violation = _verified(language)
    return TaskPage(
        shown,
        graph,
        shown_sentences(language, graph, seed),
        play(language, shown.witness) if shown.witness else None,
        verified,
        violation,
        play(language, violation) if violation else None,
    )


def _verified(language: TaskLanguage) -> tuple[bool | None, Miscoordination | None]:
    if len(language.space.target) > _VERIFIED:
        return None, None
    try:
        verdict = language.verdict or verify(language.partition, [language.space])
    except OutOfMemory:
        return None, None
    return verdict.holds, verdict.witness


def play(language: TaskLanguage, witness: Miscoordination) -> Played:
    """Play a mixture from the start: robot i executes its part of ``witness.plans[i]``."""
    space, model = language.space, language.model
    row = space.rows[space.state[language.start]]
    goal = space.goals[space.goal[language.start]]
    states = [model.codec.key(row)]
    for number, step in enumerate(zip(*witness.plans, strict=True)):
        labels = model.numbers([own[robot] for robot, own in enumerate(step)])
        assert labels is not None
        steps = model.successors(row[None, :])
        same = np.flatnonzero((steps.labels == np.array(labels)).all(axis=1))
        if not len(same):
            return Played(tuple(states), number, model.why_not(row, labels), False)
        row = steps.result[same[0]]
        states.append(model.codec.key(row))
    return Played(tuple(states), None, None, bool(model.holds(goal, row[None, :])[0]))


class Tables:
    """States and labels that the page mentions, numbered in the order of their first mention."""

    def __init__(self, model: JointModel, partition: Partition) -> None:
        self.model = model
        self.partition = partition
        self.rows: list[Rows] = []
        self.words: list[int] = []
        self.labels: list[dict[str | None, int]] = [{None: 0} for _ in model.robots]
        self._number: dict[str, int] = {}

    def state(self, key: str) -> int:
        """Return the number of a state, given by its key."""
        number = self._number.setdefault(key, len(self._number))
        if number == len(self.rows):
            row = self.model.codec.parse_key(key)
            self.rows.append(row)
            self.words.append(int(self.partition.word_of(row[None, :])[0]))
        return number

    def label(self, robot: int, text: str | None) -> int:
        """Return the number of a robot's label; None is idling."""
        own = self.labels[robot]
        return own.setdefault(text, len(own))


def task_data(part: TaskPage, tables: Tables) -> dict[str, Any]:
    """Return a task as JSON data, with states and labels as numbers into ``tables``."""
    language = part.shown.language
    space, model = language.space, language.model
    makespan, second = space.cost_of(language.task)
    requires = None if not part.shown.decided else part.shown.witness is not None
    return {
        "name": part.shown.name,
        "covered": language.covered,
        "requires": requires,
        "silence": _failure(language, None) if requires else None,
        "failure": _failure(language, language.word) if part.violation else None,
        "verified": part.verified,
        "steps": makespan,
        "second": second if model.cost != "makespan" else None,
        "plans": str(counts(space)[language.start]),
        "complete": part.graph.complete,
        "all_nodes": len(space),
        "all_edges": len(space.target),
        **_graph_data(language, part.graph, tables),
        "sentences": [
            {
                "words": list(one.words),
                "plans": str(one.plans),
                "own": [None if number is None else str(number) for number in one.own],
            }
            for one in part.sentences.listed
        ],
        "all_sentences": part.sentences.total,
        "witness": _witness_data(part.shown.witness, part.played, tables),
        "violation": _witness_data(part.violation, part.violation_played, tables),
    }


def _failure(language: TaskLanguage, word: Ints | None) -> float | None:
    """How often robots that choose by themselves fail in the task, None if that is too much work.

    ``word`` has the word number of each node; None: without a word.
    """
    space = language.space
    alone = space.with_tasks(space.starts[[language.task]], space.second[[language.task]])
    kept = space.descendants(space.starts[[language.task]])
    words = None if word is None else word[kept]
    try:
        found = failure_probability([alone], [words], _ADDITIONS)
    except TooManyToCount:
        return None
    return float(found.mean)


def _graph_data(language: TaskLanguage, graph: Graph, tables: Tables) -> dict[str, Any]:
    """The nodes of a graph, and its edges as a CSR table: ``first``, ``target``, ``labels``."""
    space, model = language.space, language.model
    makespan, _ = space.cost_of(language.task)
    number = np.full(len(space), -1)
    number[graph.nodes] = np.arange(len(graph.nodes))
    source = number[space.sources[graph.edges]]
    keys = [model.codec.key(space.rows[state]) for state in space.state[graph.nodes].tolist()]
    return {
        "nodes": {
            "state": [tables.state(key) for key in keys],
            "step": (makespan - space.layer[graph.nodes]).tolist(),
            "order": list(graph.order),
        },
        "first": np.searchsorted(source, np.arange(len(graph.nodes) + 1)).tolist(),
        "target": number[space.targets(graph.edges)].tolist(),
        "labels": [
            [
                tables.label(robot, model.label_text(robot, label))
                for label in space.robot_labels(robot, graph.edges).tolist()
            ]
            for robot in range(len(model.robots))
        ],
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


def task_summary(part: TaskPage, world: World) -> dict[str, Any]:
    """Return the start and goal of a task in words and, as ``goals``, on the map."""
    language = part.shown.language
    space, model = language.space, language.model
    init = model.codec.decode(space.rows[space.state[language.start]])
    text = goal_text(model, space.goals[space.goal[language.start]])
    literals = split_atoms(text)
    goals = world.located(literals)
    others = [a for a in literals if world.role(a)[0] != "at" and a not in init]
    return {
        "title": _title(world.located(init), goals, others),
        "goal_text": text,
        "goals": [
            [world.things.index(thing), world.places.index(place)] for thing, place in goals.items()
        ],
    }


def _title(starts: Mapping[str, str], goals: Mapping[str, str], others: list[str]) -> str:
    """What is to be done: what moves where, what else becomes true; else what comes back."""
    moves, arrivals, stays = [], [], []
    for thing, place in goals.items():
        if thing not in starts:
            arrivals.append(f"{thing} at {place}")
        elif starts[thing] != place:
            moves.append(f"{thing} {starts[thing]} → {place}")
        else:
            stays.append(f"{thing} back at {place}")
    plain = [text.strip("()") if text.count("(") == 1 else text for text in others]
    return ", ".join([*moves, *arrivals, *plain] or stays) or "nothing to do"
