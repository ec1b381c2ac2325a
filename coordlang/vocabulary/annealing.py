# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated annealing over partitions, with necessary clauses as constraints.

The energy is the flexibility less the price of violated clauses.  A partition may violate clauses
on the way; one that violates none and is better than the best is searched for counterexamples,
which give new clauses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp, log
from random import Random

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.language.warping import Clause
from coordlang.symmetry.group import SymmetryGroup
from coordlang.vocabulary.clauses import without_implied
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.necessary_clauses import TaskPart
from coordlang.vocabulary.objective import Objective
from planners.joint.tables import Ints


@dataclass(frozen=True, slots=True)
class AnnealingSettings:
    """How long a partition is annealed, how hot, and what else is left to choice.

    Heat and price are in units of what changing one word typically costs.

    Attributes
    ----------
    moves, least_moves
        Moves of the first cooling, for each pair of a state and a word, and at least.
    patience
        Coolings without a better language after which the search ends; a cooling that pays is
        followed by one twice as long.
    better
        By what factor a language must be more flexible for its cooling to pay.
    hot, cold
        Heat at the start and at the end of a cooling.
    price
        Price of a violated clause at the start.
    sample
        States that are changed to learn what changing one word typically costs.
    stage
        Moves after which the price is adapted: ``dearer`` where less than a quarter of the
        partitions violate no clause, ``cheaper`` where more than three quarters do.
    stages_unverified
        Stages after which a better partition is verified by definition.
    tasks_of_a_part
        Tasks that are searched for counterexamples together, about so many.
    work, work_of_a_move
        Edges summed over before the search ends, whatever it still finds; a move counts as so many
        besides.
    """

    moves: int = 10
    least_moves: int = 1_000
    patience: int = 3
    better: float = 1.001
    hot: float = 0.3
    cold: float = 0.01
    price: float = 0.5
    sample: int = 40
    stage: int = 250
    dearer: float = 1.3
    cheaper: float = 0.9
    stages_unverified: int = 8
    tasks_of_a_part: int = 1_500
    work: int = 600_000_000
    work_of_a_move: int = 2_000


class Violations:
    """Necessary clauses with their images, and which of them a partition violates.

    ``pairs`` of each clause by its number, ``of_state`` the numbers of the clauses with a state.
    """

    def __init__(
        self, states: Sequence[int], parts: Sequence[TaskPart], group: SymmetryGroup
    ) -> None:
        self.group = group
        self._parts = parts
        self._current = 0
        self._known: set[Clause] = set()
        self.pairs: list[tuple[tuple[int, int], ...]] = []
        self.of_state: dict[int, list[int]] = {state: [] for state in states}

    def __len__(self) -> int:
        return len(self.pairs)

    def add(self, clause: Clause) -> None:
        """Add a clause with its images."""
        for image in (clause, *(image for image, _ in self.group.images(clause))):
            if image in self._known:
                continue
            self._known.add(image)
            for state in sorted({state for states in image for state in states}):
                self.of_state[state].append(len(self.pairs))
            self.pairs.append(tuple(sorted(image)))

    def violated(self, number: int, word: Sequence[int]) -> bool:
        """Whether a partition (word of each state number) violates a clause."""
        for a, b in self.pairs[number]:  # noqa: SIM110 - the inner loop, and `all` is slower
            if word[a] != word[b]:
                return False
        return True

    def add_counterexamples(self, word: Ints) -> bool:
        """Look for counterexamples to a partition and add their clauses; False if there is none."""
        for _ in self._parts:
            found = self._parts[self._current].violated(word)
            if found:
                for clause in without_implied(found):
                    self.add(clause)
                return True
            self._current = (self._current + 1) % len(self._parts)
        return False


