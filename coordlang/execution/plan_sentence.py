# SPDX-License-Identifier: GPL-3.0-or-later
"""Plan -> sentence, and what is wrong with a plan that has none; sentence -> graph of its plans."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from itertools import count
from typing import Any

import msgspec
import numpy as np

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.demands import words_passed
from coordlang.language.sentences import sentence
from planners.joint.model import FullState, Goal, JointModel, spelled
from planners.joint.tables import Rows
from planners.pddl.formula_tree import conjuncts, formula_text
from planners.search.plan_file import NotAPlan, WholeStep, json_count, require_one_each
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans, Texts, counts
from planners.system.errors import Refuted
from planners.system.messages import counted


class NotOptimal(Refuted):
    """A plan of the task, but not an optimal one: only optimal plans have a sentence.

    ``step`` is the first one, from 0, with which the plan is the beginning of no optimal plan any
    more, ``excess`` its cost above the optimal one: (steps, second component).
    """

    def __init__(self, step: int, excess: tuple[int, int], reason: str, slack: int = 0) -> None:
        meant = f"within slack {slack}" if slack else "optimal"
        option = f" --slack {slack}" if slack else ""
        super().__init__(
            f"this plan is not {meant}: {reason}",
            remedy=f"`coordlang plans DOMAIN PROBLEM{option}` writes the plans that are.",
        )
        self.step = step
        self.excess = excess


def sentence_of_plan(task_language: TaskLanguage, plan: Sequence[Texts]) -> tuple[int, ...]:
    """The sentence of an optimal plan (the paper's TSC), as word numbers.

    ``plan[k][i]`` is the subaction of robot i in step k as text, None if it idles.  O(steps)
    expansions.  Raises `NotAPlan` and `NotOptimal`, with the first step that breaks.
    """
    numbers, rows, second = _executed(task_language, plan)
    space, node = task_language.space, task_language.start
    words = [int(task_language.word[node])]
    for step, labels in enumerate(Plans(space, node, []).of_steps(numbers) or numbers):
        edge = space.edge_with(node, labels)
        if edge is None:
            raise _not_optimal(task_language, numbers, rows, second, step)
        node = space.target_of(edge)
        words.append(int(task_language.word[node]))
    return sentence(words)


def carried_out(
    model: JointModel, row: Rows, plan: Iterable[tuple[int, ...]]
) -> tuple[list[Rows], int, str | None]:
    """Carry out joint steps (labels) from a state, as long as they can be taken.

    Returns the states passed (one more than steps taken), the second component of the cost, and why
    the next step cannot be taken, None if all are.
    """
    rows, second = [row], 0
    for labels in plan:
        steps = model.successors(rows[-1][None, :])
        found = (steps.labels == labels).all(axis=1).nonzero()[0]
        if not len(found):
            facts = model.codec.facts_part(rows[-1])
            return rows, second, model.stepper.why_not(facts, labels)
        rows.append(steps.result[found[0]])
        second += int(steps.cost[found[0]])
    return rows, second, None


def _executed(task_language: TaskLanguage, plan: Sequence[Texts]) -> tuple[Plan, list[Rows], int]:
    """Carry out a plan of the task, optimal or not.

    Returns its label numbers, the states that it passes through, and the second component of its
    cost.  Raises `NotAPlan` for a step that cannot be taken, or if the goal does not hold at the
    end.
    """
    model, space = task_language.model.in_step, task_language.space
    init = model.forgetting_slack(space.rows[space.state[task_language.start]])
    labels = partial(_label_numbers, model)
    rows, second, why = carried_out(model, init, map(labels, plan, count()))
    for number, (step, row) in enumerate(zip(plan, rows, strict=False)):
        # Another joint action of the same parts may be possible there.
        if isinstance(step, WholeStep) and not model.holds(step.action.precondition, row[None])[0]:
            rows = rows[: number + 1]
            why = f"the joint action {step.action.label} is not applicable here"
            break
    if why is not None:
        raise NotAPlan(
            len(rows) - 1,
            f"step {len(rows)} cannot be taken: {why}",
            remedy=f"The state before it is {model.state_text(rows[-1])}.",
        )
    goal = space.goals[space.goal[task_language.start]]
    if not model.holds(goal, rows[-1][None, :])[0]:
        raise NotAPlan(
            len(plan),
            f"after {counted(len(plan), 'step')} {_unmet(model, goal, rows[-1])}",
            remedy="Give the whole plan: it ends where the goal holds.",
        )
    return tuple(map(labels, plan, count())), rows, second


def _label_numbers(model: JointModel, step: Texts, number: int) -> tuple[int, ...]:
    require_one_each(model, step, number)
    found = []
    for robot, (name, text) in enumerate(zip(model.robots, step, strict=True)):
        label = model.label_number(robot, text)
        if label is None:
            raise NotAPlan(
                number,
                f"in step {number + 1}, {name} has no subaction {spelled(text)}",
                remedy="It is misspelt, belongs to another robot, can never be applied in this "
                "problem, or is idling, which is left out (`coordlang inspect DOMAIN PROBLEM`).",
            )
        found.append(label)
    return tuple(found)


def _unmet(model: JointModel, goal: Goal, row: Rows) -> str:
    """The first part of the goal that does not hold."""
    if isinstance(goal, FullState):
        return "the state is not the goal state"
    part = next(part for part in conjuncts(goal) if not model.holds(part, row[None, :])[0])
    return f"the goal is not reached: {formula_text(part)} does not hold"


def _not_optimal(
    task_language: TaskLanguage, plan: Plan, rows: Sequence[Rows], cost: int, step: int
) -> NotOptimal:
    """The error that says how much too expensive a plan is, and where it leaves optimal ones."""
    model, space = task_language.model.in_step, task_language.space
    makespan, second = space.cost_of(task_language.task)
    excess = max(0, len(plan) - makespan), cost - second
    if excess[0]:
        enough = f"{makespan} {'is' if makespan == 1 else 'are'} enough"
        if model.slack:
            least = space.least_makespan(task_language.task)
            enough = f"with slack {model.slack} {makespan} are allowed, as {least} are enough"
        wrong = f"it takes {counted(len(plan), 'step')}, and {enough}"
    else:
        what = "subactions" if model.cost == "makespan+actions" else "action costs of"
        few = "are as few as can be" if not model.slack else "are within the slack"
        steps = counted(len(plan), "step")
        wrong = f"its {steps} {few}, but with {cost} {what} where {second} are enough"
    if model.is_asynchronous:
        reason = wrong
    elif step == makespan:
        reason = f"{wrong}: the goal holds before step {step + 1} already"
    else:
        state = model.state_text(rows[step])
        doing = ", ".join(
            f"{robot} {text or 'idles'}"
            for robot, text in zip(model.robots, model.texts(plan[step]), strict=True)
        )
        kept = "plans within it" if model.slack else "optimal plans"
        reason = f"{wrong}; with step {step + 1} ({doing}) it leaves all {kept}, at {state}"
    return NotOptimal(step, excess, reason, model.slack)


# ---- sentence -> its plans


class DagNode(msgspec.Struct, frozen=True, rename={"key": "state", "words": "said"}):
    """A joint state on a plan, by its ``key``.

    ``step`` joint steps are done, ``words`` of the sentence passed, its own ``word`` included, and
    ``plans`` pass through it.
    """

    key: str
    word: str
    words: int
    step: int
    plans: int


class DagEdge(msgspec.Struct, frozen=True, rename={"source": "from", "target": "to"}):
    """Joint actions, each robot's text or None, between two nodes (numbers in `PlanDag.nodes`)."""

    source: int
    target: int
    actions: tuple[tuple[str | None, ...], ...]


class PlanDag:
    """The plans that a sentence leaves open as the paths of a layered graph.

    ``space`` is `TaskLanguage.plans_with` of the sentence.  ``nodes`` are sorted by step, those on
    most plans first; ``edges`` by source and target.
    """

    def __init__(self, task_language: TaskLanguage, words: Sequence[int], space: PlanSpace) -> None:
        names, model = task_language.partition.words, task_language.model
        self.sentence = tuple(names[w] for w in words)
        word = task_language.partition.word_of(space.rows)[space.state]
        passed, through = words_passed(space, word), _plans_through(space)
        self.nodes: list[DagNode] = []
        number: dict[int, int] = {}
        for step, span in enumerate(reversed(space.layers)):
            for node in sorted(range(span.start, span.stop), key=lambda n: (-through[n], n)):
                number[node] = len(self.nodes)
                key, said = model.codec.key(space.rows[space.state[node]]), int(passed[node])
                self.nodes.append(DagNode(key, names[word[node]], said, step, through[node]))
        found: dict[tuple[int, int], list[tuple[str | None, ...]]] = {}
        for edge, node in enumerate(space.sources.tolist()):
            ends = number[node], number[space.target_of(edge)]
            found.setdefault(ends, []).append(model.texts(space.labels_of(edge)))
        self.edges = [DagEdge(*ends, tuple(actions)) for ends, actions in sorted(found.items())]

    def data(self) -> dict[str, Any]:
        """Nodes and edges as a JSON plan file has them (docs/formats.md)."""
        nodes = [
            {**msgspec.to_builtins(node), "plans": json_count(node.plans)} for node in self.nodes
        ]
        return {"nodes": nodes, "edges": msgspec.to_builtins(self.edges)}


def _plans_through(space: PlanSpace) -> list[int]:
    below, above = np.array(counts(space), object), np.zeros(len(space), object)
    above[space.starts[0]] = 1
    for edges in reversed([*space.edges_by_layer()]):
        np.add.at(above, edges.target, above[edges.source])
    return list(above * below)
