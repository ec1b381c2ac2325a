"""Partitions into K words under clauses "one of these pairs must be separated", by SAT."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from coordlang.warping import Clause, Pair

#: Conflicts after which the solver comes back.
_SLICE = 2_000


class Colouring:
    """An incremental SAT problem: give each of ``states`` one of ``size`` words so that every clause holds.

    Variables: state has word, pair is separated.  Words are interchangeable; the symmetry is broken by the order of
    ``states``: a state may take word w only if an earlier state has word w - 1.
    """

    def __init__(self, states: Sequence[int], size: int, solver: str = "cadical153") -> None:
        from pysat.solvers import Solver

        self.size = size
        self._states = list(states)
        self._last = 0
        self._solver = Solver(name=solver)
        self._word = {s: [self._new() for _ in range(size)] for s in self._states}
        self._separated: dict[Pair, int] = {}
        for state in self._states:
            self._one_word(self._word[state])
        self._break_symmetry()

    def add(self, clause: Iterable[Pair]) -> None:
        """Require that one of these pairs of states lies in different words."""
        self._solver.add_clause([self._separate(p) for p in sorted(clause)])

    def solve(self) -> dict[int, int] | None:
        """A partition (state -> word), or None if there is none: a proof that ``size`` words do not suffice."""
        if not self._decide():
            return None
        true = {v for v in self._solver.get_model() if v > 0}
        return {s: next(w for w, v in enumerate(own) if v in true) for s, own in self._word.items()}

    def _decide(self) -> bool:
        """In slices: the solver hears no signal (time limit, Ctrl-C), so it must come back now and then."""
        while True:
            self._solver.conf_budget(_SLICE)
            try:
                answer = self._solver.solve_limited()
            except Exception as error:  # python-sat catches SIGINT itself and raises an error of its own
                if "interrupt" in str(error).lower():
                    raise KeyboardInterrupt from None
                raise
            if answer is not None:
                return bool(answer)

    def delete(self) -> None:
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


def reduce(clauses: Iterable[Clause]) -> list[Clause]:
    """The clauses that no other one implies (a subset of its pairs), shortest first."""
    kept: list[Clause] = []
    by_pair: dict[Pair, list[Clause]] = {}
    for clause in sorted(set(clauses), key=lambda c: (len(c), sorted(c))):
        if any(other <= clause for p in clause for other in by_pair.get(p, ())):
            continue
        kept.append(clause)
        for p in clause:
            by_pair.setdefault(p, []).append(clause)
    return kept
