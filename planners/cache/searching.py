# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for all optimal plans, answered from a folder where it was done before."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from planners.joint.model import JointModel, PlanningTask
from planners.search import optimal_plans
from planners.search.plan_space import PlanSpace

if TYPE_CHECKING:  # what reads and writes files is loaded where plans are kept
    from planners.cache.folder import Folder


@dataclass(slots=True)
class _Cache:
    """A folder, and the digests of the models that were asked about: each is made once."""

    folder: Folder
    digests: dict[int, tuple[JointModel, str]] = field(default_factory=dict)

    def key(self, model: JointModel, task: PlanningTask) -> str:
        from planners.cache.plan_spaces import key_of, model_digest

        found = self.digests.get(id(model))
        if found is None:
            found = self.digests[id(model)] = model, model_digest(model)
        return key_of(found[1], task)


#: What the code inside a `keeping_plans` block uses.  Outside there is none: a library looks into
#: no folder of its user's unasked.
_USED: ContextVar[_Cache | None] = ContextVar("plans that are kept", default=None)


@contextmanager
def keeping_plans(folder: Folder | None) -> Iterator[None]:
    """Let `search` use a folder inside of the block; None: no folder."""
    token = _USED.set(None if folder is None else _Cache(folder))
    try:
        yield
    finally:
        _USED.reset(token)


def shared_folder() -> Folder | None:
    """The folder that `search` uses here, to be used in other processes, too."""
    used = _USED.get()
    return None if used is None else used.folder


def search(model: JointModel, task: PlanningTask) -> PlanSpace:
    """All optimal plans of one task, see `planners.search.optimal_plans.search`.

    In a block of `keeping_plans` they are read from the folder, if they are there, and else kept.
    Those within slack are not kept, but the optimal ones are, by which they are found.
    """
    if model.slack:
        makespan, _ = search(model.without_slack, task).cost_of(0)
        return optimal_plans.search_within(model, task, makespan)
    used = _USED.get()
    if used is None:
        return optimal_plans.search(model, task)
    from planners.cache.plan_spaces import as_table, plan_space

    key = used.key(model, task)
    table = used.folder.read(key)
    if table is not None:
        space = plan_space(table, model, task)
        if space is not None:
            return space
        used.folder.ignored(key, f"an entry of {used.folder.path} is not of this task")
    found = optimal_plans.search(model, task)
    used.folder.write(key, as_table(found))
    return found


def search_each(model: JointModel, tasks: Sequence[PlanningTask]) -> PlanSpace:
    """`search` for each task, as one plan space in which every task has a goal of its own."""
    return optimal_plans.joined([search(model, task) for task in tasks])
