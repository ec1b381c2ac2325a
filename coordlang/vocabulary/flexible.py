"""Among languages with equally many words, one whose sentences leave many plans open.

Maximises the average of E = sum_s n_s^2 / N over the candidate tasks
(`coordlang.language.flexibility`) by simulated annealing over partitions, with the clauses that
counterexamples give (`coordlang.language.warping`) as constraints.  A partition may violate clauses
on the way, at a price; one that violates none and is better than the best is searched for
counterexamples, which give new clauses with their images under the model's symmetries.  What has
none is verified by definition before it counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import exp, log
from random import Random

import numpy as np

from coordlang.language.flexibility import Flexibility, Floats, flexibility
from coordlang.language.warping import Clause, pair, separation_clause
from coordlang.required.composition_walk import walk
from coordlang.vocabulary.clauses import without_implied
from coordlang.vocabulary.counterexamples import counterexamples
from coordlang.vocabulary.flexibility_bound import flexibility_bounds
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.objective import Objective
from coordlang.vocabulary.symmetry import symmetry_group
from planners.errors import OutOfMemory
from planners.limits import run_until_stopped
from planners.search.edge_index import EdgeIndex
from planners.search.plan_space import PlanSpace
from planners.tables import Bools, Ints

#: Moves of the first cooling, for each state and word and at least; each cooling that pays is
#: followed by one twice as long.
_MOVES, _LEAST = 10, 1_000
#: Coolings without a better language before the search ends, and what counts as better.
_PATIENCE, _BETTER = 3, 1.001
#: From hot to cold, in units of what changing one word typically changes.
_HOT, _COLD, _PRICE = 0.3, 0.01, 0.5
#: States whose cost is measured for that.
_SAMPLE = 40
#: Moves after which the price of a violated clause is adapted, and by what factors.
_STAGE, _DEARER, _CHEAPER = 250, 1.3, 0.9
#: Stages after which a better partition is verified by definition.
_VERIFY = 8
#: Counterexamples taken at a time, from so many tasks at most.
_MOST, _TASKS = 200, 1_500
#: Edges summed over before the search ends, whatever it still finds (and what a move costs
#: besides).
_WORK, _MOVE = 600_000_000, 2_000


def flexible(job: Job, found: Outcome) -> Outcome:
    """A language with as many words as ``found`` has, at least as flexible.

    Its bound on the number of words is kept.

    Anytime: out of time or memory, or interrupted, the best verified language so far is returned,
    with the error in ``stopped``.  ``figures`` then also hold ``flexibility`` (plans left open,
    averaged over tasks), ``flexibility_before`` (that of ``found``), ``flexibility_bound`` (which
    no language exceeds) and ``communication_saving``.
    """
    search = _Search(job, found)
    stopped = run_until_stopped(search.run)
    return search.outcome(stopped)


class _Search:
    """``best`` is the most flexible partition that was verified."""

    def __init__(self, job: Job, found: Outcome) -> None:
        self._job, self._found = job, found
        self.best: Assignment = found.partition
        self._bound: Floats | None = None
        self._moves = self._better = 0

    def outcome(self, stopped: BaseException | None) -> Outcome:
        figures = {
            **self._found.figures,
            "moves": self._moves,
            "improvements": self._better,
            **self._measures(),
        }
        return Outcome(self.best, self._found.lower_bound, figures, stopped, self._found.evidence)

    def _measures(self) -> dict[str, float]:
        """What is known of the flexibility.

        Nothing where there are too many sentences to measure it.
        """
        try:
            before, after = (
                _measured(self._job, partition) for partition in (self._found.partition, self.best)
            )
        except OutOfMemory:
            return {}
        bound = (
            float(self._bound.mean())
            if self._bound is not None
            else sum(after.plans) / len(after.plans)
        )
        return {
            "flexibility": after.value,
            "flexibility_first_plan": float(after.first.mean()),
            "flexibility_before": before.value,
            "flexibility_bound": bound,
            "communication_saving": float(after.saving.mean()),
        }

    def run(self) -> None:
        job = self._job
        spaces = job.candidates.spaces
        requires = [walk(space).requires for space in spaces]
        self._bound = flexibility_bounds(spaces, requires)
        words = self._found.size
        if words < 2:
            return
        clauses = _Clauses(job, requires)
        for clause in self._found.evidence:
            clauses.add(clause)
        annealing = _Annealing(job, clauses, words, self._bound, self._verified)
        annealing.begin(self.best)
        length, stale = max(_LEAST, _MOVES * len(job.states) * words), 0
        most = float(self._bound.mean())
        while (
            stale < _PATIENCE
            and annealing.work < _WORK
            and annealing.best_value < most * (1 - 1e-9)
        ):
            before = annealing.best_value
            for share in annealing.cool(length):
                self._moves = annealing.moves
                job.progress(
                    f"{words} words leave {annealing.best_value:,.2f} of at most {most:,.2f} "
                    "plans open: "
                    f"cooling {100 * share:.0f} %, {annealing.moves:,} moves, {len(clauses):,} "
                    "clauses"
                )
            if annealing.best_value > _BETTER * before:
                length, stale = 2 * length, 0
            else:
                stale += 1

    def _verified(self, word: Ints) -> None:
        partition = {state: int(word[state]) for state in self._job.states}
        self._job.check(partition)
        self.best = partition
        self._better += 1


class _Clauses:
    """Clauses that every language satisfies, and which of them a partition violates."""

    def __init__(self, job: Job, requires: Sequence[Bools]) -> None:
        self.symmetries = symmetry_group(job.candidates).permutations
        self._parts = _parts(job.candidates.spaces, requires)
        self._position = 0
        self._known: set[Clause] = set()
        self.pairs: list[tuple[tuple[int, int], ...]] = []
        self.of_state: dict[int, list[int]] = {state: [] for state in job.states}

    def __len__(self) -> int:
        return len(self.pairs)

    def add(self, clause: Clause) -> None:
        """A clause with its images."""
        images = (frozenset(pair(s[a], s[b]) for a, b in clause) for s in self.symmetries)
        for image in (clause, *images):
            if image in self._known:
                continue
            self._known.add(image)
            for state in sorted({state for states in image for state in states}):
                self.of_state[state].append(len(self.pairs))
            self.pairs.append(tuple(sorted(image)))

    def violated(self, number: int, word: Sequence[int]) -> bool:
        return all(word[a] == word[b] for a, b in self.pairs[number])

    def refute(self, word: Ints) -> bool:
        """Look for counterexamples and add their clauses; False if there is none."""
        words = word.tolist()
        for _ in self._parts:
            space, index, starts = self._parts[self._position]
            found = {
                separation_clause(example.states, words)
                for example in counterexamples(space, index, word[space.state], _MOST, starts)
            }
            if found:
                for clause in without_implied(clause for clause in found if clause):
                    self.add(clause)
                return True
            self._position = (self._position + 1) % len(self._parts)
        return False


class _Annealing:
    """Simulated annealing: the energy is the flexibility less the price of violated clauses."""

    def __init__(
        self,
        job: Job,
        clauses: _Clauses,
        words: int,
        bound: Floats,
        verified: Callable[[Ints], None],
    ) -> None:
        self._states, self._clauses, self._words, self._bound = job.states, clauses, words, bound
        self._verified = verified
        self._random = Random(job.seed)
        self._symmetries = clauses.symmetries
        self._objective = Objective(job.candidates.spaces, words)
        self._word = np.zeros(len(job.candidates.rows), np.int64)
        self._of: list[int] = []
        self._expected = np.zeros(0)
        self._violated: set[int] = set()
        self._pending: Ints | None = None
        self.value = self.best_value = 0.0
        self.moves = 0
        self._typical = self._price = 0.0

    @property
    def work(self) -> int:
        return self._objective.edges + _MOVE * self.moves

    def begin(self, partition: Assignment) -> None:
        """Start from a language."""
        self._word[list(partition)] = list(partition.values())
        self._of = self._word.tolist()
        self._expected = self._objective.expected(self._word)
        self.value = self.best_value = float(self._expected.mean())
        self._violated = {
            n for n in range(len(self._clauses)) if self._clauses.violated(n, self._of)
        }
        self._typical = self._cost_of_one_state()
        self._price = _PRICE * self._typical

    def _cost_of_one_state(self) -> float:
        """What it typically costs that one state has another word than all others.

        The unit of heat and price.
        """
        word = np.zeros_like(self._word)
        most = self._objective.expected(word)
        costs = []
        for state in self._random.sample(self._states, min(_SAMPLE, len(self._states))):
            word[state] = 1
            costs.append(float((most - self._objective.update(most, word, [state])).mean()))
            word[state] = 0
        return max(float(np.median(costs)), 1e-3 * self.value)

    def _other(self, state: int) -> int:
        word = self._random.randrange(self._words - 1)
        return word + (word >= self._of[state])

    def _put(self, change: Mapping[int, int]) -> dict[int, int]:
        old = {state: self._of[state] for state in change}
        for state, word in change.items():
            self._of[state] = word
            self._word[state] = word
        return old

    def cool(self, moves: int) -> Iterator[float]:
        """One cooling of so many moves; yields the share that is done."""
        rate = log(_COLD / _HOT)
        feasible = 0
        for number in range(moves):
            heat = _HOT * self._typical * exp(rate * number / moves)
            self._move(heat)
            feasible += not self._violated
            if number % _STAGE == _STAGE - 1 or number == moves - 1:
                if 4 * feasible < _STAGE:
                    self._price *= _DEARER
                elif 4 * feasible > 3 * _STAGE:
                    self._price *= _CHEAPER
                feasible = 0
                last = number == moves - 1
                if self._pending is not None and (
                    last or number % (_VERIFY * _STAGE) == _VERIFY * _STAGE - 1
                ):
                    self._verified(self._pending)
                    self._pending = None
                yield number / moves

    def _move(self, heat: float) -> None:
        self.moves += 1
        change = self._draw()
        if not change:
            return
        touched = {n for state in change for n in self._clauses.of_state[state]}
        old = self._put(change)
        violated = {n for n in touched if self._clauses.violated(n, self._of)}
        more = len(violated) - len(self._violated & touched)
        least = self.value + heat * log(1 - self._random.random()) + self._price * more
        expected = self._expected
        value = -1.0
        if self.value + self._objective.room(self._expected, self._bound, list(change)) >= least:
            expected = self._objective.update(self._expected, self._word, list(change))
            value = float(expected.mean())
        if value < least:
            self._put(old)
            return
        self._expected, self.value = expected, value
        self._violated = (self._violated - touched) | violated
        if not self._violated and value > self.best_value * (1 + 1e-9):
            self._consider()

    def _consider(self) -> None:
        known = len(self._clauses)
        if self._clauses.refute(self._word):
            fresh = range(known, len(self._clauses))
            self._violated |= {n for n in fresh if self._clauses.violated(n, self._of)}
        else:
            self.best_value, self._pending = self.value, self._word.copy()

    def _draw(self) -> dict[int, int]:
        """A random change of one state, of a state and its images, or of two states.

        One state, the states that a symmetry takes one to, or two states exchange their words.
        """
        kind = self._random.random()
        state = self._random.choice(self._states)
        if kind < 0.6 or (kind < 0.8 and not self._symmetries):
            return {state: self._other(state)}
        if kind < 0.8:
            symmetry = self._random.choice(self._symmetries)
            word = self._random.randrange(self._words)
            orbit, at = [state], symmetry[state]
            while at != state:
                orbit.append(at)
                at = symmetry[at]
            return {s: word for s in orbit if self._of[s] != word and s in self._clauses.of_state}
        asking = self._clauses.of_state[state]
        if not asking:
            return {state: self._other(state)}
        pairs = self._clauses.pairs[self._random.choice(asking)]
        others = sorted({s for p in pairs for s in p if self._of[s] != self._of[state]})
        if not others:
            return {state: self._other(state)}
        other = self._random.choice(others)
        return {state: self._of[other], other: self._of[state]}


def _measured(job: Job, partition: Assignment) -> Flexibility:
    word = np.zeros(len(job.candidates.rows), np.int64)
    word[list(partition)] = list(partition.values())
    return flexibility(
        job.candidates.spaces, [word[space.state] for space in job.candidates.spaces]
    )


def _parts(
    spaces: Sequence[PlanSpace], requires: Sequence[Bools]
) -> list[tuple[PlanSpace, EdgeIndex, Ints]]:
    """The tasks that require coordination, in parts.

    The parts are searched for counterexamples one after the other.
    """
    parts = []
    for space, required in zip(spaces, requires, strict=True):
        index = EdgeIndex.of(space)
        starts = np.unique(space.starts[required[space.starts]])
        count = 1 + len(starts) // _TASKS
        parts += [
            (space, index, mine)
            for n in range(count)
            if len(mine := starts[space.goal[starts] % count == n])
        ]
    return parts
