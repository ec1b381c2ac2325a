# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounds from below and languages from above, in turns: the same whoever is faster."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from coordlang.building import Built, build_language
from coordlang.symmetry.group import symmetry_group
from coordlang.vocabulary.above import Above
from coordlang.vocabulary.equivariant import EquivariantSearch
from coordlang.vocabulary.from_above import Answer, Fewer, Start, Trying, TurnOver, from_above
from coordlang.vocabulary.job import Assignment, Outcome, word_count
from coordlang.vocabulary.minimal import minimal
from coordlang.vocabulary.problems_by_size import SolverBudget
from coordlang.vocabulary.refuter import Refuter
from planners.pieces.conversation import Conversation, Here, Talk
from planners.pieces.processes import Processes
from planners.pieces.work import Runner
from tests.support.domains import all_tasks

OVER = TurnOver({})


@dataclass
class Scripted:
    """A search whose answers are known; those ``there`` already are ready."""

    answers: list[Answer]
    there: int = 0
    goes_on_alone: bool = True
    sent: list[int] = field(default_factory=list)

    def send(self, message: int) -> None:
        self.sent.append(message)

    def ready(self) -> bool:
        return self.there > 0

    def answer(self) -> Answer:
        self.there -= 1
        return self.answers.pop(0)

    def close(self) -> None:
        self.answers.clear()


def fewer(*words: int) -> Fewer:
    return Fewer(np.array(words))


def scripted(
    *answers: Answer, there: int = 0, alone: bool = True
) -> tuple[Above, list[Assignment]]:
    taken: list[Assignment] = []
    conversation = Scripted([*answers], there, alone)
    return Above(conversation, [3, 5, 8], taken.append, lambda _: None), taken


def test_what_is_there_is_heard_and_nothing_waited_for() -> None:
    above, taken = scripted(Trying("x"), fewer(0, 1, 2), OVER, fewer(0, 1, 0), there=3)
    above.listen()
    assert taken == [{3: 0, 5: 1, 8: 2}]
    assert above.best is taken[0]
    above.begin_turn(3, 1)  # turn 1 is over
    assert len(taken) == 1
    above.begin_turn(1, 1)


@pytest.mark.parametrize(("alone", "turn"), [(True, 3), (False, 1)])
def test_a_turn_begins_when_the_other_search_is_not_far_behind(alone: bool, turn: int) -> None:
    above, taken = scripted(fewer(0, 1, 2), OVER, fewer(0, 1, 0), OVER, alone=alone)
    above.begin_turn(turn, 1)
    assert len(taken) == 1
    above.begin_turn(turn + 1, 1)
    assert len(taken) == 2


def test_nothing_is_waited_for_once_words_are_few() -> None:
    above, taken = scripted(fewer(0, 1, 2), fewer(0, 1, 0), OVER)
    above.wait_for(1, 2)
    assert [word_count(found) for found in taken] == [3, 2]
    above.wait_for(9, 2)


class Playing:
    """A runner whose search from above plays a part."""

    def __init__(self, answers: Sequence[Answer]) -> None:
        self._answers = answers

    run = staticmethod(Processes(1).run)

    def beside(self, talk: Talk, shared: Start) -> Conversation:
        assert talk is from_above
        return Here(self._plays, shared)

    def _plays(self, _start: Start, lowers: Iterator[int]) -> Generator[Answer]:
        for _ in lowers:
            yield from self._answers
            self._answers = [OVER]


