# SPDX-License-Identifier: GPL-3.0-or-later
"""Symmetries of a joint model: permutations of its states that map plans to plans.

They map candidate tasks to candidate tasks, too, and are renamings of the PDDL objects.  Generators
come from the automorphisms of a graph of the model (`coordlang.symmetry.graph`); each is checked
before use, whoever proposed it: on robots, ground actions with their conditions, effects and costs,
facts, states and candidate tasks.  Then their products are listed.  The image of a failing tuple of
plans fails too, so the image of a necessary clause is necessary.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from msgspec.structs import replace

from coordlang.language.candidates import Candidates
from coordlang.language.warping import Clause, pair
from coordlang.symmetry.graph import Renaming, automorphism_generators, joined_order
from planners.grounding.actions import GroundAction
from planners.joint.model import FullState, Goal
from planners.joint.states import StateCodec, split_atoms
from planners.joint.tables import Ints, Rows, find_rows, unique_rows
from planners.pddl.formula_tree import Compound, Leaf, fold
from planners.pddl.lifted import Atom, StepAtom
from planners.pddl.robots import natural
from planners.search.plan_space import PlanSpace

#: Elements of the largest group that is used, the identity among them: each multiplies the clauses.
LARGEST_GROUP = 64


@dataclass(frozen=True, slots=True)
class Symmetry:
    """A renaming of objects that maps the model and its candidate tasks onto themselves.

    ``renaming`` says where each object goes, objects that are not named stay; ``states`` (states)
    where each state number goes.
    """

    renaming: Renaming
    states: Ints

    def after(self, first: Symmetry) -> Symmetry:
        """The composition: ``first``, then this one."""
        renaming = {name: self.renaming.get(to, to) for name, to in first.renaming.items()}
        return Symmetry(renaming, self.states[first.states])

    def text(self, text: str) -> str:
        """The image of an atom, a formula or a subaction, as text with single spaces."""
        return _renamed(self.renaming, text)

    def robot(self, robots: Sequence[str], number: int) -> int:
        """The number of the robot that robot ``number`` goes to."""
        return robots.index(self.renaming.get(robots[number], robots[number]))

    def joint_action(
        self, robots: Sequence[str], texts: Sequence[str | None]
    ) -> tuple[str | None, ...]:
        """The image of a joint action, given and returned as each robot's text."""
        image: list[str | None] = [None] * len(robots)
        for number, text in enumerate(texts):
            if text is not None:
                image[self.robot(robots, number)] = _in_order(self.text(text), robots)
        return tuple(image)


def _renamed(renaming: Renaming, text: str) -> str:
    return re.sub(r"(?<= )[^ ()]+", lambda match: renaming.get(match[0], match[0]), text)


def _in_order(text: str, robots: Sequence[str]) -> str:
    """An event with those that it waits for and those that it meets in the order of robots.

    As `planners.search.asynchronous.event_text` writes it; a subaction alone is as it is.
    """
    if ") (" not in text:
        return text
    subaction, *others = split_atoms(text)

    def place(other: str) -> tuple[bool, int]:
        return other.startswith("(with "), robots.index(other.split()[1].rstrip(")"))

    return " ".join((subaction, *sorted(others, key=place)))


def _images(renaming: Renaming, codec: StateCodec, rows: Rows) -> Rows | None:
    """The images of a table of states; None if a fact that is true in one goes to none."""
    images = np.zeros_like(rows)
    for fact, text in enumerate(codec.facts.texts):
        true = codec.column(rows, fact)
        if true.any():
            image = codec.facts.numbers.get(_renamed(renaming, text))
            if image is None:
                return None
            codec.set(images, true, image)
    return images


@dataclass(frozen=True)
class SymmetryGroup:
    """A group of symmetries of a model and its candidate tasks.

    ``symmetries`` are the elements without the identity, in the order of where they take the
    objects (those of `joined_order`, one after another).
    """

    symmetries: tuple[Symmetry, ...]

    @cached_property
    def permutations(self) -> list[list[int]]:
        """Where the symmetries take each state number."""
        return [symmetry.states.tolist() for symmetry in self.symmetries]

    def images(self, clause: Clause) -> Iterator[tuple[Clause, Symmetry]]:
        """The image of a clause under each symmetry."""
        for symmetry, to in zip(self.symmetries, self.permutations, strict=True):
            yield frozenset(pair(to[a], to[b]) for a, b in clause), symmetry


