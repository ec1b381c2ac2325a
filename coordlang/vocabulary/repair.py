# SPDX-License-Identifier: GPL-3.0-or-later
"""A language and other tasks -> a language in which as few states as possible change their word.

Counterexamples to the old words give clauses that every language satisfies.  A state with a word of
its own is separated from all others, so the states that change must meet every clause that the old
words violate, and any states that do suffice: the fewest are a least hitting set
(Proposition 29 of docs/concepts.md).  Of the languages with so few changes one with the fewest new
words is then looked for, as `minimal` does.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from itertools import chain, count

from coordlang.language.warping import Clause, separates
from coordlang.vocabulary.job import Assignment, Job, Outcome
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget, ProblemsBySize, close_bounds, find
from coordlang.vocabulary.sat import (
    PartitionProblem,
    Undecided,
    most_constrained_first,
    without_implied,
)
from planners.search.sat import whole
from planners.system.limits import run_until_stopped

#: Comparisons of clauses to find which are implied, a second's work: the solver finds the others.
_COMPARISONS = 5_000_000


@dataclass(frozen=True, slots=True)
class Repair(Outcome):
    """A partition, and how far it is from the old words.

    Word numbers are below ``old_words`` for an old word.  ``changed``: the states that had another
    word.  ``changes_bound`` and ``new_words_bound``: no language changes the words of fewer states;
    of those that change so few, none has fewer new words.
    """

    changed: tuple[int, ...] = ()
    changes_bound: int = 0
    new_words_bound: int = 0


def repair(job: Job, kept: Assignment, old_words: int, default: int) -> Repair:
    """The language that is nearest to old words.

    Anytime: out of time or memory, or interrupted, it returns the best language so far, with the
    error in ``stopped``; before there is one it raises that error.

    ``job`` is what the language is for; its ``check`` is called for every better one.  ``kept``
    gives state numbers their old words, numbers below ``old_words``.  States that are not named
    there are new: whatever word they get, they do not change it.  ``default`` is the old word that
    a new state gets where any will do.
    """
    search = _Repair(job, kept, old_words, default)
    with closing(search.problems):
        stopped = run_until_stopped(search.run)
    return search.result(stopped)


class _Repair:
    """``best`` is the language with the fewest changes, and then new words, that was verified."""

    def __init__(self, job: Job, kept: Assignment, old_words: int, default: int) -> None:
        self._job, self._old_words, self._default = job, old_words, default
        self._kept = {state: kept[state] for state in job.states if state in kept}
        self.best: dict[int, int] | None = None
        self._languages = Languages.of(job)
        self._changes_bound = 0
        self._new_words_bound = 0
        self.problems = ProblemsBySize(self._languages.clauses, self._start)

    def result(self, stopped: BaseException | None) -> Repair:
        """The best language, with what is proved of it.  Raises ``stopped`` if there is none."""
        if self.best is None:
            assert stopped is not None
            raise stopped
        changed = sorted(s for s, word in self._kept.items() if self.best[s] != word)
        proved = len(changed) == self._changes_bound
        return Repair(
            self.best,
            self._job.lower_bound,
            {
                "rounds": self._languages.rounds,
                "clauses": len(self._languages.clauses),
                "symmetries": len(self._languages.group.symmetries),
            },
            stopped,
            changed=tuple(changed),
            changes_bound=self._changes_bound,
            new_words_bound=self._new_words_bound if proved else 0,
        )

    def run(self) -> None:
        """A language soon, then the fewest changes, then the fewest new words."""
        self._join_words(self._hit_greedily())
        self._join_words(self._hit_least())
        close_bounds(lambda: (self._new_words_bound, self._distance(self.best)[1]), self._decide)

    def _distance(self, partition: Assignment | None) -> tuple[int, int]:
        """How many states change their word, and how many words are new."""
        assert partition is not None
        changes = sum(partition[state] != word for state, word in self._kept.items())
        return changes, len({word for word in partition.values() if word >= self._old_words})

    def _hit_greedily(self) -> set[int]:
        """States that suffice to change; few, and soon: always the one in most clauses left."""
        changed: set[int] = set()
        while not self._holds(self._apart(changed)):
            left = [states for states in self._violated_sets() if not states & changed]
            while left:
                number = Counter(state for states in left for state in states)
                chosen = min(number, key=lambda state: (-number[state], state))
                changed.add(chosen)
                left = [states for states in left if chosen not in states]
        return changed

    def _hit_least(self) -> set[int]:
        """As few states as suffice to change."""
        from pysat.examples.hitman import Hitman

        seen, changed = 0, set[int]()
        with whole(Hitman)(htype="sorted") as hitting:
            while not self._holds(self._apart(changed)):
                for states in self._violated_sets(seen):
                    hitting.hit(sorted(states))
                seen = len(self._languages.clauses)
                changed = set(hitting.get())
                self._changes_bound = len(changed)
        return changed

    def _violated_sets(self, first: int = 0) -> Iterable[frozenset[int]]:
        """The states of every clause, from number ``first`` on, that the old words violate."""
        kept = self._kept
        for clause in self._languages.clauses[first:]:
            states = frozenset(chain(*clause))
            if states <= kept.keys() and not separates(kept, clause):
                yield states

    def _apart(self, changed: set[int]) -> dict[int, int]:
        """The old words, changed and new states each in a word of its own."""
        kept, fresh = self._kept.keys() - changed, count(self._old_words)
        return {s: self._kept[s] if s in kept else next(fresh) for s in self._job.states}

    def _join_words(self, changed: set[int]) -> None:
        """Where only these states change: a language with few new words, by first fit.

        States with a word of their own take the first word that violates no known clause, until
        there is no counterexample.
        """
        self._offer(self._apart(changed))
        while not self._holds(partition := self._first_fit(changed)):
            pass
        self._offer(partition)

    def _offer(self, partition: dict[int, int]) -> None:
        """Verify a language, and keep it, if it is better than the best."""
        if self.best is None or self._distance(partition) < self._distance(self.best):
            self._job.check(partition)
            self.best = partition

    def _first_fit(self, changed: set[int]) -> dict[int, int]:
        partition = self._apart(changed)
        clauses = without_implied(self._languages.clauses, _COMPARISONS)
        of_state = defaultdict[int, list[Clause]](list)
        for clause in clauses:
            for state in set(chain(*clause)):
                of_state[state].append(clause)
        used = self._old_words
        own = [s for s in self._job.states if partition[s] >= self._old_words]
        # Until a state is placed its word is a number that no placed state has.
        partition |= {state: -1 - state for state in own}
        for state in most_constrained_first(own, clauses):
            for word in (self._kept.get(state, self._default), *range(used + 1)):
                partition[state] = word
                if all(separates(partition, clause) for clause in of_state[state]):
                    break
            used = max(used, partition[state] + 1)
        return partition

    def _holds(self, partition: Assignment) -> bool:
        """Whether there is no counterexample; those that are found are added to the clauses."""
        changes, new_words = self._distance(partition)
        self._job.progress(
            f"at least {self._changes_bound} states change their word; trying {changes}, and "
            f"{new_words} new words: round {self._languages.rounds}, "
            f"{len(self._languages.clauses):,} clauses"
        )
        return self._languages.holds(partition)

    def _decide(self, new_words: int, budget: Budget) -> bool:
        """Find a language with so many new words, or prove that there is none; False: not yet."""
        size = self._old_words + new_words

        def partition(conflicts: int) -> dict[int, int] | None:
            found = self.problems.find(size, conflicts)
            return found and {state: found[state] for state in self._job.states}

        try:
            found = find(partition, self._holds, budget)
        except Undecided:
            return False
        self.problems.drop(size)
        if found is None:
            self._new_words_bound = new_words + 1
        else:
            self._offer(found)
        return True

    def _start(self, size: int) -> PartitionProblem:
        """Partitions with the fewest changes; an anchor for each old word fixes its name."""
        clauses = without_implied(self._languages.clauses, _COMPARISONS)
        anchors = [-1 - word for word in range(self._old_words)]
        states = [*anchors, *most_constrained_first(self._job.states, clauses)]
        problem = PartitionProblem(states, size)
        for number, anchor in enumerate(anchors):
            for other in anchors[:number]:
                problem.separate_one([(anchor, other)])
        problem.keep_words(self._kept, self._changes_bound)
        for clause in clauses:
            problem.separate_one(clause)
        return problem