class Annealing:
    """Simulated annealing of a partition into a fixed number of words.

    Parameters
    ----------
    job
        Its states, plan spaces and seed are used.
    violations
        The necessary clauses that are known; new ones are added.
    words
        The number of words.
    bound
        (tasks) what no language exceeds.
    verified
        Called with the words (states) of a better language, in the end and now and then.
    """

    def __init__(
        self,
        job: Job,
        violations: Violations,
        words: int,
        bound: Floats,
        verified: Callable[[Ints], None],
        settings: AnnealingSettings,
    ) -> None:
        self._states, self._violations, self._words = job.states, violations, words
        self._bound, self._verified, self._settings = bound, verified, settings
        self._random = Random(job.seed)
        self._permutations = violations.group.permutations
        self._objective = Objective(job.candidates.spaces, words)
        self._word = np.zeros(len(job.candidates.rows), np.int64)
        #: The same as a list, which is quicker to ask for single words.
        self._word_list: list[int] = []
        self._expected = np.zeros(0)
        self._violated: set[int] = set()
        self._pending: Ints | None = None
        self.value = self.best_value = 0.0
        self.moves = 0
        self._typical_cost = self._price = 0.0

    @property
    def work(self) -> int:
        """The work done, in edges summed over."""
        return self._objective.edges + self._settings.work_of_a_move * self.moves

    def begin(self, partition: Assignment) -> None:
        """Start from a language."""
        self._word[list(partition)] = list(partition.values())
        self._word_list = self._word.tolist()
        self._expected = self._objective.expected(self._word)
        self.value = self.best_value = float(self._expected.mean())
        self._violated = self._violated_among(range(len(self._violations)))
        self._typical_cost = self._cost_of_one_state()
        self._price = self._settings.price * self._typical_cost

    def cool(self, moves: int) -> Iterator[float]:
        """Cool once, in so many moves; yields the share that is done."""
        settings = self._settings
        rate = log(settings.cold / settings.hot)
        feasible = 0
        for number in range(moves):
            self._move(settings.hot * self._typical_cost * exp(rate * number / moves))
            feasible += not self._violated
            last = number == moves - 1
            if not last and (number + 1) % settings.stage:
                continue
            self._adapt_price(feasible)
            feasible = 0
            if last or (number + 1) % (settings.stages_unverified * settings.stage) == 0:
                self._verify_pending()
            yield number / moves

    def _adapt_price(self, feasible: int) -> None:
        """After a stage, so many of whose partitions violated no clause."""
        settings = self._settings
        if 4 * feasible < settings.stage:
            self._price *= settings.dearer
        elif 4 * feasible > 3 * settings.stage:
            self._price *= settings.cheaper

    def _verify_pending(self) -> None:
        if self._pending is not None:
            self._verified(self._pending)
            self._pending = None

    def _cost_of_one_state(self) -> float:
        """What it typically costs that one state has another word than all others."""
        word = np.zeros_like(self._word)
        most = self._objective.expected(word)
        costs = []
        for state in self._random.sample(
            self._states, min(self._settings.sample, len(self._states))
        ):
            word[state] = 1
            costs.append(float((most - self._objective.update(most, word, [state])).mean()))
            word[state] = 0
        return max(float(np.median(costs)), 1e-3 * self.value)

    def _violated_among(self, clauses: Iterable[int]) -> set[int]:
        violated, word = self._violations.violated, self._word_list
        return {number for number in clauses if violated(number, word)}

    def _change_words(self, change: Mapping[int, int]) -> dict[int, int]:
        """Give states other words; the words that they had."""
        old = {state: self._word_list[state] for state in change}
        for state, word in change.items():
            self._word_list[state] = word
            self._word[state] = word
        return old

    def _move(self, heat: float) -> None:
        """Try a random change, and keep it if the energy allows."""
        self.moves += 1
        change = self._random_change()
        if not change:
            return
        touched = {n for state in change for n in self._violations.of_state[state]}
        old = self._change_words(change)
        violated = self._violated_among(touched)
        more = len(violated) - len(self._violated & touched)
        least = self.value + heat * log(1 - self._random.random()) + self._price * more
        expected = self._expected
        value = -1.0
        if self.value + self._objective.room(self._expected, self._bound, list(change)) >= least:
            expected = self._objective.update(self._expected, self._word, list(change))
            value = float(expected.mean())
        if value < least:
            self._change_words(old)
            return
        self._expected, self.value = expected, value
        self._violated = (self._violated - touched) | violated
        if not self._violated and value > self.best_value * (1 + 1e-9):
            self._look_for_counterexamples()

    def _look_for_counterexamples(self) -> None:
        """To a partition better than the best that violates no clause so far."""
        known = len(self._violations)
        if self._violations.add_counterexamples(self._word):
            self._violated |= self._violated_among(range(known, len(self._violations)))
        else:
            self.best_value, self._pending = self.value, self._word.copy()

    def _random_change(self) -> dict[int, int]:
        """New words: for one state, for the states that a symmetry takes one to, or for two.

        Two states exchange their words, one of them in a clause with the other or its partner.
        """
        kind = self._random.random()
        state = self._random.choice(self._states)
        if kind < 0.6 or (kind < 0.8 and not self._permutations):
            return self._another_word(state)
        return self._one_word_for_orbit(state) if kind < 0.8 else self._exchange(state)

    def _another_word(self, state: int) -> dict[int, int]:
        word = self._random.randrange(self._words - 1)
        return {state: word + (word >= self._word_list[state])}

    def _one_word_for_orbit(self, state: int) -> dict[int, int]:
        to = self._random.choice(self._permutations)
        word = self._random.randrange(self._words)
        orbit, image = [state], to[state]
        while image != state:
            orbit.append(image)
            image = to[image]
        states = self._violations.of_state.keys()
        return {s: word for s in orbit if self._word_list[s] != word and s in states}

    def _exchange(self, state: int) -> dict[int, int]:
        clauses = self._violations.of_state[state]
        if not clauses:
            return self._another_word(state)
        word = self._word_list
        pairs = self._violations.pairs[self._random.choice(clauses)]
        others = sorted({s for p in pairs for s in p if word[s] != word[state]})
        if not others:
            return self._another_word(state)
        other = self._random.choice(others)
        return {state: word[other], other: word[state]}
