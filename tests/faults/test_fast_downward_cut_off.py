# SPDX-License-Identifier: GPL-3.0-or-later
"""What Fast Downward writes, cut off: never a false agreement, never a false "no plan"."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from coordlang.api.inputs import read_instance
from coordlang.api.options import GivenOptions
from planners.classical import LONGEST, ClassicalTask, compile_classical
from planners.classical import fast_downward_searches as searches
from planners.classical import fast_downward_worker as worker
from planners.classical.fast_downward import FastDownwardFailed, total_cost
from planners.classical.fast_downward_searches import SEARCHES, answered, as_json
from tests.support.domains import DOMAINS
from tests.support.forks import fork, fork_command

CELLS = [DOMAINS / "three-cells" / name for name in ("domain.pddl", "problem.pddl")]


@pytest.fixture(scope="module")
def task() -> ClassicalTask:
    domain, problem = CELLS
    loaded = read_instance(domain, problem, None, GivenOptions.of())
    return compile_classical(loaded.model, loaded.tasks[0], 2000, LONGEST)


@pytest.fixture(scope="module")
def answer(task: ClassicalTask) -> dict[str, Any]:
    """What the worker writes of the task."""
    found: dict[str, Any] = {}
    read = searches._read_answer
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(searches, "_read_answer", lambda path: found.update(read(path)) or found)
        assert total_cost(task) == 2
    assert found["status"] == "solved"
    return found


@pytest.mark.parametrize("every", [97, pytest.param(1, marks=pytest.mark.slow)])
def test_the_answer_is_cut_off(
    every: int, answer: dict[str, Any], task: ClassicalTask, tmp_path: Path
) -> None:
    whole = json.dumps(answer).encode()
    for size in (*range(0, len(whole), every), len(whole) - 1, len(whole)):
        (tmp_path / "result.json").write_bytes(whole[:size])
        if size == len(whole):
            assert answered(task, tmp_path, 0) == answer["plan"]
        else:
            with pytest.raises(FastDownwardFailed, match="is not complete"):
                answered(task, tmp_path, 0)


def test_a_plan_that_is_none_is_no_answer(
    answer: dict[str, Any], task: ClassicalTask, tmp_path: Path
) -> None:
    plan = answer["plan"]
    for wrong in ([], plan[:1], plan[1:], plan[::-1], [*plan, 10**6], [-1]):
        (tmp_path / "result.json").write_text(json.dumps({**answer, "plan": wrong}))
        with pytest.raises(FastDownwardFailed, match="actions that are no plan of its task"):
            answered(task, tmp_path, 0)


@pytest.mark.parametrize("every", [11, pytest.param(1, marks=pytest.mark.slow)])
def test_its_plan_is_cut_off(
    every: int, task: ClassicalTask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In place of Fast Downward runs a program that copies a part of its plan and ends with 0."""

    def work() -> None:
        from up_fast_downward.fast_downward import FastDownwardMixin

        monkeypatch.chdir(tmp_path)
        command = FastDownwardMixin._get_cmd

        def kept(self: Any, domain: str, problem: str, plan: str) -> list[str]:
            copy = ["sh", "-c", 'p="$1"; shift; "$@" && cp "$p" whole', "sh", plan]
            return [*copy, *map(str, command(self, domain, problem, plan))]

        monkeypatch.setattr(FastDownwardMixin, "_get_cmd", kept)
        given, (search, _) = json.loads(as_json(task, None)), SEARCHES[0]
        print(json.dumps(worker.solve(given, search)["plan"]))
        length = (tmp_path / "whole").stat().st_size
        for size in (*range(0, length, every), length):

            def cut(_: Any, __: str, ___: str, plan: str, size: int = size) -> list[str]:
                return ["sh", "-c", f'head -c {size} whole > "$1"', "sh", plan]

            monkeypatch.setattr(FastDownwardMixin, "_get_cmd", cut)
            try:
                print(json.dumps(worker.solve(given, search)["plan"]))
            except Exception as error:  # whatever unified-planning raises: the worker ends with 1
                print(json.dumps(repr(error)))

    ended = fork(work).join()
    assert ended.code == 0, ended.err
    whole, *cuts = [json.loads(line) for line in ended.out.splitlines()]
    assert cuts[-1] == whole
    for plan in cuts:
        assert isinstance(plan, str) or plan == whole or task.cost_of_plan(plan) is None, plan
    assert [] in cuts


@pytest.mark.slow
@pytest.mark.parametrize("how", [search for search, _ in SEARCHES])
def test_its_translated_task_is_cut_off_at_every_length(
    how: str, task: ClassicalTask, tmp_path: Path
) -> None:
    """The file ``output.sas`` between its translator and its search."""
    import up_fast_downward
    from unified_planning.io import PDDLWriter
    from up_fast_downward.utils import introduce_artificial_goal_action

    problem, _, _ = introduce_artificial_goal_action(worker.build(json.loads(as_json(task, None))))
    writer = PDDLWriter(problem)
    writer.write_domain(str(tmp_path / "domain.pddl"))
    writer.write_problem(str(tmp_path / "problem.pddl"))
    home = Path(up_fast_downward.__file__).parent / "downward"
    translate = [sys.executable, str(home / "fast-downward.py"), "--translate"]
    subprocess.run(
        [*translate, "domain.pddl", "problem.pddl"], cwd=tmp_path, check=True, capture_output=True
    )
    sas = (tmp_path / "output.sas").read_bytes()
    plan = tmp_path / "plan"
    search = [str(home / "builds/release/bin/downward"), "--search", how]
    answers = set()
    for size in range(len(sas) + 1):
        plan.unlink(missing_ok=True)
        ended = subprocess.run(
            [*search, "--internal-plan-file", str(plan)], input=sas[:size], capture_output=True
        )
        text = plan.read_text() if plan.exists() else None
        answers.add((ended.returncode, text if ended.returncode else "; cost = 3" in str(text)))
    assert answers == {(33, None), (0, True)}  # 33: bad input


def at_most(size: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


@pytest.mark.parametrize("size", [0, 700, 4_000])
def test_a_disk_that_is_full_at_some_length(size: int, tmp_path: Path) -> None:
    check_on_a_full_disk(size)


@pytest.mark.slow
def test_a_disk_that_is_full_at_many_lengths() -> None:
    codes = [check_on_a_full_disk(size) for size in range(0, 12_000, 50)]
    print({code: codes.count(code) for code in set(codes)})
    assert set(codes) == {0, 3}


def check_on_a_full_disk(size: int) -> int:
    ended = fork_command("check", *CELLS, before=lambda: at_most(size)).join()
    if ended.code == 0:
        assert ended.out.startswith("coordlang      makespan 2\nFast Downward  makespan 2 ")
    else:
        assert ended.code == 3, ended
        assert ended.out == ""
        assert ended.err.startswith("coordlang: ")
        assert "internal error" not in ended.err
    return ended.code
