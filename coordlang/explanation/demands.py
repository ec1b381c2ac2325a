# SPDX-License-Identifier: GPL-3.0-or-later
"""What one sentence demands of each robot, and which robots decide its changes of word."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations, pairwise
from typing import Any, Literal

import msgspec
import numpy as np

from coordlang.explanation.words import Cover
from coordlang.language.words import Partition
from coordlang.required.choices import Choices
from planners.joint.conditions import Labels
from planners.joint.model import JointModel, own_text
from planners.joint.tables import Bools, Ints, find_rows
from planners.pddl.robots import natural
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts

#: Subplans of a robot that are listed one by one.
FEW = 12

#: States at once at which it is computed which robots decide the next word.
_STATES = 500

#: A robot's subplan: the text of its subaction in each step, None for idling; or of its events.
Subplan = list[str | None]


class RobotPart(msgspec.Struct, frozen=True):
    """What a sentence leaves to one robot.

    ``subplans`` is the number of its different subplans in the plans with the sentence; ``listed``
    are all of them if they are few, else empty.  ``by_step`` are for each step, or number of an
    event, the subactions that it does then in some of the plans.
    """

    robot: str
    subplans: int
    listed: list[Subplan]
    by_step: list[Subplan]


class Way(msgspec.Struct, frozen=True):
    """What robots do to change the word, one entry each; the steps in which plans do it so."""

    subactions: Subplan
    steps: list[int]


class WordChange(
    msgspec.Struct, frozen=True, rename={"before": "from", "after": "to", "robots": "decided_by"}
):
    """A change from one word of the sentence to the next one.

    ``earliest`` and ``latest`` are the first and the last step (from 1) at whose end plans make it.
    ``robots`` are the fewest robots whose subactions decide it: wherever plans make the change,
    these robots' subactions settle whether a joint step to a mapped state, or one on plans, makes
    it, whatever the others do; no robots: every such step makes it.  ``ways`` are how they do it.
    """

    before: str
    after: str
    earliest: int
    latest: int
    robots: list[str]
    ways: list[Way]


@dataclass(frozen=True, slots=True)
class SentenceDemands:
    """What one sentence of one task demands: ``steps`` is the makespan of its ``plans``.

    ``unit``: what subplans are sequences of, steps, or events where there is no common step: then
    None stands for no more of them, and no changes of words are told.
    """

    sentence: tuple[str, ...]
    plans: int
    steps: int
    parts: list[RobotPart]
    changes: list[WordChange]
    unit: Literal["step", "event"] = "step"

    def data(self) -> dict[str, Any]:
        """What it demands, for JSON; steps count from 1, null is idling."""
        own = [{"robot": p.robot, "subplans": p.subplans, "listed": p.listed} for p in self.parts]
        changes = msgspec.to_builtins(self.changes)
        return {"steps": self.steps, "robots": own, "changes": changes}


def sentence_demands(
    space: PlanSpace, partition: Partition, formulas: Mapping[str, Cover]
) -> SentenceDemands:
    """What a sentence demands of the robots.

    ``space`` holds the plans with the sentence, of one task.  Where several groups of robots of
    one size decide a change of word, robots that the formula of the next word names come first.
    """
    word = partition.word_of(space.rows)[space.state]
    passed = words_passed(space, word)
    start = int(space.starts[0])
    _, first = np.unique(passed, return_index=True)
    sentence = word[first].tolist()
    choices = Choices(space)
    changes = []
    for number, pair in enumerate(() if space.model.is_asynchronous else pairwise(sentence), 1):
        order = _named_first(space.model.robots, formulas[partition.words[pair[1]]])
        changes.append(_change(space, partition, passed == number, pair, order))
    return SentenceDemands(
        sentence=tuple(partition.words[w] for w in sentence),
        plans=counts(space)[start],
        steps=space.cost_of(0)[0],
        parts=[_part(choices, robot) for robot in range(space.robots)],
        changes=changes,
        unit=space.model.unit,
    )


def words_passed(space: PlanSpace, word: Ints) -> Ints:
    """For each node how many words of the sentence plans have passed there, its own included.

    ``space`` holds one task's plans with one sentence, and each node is on one of them; so it is
    one number for each node.
    """
    to_come = np.zeros(len(space), np.int64)
    for edges in space.edges_by_layer():
        changes = word[edges.target] != word[edges.source]
        to_come[edges.source] = to_come[edges.target] + changes
    return 1 + int(to_come[space.starts[0]]) - to_come


#: Edges of a sentence's plans up to which it is looked for what the sentences mean.
_MEANT = 100_000


def meaning(spaces: Sequence[PlanSpace]) -> tuple[str, list[tuple[str, ...]]] | None:
    """What the sentences of a task mean: an object, and for each sentence who first uses it.

    ``spaces``: the plans with each sentence.  A robot *uses* the objects that its subactions name;
    of several in one step all are first, and nobody where no subaction names it.  Sentences mean
    who uses an object first if all mixtures of each one's plans agree about it, and no two
    sentences do.  None if there is no such object (and where there is no common step, or more plans
    than are looked at); of several the first by name, if possible of those where it always is one
    robot.
    """
    if spaces[0].model.is_asynchronous or any(len(s.target) > _MEANT for s in spaces):
        return None
    first = [*map(_first_users, spaces)]
    meant = []
    for name in sorted({*chain(*first)} - {*spaces[0].model.robots}, key=natural):
        answers = [users.get(name, ()) for users in first]
        sure = [answer for answer in answers if answer is not None]
        if len({*sure}) == len(spaces):
            meant.append((name, sure))
    return min(meant, key=lambda one: sum(len(who) != 1 for who in one[1]), default=None)


def _first_users(space: PlanSpace) -> dict[str, tuple[str, ...] | None]:
    """For each object that one task's plans use, who is first, None where mixtures do not agree."""
    robots, steps = space.model.robots, space.cost_of(0)[0]
    users: dict[str, tuple[str, ...] | None] = {}
    for name, first_uses in _first_uses(space).items():
        until = min(map(max, first_uses.values()))
        first = sorted(robot for robot, when in first_uses.items() if min(when) <= until)
        agreed = len(first) == 1 or all(first_uses[robot] == {until} for robot in first)
        users[name] = tuple(robots[r] for r in first) if agreed and until <= steps else None
    return users