@pytest.fixture
def little_effort(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search from below needs the one from above."""
    module = sys.modules["coordlang.vocabulary.minimal"]
    monkeypatch.setattr(module, "SolverBudget", partial(SolverBudget, rounds=1))


def built(runner: Runner, stem: str, seed: int = 0) -> Built:
    return build_language(all_tasks("grid", stem), "minimal", seed=seed, runner=runner)


@pytest.mark.parametrize("seed", [0, 1])
def test_languages_and_proofs_do_not_depend_on_jobs(little_effort: None, seed: int) -> None:
    one, two = (built(Processes(jobs), "gw2-2x3", seed) for jobs in (1, 2))
    assert one.figures["equivariant_rounds"] > 0
    assert one.language.guarantee.size == one.language.guarantee.lower_bound == 5
    assert one.language.words == two.language.words
    assert list(one.evidence) == list(two.evidence)


def test_of_two_languages_that_from_above_is_taken(little_effort: None) -> None:
    """If it comes in the next turn at the latest; whatever else it says is no bound."""
    job = built(Processes(1), "gw1-2x2").job
    words = minimal(job).partition
    renamed = np.array([7 - words[state] for state in job.states])
    plays: list[list[Answer]] = [[OVER], [Trying("nothing"), OVER], [Fewer(renamed), OVER]]
    for answers in plays:
        found = minimal(replace(job, incumbent=None, runner=Playing(answers)))
        assert (found.size, found.lower_bound) == (3, 3)


@pytest.mark.parametrize("finds", [True, False])
def test_symmetric_words_of_the_last_number_are_looked_for_from_below(
    little_effort: None, monkeypatch: pytest.MonkeyPatch, finds: bool
) -> None:
    """What they find ends the search; that they find nothing is no bound."""
    asked: list[tuple[int, int]] = []
    find = EquivariantSearch.find

    def told(
        search: EquivariantSearch, size: int, rounds: int, *, between: Callable[[], None]
    ) -> Assignment | None:
        asked.append((size, rounds))
        return find(search, size, rounds, between=between) if finds else None

    job = built(Processes(1), "gw2-2x3").job
    monkeypatch.setattr(EquivariantSearch, "find", told)
    found = minimal(replace(job, incumbent=None, runner=Playing([OVER])))
    assert (found.size, found.lower_bound) == (5, 5)
    assert asked
    assert {size for size, _ in asked} <= {2, 3, 4, 5}
    assert [rounds for _, rounds in asked] == [500 << turn for turn in range(len(asked))]


def test_who_looks_for_symmetric_words_listens_meanwhile() -> None:
    candidates = all_tasks("grid", "gw2-2x3")
    refuter = Refuter(candidates.spaces, symmetry_group(candidates), len(candidates.rows), 0)
    states = sorted({s for space in candidates.spaces for s in space.state.tolist()})

    def heard() -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        EquivariantSearch(states, refuter, 0).find(5, 500, between=heard)


def test_a_lie_from_above_is_not_believed(little_effort: None) -> None:
    """What is heard is verified by definition before it is taken."""
    job = built(Processes(1), "gw2-2x3").job
    lie = Fewer(np.zeros(len(job.states), np.int64))
    with pytest.raises(AssertionError, match="no coordination language"):
        minimal(replace(job, incumbent=None, runner=Playing([lie, OVER])))


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_search_may_end_with_what_it_began_with(
    monkeypatch: pytest.MonkeyPatch, little_effort: None, jobs: int
) -> None:
    """A separating language with the fewest words, which is proved in later turns only.

    Then one that separates less is looked for, when the search from above is over.
    """
    job = built(Processes(1), "gw1-2x2").job
    best = minimal(job).partition
    module = sys.modules["coordlang.vocabulary.minimal"]
    monkeypatch.setattr(module, "short_separating_search", lambda _: Outcome(best, 1))
    # What is quick is not decided from below alone.
    from_below, asked = module._Search._decide_from_below, list[int]()

    def later(search: Any, budget: SolverBudget) -> SolverBudget:
        asked.append(search.lower)
        return budget if len(asked) == 1 else from_below(search, budget)

    monkeypatch.setattr(module._Search, "_decide_from_below", later)
    found = minimal(replace(job, runner=Processes(jobs)))
    assert len(asked) > 1
    assert (found.size, found.lower_bound) == (3, 3)
