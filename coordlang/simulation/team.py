# SPDX-License-Identifier: GPL-3.0-or-later
"""What each robot is given before a run: its choices, and how far in the sentence they lead.

Under a sentence that is the robot's own choices, which it can work out from language, task and
sentence.  For comparison all robots follow one whole plan, or each an optimal plan of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from random import Random
from typing import Any, Literal

from coordlang.execution.choices import choices
from coordlang.execution.choices_file import to_data
from coordlang.execution.monitor import FORMAT, IDLE, VERSION, Monitor
from coordlang.execution.task_language import TaskLanguage
from coordlang.simulation.pace import OwnWords
from coordlang.sites.world import World, find_world
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan, Plans
from planners.system.errors import BadInput, UsageError, note
from planners.system.messages import echoed

#: What the robots have agreed on: a sentence, a whole plan, or nothing.
Agreement = Literal["sentence", "plan", "nothing"]


@dataclass(frozen=True, slots=True)
class Equipment:
    """What one robot is given for one run: a monitor of its own, and its words."""

    monitor: Monitor
    words: OwnWords | None


@dataclass(frozen=True, slots=True)
class Mission:
    """A task, what the robots have agreed on, and where they are.

    Attributes
    ----------
    task_language
        The language and the task.
    agreement
        What is agreed on.
    sentence
        The word numbers of the sentence, empty for another agreement.
    world
        Where things are, and what moves.
    starts, goals
        The place of each robot at the start and at the end of the plans; where plans differ, of
        the first one.
    leads
        For each robot the place that each of its subactions leads to.
    steps
        The length of the plans in joint steps.
    """

    task_language: TaskLanguage
    agreement: Agreement
    sentence: tuple[int, ...]
    world: World
    starts: Mapping[str, str]
    goals: Mapping[str, str]
    leads: Mapping[str, Mapping[str, str]]
    steps: int
    _plans: Plans
    _given: Mapping[str, Equipment]

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots, in the order of joint actions."""
        return self.task_language.model.robots

    def team(self, seed: int) -> dict[str, Equipment]:
        """Return what each robot is given in the run with this seed."""
        if self.agreement == "sentence":
            return {name: Equipment(g.monitor.copy(), g.words) for name, g in self._given.items()}
        team = {}
        for robot, name in enumerate(self.robots):
            agreed = self.agreement == "plan"
            plan = self.agreed_plan(seed) if agreed else self._drawn(f"{seed} plan {name}")
            own = [self.task_language.model.label_text(robot, step[robot]) for step in plan]
            team[name] = self._following(name, own, self._words_on(plan) if agreed else None)
        return team

    def agreed_plan(self, seed: int) -> Plan:
        """Return the plan that all robots follow in the run with this seed if they agree on one."""
        return self._drawn(f"{seed} plan")

    def atom_at(self, robot: str, place: str) -> str:
        """Return the atom that says that a robot is in a place.

        Raises
        ------
        UsageError
            If there is none.
        """
        for text, role in sorted(self.world.roles.items()):
            if role == ("at", robot, place):
                return text
        raise UsageError(
            f"no atom says that {echoed(robot)} is in {echoed(place)}",
            remedy=f"Robots are {', '.join(self.robots)}; places are called as "
            f"{self.starts[self.robots[0]]} is.",
        )

    def mixes(self, subplans: Mapping[str, Sequence[str | None]]) -> bool:
        """Say whether subplans of all robots, done in step, are an optimal plan of the task."""
        model = self.task_language.model
        numbers = [
            [model.label_number(robot, text) for text in subplans[name]]
            for robot, name in enumerate(self.robots)
        ]
        steps = [tuple(step) for step in zip(*numbers, strict=True)]
        found = [step for step in steps if None not in step]
        return len(found) == self.steps and (
            self._plans.space.path_with(self._plans.start, found) is not None
        )

    def _following(
        self, robot: str, subactions: Sequence[str | None], words: Sequence[int] | None = None
    ) -> Equipment:
        """What a robot is given that has one subplan: a choices file without a choice.

        It knows in which place it is, and nothing else.
        """
        texts = self.task_language.model.codec.facts.texts
        own = [text for text in texts if self.world.role(text)[:2] == ("at", robot)]
        number = {self.world.role(text)[2]: fact for fact, text in enumerate(own)}
        place, states = self.starts[robot], list[dict[str, Any]]()
        for step, text in enumerate([*subactions, None]):
            following = {text or IDLE: step + 1} if step < len(subactions) else {}
            known: dict[str, Any] = {"true": [number[place]], "unknown": []}
            states.append({"step": step, "left": 1, "next": following, **known})
            place = self.leads[robot].get(text or IDLE, place)
        entry = {
            "robot": robot,
            "steps": len(subactions),
            "subplans": 1,
            "atoms": "own",
            "facts": own,
            "others": [text for text in texts if text not in own],
            "states": states,
        }
        data = {"format": FORMAT, "version": VERSION, "sentence": "", "choices": [entry]}
        if words is None:
            return Equipment(Monitor(data, robot), None)
        moves = [dict(state["next"]) for state in states]
        return Equipment(Monitor(data, robot), OwnWords(moves, words))

    def _drawn(self, seed: str) -> Plan:
        return self._plans.unrank(Random(seed).randrange(self._plans.count))

    def _words_on(self, plan: Plan) -> tuple[int, ...]:
        """Return how many words are passed before each step of a plan and at its end."""
        space, start = self._plans.space, self._plans.start
        path = space.path_with(start, plan)
        assert path is not None, "it was drawn from this space"
        word = self.task_language.word[space.nodes_on(start, path)].tolist()
        passed = [0]
        for before, after in pairwise(word):
            passed.append(passed[-1] + (before != after))
        return tuple(passed)