def _first_uses(space: PlanSpace) -> dict[str, dict[int, set[int]]]:
    """For each object the robots (numbers) that use it, and in which steps plans use it first.

    The step after the last one stands for never.  One pass from the start, with what robots have
    not used on some way to each node.
    """
    model, steps = space.model, space.cost_of(0)[0]
    named = [
        [{(robot, name) for name in text.strip("()").split()[1:]} for text in labels]
        for robot, labels in enumerate(model.labels)
    ]
    uses: dict[str, dict[int, set[int]]] = defaultdict(lambda: defaultdict(set))
    unused = {int(space.starts[0]): set[tuple[int, str]]().union(*chain(*named))}
    for step in range(1, steps + 1):
        before, unused = unused, defaultdict(set)
        for edge, source, target in np.column_stack(space.layer_edges(steps + 1 - step)).tolist():
            labels = enumerate(space.labels_of(edge))
            used = set().union(*(named[robot][label] for robot, label in labels))
            for robot, name in used & before[source]:
                uses[name][robot].add(step)
            unused[target] |= before[source] - used
    for robot, name in set().union(*unused.values()):
        if name in uses:  # else nobody ever uses it
            uses[name][robot].add(steps + 1)
    return uses


def _part(choices: Choices, robot: int) -> RobotPart:
    space = choices.space
    own = int(choices.of_node[robot, space.starts[0]])
    subplans = choices.sets.size(own)
    listed = choices.sets.sequences(own) if subplans <= FEW else ()

    def texts(used: Sequence[int]) -> Subplan:
        return [_own_text(space.model, robot, label) for label in used]

    name, by_step = space.model.robots[robot], list(map(texts, space.labels_by_step(robot)))
    return RobotPart(name, subplans, list(map(texts, listed)), by_step)


def _own_text(model: JointModel, robot: int, label: int) -> str | None:
    text = model.label_text(robot, label)
    return None if text is None else own_text(text, model.robots[robot])


def _named_first(robots: Sequence[str], formula: Cover) -> list[int]:
    """All robots, those that a formula names first."""
    atoms = [atom for term in formula.terms for literal in term for atom in literal.variable.atoms]
    named = {name for atom in atoms for arg in atom.args for name in arg.strip("()").split()}
    return sorted(range(len(robots)), key=lambda robot: robots[robot] not in named)


def _change(
    space: PlanSpace,
    partition: Partition,
    before: Bools,
    pair: tuple[int, int],
    order: Sequence[int],
) -> WordChange:
    """The change out of the nodes ``before`` (a mask) into the next word."""
    edges = np.flatnonzero(before[space.sources] & ~before[space.targets()])
    node = space.sources_of(edges)
    step = space.cost_of(0)[0] - space.layer[node] + 1
    robots = _deciding(space, partition, np.unique(space.state[node]), pair[1], order)
    ways: dict[tuple[str | None, ...], set[int]] = defaultdict(set)
    for when, edge in zip(step.tolist(), edges.tolist(), strict=True):
        labels = space.labels_of(edge)
        ways[tuple(_own_text(space.model, robot, labels[robot]) for robot in robots)].add(when)
    return WordChange(
        before=partition.words[pair[0]],
        after=partition.words[pair[1]],
        earliest=int(step.min()),
        latest=int(step.max()),
        robots=[space.model.robots[r] for r in robots],
        ways=[
            Way(list(does), sorted(when))
            for does, when in sorted(ways.items(), key=lambda w: (min(w[1]), str(w)))
        ],
    )


def _deciding(
    space: PlanSpace, partition: Partition, states: Ints, after: int, order: Sequence[int]
) -> tuple[int, ...]:
    """The fewest robots whose subactions decide whether the next word is ``after``.

    At each of some states; early ones in ``order`` first.  All of them, where states say what is
    left of the slack: that is no effect of a joint step.
    """
    if space.model.slack_facts:
        return tuple(sorted(order))
    parts = []
    for start in range(0, len(states), _STATES):
        steps = space.model.successors(space.rows[states[start : start + _STATES]])
        kept = find_rows(partition.rows, steps.result) >= 0
        kept |= find_rows(space.rows, steps.result) >= 0
        changes = partition.word_of(steps.result[kept]) == after
        parts.append((changes, steps.source[kept], steps.labels[kept]))
    for robots in chain(*(combinations(order, size) for size in range(len(order)))):
        if all(_settle(changes, source, labels[:, robots]) for changes, source, labels in parts):
            return tuple(sorted(robots))
    return tuple(sorted(order))


def _settle(changes: Bools, source: Ints, labels: Labels) -> bool:
    """Whether of all joint steps from one state in which robots do the same each one changes."""
    seen = np.column_stack((source, labels))
    _, first, inverse = np.unique(seen, axis=0, return_index=True, return_inverse=True)
    return bool((changes == changes[first][inverse.reshape(-1)]).all())
