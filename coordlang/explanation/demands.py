"""What one sentence asks of each robot, and who brings its words about."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from coordlang.explanation.cover import Cover
from coordlang.language.partition import Partition
from planners.joint.model import own_text
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.tables import Ints, find_rows, ranges

#: More sets of plan-space nodes than this in one step, and a robot's subplans are not counted.
_SETS = 5_000
#: States at which it is worked out which robots decide the next word.
_STATES = 500

#: A robot's subplan: the text of its subaction in each step, None for idling.
Subplan = tuple[str | None, ...]


@dataclass(frozen=True, slots=True)
class RobotPart:
    """What a sentence leaves to one robot.

    ``subplans`` is the number of its different subplans in the plans that fit (None: too many to
    count); ``listed`` has all of them if they are few, else it is empty.  ``choices[step]`` is what
    it does in that step in some of them.
    """

    robot: str
    subplans: int | None
    listed: tuple[Subplan, ...]
    choices: tuple[Subplan, ...]


@dataclass(frozen=True, slots=True)
class WordChange:
    """The change from the sentence's word ``before`` to the next one, ``after``.

    It happens at the end of step ``earliest`` at the soonest and ``latest`` at the latest (from 1).
    ``robots`` are the fewest robots whose subactions decide it: wherever plans make the change,
    these robots' subactions settle whether a joint step to a mapped state makes it, whatever the
    others do.  No robots: every such step makes it.  ``ways`` is what they do, one entry each, and
    the steps in which plans make the change in this way.
    """

    before: str
    after: str
    earliest: int
    latest: int
    robots: tuple[str, ...]
    ways: tuple[tuple[Subplan, tuple[int, ...]], ...]


@dataclass(frozen=True, slots=True)
class SentenceDemands:
    """One sentence of one task.

    The number of ``plans`` that fit, each robot's part, and the changes of word.
    """

    sentence: tuple[str, ...]
    plans: int
    steps: int
    parts: tuple[RobotPart, ...]
    changes: tuple[WordChange, ...]


def sentence_demands(
    fitting: PlanSpace, table: Partition, formulas: Mapping[str, Cover], few: int = 4
) -> SentenceDemands:
    """What a sentence asks, from the plan space of the plans that fit it (one task, one sentence).

    ``formulas``: the words' formulas; where several robots could be said to decide a change of
    word, those that the formula of the next word speaks of are named.  ``few``: up to so many
    subplans of a robot are listed.
    """
    word = table.word_of(fitting.rows)[fitting.state]
    place = _places(fitting, word)
    start = int(fitting.starts[0])
    sentence = [int(word[start])]
    for edges in _edges_by_step(fitting):
        source, target = fitting.sources[edges], fitting.target[edges]
        change = (place[target] == len(sentence)) & (place[source] < len(sentence))
        if change.any():
            sentence.append(int(word[target[change][0]]))
    return SentenceDemands(
        sentence=tuple(table.words[w] for w in sentence),
        plans=counts(fitting)[start],
        steps=int(fitting.layer[start]),
        parts=tuple(_part(fitting, robot, few) for robot in range(len(fitting.model.robots))),
        changes=tuple(
            _change(
                fitting,
                table,
                place,
                number,
                pair,
                _spoken_of(fitting, formulas[table.words[pair[1]]]),
            )
            for number, pair in enumerate(pairwise(sentence))
        ),
    )


def _edges_by_step(space: PlanSpace) -> Iterator[Ints]:
    """The edges of each joint step, the first step first."""
    for span in reversed(space.layers[1:]):
        yield np.arange(space.first[span.start], space.first[span.stop])


def _places(space: PlanSpace, word: Ints) -> Ints:
    """For each node, how many changes of word lie before it.

    One number, as all plans have one sentence.
    """
    place = np.zeros(len(space), np.int64)
    source = space.sources
    for edges in _edges_by_step(space):
        place[space.target[edges]] = place[source[edges]] + (
            word[space.target[edges]] != word[source[edges]]
        )
    return place


def _part(space: PlanSpace, robot: int, few: int) -> RobotPart:
    """Walk over the sets of nodes that one sequence of the robot's own subactions leaves possible."""
    labels = space.model.labels[robot]
    choices = tuple(
        tuple(
            own_text(labels[n], space.model.robots[robot]) if n else None
            for n in np.unique(space.labels[edges, robot])
        )
        for edges in _edges_by_step(space)
    )
    sets: dict[tuple[int, ...], int] = {(int(space.starts[0]),): 1}
    sequences: dict[tuple[int, ...], list[tuple[int, ...]]] = {(int(space.starts[0]),): [()]}
    for _ in choices:
        reached: dict[tuple[int, ...], int] = defaultdict(int)
        written: dict[tuple[int, ...], list[tuple[int, ...]]] = defaultdict(list)
        for nodes, number in sets.items():
            for label, after in _moves(space, robot, nodes):
                reached[after] += number
                written[after] += [(*before, label) for before in sequences[nodes]]
        if len(reached) > _SETS:
            return RobotPart(space.model.robots[robot], None, (), choices)
        sets = reached
        sequences = {nodes: texts[: few + 1] for nodes, texts in written.items()}
    total = sum(sets.values())
    listed = sorted(text for texts in sequences.values() for text in texts) if total <= few else []
    name = space.model.robots[robot]
    return RobotPart(
        name,
        total,
        tuple(tuple(own_text(labels[n], name) if n else None for n in s) for s in listed),
        choices,
    )


