# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks of problems as jobs: whether each requires coordination, and how often robots fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import msgspec
import numpy as np

from coordlang.language.tolerance import percent
from coordlang.required.choices import Choices, LabelSets
from coordlang.required.failures import NONE, FailureEstimate, Failures, failures
from coordlang.required.miscoordination import Miscoordination, miscoordination
from planners.joint.composition import cost_of
from planners.joint.model import JointModel, PlanningTask
from planners.joint.tables import Ints
from planners.loading import PlanningInstance
from planners.parallel.batch import Batch, Table, digest
from planners.parallel.store import Store
from planners.parallel.workers import Workers
from planners.pddl.model_options import Cost
from planners.search.kept_plans import keeping_plans, search, store_in_use
from planners.search.plan_file import json_count
from planners.search.plan_space import PlanSpace
from planners.search.plans import counts
from planners.system.notebook import counted

#: Additions after which the failures of one task are estimated, some seconds of work.
_ADDITIONS = 3_000_000


@dataclass(frozen=True, slots=True)
class TaskAnswer:
    """One task: its optimal makespan and plans, and plans that miscoordinate, if there are any.

    ``failures`` says how often robots do that draw their plans without a word, ``fewest`` the same
    of the plans with the fewest actions, if they fail less often.
    """

    makespan: int
    plans: int
    witness: Miscoordination | None
    failures: Failures
    fewest: FewestActions | None = None


@dataclass(frozen=True, slots=True)
class FewestActions:
    """The optimal plans of a task with the fewest actions, and how often robots fail with them."""

    plans: int
    required: bool
    failure: float

    def data(self) -> dict[str, Any]:
        """Return it as JSON data."""
        return {
            "plans": json_count(self.plans),
            "requires_coordination": self.required,
            "failure": self.failure,
        }

    def text(self) -> str:
        """Return it as a line."""
        line = f"With --cost {FEWEST}, which leaves {counted(self.plans, 'plan')}, "
        if not self.required:
            return f"{line}coordination is not required."
        return f"{line}they fail in {percent(self.failure)}."


def answers(loaded: PlanningInstance, workers: Workers) -> list[TaskAnswer]:
    """Search the task of each problem and decide whether it requires coordination, as jobs.

    Raises `ProvedImpossible` for the first task without a plan.
    """
    model, tasks = loaded.model, loaded.tasks
    effort = float(len(model.codec.facts) * sum(map(len, model.labels)))  # a guess: no search yet
    numbers = range(len(tasks))
    hashes = (loaded.domain.source.sha256, *(p.source.sha256 for p in loaded.problems))
    identity = digest(*hashes, repr(loaded.options))
    shared = (model, tasks, store_in_use())
    batch = Batch("coordination", _answer, shared, numbers, identity, [effort for _ in numbers])
    return [_read_answer(table) for table in workers.tables(batch)]


#: An answer as JSON holds it: makespan, plans, witness, failures, and what the fewest actions do:
#: plans, whether coordination is required, failure.  Exact numbers are texts.
_Failures = tuple[str | None, tuple[int, int] | None, str]
_Record = tuple[int, str, Miscoordination | None, _Failures, tuple[str, bool, float] | None]


def _answer(shared: tuple[JointModel, Sequence[PlanningTask], Store | None], number: int) -> Table:
    """One job: a task."""
    model, tasks, folder = shared
    with keeping_plans(folder):
        space = search(model, tasks[number])
    witness = miscoordination(space, 0)
    found = NONE if witness is None else failures([space], [None], _ADDITIONS)
    drawn = None if found.estimate is None else (found.estimate.failures, found.estimate.runs)
    said = (None if found.mean is None else str(found.mean), drawn, found.why_not)
    fewest = None if witness is None else _fewest(space, found)
    record: _Record = (space.least_makespan(0), _plans(space), witness, said, fewest)
    return {"answer": np.frombuffer(msgspec.json.encode(record), np.uint8)}


def _plans(space: PlanSpace) -> str:
    return str(counts(space)[int(space.starts[0])])


def _fewest(space: PlanSpace, found: Failures) -> tuple[str, bool, float] | None:
    """What holds of the plans with the fewest actions, None if it is no better."""
    fewer = fewest_actions(space)
    if fewer is None:
        return None
    required = bool(Choices(fewer).requires[fewer.starts[0]])
    own = failures([fewer], [None], _ADDITIONS) if required else NONE
    if required and (own.mean is None or found.mean is None or own.mean >= found.mean):
        return None
    return _plans(fewer), required, float(own.mean or 0)


def _read_answer(table: Table) -> TaskAnswer:
    record = msgspec.json.decode(table["answer"].tobytes(), type=_Record)
    makespan, plans, witness, (mean, drawn, why_not), fewest = record
    exact = None if mean is None else Fraction(mean)
    return TaskAnswer(
        makespan,
        int(plans),
        witness,
        Failures(exact, exact, FailureEstimate(*drawn) if drawn else None, why_not),
        FewestActions(int(fewest[0]), *fewest[1:]) if fewest else None,
    )


#: The cost that has these plans only.
FEWEST: Cost = "makespan+actions"
#: Edges of plan spaces up to which `requiring` looks at them: some seconds of work.
MOST_EDGES = 300_000


def fewest_actions(space: PlanSpace) -> PlanSpace | None:
    """The plans with the fewest actions, None if all plans are or the cost is no makespan.

    O(edges).
    """
    model = space.model
    if model.cost != "makespan" or model.slack:
        return None
    counts = _actions(model)
    cost = sum(counts[robot][space.robot_labels(robot)] for robot in range(space.robots))
    fewer = space.cheapest(np.asarray(cost))
    return None if len(fewer.target) == len(space.target) else fewer


def requiring(spaces: Sequence[PlanSpace]) -> int | None:
    """How many tasks require coordination if only plans with the fewest actions count.

    None if all plans count, or there are too many.
    """
    if sum(len(space.target) for space in spaces) > MOST_EDGES:
        return None
    found = [(space, fewest_actions(space)) for space in spaces]
    if all(fewer is None for _, fewer in found):
        return None
    sets = LabelSets()
    return sum(
        int(Choices(used, sets).requires[used.starts].sum())
        for used in (space if fewer is None else fewer for space, fewer in found)
    )


def _actions(model: JointModel) -> list[Ints]:
    """For each robot how many actions each of its labels is; a shared one counts once."""
    if model.is_joint_action:
        return [np.array([0] + [1] * (len(own) - 1), np.int64) for own in model.labels]
    counts = [dict.fromkeys(own, 0) for own in model.labels]
    for action in model.actions:
        counts[action.owners[0]][action.label] = cost_of(action, FEWEST)
    return [np.array(list(own.values()), np.int64) for own in counts]
