# SPDX-License-Identifier: GPL-3.0-or-later
"""Tasks of problems as jobs: whether each requires coordination, and how often robots fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import msgspec
import numpy as np

from coordlang.language.provenance import percent
from coordlang.required.choices import Choices, LabelSets
from coordlang.required.failure import NONE, Failures, failures
from coordlang.required.miscoordination import Miscoordination, miscoordination
from planners.joint.model import JointModel, PlanningTask
from planners.joint.tables import Ints
from planners.loading import PlanningInstance
from planners.parallel.batch import Batch, Store, Table, digest
from planners.parallel.workers import Workers
from planners.pddl.model_options import Cost
from planners.search.asynchronous import as_executed
from planners.search.kept_plans import keeping_plans, key_of, model_digest, search, store_in_use
from planners.search.plan_file import json_count
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.messages import counted

#: Additions after which the failures of one task are estimated, some seconds of work.
_ADDITIONS = 3_000_000
#: The cost that has the plans with the fewest actions only.
FEWEST: Cost = "makespan+actions"
#: Edges of plan spaces up to which `requiring` looks at them: some seconds of work.
MOST_EDGES = 300_000


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


def answers(loaded: PlanningInstance, workers: Workers) -> list[TaskAnswer]:
    """Search the task of each problem and decide whether it requires coordination, as jobs.

    Raises `ProvedImpossible` for the first task without a plan.
    """
    model, tasks = loaded.model, loaded.tasks
    effort = float(len(model.codec.facts) * sum(map(len, model.labels)))  # a guess: no search yet
    numbers = range(len(tasks))
    known = model_digest(model)
    identity = digest(*(key_of(known, task) for task in tasks), repr(loaded.options))
    shared = (model, tasks, store_in_use())
    batch = Batch("coordination", _answer, shared, numbers, identity, [effort for _ in numbers])
    decoder = msgspec.json.Decoder(TaskAnswer, dec_hook=lambda _, text: Fraction(text))
    return [decoder.decode(table["answer"].tobytes()) for table in workers.tables(batch)]


def _answer(shared: tuple[JointModel, Sequence[PlanningTask], Store | None], number: int) -> Table:
    """One job: a task; its answer as JSON, in which fractions are texts."""
    model, tasks, folder = shared
    with keeping_plans(folder):
        space = as_executed(search(model, tasks[number]))
    witness = miscoordination(space, 0)
    found = NONE if witness is None else failures([space], [None], _ADDITIONS)
    fewest = None if witness is None else _fewest(space, found)
    answer = TaskAnswer(space.least_makespan(0), Plans.of(space).count, witness, found, fewest)
    return {"answer": np.frombuffer(msgspec.json.encode(answer, enc_hook=str), np.uint8)}


def _fewest(space: PlanSpace, found: Failures) -> FewestActions | None:
    """What holds of the plans with the fewest actions, None if it is no better."""
    fewer = fewest_actions(space)
    if fewer is None:
        return None
    own = failures([fewer], [None], _ADDITIONS).mean
    if own is None or (own and (found.mean is None or own >= found.mean)):
        return None
    return FewestActions(Plans.of(fewer).count, own > 0, float(own))


def fewest_actions(space: PlanSpace) -> PlanSpace | None:
    """The plans with the fewest actions; None: all plans are, or the cost is no makespan."""
    model = space.model
    if model.cost != "makespan" or model.slack or model.is_asynchronous:
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
    used = [space if fewer is None else fewer for space, fewer in found]
    return sum(int(Choices(space, sets).requires[space.starts].sum()) for space in used)


def _actions(model: JointModel) -> list[Ints]:
    """For each robot how many actions each of its labels is; a shared one counts once."""
    if model.is_joint_action:
        return [np.array([0] + [1] * (len(own) - 1), np.int64) for own in model.labels]
    counts = [dict.fromkeys(own, 0) for own in model.labels]
    for action in model.actions:
        counts[action.owners[0]][action.label] = action.second_cost(FEWEST)
    return [np.array(list(own.values()), np.int64) for own in counts]
