# SPDX-License-Identifier: GPL-3.0-or-later
"""What a report page needs of one task: its plans, its sentences, what goes wrong without them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from operator import itemgetter
from typing import Any

import numpy as np

from coordlang.execution.automaton import determinise
from coordlang.execution.best_sentence import leading_sentences
from coordlang.execution.plan_sentence import carried_out
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.listed import goal_text
from coordlang.language.sentences import Sentence, number_of_sentences
from coordlang.report.layout import layer_orders
from coordlang.report.shown import ShownTask
from coordlang.required.failure import TooManyToCount, failure_probability
from coordlang.required.miscoordination import Miscoordination
from coordlang.sites.world import World
from coordlang.verification.by_definition import Verdict, verify
from planners.joint.states import split_atoms
from planners.joint.tables import Ints
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, counts
from planners.system.errors import OutOfMemory

#: Plan-space edges of one task beyond which plans are drawn.
EDGES = 4_000
#: Sentences listed for one task.
SENTENCES = 60
#: Members of the subsets with which one robot's own subplans are counted; beyond, they are not.
_SUBSETS = 1_000_000
#: Additions beyond which it is not counted how often robots fail in a task.
_ADDITIONS = 300_000
#: Plan-space edges beyond which a task is not verified again for the page.
_VERIFIED = 20_000


class Tables:
    """States and labels that the page mentions, in the order of their first mention.

    ``states`` are mentioned already, by their keys.
    """

    def __init__(self, robots: int, states: Sequence[str]) -> None:
        self.states = {key: number for number, key in enumerate(states)}
        self.labels: list[dict[str | None, int]] = [{None: 0} for _ in range(robots)]

    def state(self, key: str) -> int:
        """Return the number of a state, given by its key."""
        return self.states.setdefault(key, len(self.states))

    def label(self, robot: int, text: str | None) -> int:
        """Return the number of a robot's label; None is idling."""
        own = self.labels[robot]
        return own.setdefault(text, len(own))


def task_data(shown: ShownTask, tables: Tables, seed: int) -> dict[str, Any]:
    """Return a task as JSON data, with states and labels as numbers into ``tables``."""
    language, space = shown.language, shown.language.space
    part = drawn_part(language, seed)
    leading = leading_sentences(language, SENTENCES)
    verdict = _verdict(language)
    violation = verdict.witness if verdict else None  # plans of one sentence that miscoordinate
    makespan, second = space.cost_of(language.task)
    requires = None if not shown.decided else shown.witness is not None
    return {
        "name": shown.name,
        "covered": language.covered and (violation is None or language.language.may_fail),
        "requires": requires,
        "silence": _failure(language, None) if requires else None,
        "failure": _failure(language, language.word) if violation else None,
        "verified": verdict.holds if verdict else None,
        "steps": makespan,
        "second": second if language.model.cost != "makespan" else None,
        "plans": str(counts(space)[language.start]),
        "complete": part is space,
        "all_nodes": len(space),
        "all_edges": len(space.target),
        **_graph_data(part, tables),
        "sentences": [
            {"words": list(words), "plans": str(plans), "own": _own_counts(language, words)}
            for words, plans in leading
        ],
        "all_sentences": number_of_sentences(space, language.word, language.start),
        "witness": _witness_data(language, shown.witness, tables),
        "violation": _witness_data(language, violation, tables),
    }


def _verdict(language: TaskLanguage) -> Verdict | None:
    """Whether the language coordinates the task; None if it is too large to find out."""
    if len(language.space.target) > _VERIFIED:
        return None
    with suppress(OutOfMemory):
        return language.verdict or verify(language.partition, [language.space])
    return None


def _failure(language: TaskLanguage, word: Ints | None) -> float | None:
    """How often robots that choose by themselves fail in the task, None if that is too much work.

    ``word`` has the word number of each node; None: without a word.
    """
    with suppress(TooManyToCount):
        return float(failure_probability([language.space], [word], _ADDITIONS)[0])
    return None


