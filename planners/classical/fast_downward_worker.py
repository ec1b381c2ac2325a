# SPDX-License-Identifier: GPL-3.0-or-later
"""The child process in which Fast Downward solves one classical task.

``python -P fast_downward_worker.py TASK RESULT SEARCH`` reads the task (JSON, see
`planners.classical.fast_downward_searches.as_json`), solves it by a search that finds optimal plans
(what Fast Downward gets as ``--search``) and writes one JSON object: ``{"status": .., "plan":
numbers of actions or null, "log": the end of what Fast Downward said}``.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import ModuleType
from typing import Any

from planners.limits import limit_memory

#: The exit codes with which Fast Downward's translator and search say that they proved it.
#: unified-planning takes other codes for a proof too, 1 among them, with which the driver ends when
#: Python cannot even start.
_UNSOLVABLE = (10, 11)
#: The code of the driver when its search was killed: by the system, which is out of memory.
_KILLED = 256 - signal.SIGKILL


class _FastDownward(subprocess.Popen[bytes]):
    """Fast Downward with a memory limit, and in our process group.

    unified-planning would give it a session of its own, and then nobody could end it together with
    us.
    """

    memory_limit: int | None = None
    started: list[_FastDownward] = []  # noqa: RUF012 - of the one process that this module is

    def __init__(self, arguments: Any, **settings: Any) -> None:
        settings.pop("start_new_session", None)
        super().__init__(arguments, preexec_fn=lambda: limit_memory(self.memory_limit), **settings)
        self.started.append(self)


def main(task_file: str, result_file: str, search: str) -> None:
    """Solve the task of one file and write the outcome to another (never half of it)."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    task = json.loads(Path(task_file).read_text())
    result = solve(task, search)
    beside = Path(result_file + ".part")
    beside.write_text(json.dumps(result))
    os.replace(beside, result_file)


def _end_with_parent() -> None:
    """End the whole process group when the parent's end of our standard input closes."""
    os.read(0, 1)
    os.killpg(0, signal.SIGKILL)


def solve(task: dict[str, Any], search: str) -> dict[str, Any]:
    """Build the task with unified-planning and ask ``fast-downward-opt`` for an optimal plan.

    The engine calls its answer optimal whatever it is told to search by: ``search`` has to be so.
    """
    sys.modules.setdefault("ConfigSpace", _config_space())
    from unified_planning.engines import PlanGenerationResultStatus as Status
    from unified_planning.shortcuts import OneshotPlanner, get_environment

    get_environment().credits_stream = None
    _FastDownward.memory_limit = task["memory_limit"]
    subprocess.Popen = _FastDownward  # type: ignore[assignment, misc]
    problem = build(task)
    with OneshotPlanner(name="fast-downward-opt") as planner:
        # A search for invariants among facts without arguments takes seconds and gains nothing:
        # 0.05 s without it where it took 7 s.  The engine that promises optimality has no parameter
        # for it, nor for the search.
        planner._fd_translate_options = ["--invariant-generation-max-time", "0"]
        planner._fd_search_config = search
        answer = planner.solve(problem)
    log = "".join(message.message for message in answer.log_messages or ())
    code = _FastDownward.started[-1].returncode
    if answer.status == Status.SOLVED_OPTIMALLY and code == 0:
        outcome = "solved"
    elif answer.status == Status.UNSOLVABLE_PROVEN and code in _UNSOLVABLE:
        outcome = "unsolvable"
    else:
        out_of_memory = answer.status == Status.MEMOUT or code == _KILLED
        outcome = "memory" if out_of_memory else f"ended with exit code {code}"
    plan = (
        [int(step.action.name[1:]) for step in answer.plan.actions] if outcome == "solved" else None
    )
    return {"status": outcome, "plan": plan, "log": log[-2000:]}


def _config_space() -> ModuleType:
    """What unified-planning takes from ConfigSpace: one class, as the type of a parameter.

    ConfigSpace itself loads statistics for longer than most tasks are solved in.
    """
    module = ModuleType("ConfigSpace")
    module.ConfigurationSpace = object  # type: ignore[attr-defined]
    return module


def build(task: dict[str, Any]) -> Any:
    """The task as a unified-planning problem.

    Facts have no arguments and are called ``f0``, ``f1``, ..; actions ``a0``, ``a1``, ..
    """
    from unified_planning.shortcuts import (
        BoolType,
        Fluent,
        InstantaneousAction,
        Int,
        MinimizeActionCosts,
        Not,
        Problem,
    )

    problem = Problem("plain")
    fluents = [Fluent(f"f{n}", BoolType()) for n in range(task["facts"])]
    true = [fluent() for fluent in fluents]
    false = [Not(fact) for fact in true]
    for fluent in fluents:
        problem.add_fluent(fluent, default_initial_value=False)
    for n in task["init"]:
        problem.set_initial_value(true[n], True)
    prices = {}
    for number, (conditions, adds, deletes, cost) in enumerate(task["actions"]):
        if not adds and not deletes:
            continue  # of no use in a plan, and its PDDL could not be read by Fast Downward
        action = InstantaneousAction(f"a{number}")
        for n, positive in conditions:
            action.add_precondition(true[n] if positive else false[n])
        for n in adds:
            action.add_effect(true[n], True)
        for n in deletes:
            action.add_effect(true[n], False)
        problem.add_action(action)
        prices[action] = Int(cost)
    for n, positive in task["goal"]:
        problem.add_goal(true[n] if positive else false[n])
    # Without a metric the engine calls its answer "satisficing".
    problem.add_quality_metric(MinimizeActionCosts(prices))
    return problem


if __name__ == "__main__":
    main(*sys.argv[1:])
