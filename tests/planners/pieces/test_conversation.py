# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversations: the same answers here and in another process, also when that one is lost."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from planners.limits import address_space, limited_memory
from planners.pieces.beside import Beside
from planners.pieces.conversation import Conversation, Here
from planners.pieces.kept import Kept
from planners.pieces.processes import Processes
from tests.support.pieces import sums
from tests.support.processes import runs, until


def heard(conversation: Conversation, messages: list[int]) -> tuple[list[int], set[int]]:
    """Two answers for each message, and the processes that gave them."""
    for message in messages:
        conversation.send(message)
    answers = [conversation.answer() for _ in range(2 * len(messages))]
    return [value for value, _ in answers], {process for _, process in answers}


def test_answers_are_the_same_whoever_gives_them() -> None:
    here, beside = Here(sums, 5), Beside(sums, 5)
    for messages in ([1, 2], [3], [4, 5, 6]):
        values, processes = heard(here, messages)
        assert processes == {os.getpid()}
        assert not here.ready()
        assert heard(beside, messages) == (values, {beside.pid})
    assert not here.goes_on_alone
    assert beside.goes_on_alone
    beside.send(1)
    until(beside.ready)
    here.close()
    beside.close()
    assert not runs(beside.pid)


@pytest.mark.parametrize("answered", [0, 1, 4])
def test_a_process_that_is_lost_is_replaced(answered: int) -> None:
    """What was heard is not heard again."""
    beside = Beside(sums, 0)
    for message in (1, 2, 3):
        beside.send(message)
    values = [beside.answer()[0] for _ in range(answered)]
    os.kill(beside.pid, signal.SIGKILL)
    until(lambda: not runs(beside.pid))
    while len(values) < 6:
        values.append(beside.answer()[0])
    beside.send(4)
    assert [*values, beside.answer()[0]] == [1, 1, 3, 3, 6, 6, 10]
    assert not beside.goes_on_alone
    beside.close()


@pytest.mark.parametrize("kind", [Here, Beside])
def test_errors_are_those_of_the_work(kind: type[Here] | type[Beside]) -> None:
    conversation = kind(sums, 0)
    conversation.send(0)
    assert conversation.answer()[0] == 0
    with pytest.raises(ZeroDivisionError, match="a bug"):
        conversation.answer()
    conversation.close()


def test_more_than_one_job_allows_another_process(tmp_path: Path) -> None:
    for jobs in (1, 2):
        conversation = Kept(Processes(jobs), tmp_path, print).beside(sums, 0)
        assert conversation.goes_on_alone == (jobs > 1)
        conversation.close()


def test_without_memory_there_is_no_other_process() -> None:
    with limited_memory(address_space() + (300 << 20)):
        conversation = Processes(jobs=2).beside(sums, 0)
    assert not conversation.goes_on_alone
    conversation.close()
