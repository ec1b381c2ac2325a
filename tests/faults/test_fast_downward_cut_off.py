# SPDX-License-Identifier: GPL-3.0-or-later
"""What Fast Downward writes, cut off: never a false agreement, never a false "no plan"."""

from __future__ import annotations

import resource
from functools import partial
from pathlib import Path

import pytest

from coordlang.commands.inputs import load
from planners.classical import LONGEST, ClassicalTask, compile_classical, fast_downward
from planners.classical.fast_downward import FastDownwardFailed, answered, total_cost
from tests.support.domains import DOMAINS
from tests.support.forks import fork_command

CELLS = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]


@pytest.fixture(scope="module")
def task() -> ClassicalTask:
    domain, problem = CELLS
    loaded = load(domain, problem)
    return compile_classical(loaded.model, loaded.tasks[0], 2000, LONGEST)


@pytest.fixture(scope="module")
def plan(task: ClassicalTask) -> str:
    """What Fast Downward writes of the task."""
    found: list[str] = []
    with pytest.MonkeyPatch.context() as patch:

        def read(classical: ClassicalTask, directory: Path, code: int) -> int | None:
            found.append((directory / "plan").read_text())
            return answered(classical, directory, code)

        patch.setattr(fast_downward, "answered", read)
        assert total_cost(task) == 2
    return found[0]


def test_its_plan_is_cut_off(plan: str, task: ClassicalTask, tmp_path: Path) -> None:
    """At every length: the line with the cost is the last one, and it must be whole."""
    with pytest.raises(FastDownwardFailed, match="is not complete"):
        answered(task, tmp_path, 0)
    end = len(plan.rstrip())
    for size in range(len(plan) + 1):
        (tmp_path / "plan").write_text(plan[:size])
        if size >= end:
            assert answered(task, tmp_path, 0) == 2
        else:
            with pytest.raises(FastDownwardFailed, match="is not complete"):
                answered(task, tmp_path, 0)


def test_a_plan_that_is_none_is_no_answer(plan: str, task: ClassicalTask, tmp_path: Path) -> None:
    *actions, cost = plan.splitlines()
    for wrong in ([], actions[:1], actions[1:], actions[::-1], [*actions, "(fly )"], actions * 2):
        (tmp_path / "plan").write_text("\n".join([*wrong, cost]))
        with pytest.raises(FastDownwardFailed, match="actions that are no plan of its task"):
            answered(task, tmp_path, 0)
    (tmp_path / "plan").write_text("\n".join([*actions, cost.replace("2", "1")]))
    with pytest.raises(FastDownwardFailed, match="actions that are no plan of its task"):
        answered(task, tmp_path, 0)


@pytest.mark.parametrize(
    "size",
    [0, 700, 4_000, *(pytest.param(n, marks=pytest.mark.slow) for n in range(50, 12_000, 50))],
)
def test_a_disk_that_is_full_at_some_length(size: int) -> None:
    limit = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (size, size))
    ended = fork_command("check", *CELLS, before=limit).join()
    assert "internal error" not in ended.err
    if ended.code == 0:
        assert ended.out.startswith("coordlang      makespan 2\nFast Downward  makespan 2 ")
    else:
        assert (ended.code, ended.out) == (3, ""), ended
        assert ended.err.startswith("coordlang: ")
