# SPDX-License-Identifier: GPL-3.0-or-later
"""The least number of words, with proof, or few words soon: counterexamples in, SAT out.

Words that some states decide, and the words of a known language, merged, give the first upper
bound; numbers of words are decided by the loop (`coordlang.vocabulary.loop`), with clauses that
every language must satisfy (`coordlang.language.warping`), from below, and from above where that
takes long.  The result is least among partitions (the paper's ``D_MinW+``); Proposition 8 of
docs/concepts.md allows for symmetries.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import replace
from functools import cached_property, partial
from itertools import chain, islice
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from coordlang.language.warping import Clause
from coordlang.required.choices import Choices
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.job import Assignment, Evidence, Job, Outcome, word_count
from coordlang.vocabulary.loop import (
    Budget,
    Languages,
    Partitions,
    between,
    close_bounds,
    find,
)
from coordlang.vocabulary.merging import merged
from coordlang.vocabulary.sat import Undecided
from planners.joint.tables import Ints
from planners.search.sat import SolverName
from planners.system.errors import OutOfMemory
from planners.system.limits import memory_left, run_until_stopped

if TYPE_CHECKING:  # they load networkx
    from coordlang.vocabulary.contained import ContainedInstance
    from coordlang.vocabulary.plan_pairs import PlanPairs
    from coordlang.vocabulary.tied_words import TiedWords
    from coordlang.vocabulary.two_words import TwoWords
    from coordlang.vocabulary.warped_pairs import PairsApart

#: A thousand conflicts are a unit of effort; a refuted partition counts as so many ..
_UNIT, _ROUND = 1_000, 250
#: .. a search for plans that a merge of words confuses as a share of it ..
_MERGES = 5
#: .. and besides as one for so many pairs of edges that leave one node; the first failing plans
#: count as one for far fewer.
_PAIRS, _FIRST_PAIRS = 1_000, 30
#: Effort that is not enough for a tenth of the first failing plans is not begun with.
_BEGINNING = 10
#: What may be spent on each number at first.
_SOON = Budget(rounds=10, conflicts=2_000)
#: For each round of a budget so many steps of mixtures of two plans are looked at for two words of
#: one task, and so many conflicts allowed: small formulas may need many.
_FOR_ROUND, _CONFLICTS = 60_000, 40_000
#: Steps of mixtures of two plans that are looked at, in some ten seconds, for words that tell plans
#: apart step by step, and along all warping paths; so many count as a conflict.
_MOST_PAIRS, _FEW_PAIRS, _EDGES = 26_000_000, 1_200_000, 200
#: Clauses of a formula of words that tell plans apart step by step, in some 20 seconds; that within
#: two steps after a mixture has failed, not one, where it has so many times less for one; and what
#: may be spent on each number.
_MOST_CLAUSES, _SMALL, _AT_FIRST = 20_000_000, 4, Budget(rounds=8, conflicts=2_000)
#: A solver has so many words more than it is asked for at first: larger sizes are asked for next.
_FURTHER = 2
#: Steps of pairs of plans that fail along their warping paths, in some 20 seconds; so many count as
#: a conflict.  Each takes so many bytes at most.
_MOST_STEPS, _STEPS, _BYTES = 11_000_000, 100, 200
#: Steps by which the plans are apart at most: more make larger graphs and refute hardly more.
_APART = 3
#: Other searches come first where there are more steps than this part of the most.
_LARGE = 5
#: Conflicts that are allowed for each round of a budget then.
_HARD = 3_000
#: Rounds are dear where there are more pairs of edges that leave one node.
_DEAR = 30_000
#: Rounds that partitions of a kind are given for one task at first, one time after another, and
#: where they are dear ..
_FOR_KINDS, _WHERE_DEAR = (1, 2, 5, 10), (5, 10)
#: .. with fewer words than the best language by this part at least.
_FEWER_WORDS = 5
#: Where there are more steps times words, a solver would get too many clauses (elevators p03, 92
#: million: not done after 80 s).  There words that a few facts say come first, and so many searches
#: for merges.
_CLAUSES, _MERGED_SOON = 20_000_000, 30
#: Merges in a row that fail before something else is tried.
_VAIN = 15
#: Plans that local search may measure for a unit of effort.
_MEASURED = 1_000_000
#: Merged words are verified once they are so many times the last ones that were.
_FEWER = 0.9


def minimal(job: Job) -> Outcome:
    """A language with the fewest words among all partitions.

    Anytime: out of time or memory, or interrupted, it returns the best language found with the
    lower bound proved so far, and the error in ``stopped``.
    """
    with closing(MinimalSearch(job)) as search:
        stopped = run_until_stopped(search.run)
    return search.outcome(stopped)


def best(job: Job) -> Outcome:
    """As few words as ``job.effort`` finds, and the bound that it proves; the default method.

    Greedy words, merged; then the loop of `minimal` as far as the effort allows; and for a single
    task, of the languages with so few words one whose sentences leave many plans open.  Effort is
    counted work, so the same input gives the same language on every machine.  Anytime, like
    `minimal`.  Without effort the words are greedy's.
    """
    if not job.effort:
        assert job.incumbent is not None
        return Outcome(job.incumbent, job.lower_bound, {"work": 0})
    with closing(MinimalSearch(job, job.effort)) as search:
        stopped = run_until_stopped(search.run)
        outcome = search.outcome(stopped)
    if stopped is not None or job.candidates.count != 1:
        return outcome
    job.progress("leaving plans open")
    freer = flexible(job, outcome, _MEASURED * job.effort)
    return replace(freer, stopped=None) if isinstance(freer.stopped, OutOfMemory) else freer


def refuting_clauses(job: Job, size: int) -> Mapping[Clause, Evidence]:
    """Necessary clauses that no partition into ``size`` words satisfies together.

    Not anytime: it takes as long as the proof takes.  Raises `ValueError` if there is a language
    with so few words.
    """
    with closing(MinimalSearch(replace(job, incumbent=None, by_clauses=True))) as search:
        budget = Budget()
        while not search.decide(size, budget):
            budget = budget.doubled()
        if search.lower <= size:
            raise ValueError(f"there is a language with {size} words")
    return search.refuting


class MinimalSearch:
    """Closes in on the least number of words.

    ``lower`` words are proved to be needed; ``refuting`` are the clauses that refuted a number of
    words last.  ``best`` is the language with the fewest words so far, None before there is one.
    """

    def __init__(self, job: Job, effort: int | None = None) -> None:
        """Begin; the search ends after ``effort``, in thousands of ``work``, None: by its proof."""
        self._job = job
        self._most = sys.maxsize if effort is None else effort * _UNIT
        candidates = job.candidates
        self._is_one_task = candidates.count == 1
        self._is_asynchronous = candidates.model.is_asynchronous
        #: Pairs of edges that leave one node: what a walk through all tasks goes over.
        degrees = (space.out_degrees.astype(float) for space in candidates.spaces)
        self._pairs = sum(int((degree**2).sum()) for degree in degrees)
        self._is_dear = self._pairs > _DEAR
        self._merges = 0
        self._merging: tuple[Assignment, Iterator[Assignment]] | None = None
        #: Searches for stutter-free words, made one after another.
        self._in_step: list[PairsApart] = []
        self._next_in_step = self._more_in_step()
        self.lower = job.lower_bound
        self.best: Assignment | None = job.incumbent
        self.refuting: Mapping[Clause, Evidence] = {}

    @cached_property
    def languages(self) -> Languages:
        """What is known of all languages; collecting the first failing plans takes a while."""
        return Languages.of(self._job)

    @cached_property
    def _partitions(self) -> Partitions:
        languages = self.languages
        # Without a common step proofs are long, and longer with Glucose.
        prover: SolverName = "cadical195" if self._is_asynchronous else "glucose42"
        return Partitions(self._job.states, languages.clauses, languages.group.permutations, prover)

    @cached_property
    def _tied(self) -> TiedWords:
        from coordlang.vocabulary.tied_words import TiedWords

        return TiedWords(self._job, self.languages)

    @cached_property
    def _plan_pairs(self) -> PlanPairs:
        """Pairs of plans of one task, as far as they were looked at."""
        from coordlang.vocabulary.plan_pairs import PlanPairs

        (space,) = self._job.candidates.spaces
        return PlanPairs(Choices(space))

    @cached_property
    def _two_words(self) -> TwoWords | None:
        """Who decides two words of one task; None where clauses must prove it."""
        from coordlang.vocabulary.two_words import TwoWords

        if self._job.by_clauses or self._is_asynchronous or not self._is_one_task:
            return None
        return TwoWords(self._plan_pairs, self._job.states, self.languages.clauses)

    @cached_property
    def _apart(self) -> PairsApart | None:
        """Partitions of one task's states that tell pairs of plans apart; None for large tasks."""
        from coordlang.vocabulary.warped_pairs import PairsApart, WarpedPairs, steps_apart

        left = self._most - self.work
        most = min(_MOST_STEPS, _STEPS * left, memory_left() // _BYTES)
        apart = min(_APART, steps_apart(self._plan_pairs.space, most))
        if apart < 1:
            return None
        self._plan_pairs.grow(min(_FEW_PAIRS, _EDGES * left))
        random, pairs = np.random.default_rng(self._job.seed), WarpedPairs(self._plan_pairs, apart)
        return PairsApart(self._job.states, self.languages.clauses, pairs.steps(), random)

    @cached_property
    def _is_large(self) -> bool:
        """Whether it takes long to tell pairs of plans of one task apart on all warping paths."""
        from coordlang.vocabulary.warped_pairs import steps_apart

        return steps_apart(self._plan_pairs.space, _MOST_STEPS // _LARGE) < _APART

    @property
    def _most_clauses(self) -> int:
        """What a formula of words that tell plans apart step by step may have."""
        return min(_MOST_CLAUSES, _STEPS * self._most, memory_left() // _BYTES)

    def _more_in_step(self) -> Iterator[PairsApart]:
        """Stutter-free words that tell pairs of plans of one task apart, step by step."""
        from coordlang.vocabulary.warped_pairs import PairsApart, failing_pairs, joined_states

        pairs, most = self._plan_pairs, self._most_clauses
        self._report("looking at pairs of plans")
        if not pairs.complete(min(_MOST_PAIRS, _EDGES * self._most, memory_left() // _BYTES)):
            return
        joined, clauses = joined_states(pairs.space), self.languages.clauses

        def tables() -> Iterator[Ints]:
            soon = failing_pairs(pairs, 1, most)
            yield soon if _SMALL * len(soon) > most else failing_pairs(pairs, 2, most)
            yield failing_pairs(pairs, inf, most)

        with suppress(Undecided):
            for steps in tables():
                search = PairsApart(self._job.states, clauses, steps, joined=joined)
                if search.number_of_clauses(2 * self.lower) > most:
                    return
                self._in_step.append(search)
                yield search

    @cached_property
    def _contained(self) -> list[ContainedInstance]:
        candidates, group = self._job.candidates, self.languages.group
        if self._is_one_task:  # it contains itself alone
            return []
        from coordlang.vocabulary.contained import parts, tasks_of_one_orbit

        found = [
            *tasks_of_one_orbit(candidates, group, self._job.seed),
            *parts(candidates, group, self._job.seed),
        ]
        return sorted(found, key=lambda instance: len(instance.states))

    @property
    def upper(self) -> int:
        """The number of words that is known to suffice."""
        return len(self._job.states) if self.best is None else word_count(self.best)

    def run(self) -> None:
        """Close the bounds."""
        if not self._job.first_differences.requiring:
            self.best = dict.fromkeys(self._job.states, 0)
            return
        if self._pairs // _FIRST_PAIRS > _BEGINNING * self._most:
            return
        if self._is_one_task:
            self._begin_with_one_task()
        while self._is_open and self.decide(self.lower, _SOON):
            pass
        while self._is_open and not self._is_one_task:
            if not self.decide(between(self.lower, self.upper), _SOON):
                break
        self.merge(_VAIN)
        known = self.best
        close_bounds(lambda: (self.lower, self.upper), self._narrow, lambda: self._is_spent)
        if self.best is known and not self._is_spent:
            # Merged words tell more states apart than a language must: fewer leave more plans open.
            self.decide(self.lower, Budget())

    def _begin_with_one_task(self) -> None:
        """Decide what is soon decided from below, and look for words of a kind."""
        (space,) = self._job.candidates.spaces
        of_kinds = iter(_WHERE_DEAR if self._is_dear else _FOR_KINDS)
        from_below = self._two_words is not None
        if from_below and self.lower == 2 and self._is_open:
            from_below = self._find_or_refute(2, _SOON)
        if from_below and self._is_large:
            self._find_fewer_tied(next(of_kinds))
        while from_below and self._is_open and self._apart is not None:
            from_below = self._find_or_refute(self.lower, _SOON)
        if len(space.target) * between(self.lower, self.upper) > _CLAUSES:
            found = self._tied.of_facts()
            if found is not None and word_count(found) < self.upper:
                self._offer(found)
                self.merge(most=_MERGED_SOON)
        for rounds in of_kinds:
            self._find_fewer_tied(rounds)

    def _find_fewer_tied(self, rounds: int) -> None:
        """Look for a language of some kind with fewer words than the best one.

        From below, where partitions are refuted soonest and most is learnt of the others, too; then
        between the number that was tried last and the one that suffices.  Where rounds are dear
        only that.
        """
        if not self._is_open:
            return
        self._find_fewer_in_step(rounds)
        least = self.lower
        if not self._is_dear and least < self.upper:
            if self._finds_tied(least, rounds):
                return
            least += 1
        while least <= self.upper - max(1, self.upper // _FEWER_WORDS) and not self._is_spent:
            size = between(least, self.upper)
            if not self._finds_tied(size, rounds):
                least = size + 1

    def _find_fewer_in_step(self, rounds: int) -> None:
        """Look for fewer stutter-free words that tell all pairs of plans of one task apart.

        From below, at most twice the number that was tried last: small ones are soon decided.
        """
        for search in chain(self._in_step[:], self._next_in_step):
            least = self.lower
            most = 2 * least
            while least < self.upper and not self._is_spent:
                size = min(most, between(least, self.upper))
                left = max(0, self._most - self.work)
                own = Budget(_AT_FIRST.rounds, min(_AT_FIRST.conflicts * rounds, left))
                self._report(f"trying {size} words that tell plans apart step by step")
                room = min(4 * size, self.upper - 1)
                room = room if search.number_of_clauses(room) <= self._most_clauses else size
                ask = partial(search.find, size, room)
                found = None
                with suppress(Undecided):
                    found = find(ask, self._holds, own)
                if found is None:
                    least, most = size + 1, 2 * size
                else:
                    self._offer(found)

    @property
    def work(self) -> int:
        """What was done so far: the conflicts of the solver, refuted partitions counted as some."""
        if "languages" not in self.__dict__:
            return 0
        rounds = self.languages.rounds + self._merges // _MERGES
        conflicts = self._partitions.conflicts
        if "_tied" in self.__dict__:
            conflicts += self._tied.conflicts
        if self._two_words is not None:
            conflicts += self._two_words.conflicts
        if "_plan_pairs" in self.__dict__:
            conflicts += self._plan_pairs.looked_at // _EDGES
        for search in (*self._in_step, self.__dict__.get("_apart")):
            if search is not None:
                conflicts += search.conflicts + search.steps // _STEPS
        return conflicts + rounds * (_ROUND + self._pairs // _PAIRS)

    @property
    def _is_open(self) -> bool:
        return self.lower < self.upper and not self._is_spent

    @property
    def _is_spent(self) -> bool:
        return self.work >= self._most

    def merge(self, vain: int = sys.maxsize, most: int = sys.maxsize) -> None:
        """Merge words of the best language as long as it stays a language.

        After ``vain`` searches in a row that failed, or ``most``, it is left, and the next call
        goes on there.
        """
        if self.best is None or self.upper <= self.lower:
            return
        if self._merging is None or self._merging[0] is not self.best:
            self._merging = self.best, merged(self.best, self._job.states, self.languages.refuter)
        coarsest, failed = self.best, 0
        for number, coarser in enumerate(self._merging[1], 1):
            failed += 1
            if word_count(coarser) < word_count(coarsest):
                coarsest, failed = coarser, 0
                if word_count(coarsest) <= _FEWER * self.upper:
                    self._offer(coarsest)  # what is not verified is lost when time is over
            self._merges += 1
            self._report(f"merging words: {word_count(coarser)} left")
            if self._is_spent or failed >= vain or number >= most:
                break
        if coarsest is not self.best:
            self._offer(coarsest)
        self._merging = self.best, self._merging[1]

    def _narrow(self, size: int, budget: Budget) -> bool:
        """`decide`; between the bounds, look for languages that are sooner found first."""
        if size == self.lower:
            return self.decide(size, budget)
        bounds = self.lower, self.upper
        if self._is_one_task:
            self._find_fewer_tied(budget.rounds)
        if bounds == (self.lower, self.upper):
            self.merge(_VAIN)
        return bounds != (self.lower, self.upper) or self.decide(size, budget)

    def decide(self, size: int, budget: Budget) -> bool:
        """Find a language of ``size`` words, or prove that there is none; False: not yet."""
        is_last = size == self.lower == self.upper - 1
        ties_first = not self._is_one_task and (is_last or size > self.lower)
        if ties_first and self._finds_tied(size, budget.rounds):
            return True
        if self._find_or_refute(size, budget):
            return True
        return self._is_one_task and is_last and self._finds_tied(size, budget.rounds)

    def _find_or_refute(self, size: int, budget: Budget) -> bool:
        """`decide` among all partitions."""
        try:
            refuting = self._refuted_within(size, budget) or self._refuted(size, budget)
        except Undecided:
            return False
        if refuting is not None:
            # In this order: a signal in between leaves clauses that refute too much.
            self.refuting = refuting
            self.lower = size + 1
        return True

    def _refuted(self, size: int, budget: Budget) -> Mapping[Clause, Evidence] | None:
        """The clauses that refute so few words; None, and a language is offered, if none do.

        None of them where pairs of plans do.
        """
        ways = [self._by_clauses, self._by_pairs]
        if size > 2 and self.__dict__.get("_apart") is not None:
            ways.reverse()
        for way in ways:
            with suppress(Undecided):
                found = way(size, budget)
                break
        else:
            raise Undecided
        self._partitions.drop(size)
        if found is None:
            return dict(self.languages.evidence) if way == self._by_clauses else {}
        self._offer(found)
        self.merge(_VAIN)
        return None

    def _by_clauses(self, size: int, budget: Budget) -> dict[int, int] | None:
        """A language of so many words, None if known clauses refute them.  Raises `Undecided`."""

        def partition(conflicts: int) -> dict[int, int] | None:
            if self._is_spent:
                raise Undecided
            return self._partitions.find(size, min(conflicts, self._most - self.work))

        return find(partition, self._holds, budget)

    def _by_pairs(self, size: int, budget: Budget) -> dict[int, int] | None:
        """The same by what is said of all pairs of plans of one task."""
        two_words = self._two_words
        if two_words is None:
            raise Undecided
        left = max(0, self._most - self.work)
        if size == 2:
            edges = min(_FOR_ROUND * budget.rounds, _EDGES * left)
            own = Budget(budget.rounds, min(_CONFLICTS * budget.rounds, left))
            return two_words.find(self._holds, own, edges)
        if (apart := self._apart) is None:
            raise Undecided
        own = Budget(budget.rounds, min(_HARD * budget.rounds, left))
        return find(partial(apart.find, size, size + _FURTHER), self._holds, own)

    def _finds_tied(self, size: int, rounds: int) -> bool:
        """Whether a language with so many words is soon found among those of some kinds."""
        if self._is_spent:
            return False
        self._report(f"trying {size} words that some states decide")
        found = self._tied.find(size, rounds)
        if found is not None:
            self._offer(found)
        return found is not None

    def _refuted_within(self, size: int, budget: Budget) -> Mapping[Clause, Evidence] | None:
        """A proof by an instance that this one contains, the smallest that has one."""
        while size == self.lower and self._contained:
            instance = self._contained[0]
            self._report(f"trying {size} words for {len(instance.states):,} of the states")
            refuting = instance.refute(size, budget)
            if refuting is not None:
                return refuting
            # So many words suffice for it, and more will.
            self._contained.pop(0).close()
        return None

    def outcome(self, stopped: BaseException | None) -> Outcome:
        """The best language, with what is proved.  Raises ``stopped`` if there is none."""
        if self.best is None:
            assert stopped is not None
            raise stopped
        figures: dict[str, float] = {}
        refuting, languages = self.refuting, self.__dict__.get("languages")
        if languages is not None:
            figures = {
                "rounds": languages.rounds,
                "clauses": len(languages.clauses),
                "symmetries": len(languages.group.symmetries),
                "counterexamples": len(languages.refuter.pool),
                "walks": languages.refuter.walks,
                "work": self.work,
            }
            if self.lower == 2:  # any clause refutes one word
                refuting = dict(islice(languages.evidence.items(), 1))
        return Outcome(self.best, self.lower, figures, stopped, refuting, languages)

    def close(self) -> None:
        """Give back what the solvers hold."""
        for name in ("_partitions", "_tied", "_two_words", "_apart"):
            if (search := self.__dict__.get(name)) is not None:
                search.close()
        for search in self._in_step:
            search.close()
        for instance in self.__dict__.get("_contained", ()):
            instance.close()

    def _offer(self, partition: Assignment) -> None:
        """Take a language, once it is verified by definition: what is left if time is over."""
        self._job.check(partition)
        self.best = partition

    def _holds(self, partition: Assignment) -> bool:
        self._report(f"trying {word_count(partition)} words")
        return self.languages.holds(partition)

    def _report(self, what: str) -> None:
        languages = self.languages
        self._job.progress(
            f"{what}, {self.lower} to {self.upper} needed: "
            f"round {languages.rounds}, {len(languages.clauses):,} clauses"
        )
