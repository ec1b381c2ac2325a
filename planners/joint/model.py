# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots' subactions -> the joint model: states, joint actions, their results.

A joint step gives every robot one label: 0 is idling, ``k`` the robot's k-th subaction.  The
product of the robots' subactions is never stored: `JointModel.successors` composes what is
applicable, a whole table of states at a time.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from planners.grounding.actions import GroundAction, Impossible
from planners.joint.conditions import Evaluator, Labels
from planners.joint.states import StateCodec
from planners.joint.tables import Bools, Ints, Rows, kept_runs
from planners.pddl.formula_tree import label
from planners.pddl.lifted import Atom, Formula, StepAtom
from planners.pddl.model_options import Cost
from planners.system.errors import Position
from planners.system.messages import named

if TYPE_CHECKING:
    from planners.joint.traces import Event

#: The text of label 0.
IDLE = "idle"
#: The predicate of the facts that say how many joint steps of the slack are left.
SLACK_LEFT = "slack-left"
#: A state in which nothing is true, for people; its key is empty.
NO_FACT = "(no fact holds)"


def some_options(options: Options, kept: Sequence[Bools]) -> Options:
    """Those of the robots' options that are ``kept``."""
    return [
        (kept_runs(first, good), label[good])
        for (first, label), good in zip(options, kept, strict=True)
    ]


def products(options: Options) -> NDArray[np.float64]:
    """How many combinations the robots' options have, by state."""
    counts = np.ones(len(options[0][0]) - 1)
    for first, _ in options:
        counts *= np.diff(first)
    return counts


@dataclass(frozen=True, slots=True)
class FullState:
    """A goal that is one state: just these facts are true, by number, in order."""

    facts: tuple[int, ...]


#: For each robot the labels that it may choose in each state of a table: CSR (first index, labels).
Options = list[tuple[Ints, Ints]]

#: What a task asks for: a ground formula, or one full state.
Goal = Formula | FullState


@dataclass(frozen=True, slots=True)
class PlanningTask:
    """A task ``(I, G)`` of a joint model: a row (blocks), and what must hold at the end.

    ``name`` is what messages call it, ``position`` the file that it is from.
    """

    name: str
    init: Rows
    goal: Goal
    position: Position | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """Joint steps out of a table of states, sorted by source and labels.

    ``source`` (k) row numbers of the table; ``labels`` (k, robots); ``result`` (k, words) the
    states reached; ``cost`` (k) the second component of the cost (0 under ``makespan``).
    """

    source: Ints
    labels: Labels
    result: Rows
    cost: Ints

    def __len__(self) -> int:
        return len(self.source)


class Stepper(ABC):
    """What composes joint steps, or reads whole ones: see `planners.joint.composition`.

    Of states it is given the facts (`StateCodec.facts_part`), and not what robots did last.  What
    is not abstract is said of robots that neither do joint actions nor ever interfere.
    """

    @abstractmethod
    def steps(self, rows: Rows, options: Options | None = None) -> Steps:
        """All joint steps applicable in the states of a table, sorted by source and labels.

        Of ``options`` only, some of the `choices`, if they are given.
        """

    @abstractmethod
    def choices(self, rows: Rows) -> Options:
        """For each robot the labels that are possible in each state, by state (CSR)."""

    @abstractmethod
    def most_steps(self, rows: Rows) -> int:
        """An upper bound on the joint steps out of these states, without composing them."""

    @abstractmethod
    def why_not(self, row: Rows, labels: Sequence[int]) -> str:
        """Why these labels are no joint step in a state, in words."""

    def joint_action(self, row: Rows, labels: Sequence[int]) -> str | None:
        """The ground joint action of the domain that these labels are in a state.

        None where robots' subactions are actions of their own.
        """
        return None

    def interfering_pairs(self) -> int:
        """How many pairs of subactions of different robots may not share a step."""
        return 0

    def conflicts(self, rows: Rows) -> Iterator[tuple[object, str]]:
        """State by state pairs of subactions that are both possible and interfere, and why."""
        return iter(())