def symmetry_group(candidates: Candidates, largest: int = LARGEST_GROUP) -> SymmetryGroup:
    """The symmetries of the candidates' model: of more than ``largest`` elements a subgroup.

    The identity counts among them.  It is alone under ``--remember-actions`` and where states say
    what is left of the slack: symmetries only save work.
    """
    if candidates.model.remembers or candidates.model.slack_facts:
        return SymmetryGroup(())
    generators = checked_generators(candidates)
    if candidates.model.is_asynchronous and any(s.model.has_ties for s in candidates.spaces):
        # Robots whose events could be done in either order do them in the order of robots.
        robots = candidates.model.robots
        generators = [s for s in generators if all(s.renaming.get(r, r) == r for r in robots)]
    names = joined_order(candidates)
    group = sorted(
        generated(generators, largest),
        key=lambda symmetry: [natural(symmetry.renaming[name]) for name in names],
    )
    return SymmetryGroup(tuple(group))


def checked_generators(candidates: Candidates, *, with_tasks: bool = True) -> list[Symmetry]:
    """Symmetries that generate the group: those automorphisms of the graph that are some."""
    proposed = automorphism_generators(candidates, with_tasks=with_tasks)
    if not proposed:
        return []
    itself = _renamed_model(candidates, {}, np.arange(len(candidates.rows)))
    found = [(renaming, _states_under(renaming, candidates, itself)) for renaming in proposed]
    return [Symmetry(renaming, states) for renaming, states in found if states is not None]


def generated(generators: Iterable[Symmetry], largest: int) -> list[Symmetry]:
    """The group that the generators generate, without the identity.

    A generator with which the group would have more than ``largest`` elements is left out, so that
    what is returned is a group always.
    """
    chosen: list[Symmetry] = []
    group: list[Symmetry] = []
    for generator in generators:
        grown = _closure([*chosen, generator], largest)
        if grown is not None:
            chosen.append(generator)
            group = grown
    return group


def _closure(generators: Sequence[Symmetry], largest: int) -> list[Symmetry] | None:
    """All products of the generators but the identity; None if there are ``largest`` or more."""
    identity = np.arange(len(generators[0].states))
    known = {identity.tobytes()}
    group: list[Symmetry] = []
    waiting = list(generators)
    while waiting:
        element = waiting.pop()
        if element.states.tobytes() in known:
            continue
        known.add(element.states.tobytes())
        group.append(element)
        if len(known) > largest:
            return None
        waiting += [generator.after(element) for generator in generators]
    return group


def orbits(permutations: Sequence[Ints]) -> Ints:
    """(elements) the least of the elements that permutations take to each other."""
    before, orbit = np.zeros(0, np.int64), np.arange(len(permutations[0]))
    while not np.array_equal(orbit, before):
        before = orbit
        for to in permutations:
            orbit = np.minimum(orbit, orbit[to])
    return orbit


# ---- is a renaming a symmetry?


def _states_under(
    renaming: Renaming, candidates: Candidates, itself: tuple[Hashable, ...]
) -> Ints | None:
    """Where the renaming takes each state number; None if it is no symmetry.

    If it takes states to states, it is one iff all that the tasks are made of, ``itself``, is the
    same when it is renamed.
    """
    rows = _images(renaming, candidates.model.codec, candidates.rows)
    if rows is None or (states := find_rows(candidates.rows, rows)).min(initial=0) < 0:
        return None
    return states if _renamed_model(candidates, renaming, states) == itself else None


def _renamed_model(
    candidates: Candidates, renaming: Renaming, states: Ints
) -> tuple[Hashable, ...]:
    """Robots with their idling costs, ground actions and tasks, as renamed."""
    model, image = candidates.model, _Image(renaming, candidates.model.codec.facts.atoms)
    robots = list(map(image.name, model.robots))
    kinds = model.robots if model.is_joint_action else model.idling_costs
    actions = (image.action(action, robots) for action in model.actions)
    tasks: set[tuple[int, Hashable]] = set()
    # All pairs of states, the second to be reached from the first, go to such pairs.
    for space in () if candidates.kind == "all" else candidates.spaces:
        goals = list(map(image.form, space.goals))
        for node in space.starts.tolist():
            tasks.add((int(states[space.state[node]]), goals[space.goal[node]]))
    return frozenset(zip(robots, kinds, strict=True)), frozenset(actions), frozenset(tasks)


