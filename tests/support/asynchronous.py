# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots that keep no common step, by definition: plans are listed, mixtures made, and all
interleavings of starts and ends tried.  Tiny inputs only.

An *event* is a subaction that is not idle.  A robot's *part* of a plan is its events in order, each
with what it waits for: of each other robot so many events that interfere with it, and its meeting.
Plans with equal parts differ in timing alone: they are one plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from itertools import product
from random import Random

from coordlang.language.candidates import all_pairs
from coordlang.vocabulary.sat import PartitionProblem
from planners.grounding.actions import GroundAction
from planners.joint import traces as joint
from planners.joint.composition import ComposingStepper, JointActionStepper
from planners.joint.model import Goal, JointModel
from planners.joint.tables import Rows
from planners.pddl.formula_tree import literals
from planners.pddl.lifted import Atom, StepAtom
from planners.search.asynchronous import asynchronous, event_text
from planners.search.plan_space import PlanSpace
from planners.system.errors import CoordlangError
from tests.support import naive
from tests.support.random_models import random_model

#: A joint step: the label number of each robot.
Step = tuple[int, ...]
#: Robots that start together.
Block = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Event:
    """One of a robot's events.

    ``waits`` says of how many events of each robot, that interfere with it, it waits for the end;
    ``meets`` are the others of its meeting, each with its label.
    """

    label: int
    waits: tuple[int, ...]
    meets: frozenset[tuple[int, int]]


#: What one robot does, and all robots.
Part = tuple[Event, ...]
Parts = tuple[Part, ...]


class ChangesAlone(Exception):
    """The state changes in a step in which all robots idle: no event does that."""


