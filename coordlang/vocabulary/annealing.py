# SPDX-License-Identifier: GPL-3.0-or-later
"""Local search over partitions into a given number of words: simulated annealing.

One set of moves for whatever is measured: how many plans sentences leave open
(`coordlang.vocabulary.flexible`), how often robots fail (`coordlang.vocabulary.few_words`).
Necessary clauses may be constraints: a partition may violate some on the way, at a price.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import log
from random import Random

import numpy as np

from coordlang.language.flexibility import Floats
from coordlang.language.warping import Clause
from coordlang.required.plan_table import PlanTable
from coordlang.vocabulary.clauses import without_implied
from planners.joint.tables import Ints

#: Comparisons of clauses to find which are implied.
_COMPARISONS = 1_000_000
#: Share of the moves that change the words of an orbit.
_ORBITS = 0.2
#: Values that are equal but for rounding.
EQUAL = 1e-9
#: What a move counts as, in plans measured.
_MOVE = 2_000


@dataclass(frozen=True, slots=True)
class AnnealingSettings:
    """How long a partition is annealed, and how hot.

    Heat and price are in units of what changing one word typically costs.

    Attributes
    ----------
    moves, least_moves
        Moves of the first cooling, for each pair of a state and a word, and at least.
    patience
        Coolings that find nothing better after which the search ends; one that does is followed by
        one twice as long.
    work
        Plans measured before the search ends, whatever it still finds.
    hot, cold
        Heat at the start and at the end of a cooling.
    price
        Price of a violated clause at the start.
    stage
        Moves after which the price is adapted: ``dearer`` where less than a quarter of the
        partitions violate no clause, ``cheaper`` where more than three quarters do.
    sample
        States that are changed to learn what changing one word typically costs.
    """

    moves: int = 10
    least_moves: int = 1_000
    patience: int = 3
    work: int = 60_000_000
    hot: float = 0.5
    cold: float = 0.01
    price: float = 0.5
    stage: int = 100
    dearer: float = 1.5
    cheaper: float = 0.7
    sample: int = 30


@dataclass(frozen=True, slots=True)
class Measure:
    """What is minimised.

    Attributes
    ----------
    table
        The plans by which partitions are measured.
    of_tasks
        The value of some tasks under the word of each state.
    energy
        What is minimised, from the values of all tasks.
    least
        A bound on the energy of all partitions.
    """

    table: PlanTable
    of_tasks: Callable[[Ints, Ints], Floats]
    energy: Callable[[Floats], float]
    least: float = 0.0


class Constraints:
    """Clauses, by the states that they are about.

    ``pairs`` of each clause by its number, ``of_state`` the numbers of the clauses with a state.
    """

    def __init__(self, clauses: Iterable[Clause] = ()) -> None:
        self.pairs: list[Sequence[tuple[int, int]]] = []
        self.of_state: dict[int, list[int]] = {}
        self.add(clauses)

    def __len__(self) -> int:
        return len(self.pairs)

    def add(self, clauses: Iterable[Clause]) -> None:
        """Add clauses, without those that others of them imply."""
        for clause in without_implied(clauses, _COMPARISONS):
            for state in {state for pair in clause for state in pair}:
                self.of_state.setdefault(state, []).append(len(self.pairs))
            self.pairs.append(sorted(clause))

    def violated(self, numbers: Iterable[int], word: Ints) -> set[int]:
        """Of some clauses those of which no pair has two words."""
        pairs, of = self.pairs, word.tolist()
        return {n for n in numbers if all(of[a] == of[b] for a, b in pairs[n])}


class Annealing:
    """Simulated annealing of a partition into some number of words.

    Parameters
    ----------
    states, words
        The states that need words, and how many words there are, two or more.
    measure, constraints, permutations
        What is minimised, under which clauses; where symmetries take each state.
    random, settings
        What is drawn, and how long and how hot.
    offer
        Called with every partition that violates no clause: the words, values and energy.  It may
        add clauses that the partition violates.

    Attributes
    ----------
    word, energy
        The word of each state, and what is minimised.
    moves, work
        The moves so far, and the plans measured.
    """

    def __init__(
        self,
        states: Sequence[int],
        words: int,
        measure: Measure,
        offer: Callable[[Ints, Floats, float], None],
        random: Random,
        *,
        constraints: Constraints | None = None,
        permutations: Sequence[Sequence[int]] = (),
        settings: AnnealingSettings | None = None,
    ) -> None:
        self._words, self._measure, self._offer = words, measure, offer
        self._random, self._permutations = random, permutations
        self._constraints = constraints or Constraints()
        self._settings = settings or AnnealingSettings()
        of_state = measure.table.tasks_of_state
        self._movable = [state for state in states if len(of_state[state])]
        self._states = frozenset(self._movable)
        self._every = np.arange(len(measure.table))
        self._violated: set[int] = set()
        self._values: Floats = np.zeros(0)
        self._unit = self._price = 0.0
        self.word: Ints = np.zeros(0, np.int64)
        self.energy = 0.0
        self.moves = self.work = 0

    def begin(self, word: Ints) -> None:
        """Go on from a partition."""
        if not self._unit:
            self._look_at(np.zeros_like(word))
            self._unit = self._typical_cost()
        self._look_at(word.copy())
        self._violated = self._constraints.violated(range(len(self._constraints)), word)
        self._price = self._price or self._settings.price * self._unit

    def _look_at(self, word: Ints) -> None:
        self.word = word
        self._values = self._measured(self._every)
        self.energy = self._measure.energy(self._values)

    def search(self, best: Callable[[], float], progress: Callable[[str], None]) -> Iterator[None]:
        """Cool until it does not pay any more; between coolings the caller may begin elsewhere.

        Parameters
        ----------
        best
            The energy of the best partition that counts: by it a cooling pays or not.
        progress
            Called with a line of text now and then.
        """
        settings, in_vain = self._settings, 0
        moves = max(settings.least_moves, settings.moves * len(self._movable) * self._words)
        while in_vain < settings.patience and self.work < settings.work and self._movable:
            before = best()
            self._cool(moves, progress)
            yield
            if best() < before - EQUAL:
                moves, in_vain = 2 * moves, 0
            else:
                in_vain += 1

    def _cool(self, moves: int, progress: Callable[[str], None]) -> None:
        """Cool once, in so many moves."""
        settings, feasible = self._settings, 0
        factor = (settings.cold / settings.hot) ** (1 / max(1, moves - 1))
        for number in range(moves):
            if self.work >= settings.work:
                return
            self._move(self._unit * settings.hot * factor**number)
            feasible += not self._violated
            if number % 50 == 0:
                progress(f"annealing: {number:,} of {moves:,} moves, at {self.energy:,.4f}")
            if (number + 1) % settings.stage == 0:
                if 4 * feasible < settings.stage:
                    self._price *= settings.dearer
                elif 4 * feasible > 3 * settings.stage:
                    self._price *= settings.cheaper
                feasible = 0

    def _move(self, heat: float) -> None:
        """Try a random change, and keep it if its energy and the price of its clauses allow."""
        self.moves += 1
        change = self._random_change()
        touched = {n for s in change for n in self._constraints.of_state.get(s, ())}
        old = self._replace(change)
        violated = self._constraints.violated(touched, self.word)
        # So much worse it may become (Metropolis); some of that is the price of violated clauses.
        allowed = -heat * log(1 - self._random.random())
        allowed -= self._price * (len(violated) - len(self._violated & touched))
        if self._measure.least - self.energy <= allowed:
            values = self._updated(change)
            energy = self._measure.energy(values)
            if energy - self.energy <= allowed:
                self._values, self.energy = values, energy
                self._violated = (self._violated - touched) | violated
                if not self._violated:
                    self._offer_it()
                return
        self._replace(old)

    def _offer_it(self) -> None:
        known = len(self._constraints)
        self._offer(self.word, self._values, self.energy)
        self._violated |= self._constraints.violated(
            range(known, len(self._constraints)), self.word
        )

    def _replace(self, change: Mapping[int, int]) -> dict[int, int]:
        """Give states other words; the words that they had."""
        old = {state: int(self.word[state]) for state in change}
        for state, word in change.items():
            self.word[state] = word
        return old

    def _updated(self, change: Iterable[int]) -> Floats:
        """The values after a change of some states: those of the tasks with plans through them."""
        lists = [self._measure.table.tasks_of_state[state] for state in change]
        tasks = lists[0] if len(lists) == 1 else np.unique(np.concatenate(lists))
        values = self._values.copy()
        values[tasks] = self._measured(tasks)
        return values

    def _measured(self, tasks: Ints) -> Floats:
        self.work += _MOVE + int(self._measure.table.plans[tasks].sum())
        return self._measure.of_tasks(self.word, tasks)

    def _typical_cost(self) -> float:
        """What it typically costs that one state has another word than all others."""
        costs = []
        for state in self._random.sample(
            self._movable, min(self._settings.sample, len(self._movable))
        ):
            old = self._replace(self._another_word(state))
            costs.append(abs(self._measure.energy(self._updated(old)) - self.energy))
            self._replace(old)
        return float(np.median([cost for cost in costs if cost > EQUAL] or [EQUAL]))

    def _another_word(self, state: int) -> dict[int, int]:
        word = self._random.randrange(self._words - 1)
        return {state: word + (word >= self.word[state])}

    def _random_change(self) -> dict[int, int]:
        """A new word for one state, or for the states that a symmetry takes one to."""
        state = self._random.choice(self._movable)
        if self._permutations and self._random.random() < _ORBITS:
            return self._one_word_for_orbit(state)
        return self._another_word(state)

    def _one_word_for_orbit(self, state: int) -> dict[int, int]:
        to = self._random.choice(self._permutations)
        change = self._another_word(state)
        word, image = change[state], to[state]
        while image != state:
            if image in self._states:
                change[image] = word
            image = to[image]
        return change
