"""Partitions into K words under clauses "one of these pairs must be separated", by SAT."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from coordlang.language.warping import Clause, Pair, pair

Requirement = TypeVar("Requirement")

#: Conflicts after which the solver comes back.
_SLICE = 2_000
#: A problem starts afresh when it has so many times the requirements that it started with.
_GROWN = 2


class PartitionProblem:
    """An incremental SAT problem.

    Give each of ``states`` one of ``size`` words so that every clause holds.

    Variables: state has word, pair is separated.  Words are interchangeable; the symmetry is broken
    by the order of ``states``: a state may take word w only if an earlier state has word w - 1.
    """

    def __init__(self, states: Sequence[int], size: int, solver: str = "cadical153") -> None:
        from pysat.solvers import Solver

        self.size = size
        self._states = list(states)
        self._last = 0
        self._solver = Solver(name=solver)
        self._word = {s: [self._new() for _ in range(size)] for s in self._states}
        self._separated: dict[Pair, int] = {}
        self._defined: set[Pair] = set()
        self._all: dict[Clause, int] = {}
        for state in self._states:
            self._one_word(self._word[state])
        self._break_symmetry()

    def add(self, clause: Iterable[Pair]) -> None:
        """Require that one of these pairs of states lies in different words."""
        self._solver.add_clause([self._separate(p) for p in sorted(clause)])

    def choose(self, alternatives: Sequence[Clause]) -> None:
        """Require that all pairs of one of these sets lie in different words."""
        if len(alternatives) == 1:
            for states in sorted(alternatives[0]):
                self.add([states])
            return
        self._solver.add_clause([self._all_separate(pairs) for pairs in alternatives])

    def add_lex_leaders(self, symmetries: Sequence[Sequence[int]], pairs: Sequence[Pair]) -> None:
        """A lex-leader constraint over so many ``pairs``, to break symmetry.

        Of partitions that are images of each other, allow the one that separates the first of
        ``pairs`` (and of such the one that separates the second, ..).

        ``symmetries`` map states to states.  No proof is lost if every requirement's images are
        required as well.
        """
        for symmetry in symmetries:
            # A variable: a partition and its image agree on all pairs so far (0: none yet).
            equal = 0
            for states in pairs:
                image = pair(*(symmetry[s] for s in states))
                if image == states:
                    continue
                here, there = self._differ(states), self._differ(image)
                before = [-equal] if equal else []
                self._solver.add_clause([*before, here, -there])
                equal = self._new()
                self._solver.add_clause([*before, here, there, equal])
                self._solver.add_clause([*before, -here, -there, equal])

    def solve(self, conflicts: int | None = None) -> dict[int, int] | None:
        """A partition (state -> word), or None if there is none.

        A proof that ``size`` words do not suffice.

        Raises `Undecided` after about so many ``conflicts`` of the solver.
        """
        if not solved(self._solver, conflicts=conflicts):
            return None
        true = {v for v in self._solver.get_model() if v > 0}
        return {s: next(w for w, v in enumerate(own) if v in true) for s, own in self._word.items()}

    def delete(self) -> None:
        """Free the solver."""
        self._solver.delete()

    def _new(self) -> int:
        self._last += 1
        return self._last

    def _one_word(self, variables: list[int]) -> None:
        self._solver.add_clause(variables)
        for n, b in enumerate(variables):
            for a in variables[:n]:
                self._solver.add_clause([-a, -b])

    def _separate(self, states: Pair) -> int:
        if states not in self._separated:
            variable = self._separated[states] = self._new()
            for a, b in zip(*(self._word[s] for s in states), strict=True):
                self._solver.add_clause([-variable, -a, -b])
        return self._separated[states]

    def _differ(self, states: Pair) -> int:
        """As `_separate`, but the variable is false too if both states have one word."""
        variable = self._separate(states)
        if states not in self._defined:
            self._defined.add(states)
            for a, b in zip(*(self._word[s] for s in states), strict=True):
                self._solver.add_clause([variable, -a, b])
                self._solver.add_clause([variable, a, -b])
        return variable

    def _all_separate(self, pairs: Clause) -> int:
        if pairs not in self._all:
            variable = self._all[pairs] = self._new()
            for states in sorted(pairs):
                self._solver.add_clause([-variable, self._separate(states)])
        return self._all[pairs]

    def _break_symmetry(self) -> None:
        used: list[int] = []  # used[w]: some state so far has word w
        for state in self._states:
            own = self._word[state]
            if not used:
                self._solver.add_clause([own[0]])
                used = [own[0], *(self._new() for _ in range(1, self.size))]
                for variable in used[1:]:
                    self._solver.add_clause([-variable])
                continue
            for word in range(1, self.size):
                self._solver.add_clause([-own[word], used[word - 1]])
            after = [used[0]]
            for word in range(1, self.size):
                now = self._new()
                self._solver.add_clause([-now, used[word], own[word]])
                self._solver.add_clause([now, -used[word]])
                self._solver.add_clause([now, -own[word]])
                after.append(now)
            used = after


class PartitionProblems(Generic[Requirement]):
    """The colouring problem of each number of words, kept as long as it is undecided.

    A solver goes on where it stopped.

    ``start`` makes a problem with all requirements that are known; ``require`` adds one.
    """

    def __init__(
        self,
        start: Callable[[int, Sequence[Requirement]], PartitionProblem],
        require: Callable[[PartitionProblem, Requirement], None],
    ) -> None:
        self._start, self._require = start, require
        self._kept: dict[int, _Kept] = {}

    def of(self, size: int, known: Sequence[Requirement]) -> PartitionProblem:
        """The problem with ``size`` words under all ``known`` requirements, a list that only grows.

        When it has grown much, the problem starts afresh: the order of its states was that of few
        requirements.
        """
        kept = self._kept.get(size)
        if kept is None or len(known) > _GROWN * kept.first:
            self.drop(size)
            kept = self._kept[size] = _Kept(self._start(size, known), len(known), len(known))
        for requirement in known[kept.given :]:
            self._require(kept.colouring, requirement)
        kept.given = len(known)
        return kept.colouring

    def drop(self, size: int) -> None:
        """Free the problem with this number of words."""
        if (kept := self._kept.pop(size, None)) is not None:
            kept.colouring.delete()

    def drop_all(self) -> None:
        """Free all problems."""
        for size in list(self._kept):
            self.drop(size)


@dataclass(slots=True)
class _Kept:
    colouring: PartitionProblem
    first: int
    given: int


class Undecided(Exception):
    """The effort allowed was used up.

    A number of words is not decided yet, and others may be easier.
    """


def solved(solver: Any, assumptions: Sequence[int] = (), conflicts: int | None = None) -> bool:
    """Whether a python-sat solver's clauses can be satisfied.

    Raises `Undecided` after so many ``conflicts``.

    In slices: the solver hears no signal (time limit, Ctrl-C), so it must come back now and then.
    """
    spent = 0
    while conflicts is None or spent < conflicts:
        solver.conf_budget(_SLICE)
        try:
            answer = solver.solve_limited(assumptions=list(assumptions))
        except (
            Exception
        ) as error:  # python-sat catches SIGINT itself and raises an error of its own
            if "interrupt" in str(error).lower():
                raise KeyboardInterrupt from None
            raise
        if answer is not None:
            return bool(answer)
        spent += _SLICE
    raise Undecided


def close_bounds(
    bounds: Callable[[], tuple[int, int]], decide: Callable[[int, SolverBudget], bool]
) -> None:
    """Decide numbers of words until the bounds (proved to be needed, known to suffice) meet.

    From below as long as that is quick; what is slow is first closed in from above, to have a good
    language early. ``decide`` moves a bound, or returns False when the effort was not enough, which
    then is doubled.
    """
    effort = SolverBudget()
    while (span := bounds())[0] < span[1]:
        lower, upper = span
        if decide(lower, effort):
            continue
        middle = (lower + upper) // 2
        if middle == lower or not decide(middle, effort):
            effort = SolverBudget(2 * effort.rounds, 2 * effort.conflicts)


@dataclass(frozen=True, slots=True)
class SolverBudget:
    """What may be spent on one number of words: partitions refuted, and conflicts for each."""

    rounds: int = 60
    conflicts: int = 30_000


def reduce(clauses: Iterable[Clause], most: int = sys.maxsize) -> list[Clause]:
    """The clauses that no other one implies (a subset of its pairs), shortest first.

    After ``most`` comparisons of clauses the longer ones are left as they are.
    """
    kept: list[Clause] = []
    compared = 0
    # A kept clause stands under one of its pairs: what it implies has that pair as well.
    by_pair: dict[Pair, list[Clause]] = {}
    for clause in sorted(set(clauses), key=lambda c: (len(c), sorted(c))):
        if compared < most:
            others = [other for p in clause for other in by_pair.get(p, ())]
            compared += len(others)
            if any(other <= clause for other in others):
                continue
        kept.append(clause)
        rarest = min(sorted(clause), key=lambda p: len(by_pair.get(p, ())))
        by_pair.setdefault(rarest, []).append(clause)
    return kept


def most_asked(clauses: Iterable[Clause], most: int) -> list[Pair]:
    """The pairs that most clauses name, the most frequent first."""
    asked = Counter(states for clause in clauses for states in clause)
    return sorted(asked, key=lambda p: (-asked[p], p))[:most]


def most_constrained_first(states: Iterable[int], clauses: Iterable[Clause]) -> list[int]:
    """States in the order of how much the clauses ask of them.

    A good order to break the symmetry of words.
    """
    demand: dict[int, float] = {}
    for clause in clauses:
        for states_of_pair in clause:
            for state in states_of_pair:
                demand[state] = demand.get(state, 0.0) + 1 / len(clause)
    return sorted(states, key=lambda s: (-demand.get(s, 0.0), s))