@dataclass(frozen=True, slots=True, eq=False)
class JointModel:
    """A joint model ``M = (P, A)`` (the paper, section 2) over the robots of one problem.

    ``labels[i]`` are robot i's labels, ``labels[i][0]`` being idle.  ``actions`` are the ground
    actions it is made of.  Every robot may always idle (joint-action PDDL says itself who idles);
    ``idling_costs[i]`` is what that adds to the second cost.  ``slack`` is how many steps more
    than the least makespan plans may take (`planners.search.optimal_plans`); ``slack_facts``, where
    states on plans say how many of them are left, are the numbers of the facts that do: none left,
    one left, and so on.  ``impossible`` says what robots can never do, for messages.
    ``is_asynchronous``: robots keep no common step, and the labels of plan spaces are events
    (`planners.search.asynchronous`).  The model of such a space has these ``events`` by label, the
    ``step_model`` whose subactions they are, and ``has_ties`` (`planners.joint.traces.Traces`).
    """

    robots: tuple[str, ...]
    labels: tuple[tuple[str, ...], ...]
    actions: tuple[GroundAction, ...]
    codec: StateCodec
    stepper: Stepper
    evaluator: Evaluator
    cost: Cost = "makespan"
    idling_costs: tuple[int, ...] = ()
    statics: frozenset[Atom] = frozenset()
    is_joint_action: bool = False
    slack: int = 0
    slack_facts: tuple[int, ...] = ()
    impossible: tuple[Impossible, ...] = ()
    is_asynchronous: bool = False
    has_ties: bool = False
    step_model: JointModel | None = None
    events: tuple[tuple[Event | None, ...], ...] = ()

    @property
    def in_step(self) -> JointModel:
        """The model of joint steps: this one, or where labels are events ``step_model``."""
        return self.step_model or self

    @property
    def unit(self) -> Literal["step", "event"]:
        """What a robot's part of a plan is made of: joint steps, or its own events."""
        return "event" if self.is_asynchronous else "step"

    @property
    def kept_plan(self) -> str:
        """What one of the plans is called in messages: an optimal one, or one within the slack."""
        steps = f"{self.slack} step{'s' * (self.slack != 1)}"
        return f"plan within {steps} of the optimum" if self.slack else "optimal plan"

    @property
    def kept_plans(self) -> str:
        """`kept_plan`, for several."""
        return self.kept_plan.replace("plan", "plans", 1)

    @property
    def without_slack(self) -> JointModel:
        """The same model, of which optimal plans are meant."""
        return replace(self, slack=0, slack_facts=())

    def forgetting_slack(self, rows: Rows) -> Rows:
        """States, one or a table, without what they say of the slack."""
        if not self.slack_facts:
            return rows
        rows = rows.copy()
        rows[..., : self.codec.fact_blocks] &= ~self.codec.mask(self.slack_facts)
        return rows

    @property
    def hides_slack(self) -> bool:
        """Whether plans have slack and states do not say how much is left: states may repeat."""
        return bool(self.slack) and not self.slack_facts

    @property
    def nodes_are_states(self) -> bool:
        """Whether no two nodes of a plan space have one state, goal and number of steps to go.

        Nodes also say what is left of hidden slack, or what robots without a common step do next.
        """
        return not (self.hides_slack or self.is_asynchronous)

    @property
    def remembers(self) -> bool:
        """Whether states remember each robot's last subaction."""
        return self.codec.memory is not None

    def smaller(self, *others: str) -> str:
        """What makes work smaller: ``others``, and a cost with fewer plans where it is not used.

        As the end of a sentence that begins with "Use".
        """
        ways = [*others, *(["--cost makespan+actions"] if self.cost == "makespan" else [])]
        return named(ways, "or")

    def successors(
        self, rows: Rows, only: Callable[[Rows, Options], Options] | None = None
    ) -> Steps:
        """All joint steps from a table of states (see `Steps`).

        ``only`` may leave out some of the robots' own choices.
        """
        facts = self.codec.facts_part(rows)
        options = only(facts, self.stepper.choices(facts)) if only else None
        base = self.stepper.steps(facts, options)
        if not self.remembers:
            return base
        result = self.codec.remembering(base.result, base.labels)
        return Steps(base.source, base.labels, result, base.cost)

    def holds(self, goal: Goal, rows: Rows) -> Bools:
        """Which states of a table satisfy a goal.  Remembered actions and slack never count."""
        if isinstance(goal, FullState):
            facts = self.codec.facts_part(self.forgetting_slack(rows))
            same: Bools = (facts == self.codec.mask(goal.facts)).all(axis=1)
            return same
        return self.evaluator.holds(goal, rows, np.arange(len(rows)))

    def state(self, atoms: Iterable[Atom]) -> Rows:
        """The row of an initial state: the fluents among ``atoms`` (statics are left out)."""
        return self.codec.encode(sorted(show(a) for a in atoms if a not in self.statics))

    def state_text(self, row: Rows) -> str:
        """A state for people: its key, if it is not empty."""
        return self.codec.key(row) or NO_FACT

    def full_state(self, row: Rows) -> FullState:
        """The goal that is this state; what it remembers, and slack, are left out."""
        return FullState(tuple(self.codec.true_facts(self.forgetting_slack(row))))

    def label_text(self, robot: int, label: int) -> str | None:
        """The text of a robot's label; None is idling."""
        return self.labels[robot][label] if label else None

    def subaction_text(self, robot: int, label: int) -> str | None:
        """The text of the subaction of a robot's label, be that an event; None is idling."""
        if not self.events:
            return self.label_text(robot, label)
        event = self.events[robot][label]
        return self.in_step.label_text(robot, event.label) if event else None

    def label_number(self, robot: int, text: str | None) -> int | None:
        """The number of a robot's label with this text (None: idling), None if there is none."""
        own = self.labels[robot]
        said = text if text in own else spelled(text)
        return own.index(said) if said in own else None

    def texts(self, labels: Sequence[int]) -> tuple[str | None, ...]:
        """Label numbers as text; None is idling."""
        return tuple(self.label_text(robot, label) for robot, label in enumerate(labels))

    def numbers(self, texts: Sequence[str | None]) -> tuple[int, ...] | None:
        """Text as label numbers, or None if some robot has no such subaction."""
        found = (self.label_number(robot, text) for robot, text in enumerate(texts))
        numbers = tuple(number for number in found if number is not None)
        return numbers if len(numbers) == len(self.labels) else None


def spelled(text: str | None) -> str:
    """The text of a label as models spell it: capitals and spaces do not matter; None is idling."""
    said = IDLE if text is None else str(text).strip().lower()
    return said if said == IDLE else "(" + " ".join(re.findall(r"[^\s()]+", said)) + ")"


def show(atom: Atom | StepAtom) -> str:
    """PDDL syntax of a ground atom."""
    return label(atom.predicate if isinstance(atom, Atom) else atom.action, atom.args)


def own_text(text: str, robot: str) -> str:
    """A subaction's text as the robot says it of itself.

    ``(pass r1 r2 ball)`` of r1 is ``pass r2 ball``, and of r2 ``pass r1 r2 ball``.

    Without the parentheses, and without the robot's name if it is the first argument: elsewhere it
    says which part the robot has.  What an event waits for follows as it is.
    """
    subaction, more, waits = text.partition(") (")
    name, *args = subaction.strip("()").split()
    if args[:1] == [robot]:
        del args[0]
    return " ".join((name, *args)) + more[1:] + waits