class World:
    """A joint model, as robots without a clock see it."""

    def __init__(self, model: JointModel) -> None:
        self.model, self.robots = model, range(len(model.robots))
        self._steps: dict[bytes, dict[Step, Rows]] = {}

    def action(self, robot: int, label: int) -> GroundAction | None:
        """The ground action of a label; None where only joint actions have one."""
        stepper = self.model.stepper
        return stepper.labelled[robot][label] if isinstance(stepper, ComposingStepper) else None

    def steps(self, row: Rows) -> dict[Step, Rows]:
        """The joint steps from a state, with what they lead to."""
        key = row.tobytes()
        if key not in self._steps:
            found = self.model.successors(row[None, :])
            labels = map(tuple, found.labels.tolist())
            self._steps[key] = dict(zip(labels, found.result, strict=True))
        return self._steps[key]

    def alone(self, block: Block, step: Step) -> Step:
        """What some robots do in a step, all others idle."""
        return tuple(label if robot in block else 0 for robot, label in enumerate(step))

    @cache  # noqa: B019
    def interfere(self, robot: int, label: int, other: int, its: int) -> bool:
        """Whether one of two events touches what the other reads or writes, or names the other."""
        one, two = self.action(robot, label), self.action(other, its)
        if one is None or two is None or one is two:
            return True
        for a, b in ((one, two), (two, one)):
            reads, names = _reads(a)
            if StepAtom(b.schema, b.args) in names or _writes(b) & (reads | _writes(a)):
                return True
        return False

    def blocks(self, row: Rows, step: Step) -> list[Block]:
        """The events of a step in blocks, those that interfere in order: as fine as possible."""
        acting = [robot for robot in self.robots if step[robot]]
        found = []
        for together in _components(acting, lambda a, b: self.interfere(a, step[a], b, step[b])):
            if isinstance(self.model.stepper, JointActionStepper):
                found.append(together)
            else:
                found += self._finest(row, step, together)
        return found

    def _finest(self, row: Rows, step: Step, together: Block) -> tuple[Block, ...]:
        result = self.steps(row)[self.alone(together, step)]
        for number in range(len(together), 0, -1):
            for blocks in ordered_partitions(together, number):
                here: Rows | None = row
                for block in blocks:
                    here = None if here is None else self.steps(here).get(self.alone(block, step))
                if here is not None and (here == result).all():
                    return blocks
        raise AssertionError("one block is the step itself")

    def parts(self, row: Rows, plan: Sequence[Step]) -> tuple[Parts, tuple[tuple[int, ...], ...]]:
        """Each robot's part of a plan from a state, and in which steps its events are."""
        done: list[list[Event]] = [[] for _ in self.robots]
        when: list[list[int]] = [[] for _ in self.robots]
        for time, step in enumerate(plan):
            if not any(step) and (self.steps(row)[step] != row).any():
                raise ChangesAlone
            for block in self.blocks(row, step):
                waits = [self._count(done, robot, step[robot]) for robot in block]
                for robot, own in zip(block, waits, strict=True):
                    meets = frozenset((other, step[other]) for other in block if other != robot)
                    done[robot].append(Event(step[robot], own, meets))
                    when[robot].append(time)
            row = self.steps(row)[step]
        return tuple(map(tuple, done)), tuple(map(tuple, when))

    def _count(self, done: Sequence[Sequence[Event]], robot: int, label: int) -> tuple[int, ...]:
        """Of each other robot how many events so far interfere with an event."""
        return tuple(
            sum(self.interfere(robot, label, other, event.label) for event in done[other])
            if other != robot
            else 0
            for other in self.robots
        )

    def ends(self, row: Rows, parts: Parts, goal: Goal) -> set[str]:
        """How executions of parts end, over all interleavings of starts and ends.

        Of ``arrived`` (all is done, and the goal holds), ``elsewhere`` (it does not), ``stuck`` (some wait for ever), ``overlap`` (an event would
        start beside one that interferes with it) and ``impossible`` (it would start where it is
        not applicable).
        """
        none: dict[int, Changes] = {}
        begin = Moment((0,) * len(self.robots), frozenset(none.items()), self._facts(row))
        found, seen, front = set[str](), {begin}, [begin]
        while front:
            here = front.pop()
            following = list(here.after_ends())
            for block in self._ready(parts, here):
                then = self._started(parts, here, block)
                if isinstance(then, str):
                    found.add(then)
                else:
                    following.append(then)
            if not following:
                done = here.ended == tuple(map(len, parts))
                mask = self.model.codec.mask(sorted(here.facts))
                holds = done and self.model.holds(goal, mask[None, :])[0]
                found.add("arrived" if holds else "elsewhere" if done else "stuck")
            front += [then for then in following if then not in seen]
            seen.update(following)
        return found

    def _facts(self, row: Rows) -> frozenset[int]:
        return frozenset(self.model.codec.true_facts(row))

    def _ready(self, parts: Parts, here: Moment) -> Iterator[Block]:
        """The meetings that may start: each robot is at it, and has seen what it waits for."""
        busy = dict(here.running)
        ready: dict[int, Event] = {}
        for robot, (part, k) in enumerate(zip(parts, here.ended, strict=True)):
            if robot not in busy and k < len(part):
                done = [own[:many] for own, many in zip(parts, here.ended, strict=True)]
                seen = self._count(done, robot, part[k].label)
                if all(have >= want for have, want in zip(seen, part[k].waits, strict=True)):
                    ready[robot] = part[k]
        for robot, event in ready.items():
            block = tuple(sorted([robot, *(other for other, _ in event.meets)]))
            if block[0] == robot and ready.keys() >= set(block):
                meeting = {(one, ready[one].label) for one in block}
                if all(ready[one].meets | {(one, ready[one].label)} == meeting for one in block):
                    yield block

    def _started(self, parts: Parts, here: Moment, block: Block) -> Moment | str:
        """After robots have started together; or what is wrong with that."""
        label = {robot: parts[robot][here.ended[robot]].label for robot in block}
        busy = {robot: parts[robot][here.ended[robot]].label for robot, _ in here.running}
        for robot, other in product(label, busy):
            if self.interfere(robot, label[robot], other, busy[other]):
                return "overlap"
        step = tuple(label.get(robot, 0) for robot in self.robots)
        result = self.steps(self.model.codec.mask(sorted(here.facts))).get(step)
        if result is None:
            return "impossible"
        after = self._facts(result)
        starting = {robot: self._changes(robot, step[robot], here.facts, after) for robot in block}
        return Moment(here.ended, here.running | frozenset(starting.items()), here.facts)

    def _changes(self, robot: int, label: int, before: Facts, after: Facts) -> Changes:
        """What an event changes by its end, of what its meeting changes."""
        action, index = self.action(robot, label), self.model.codec.facts.index
        own = None if action is None else {index.get(e.atom) for e in action.effects}
        changed = {fact for fact in before ^ after if own is None or fact in own}
        return frozenset(changed & after), frozenset(changed & before)


#: What is true, and what becomes true and false.
Facts = frozenset[int]
Changes = tuple[Facts, Facts]


@dataclass(frozen=True, slots=True)
class Moment:
    """Of an execution: how many events of each robot have ended, which run, and what is true."""

    ended: tuple[int, ...]
    running: frozenset[tuple[int, Changes]]
    facts: Facts

    def after_ends(self) -> Iterator[Moment]:
        """One of the events that run ends."""
        for robot, (adds, deletes) in self.running:
            ended = tuple(k + (other == robot) for other, k in enumerate(self.ended))
            yield Moment(
                ended, self.running - {(robot, (adds, deletes))}, self.facts - deletes | adds
            )


def _reads(action: GroundAction) -> tuple[set[Atom], set[StepAtom]]:
    """The facts that an action's conditions read, and the actions that they name."""
    formulas = [action.precondition, *(effect.condition for effect in action.effects)]
    leaves = [leaf for formula in formulas for leaf, _ in literals(formula)]
    names = {leaf for leaf in leaves if isinstance(leaf, StepAtom)} | action.links
    return {leaf for leaf in leaves if isinstance(leaf, Atom)}, names


def _writes(action: GroundAction) -> set[Atom]:
    return {effect.atom for effect in action.effects}


