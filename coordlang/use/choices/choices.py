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

from coordlang.use.choices.automaton import Automaton, determinise
from coordlang.use.choices.mixtures import Mixtures, walk_mixtures
from coordlang.use.choices.own_facts import OwnFacts, with_own_facts
from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import OutOfMemory
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace

#: Combinations of the robots' moves beyond which exact knowledge is not tried, unless it was asked
#: for.
MOST = 2_000_000

#: How what is known in an automaton's states was found: over every combination of all robots'
#: choices, or from the robot's own subactions alone.
Atoms = Literal["exact", "own"]


@dataclass(frozen=True, slots=True)
class RobotChoices:
    """One robot's choices.

    An automaton that accepts its subplans, and says what the robot knows in each state.
    """

    robot: int
    automaton: Automaton
    atoms: Atoms


@dataclass(frozen=True, slots=True)
class Choices:
    """All robots' choices under one sentence (``words``: word numbers) of one task.

    ``fits`` are the plans with the sentence.  ``mixtures`` holds every combination of the choices,
    or is None where there are too many to walk.
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
        return self.task_language.covered if self.mixtures is None else self.mixtures.holds


def choices(
    task_language: TaskLanguage,
    words: Sequence[int],
    index: EdgeIndex | None = None,
    most: int | None = MOST,
) -> Choices:
    """The choices of every robot under a sentence.

    What is known in a state is exact (`coordlang.use.choices.automaton.determinise`) where all
    combinations of choices can be walked with at most ``most`` joint moves (None: as many as the
    memory holds) and all of them are optimal.  Elsewhere only the atoms are known that the robot's
    own subactions alone change.

    ``index``: see `coordlang.use.choices.mixtures.mix`.  Raises
    `coordlang.use.sentence.fitting_plans.NoPlanFits`, and `OutOfMemory` if the automata, or with
    ``most=None`` the combinations, do not fit into the memory.
    """
    fits = task_language.plans_with(words)
    robots = range(len(task_language.model.robots))
    plain = [determinise(fits, robot) for robot in robots]
    try:
        mixtures = walk_mixtures(task_language, fits, plain, words, index, most)
    except OutOfMemory:
        if most is None:
            raise
        mixtures = None
    own = tuple(
        _with_knowledge(task_language, plain[robot], robot, mixtures, most) for robot in robots
    )
    return Choices(task_language, tuple(words), fits, own, mixtures)


def _with_knowledge(
    task_language: TaskLanguage,
    plain: Automaton,
    robot: int,
    mixtures: Mixtures | None,
    most: int | None,
) -> RobotChoices:
    if mixtures is not None and mixtures.space is not None:
        with suppress(OutOfMemory):  # the combinations are checked all the same
            return RobotChoices(
                robot, determinise(mixtures.space, robot, _truth(mixtures.space), most), "exact"
            )
    own = OwnFacts.of(task_language.model, robot)
    start = _bits(task_language.space, int(task_language.space.state[task_language.start]))
    return RobotChoices(robot, with_own_facts(plain, own, start), "own")


def _truth(space: PlanSpace) -> dict[int, int]:
    """The true facts of each state that the space passes through, as bits."""
    return {state: _bits(space, state) for state in set(space.state.tolist())}


def _bits(space: PlanSpace, state: int) -> int:
    words = space.rows[state][: space.model.codec.fact_blocks]
    return int.from_bytes(words.astype("<u8").tobytes(), "little")