class _Image:
    """What a renaming makes of names, atoms, formulas and actions."""

    def __init__(self, renaming: Renaming, facts: Sequence[Atom]) -> None:
        self._renaming, self._facts = renaming, facts

    def name(self, name: str) -> str:
        return self._renaming.get(name, name)

    def names(self, names: Sequence[str]) -> tuple[str, ...]:
        return tuple(map(self.name, names))

    def leaf(self, leaf: Leaf) -> Leaf:
        if isinstance(leaf, Atom | StepAtom):
            return replace(leaf, args=self.names(leaf.args))
        return leaf

    def form(self, formula: Goal) -> Hashable:
        """A goal or formula; the order of the parts of a conjunction or disjunction is gone."""
        if isinstance(formula, FullState):
            return frozenset(self.leaf(self._facts[fact]) for fact in formula.facts)

        def compound(kind: Compound, parts: Iterator[Hashable]) -> Hashable:
            return type(kind).__name__, frozenset(parts)

        return fold(formula, self.leaf, compound)

    def action(self, action: GroundAction, robots: Sequence[str]) -> Hashable:
        """What an action is and does; ``robots`` are those of the model, renamed."""
        form = self.form
        return (
            action.schema,
            self.names(action.args),
            action.cost,
            frozenset(robots[own] for own in action.owners),
            form(action.precondition),
            frozenset((self.leaf(e.atom), e.adds, form(e.condition)) for e in action.effects),
            frozenset(map(form, action.links)),
        )


def symmetries_of_part(space: PlanSpace, end: Ints, proposed: Iterable[Renaming]) -> SymmetryGroup:
    """The group of those proposed renamings that map a part of a plan space onto itself.

    Each is checked on the edges of the part themselves (Proposition 20 of docs/concepts.md).
    ``end`` (goals) is the state that each goal of the part is.  The ``proposed`` renamings have the
    same names.  Of a group with more than `LARGEST_GROUP` elements a subgroup is taken.  States
    outside the part stay.
    """
    part = _Part(space, end)
    checked = (part.symmetry(renaming) for renaming in proposed)
    return SymmetryGroup(tuple(generated((s for s in checked if s is not None), LARGEST_GROUP)))


class _Part:
    """What renamings of a part are checked on."""

    def __init__(self, space: PlanSpace, end: Ints) -> None:
        self._space = space
        self._states = np.unique(space.state)
        target = space.state[space.target]
        source, goal = space.state[space.sources], end[space.goal[space.sources]]
        #: (edges, 3) the states that an edge leads from and to, and the state that its goal is.
        self._ends = np.column_stack((source, target, goal))
        labels = [space.robot_labels(robot) for robot in range(space.robots)]
        self._edges = self._table(self._ends, labels)

    def _table(self, ends: Ints, labels: Sequence[Ints]) -> Ints:
        """Edges, sorted, each once."""
        return unique_rows(np.column_stack((ends, *labels)))[0]

    def symmetry(self, renaming: Renaming) -> Symmetry | None:
        """The renaming with where it takes states; None if it is no symmetry of the part.

        It is one if its states go to different states of it, and its edges to its edges, with the
        images of labels and to those of goals.
        """
        space = self._space
        robots = space.model.robots
        if {renaming.get(robot, robot) for robot in robots} != set(robots):
            return None
        rows = _images(renaming, space.model.codec, space.rows[self._states])
        if rows is None:
            return None
        found = find_rows(space.rows, rows)
        if not np.array_equal(np.sort(found), self._states):
            return None
        states = np.arange(len(space.rows))
        states[self._states] = found
        symmetry = Symmetry(renaming, states)
        labels = self._labels_under(symmetry)
        if labels is None:
            return None
        edges = self._table(states[self._ends], labels)
        return symmetry if np.array_equal(edges, self._edges) else None

    def _labels_under(self, symmetry: Symmetry) -> Sequence[Ints] | None:
        """The label of each robot on the image of each edge; None if it has no such label."""
        model = self._space.model
        images = [np.zeros(0, np.int64)] * len(model.robots)
        for robot in range(len(model.robots)):
            to = symmetry.robot(model.robots, robot)
            used, place = np.unique(self._space.robot_labels(robot), return_inverse=True)
            image = []
            for label in used.tolist():
                text = model.label_text(robot, label)
                image.append(model.label_number(to, text if text is None else symmetry.text(text)))
            if None in image:
                return None
            images[to] = np.array(image, np.int64)[place]
        return images