def _components(acting: Sequence[int], joined: Callable[[int, int], bool]) -> list[Block]:
    """Robots that are joined, by way of others too, together."""
    found: list[set[int]] = []
    for robot in acting:
        own = [one for one in found if any(joined(robot, other) for other in one)]
        found = [one for one in found if one not in own] + [{robot}.union(*own)]
    return sorted(tuple(sorted(one)) for one in found)


def ordered_partitions(robots: Block, number: int) -> list[tuple[Block, ...]]:
    """The ways to put robots into so many blocks one after another, small first blocks first."""
    found = [
        tuple(tuple(r for r, k in zip(robots, own, strict=True) if k == at) for at in range(number))
        for own in product(range(number), repeat=len(robots))
    ]
    return sorted(filter(all, found), key=lambda blocks: [(len(own), own) for own in blocks])


def random_tasks(robots: int, seeds: range) -> Iterator[tuple[PlanSpace, World, list[int], Random]]:
    """Plan spaces in step of random models, and some of their tasks."""
    for seed in seeds:
        random = Random(seed)
        try:
            domain, problem, options = random_model(seed, robots)
            candidates = all_pairs(domain, [problem], options)
        except CoordlangError:
            continue
        for space in candidates.spaces:
            tasks = random.sample(range(len(space.starts)), min(4, len(space.starts)))
            yield space, World(candidates.model), tasks, random


def random_plans(
    robots: int, seeds: range, most: int
) -> Iterator[tuple[World, PlanSpace, Plans, PlanSpace, Random]]:
    """Random tasks, their plans up to timing, and their graph; not those with too many plans."""
    for space, world, tasks, random in random_tasks(robots, seeds):
        for task in tasks:
            own = space.with_tasks(space.starts[[task]], space.second[[task]])
            try:
                plans = Plans(world, own, 0, most)
            except (naive.TooLarge, ChangesAlone):
                continue
            yield world, own, plans, asynchronous(own), random


class Plans:
    """Plans up to timing; ``states``: for the parts of each those passed as soon as possible."""

    def __init__(self, world: World, space: PlanSpace, task: int, most: int) -> None:
        best: dict[Parts, tuple[int, tuple[tuple[int, ...], ...], tuple[int, ...]]] = {}
        row = space.rows[space.state[space.starts[task]]]
        self.listed = naive.listed(space, task, most)
        for plan in self.listed:
            parts, when = world.parts(row, plan)
            own = sum(map(sum, when)), when, naive.states(space, task, plan)
            best[parts] = min(best.get(parts, own), own)
        self.states = {parts: states for parts, (*_, states) in best.items()}

    def by_sentence(self, word: Mapping[int, int]) -> dict[tuple[int, ...], list[Parts]]:
        """The parts of the plans with each sentence."""
        found: dict[tuple[int, ...], list[Parts]] = {}
        for parts, states in self.states.items():
            found.setdefault(naive.sentence([word[s] for s in states]), []).append(parts)
        return found

    def mixtures(self, word: Mapping[int, int]) -> Iterator[tuple[Parts, tuple[Parts, ...]]]:
        """The mixtures of plans with one sentence, each with plans that it is made of."""
        for group in self.by_sentence(word).values():
            yield from self.mixtures_of(group)

    @staticmethod
    def mixtures_of(group: Sequence[Parts]) -> Iterator[tuple[Parts, tuple[Parts, ...]]]:
        """The mixtures of some plans."""
        made: dict[Parts, tuple[Parts, ...]] = {}
        for chosen in product(group, repeat=len(group[0])):
            made.setdefault(tuple(own[robot] for robot, own in enumerate(chosen)), chosen)
        yield from made.items()


def texts(model: JointModel, parts: Parts) -> tuple[tuple[str, ...], ...]:
    """Parts as the product writes them."""
    return tuple(
        tuple(
            event_text(model, robot, joint.Event(e.label, e.waits, tuple(sorted(e.meets))))
            for e in part
        )
        for robot, part in enumerate(parts)
    )


def least_words(plans: Sequence[Plans], states: Sequence[int]) -> tuple[int, dict[int, int]]:
    """The fewest words of an asynchronous language, and one with so few."""
    clauses: list[frozenset[tuple[int, int]]] = []
    for size in range(1, len(states) + 1):
        with closing(PartitionProblem(states, size)) as problem:
            for clause in clauses:
                problem.separate_one(clause)
            while (word := problem.solve()) is not None:
                new = _violated(plans, word)
                if not new:
                    return size, word
                for clause in new:
                    problem.separate_one(clause)
                clauses += new
    raise AssertionError("a word for each state is a language, or there is none")


def _violated(plans: Sequence[Plans], word: Mapping[int, int]) -> list[frozenset[tuple[int, int]]]:
    """Clauses of plans with one sentence whose mixture is not optimal."""
    found = []
    for own in plans:
        for mixed, chosen in own.mixtures(word):
            if mixed not in own.states:
                clause = naive.separation_clause([own.states[parts] for parts in chosen], word)
                assert clause is not None, "they have one sentence"
                found.append(clause)
    return found
