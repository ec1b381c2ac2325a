# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's choices: exactly the subplans that it may follow under a sentence.

Whatever the others choose from theirs.

The optimal plans with one sentence are RC-free, so every combination of one own subplan for each
robot is an optimal plan. Robot i's subplans are therefore the own parts of those plans, no more and
no fewer.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

from coordlang.execution.automaton import Automaton, determinise
from coordlang.execution.mixtures import Mixtures, walk_mixtures
from coordlang.execution.own_facts import OwnFacts, with_own_facts
from coordlang.execution.task_language import TaskLanguage
from planners.search.plan_space import PlanSpace
from planners.system.errors import OutOfMemory

#: Combinations of the robots' moves beyond which exact knowledge is not tried by default.
MOST = 2_000_000

#: How what is known in an automaton's states was found: over every combination of all robots'
#: choices, or from the robot's own subactions alone.
Atoms = Literal["exact", "own"]


@dataclass(frozen=True, slots=True)
class RobotChoices:
    """One robot's choices.

    Parameters
    ----------
    robot
        The robot's number.
    automaton
        Accepts its subplans, and has for each state what the robot knows there.
    atoms
        How this knowledge was found.
    """

    robot: int
    automaton: Automaton
    atoms: Atoms


@dataclass(frozen=True, slots=True)
class SentenceChoices:
    """All robots' choices under one sentence of one task.

    Parameters
    ----------
    task_language
        The language and the task.
    words
        The word numbers of the sentence.
    fits
        The plans with the sentence.
    robots
        Each robot's choices.
    mixtures
        Every combination of the choices; None where there are too many to walk.
    """

    task_language: TaskLanguage
    words: tuple[int, ...]
    fits: PlanSpace
    robots: tuple[RobotChoices, ...]
    mixtures: Mixtures | None

    @property
    def guaranteed(self) -> bool:
        """Whether every combination is optimal.

        Proved by walking them all, or else by the language's own guarantee.
        """
        return self.task_language.guaranteed if self.mixtures is None else self.mixtures.holds

    def of(self, robots: Sequence[int] | None) -> tuple[RobotChoices, ...]:
        """The choices of the robots with these numbers; of all robots for None."""
        return self.robots if robots is None else tuple(self.robots[robot] for robot in robots)


def choices(
    task_language: TaskLanguage,
    words: Sequence[int],
    most: int | None = MOST,
) -> SentenceChoices:
    """The choices of every robot under a sentence.

    What is known in a state is exact (`coordlang.execution.automaton.determinise`) where all
    combinations of choices can be walked with at most ``most`` joint moves and all of them are
    optimal.  Elsewhere only the atoms are known that the robot's own subactions alone change.

    Parameters
    ----------
    task_language
        The language and the task.
    words
        The word numbers of the sentence.
    most
        The most joint moves of a walk; None: as many as the memory holds.

    Raises
    ------
    NoPlanFits
        If no optimal plan has the sentence.
    OutOfMemory
        If the automata, or with ``most=None`` the combinations, do not fit into the memory.
    """
    fits = task_language.plans_with(words)
    subplans = [determinise(fits, robot) for robot in range(len(task_language.model.robots))]
    try:
        mixtures = walk_mixtures(task_language, fits, subplans, words, most)
    except OutOfMemory:
        if most is None:
            raise
        mixtures = None
    robots = tuple(
        _with_knowledge(task_language, automaton, robot, mixtures, most)
        for robot, automaton in enumerate(subplans)
    )
    return SentenceChoices(task_language, tuple(words), fits, robots, mixtures)


def _with_knowledge(
    task_language: TaskLanguage,
    automaton: Automaton,
    robot: int,
    mixtures: Mixtures | None,
    most: int | None,
) -> RobotChoices:
    """A robot's subplans with what it knows on the way."""
    if mixtures is not None and mixtures.space is not None:
        with suppress(OutOfMemory):  # the combinations are checked all the same
            exact = determinise(mixtures.space, robot, _truth(mixtures.space), most)
            return RobotChoices(robot, exact, "exact")
    own = OwnFacts.of(task_language.model, robot)
    space = task_language.space
    start = space.model.codec.fact_bits(space.rows[space.state[task_language.start]])
    return RobotChoices(robot, with_own_facts(automaton, own, start), "own")


def _truth(space: PlanSpace) -> dict[int, int]:
    """The true facts of each state that the space passes through, as bits."""
    codec = space.model.codec
    return {state: codec.fact_bits(space.rows[state]) for state in set(space.state.tolist())}
