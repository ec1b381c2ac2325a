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
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING

from coordlang.language.warping import Clause
from coordlang.vocabulary.flexible import flexible
from coordlang.vocabulary.job import Assignment, Evidence, Job, Outcome, word_count
from coordlang.vocabulary.languages import Languages
from coordlang.vocabulary.loop import Budget, Partitions, between, close_bounds, find
from coordlang.vocabulary.merging import merged
from coordlang.vocabulary.one_task import OneTask
from coordlang.vocabulary.sat import Undecided
from coordlang.vocabulary.tied_words import TiedWords
from planners.search.sat import SolverName
from planners.system.errors import OutOfMemory
from planners.system.limits import run_until_stopped

if TYPE_CHECKING:  # it loads networkx
    from coordlang.vocabulary.contained import ContainedInstance

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
        self._is_one_task = job.candidates.count == 1
        #: Pairs of edges that leave one node: what a walk through all tasks goes over.
        degrees = (space.out_degrees.astype(float) for space in job.candidates.spaces)
        self._pairs = sum(int((degree**2).sum()) for degree in degrees)
        self._is_dear = self._pairs > _DEAR
        self._merges = 0
        #: A language, and those that are made of it by merging words.
        self._merging: tuple[Assignment | None, Iterator[Assignment]] = None, iter(())
        self.lower = job.lower_bound
        self.best: Assignment | None = job.incumbent
        #: The language that was found last among all partitions, nothing before there is one.
        self._found: Assignment = {}
        self.refuting: Mapping[Clause, Evidence] = {}

    @cached_property
    def languages(self) -> Languages:
        """What is known of all languages; collecting the first failing plans takes a while."""
        return Languages.of(self._job)

    @cached_property
    def _partitions(self) -> Partitions:
        languages = self.languages
        # Without a common step proofs are long, and longer with Glucose.
        is_asynchronous = self._job.candidates.model.is_asynchronous
        prover: SolverName = "cadical195" if is_asynchronous else "glucose42"
        return Partitions(self._job.states, languages.clauses, languages.group.permutations, prover)

    @cached_property
    def _tied(self) -> TiedWords:
        return TiedWords(self._job, self.languages)

    @cached_property
    def _one_task(self) -> OneTask | None:
        """Who asks for all pairs of plans of one task; None where clauses must prove it."""
        if self._job.by_clauses or not self._is_one_task:
            return None
        return OneTask(self._job, self.languages, self)

    @cached_property
    def _contained(self) -> list[ContainedInstance]:
        candidates, group = self._job.candidates, self.languages.group
        if self._is_one_task:  # it contains itself alone
            return []
        from coordlang.vocabulary.contained import parts, tasks_of_one_orbit

        found = tasks_of_one_orbit(candidates, group, self._job.seed)
        found += parts(candidates, group, self._job.seed)
        return sorted(found, key=lambda instance: len(instance.states))

    @property
    def upper(self) -> int:
        """The number of words that is known to suffice."""
        return len(self._job.states) if self.best is None else word_count(self.best)

    def _bounds(self) -> tuple[int, int]:
        return self.lower, self.upper

    def run(self) -> None:
        """Close the bounds."""
        if not self._job.first_differences.requiring:
            self.best = dict.fromkeys(self._job.states, 0)
            return
        if self._pairs // _FIRST_PAIRS > _BEGINNING * self._most:
            return
        self._begin_with_one_task()
        while self._is_open and self.decide(self.lower, _SOON):
            pass
        while self._is_open and not self._is_one_task:
            if not self.decide(between(self.lower, self.upper), _SOON):
                break
        self.merge(_VAIN)
        known = self.best
        close_bounds(self._bounds, self._narrow, lambda: self._is_spent)
        if self.best is known and known is not self._found and not self._is_spent:
            # Merged words tell more states apart than a language must: fewer leave more plans open.
            self.decide(self.lower, Budget())

    def _begin_with_one_task(self) -> None:
        """Of one task: decide what is soon decided from below, and look for words of a kind."""
        one_task = self._one_task
        if one_task is None or not self._is_open:
            return
        of_kinds = iter(_WHERE_DEAR if self._is_dear else _FOR_KINDS)
        from_below = self._find_or_refute(2, _SOON)
        if from_below and one_task.is_large:
            self._find_fewer_tied(next(of_kinds))
        while from_below and self._is_open and one_task.can_decide(self.lower):
            from_below = self._find_or_refute(self.lower, _SOON)
        self._merge_words_of_facts()
        for rounds in of_kinds:
            self._find_fewer_tied(rounds)

    def _merge_words_of_facts(self) -> None:
        """Begin with words that a few facts say where a solver would get too many clauses."""
        (space,) = self._job.candidates.spaces
        if len(space.target) * between(self.lower, self.upper) <= _CLAUSES:
            return
        found = self._tied.of_facts()
        if found is not None and word_count(found) < self.upper:
            self._offer(found)
            self.merge(most=_MERGED_SOON)

    def _find_fewer_tied(self, rounds: int) -> None:
        """Look for a language of some kind with fewer words than the best one.

        From below, where partitions are refuted soonest and most is learnt of the others, too; then
        between the number that was tried last and the one that suffices.  Where rounds are dear
        only that.
        """
        if not self._is_open:
            return
        if self._one_task is not None:
            for found in self._one_task.in_step(rounds):
                self._offer(found)
        least = self.lower
        if not self._is_dear and least < self.upper:
            if self._finds_tied(least, rounds):
                return
            least += 1
        while least <= self.upper - max(1, self.upper // _FEWER_WORDS) and not self._is_spent:
            size = between(least, self.upper)
            if not self._finds_tied(size, rounds):
                least = size + 1

    @property
    def work(self) -> int:
        """What was done so far: the conflicts of the solver, refuted partitions counted as some."""
        if "languages" not in self.__dict__:
            return 0
        rounds = self.languages.rounds + self._merges // _MERGES
        conflicts = self._partitions.conflicts + self._tied.conflicts
        if self._one_task is not None:
            conflicts += self._one_task.work
        return conflicts + rounds * (_ROUND + self._pairs // _PAIRS)

    def left(self) -> int:
        """Conflicts that may still be spent."""
        return max(0, self._most - self.work)

    @property
    def _is_open(self) -> bool:
        return self.lower < self.upper and not self._is_spent

    @property
    def _is_spent(self) -> bool:
        return self.left() == 0

    def merge(self, vain: int = sys.maxsize, most: int = sys.maxsize) -> None:
        """Merge words of the best language as long as it stays a language.

        After ``vain`` searches in a row that failed, or ``most``, it is left, and the next call
        goes on there.
        """
        if self.best is None or self.upper <= self.lower:
            return
        if self._merging[0] is not self.best:
            self._merging = self.best, merged(self.best, self._job.states, self.languages)
        coarsest, failed = self.best, 0
        for coarser in islice(self._merging[1], most):
            failed += 1
            if word_count(coarser) < word_count(coarsest):
                coarsest, failed = coarser, 0
                if word_count(coarsest) <= _FEWER * self.upper:
                    self._offer(coarsest)  # what is not verified is lost when time is over
            self._merges += 1
            self.report(f"merging words: {word_count(coarser)} left")
            if self._is_spent or failed >= vain:
                break
        if coarsest is not self.best:
            self._offer(coarsest)
        self._merging = self.best, self._merging[1]

    def _narrow(self, size: int, budget: Budget) -> bool:
        """`decide`; between the bounds, look for languages that are sooner found first."""
        if size == self.lower:
            return self.decide(size, budget)
        bounds = self._bounds()
        if self._is_one_task:
            self._find_fewer_tied(budget.rounds)
        if bounds == self._bounds():
            self.merge(_VAIN)
        return bounds != self._bounds() or self.decide(size, budget)

    def decide(self, size: int, budget: Budget) -> bool:
        """Find a language of ``size`` words, or prove that there is none; False: not yet."""
        ties_first = size > self.lower and not self._is_one_task
        if ties_first and self._finds_tied(size, budget.rounds):
            return True
        if self._find_or_refute(size, budget):
            return True
        is_last = size == self.lower == self.upper - 1
        return is_last and self._finds_tied(size, budget.rounds)

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
        ways = [self._by_clauses]
        if (one_task := self._one_task) is not None:
            ways.insert(0 if size > 2 and one_task.has_formula else 1, one_task.find)
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
        self._found = found
        self.merge(_VAIN)
        return None

    def _by_clauses(self, size: int, budget: Budget) -> dict[int, int] | None:
        """A language of so many words, None if known clauses refute them.  Raises `Undecided`."""

        def partition(conflicts: int) -> dict[int, int] | None:
            if self._is_spent:
                raise Undecided
            return self._partitions.find(size, min(conflicts, self.left()))

        return find(partition, self.holds, budget)

    def _finds_tied(self, size: int, rounds: int) -> bool:
        """Whether a language with so many words is soon found among those of some kinds."""
        if self._is_spent:
            return False
        self.report(f"trying {size} words that some states decide")
        found = self._tied.find(size, rounds)
        if found is not None:
            self._offer(found)
        return found is not None

    def _refuted_within(self, size: int, budget: Budget) -> Mapping[Clause, Evidence] | None:
        """A proof by an instance that this one contains, the smallest that has one."""
        while size == self.lower and self._contained:
            instance = self._contained[0]
            self.report(f"trying {size} words for {len(instance.states):,} of the states")
            refuting = instance.refute(size, budget)
            if refuting is not None:
                return refuting
            # So many words suffice for it, and more will.
            self._contained.pop(0).close()
        return None

    def outcome(self, stopped: BaseException | None) -> Outcome:
        """The best language, with what is proved."""
        assert self.best is not None, "there was one to begin with"
        figures: dict[str, float] = {}
        refuting, languages = self.refuting, self.__dict__.get("languages")
        if languages is not None:
            figures = {
                "rounds": languages.rounds,
                "clauses": len(languages.clauses),
                "symmetries": len(languages.group.symmetries),
                "counterexamples": len(languages.pool),
                "walks": languages.walks,
                "work": self.work,
            }
            if self.lower == 2:  # any clause refutes one word
                refuting = dict(islice(languages.evidence.items(), 1))
        return Outcome(self.best, self.lower, figures, stopped, refuting, languages)

    def close(self) -> None:
        """Give back what the solvers hold."""
        for name in ("_partitions", "_tied", "_one_task"):
            if (search := self.__dict__.get(name)) is not None:
                search.close()
        for instance in self.__dict__.get("_contained", ()):
            instance.close()

    def _offer(self, partition: Assignment) -> None:
        """Take a language, once it is verified by definition: what is left if time is over."""
        self._job.check(partition)
        self.best = partition

    def holds(self, partition: Assignment) -> bool:
        """Whether a partition is a language, see `Languages.holds`; it is said what is tried."""
        self.report(f"trying {word_count(partition)} words")
        return self.languages.holds(partition)

    def report(self, what: str) -> None:
        """Say what is tried, with what is known so far."""
        languages = self.languages
        self._job.progress(
            f"{what}, {self.lower} to {self.upper} needed: "
            f"round {languages.rounds}, {len(languages.clauses):,} clauses"
        )