def _graph_data(part: PlanSpace, tables: Tables) -> dict[str, Any]:
    """Nodes by step, then by their place in its column; edges as a CSR table.

    The table is ``first``, ``target`` and ``labels``, the edges of a node in the order of labels.
    """
    model, steps = part.model, int(part.layer[-1])
    by_step = part.reordered(np.argsort(steps - part.layer, kind="stable"))
    sizes = np.bincount(steps - part.layer).tolist()
    ends = zip(by_step.sources.tolist(), by_step.target.tolist(), strict=True)
    order = np.array(layer_orders(sizes, list(ends)))
    drawn = by_step.reordered(np.lexsort((order, steps - by_step.layer)))
    keys = map(model.codec.key, drawn.rows[drawn.state])
    return {
        "nodes": {
            "state": [*map(tables.state, keys)],
            "step": (steps - drawn.layer).tolist(),
            "order": [place for size in sizes for place in range(size)],
        },
        "first": drawn.first.tolist(),
        "target": drawn.target.tolist(),
        "labels": [
            [
                tables.label(robot, model.label_text(robot, label))
                for label in drawn.robot_labels(robot).tolist()
            ]
            for robot in range(len(model.robots))
        ],
    }


def _witness_data(
    language: TaskLanguage, witness: Miscoordination | None, tables: Tables
) -> dict[str, Any] | None:
    """Plans that miscoordinate, and what happens: robot i executes its part of plan i.

    ``together`` are the states passed, the start first; ``stops`` is the number of the first step
    that is not applicable (None: all are), and ``why``; ``reaches``: the goal holds at last.
    """
    if witness is None:
        return None
    space, model = language.space, language.model
    why: str | None = witness.reason
    together, reaches = list(witness.mixed_states), False
    if not model.is_asynchronous:  # else nobody does them step by step
        parts = [map(itemgetter(robot), plan) for robot, plan in enumerate(witness.plans)]
        steps = filter(None, map(model.numbers, zip(*parts, strict=True)))
        rows, _, why = carried_out(model, space.rows[space.state[language.start]], steps)
        together = [*map(model.codec.key, rows)]
        goal = space.goals[space.goal[language.start]]
        reaches = why is None and bool(model.holds(goal, rows[-1][None, :])[0])
    return {
        "plans": [
            [[tables.label(robot, text) for robot, text in enumerate(step)] for step in plan]
            for plan in witness.plans
        ],
        "states": [[*map(tables.state, keys)] for keys in witness.states],
        "breaks": witness.step,
        "reason": witness.reason,
        "together": [*map(tables.state, together)],
        "stops": None if why is None else len(together) - 1,
        "why": why,
        "reaches": reaches,
    }


def task_summary(language: TaskLanguage, world: World) -> dict[str, Any]:
    """Return the start and goal of a task in words and, as ``goals``, on the map."""
    space, model = language.space, language.model
    init = model.codec.decode(space.rows[space.state[language.start]])
    literals = split_atoms(goal_text(model, space.goals[space.goal[language.start]]))
    goals = world.located(literals)
    false = {a for a in literals if a.startswith("(not ") and a.count("(") == 2}
    done = {*init, *(a for a in false if a[5:-1] not in init)}
    others = [a for a in literals if world.role(a)[0] != "at" and a not in done]
    return {
        "title": _title(world.located(init), goals, others),
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


# ---- plans and sentences


def drawn_part(language: TaskLanguage, seed: int, most: int = EDGES) -> PlanSpace:
    """Return the plan space of a task; of one of more than ``most`` edges plans drawn of it."""
    space = language.space
    if len(space.target) <= most:
        return space
    plans, kept = Plans.of(space, language.task), set[int]()
    for plan in plans.sample(most, seed):
        path = space.path_with(plans.start, plan)
        assert path is not None, "a plan is a path of its plan space"
        if len(kept.union(path)) > most // 4:
            break
        kept.update(path)
    drawn = np.zeros(len(space.target), np.bool_)
    drawn[sorted(kept)] = True
    return space.along(drawn)


def _own_counts(language: TaskLanguage, words: Sentence) -> list[str | None]:
    """The numbers of the robots' own subplans under a sentence; None for too many to count."""
    found: list[str | None] = []
    open_plans = language.plans_with(words)
    for robot in range(len(language.model.robots)):
        found.append(None)
        with suppress(OutOfMemory):
            found[robot] = str(determinise(open_plans, robot, most=_SUBSETS).count)
    return found