def _moves(
    space: PlanSpace, robot: int, nodes: Sequence[int]
) -> Iterator[tuple[int, tuple[int, ...]]]:
    """The robot's subactions that lead on from some of the nodes, and where they may lead."""
    array = np.array(nodes)
    edges = ranges(space.first[array], space.first[array + 1] - space.first[array])
    label = space.labels[edges, robot]
    for own in np.unique(label).tolist():
        yield own, tuple(np.unique(space.target[edges[label == own]]).tolist())


def _spoken_of(space: PlanSpace, formula: Cover) -> list[int]:
    """The robots that a formula names, and then the others."""
    atoms = [atom for term in formula.terms for literal in term for atom in literal.variable.atoms]
    named = {word for atom in atoms for word in atom.replace("(", " ").replace(")", " ").split()}
    robots = space.model.robots
    return sorted(range(len(robots)), key=lambda r: robots[r] not in named)


def _change(
    space: PlanSpace,
    table: Partition,
    place: Ints,
    number: int,
    pair: tuple[int, int],
    order: Sequence[int],
) -> WordChange:
    source = space.sources
    edges = np.flatnonzero((place[source] == number) & (place[space.target] == number + 1))
    step = int(space.layer[space.starts[0]]) - space.layer[source[edges]] + 1
    robots = _deciding(space, table, np.unique(space.state[source[edges]]), pair[1], order)
    ways: dict[Subplan, set[int]] = defaultdict(set)
    for when, labels in zip(step.tolist(), space.labels[edges].tolist(), strict=True):
        model = space.model
        does = tuple(
            own_text(model.labels[r][labels[r]], model.robots[r]) if labels[r] else None
            for r in robots
        )
        ways[does].add(when)
    return WordChange(
        before=table.words[pair[0]],
        after=table.words[pair[1]],
        earliest=int(step.min()),
        latest=int(step.max()),
        robots=tuple(space.model.robots[r] for r in robots),
        ways=tuple(
            (does, tuple(sorted(when)))
            for does, when in sorted(ways.items(), key=lambda w: (min(w[1]), str(w)))
        ),
    )


def _deciding(
    space: PlanSpace, table: Partition, states: Ints, after: int, order: Sequence[int]
) -> tuple[int, ...]:
    """The fewest robots whose subactions decide whether the next word is ``after``.

    At each of some states; early ones in ``order`` first.
    """
    rows = space.rows[states[:_STATES]]
    steps = space.model.successors(rows)
    mapped = find_rows(table.rows, steps.result) >= 0
    source, labels = steps.source[mapped], steps.labels[mapped]
    changes = table.word_of(steps.result[mapped]) == after
    for size in range(len(order)):
        for some in combinations(order, size):
            seen = np.column_stack((source, labels[:, list(some)]))
            _, first, inverse = np.unique(seen, axis=0, return_index=True, return_inverse=True)
            if (changes == changes[first][inverse.reshape(-1)]).all():
                return tuple(sorted(some))
    return tuple(sorted(order))
