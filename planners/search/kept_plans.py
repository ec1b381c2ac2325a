# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for all optimal plans, answered from a store where it was done before."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from planners.joint.model import FullState, JointModel, PlanningTask
from planners.search import optimal_plans
from planners.search.plan_space import PlanSpace
from planners.system.errors import UsageError, note

if TYPE_CHECKING:
    import pathlib

    from planners.parallel.batch import Store

#: The name of their folder.  What other code has kept there is never looked at, and goes in time.
_FOLDER = "plans-8"
#: Bytes that all tables together may take.
_MOST_BYTES = 2**30
#: The arrays of a plan space that are kept; goals are those of the task.
_KEPT = ("rows", "state", "layer", "first", "target", "labels", "cost", "starts", "second")


#: The store that a `keeping_plans` block uses, and its `model_digest`, which looks at each model
#: once.  Outside there is none: a library looks into no folder of its user's unasked.
_USED: ContextVar[tuple[Store, Callable[[JointModel], str]] | None] = ContextVar(
    "plans that are kept", default=None
)


def plan_store(folder: pathlib.Path) -> Store:
    """The store of plans in a folder, bounded."""
    from planners.parallel.batch import Store

    return Store(folder / _FOLDER, _MOST_BYTES)


def default_folder(environment: Mapping[str, str] = os.environ) -> pathlib.Path | None:
    """Where a user's plans are; None where the user wants none, or has no home.

    ``$COORDLANG_CACHE`` if it is set (``off``: none), else ``coordlang`` in ``$XDG_CACHE_HOME``, or
    in ``~/.cache``.
    """
    chosen = environment.get("COORDLANG_CACHE", "")
    if chosen.lower() == "off":
        return None
    import pathlib

    if chosen:
        with suppress(FileNotFoundError):  # the working directory has been removed
            return pathlib.Path(chosen).absolute()  # a worker may have another one
        return None
    base = environment.get("XDG_CACHE_HOME", "")
    with suppress(RuntimeError):
        # By its specification a relative path is ignored.
        caches = pathlib.Path(base) if os.path.isabs(base) else pathlib.Path.home() / ".cache"
        if caches.parent.is_dir():
            return caches / "coordlang"
    return None


@contextmanager
def keeping_plans(store: Store | None) -> Iterator[None]:
    """Let `search` use a store inside of the block; None: no store."""
    token = _USED.set(None if store is None else (store, cache(model_digest)))
    try:
        yield
    finally:
        _USED.reset(token)


def store_in_use() -> Store | None:
    """The store that `search` uses here, to be used in other processes, too."""
    used = _USED.get()
    return None if used is None else used[0]


def search(model: JointModel, task: PlanningTask) -> PlanSpace:
    """All optimal plans of one task, see `planners.search.optimal_plans.search`.

    In a block of `keeping_plans` they are read from the store, if they are there, and else kept.
    Those within slack are not kept, but the optimal ones are, by which they are found.
    """
    if model.slack:
        makespan, _ = search(model.without_slack, task).cost_of(0)
        return optimal_plans.search_within(model, task, makespan)
    used = _USED.get()
    if used is None:
        return optimal_plans.search(model, task)
    store, digest_of = used
    key = key_of(digest_of(model), task)
    table = store.read(key)
    if table is not None:  # the plan space of the task, as the hash of its entry says
        goal = np.zeros(len(table["state"]), np.int64)
        return PlanSpace(model=model, goal=goal, goals=(task.goal,), **table)
    found = optimal_plans.search(model, task)
    try:
        store.write(key, {name: getattr(found, name) for name in _KEPT})
    except (UsageError, MemoryError) as error:
        said = str(error).partition("\n")[0] or "out of memory"
        note(
            f"the plans that were found are not kept: {said} ({store.path})",
            remedy="Say --no-cache, or set COORDLANG_CACHE to a folder that you may write to.",
        )
    return found


def model_digest(model: JointModel) -> str:
    """A hash of all that a search reads of a joint model, whatever files it was made from."""
    from planners.parallel.batch import digest

    read = (
        (a.label, a.precondition, a.owners, a.parts, a.cost, sorted(map(repr, a.links)), a.effects)
        for a in model.actions
    )
    return digest(
        tuple(map(repr, read)),  # in PDDL an atom and an action as a literal may be one text
        model.robots,
        model.labels,
        model.idling_costs,
        model.codec.facts.texts,
        model.codec.memory,
        model.cost,
        int(model.is_joint_action),
    )


def key_of(model: str, task: PlanningTask) -> str:
    """The key of a task's plan space, of all that it depends on.

    That is the model (its `model_digest`), the task, the code of this package and numpy.
    """
    from planners.parallel.batch import code_hash, digest

    goal = task.goal
    wanted = goal.facts if isinstance(goal, FullState) else repr(goal)
    return digest(code_hash("planners"), np.version.version, model, task.init, wanted)