def mission(
    task_language: TaskLanguage, agreement: Agreement, sentence: Sequence[int] = ()
) -> Mission:
    """Prepare the robots for runs of a task.

    Raises
    ------
    NoPlanFits
        If no optimal plan has the sentence.
    BadInput
        If no atom says where a robot is.
    """
    model, space = task_language.model, task_language.space
    plans = Plans.of(space, task_language.task)
    path = space.nodes_on(task_language.start, space.first_path(task_language.start))
    states = [model.codec.decode(space.rows[space.state[node]]) for node in path]
    world = find_world(model, states)
    starts = _starts(world, model.robots, states[0])
    _note_what_is_left_out(world, model.robots, space)
    given: dict[str, Equipment] = {}
    if agreement == "sentence":
        found = choices(task_language, sentence)
        for robot, name in enumerate(model.robots):
            words = own_words(found.fits, task_language, robot)
            given[name] = Equipment(Monitor(to_data(found, [robot]), name), words)
    return Mission(
        task_language,
        agreement,
        tuple(sentence),
        world,
        starts,
        _robots_in(world, model.robots, states[-1]),
        {name: _leads(world, space, robot) for robot, name in enumerate(model.robots)},
        space.cost_of(task_language.task)[0],
        plans,
        given,
    )


def own_words(fits: PlanSpace, task_language: TaskLanguage, robot: int) -> OwnWords:
    """How far in the sentence a robot may be after each of its own beginnings.

    Subset construction over the plans with the sentence: a state is the set of nodes in which they
    can be after the same own subactions.
    """
    model = task_language.model
    word = task_language.partition.word_of(fits.rows)[fits.state]
    passed = {int(fits.starts[0]): 0}
    first = frozenset(passed)
    numbers, order, moves, words = {first: 0}, [first], list[dict[str, int]](), []
    for nodes in order:  # which grows meanwhile
        targets: dict[str, set[int]] = {}
        for node in sorted(nodes):
            for edge in fits.out_edges(node):
                text = model.label_text(robot, fits.labels_of(edge)[robot]) or IDLE
                target = fits.target_of(edge)
                passed[target] = passed[node] + int(word[target] != word[node])
                targets.setdefault(text, set()).add(target)
        words.append(max(passed[node] for node in nodes))
        moves.append({})
        for text, found in sorted(targets.items()):
            moves[-1][text] = numbers.setdefault(frozenset(found), len(numbers))
            order += [frozenset(found)] if len(numbers) > len(order) else []
    return OwnWords(moves, words)


def _starts(world: World, robots: Sequence[str], state: Sequence[str]) -> dict[str, str]:
    located = _robots_in(world, robots, state)
    lost = [name for name in robots if name not in located]
    if lost:
        raise BadInput(
            f"no atom says where {' and '.join(lost)} {'is' if len(lost) == 1 else 'are'} at the "
            "start",
            remedy="Simulate a domain whose robots move from place to place.",
        )
    return located


def _note_what_is_left_out(world: World, robots: Sequence[str], space: PlanSpace) -> None:
    """Give notes on what the simulator does not do as the domain says."""
    located = {role[1] for role in world.roles.values() if role[0] == "at"}
    others = [name for name in world.things if name in located and name not in robots]
    if others:
        more = f" and {len(others) - 3} more" if len(others) > 3 else ""
        note(
            "only robots are on the floor; what is left out, so that nothing collides with it: "
            f"{', '.join(others[:3])}{more}",
            remedy="Subactions that move no robot are waiting.",
        )
    for number in sorted(set(space.state.tolist())):
        places = _robots_in(world, robots, space.model.codec.decode(space.rows[number]))
        taken: dict[str, str] = {}
        for name, place in places.items():
            other = taken.setdefault(place, name)
            if other != name:
                note(
                    f"plans may bring {other} and {name} to {place} at once, where robots on a "
                    "floor collide",
                    remedy="Collisions are then none of the language: simulate a domain in which "
                    "robots share no place.",
                )
                return


def _robots_in(world: World, robots: Sequence[str], state: Sequence[str]) -> dict[str, str]:
    """The places of the robots in a state."""
    located = world.located(state)
    return {name: located[name] for name in robots if name in located}


def _leads(world: World, space: PlanSpace, robot: int) -> dict[str, str]:
    """The place to which each of a robot's subactions on the plans leads, by its text."""
    model = space.model
    found = {}
    for label in sorted(set(space.robot_labels(robot).tolist())):
        text = model.label_text(robot, label)
        for thing, place in world.moves(model, robot, label):
            if text is not None and thing == model.robots[robot]:
                found[text] = place
    return found
