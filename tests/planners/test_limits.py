# SPDX-License-Identifier: GPL-3.0-or-later
"""A limit ends the work with an error that says how far it got, in numbers, and what else may help."""

from __future__ import annotations

import gc
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from coordlang.language.partition import Partition
from coordlang.required.choices import Choices, LabelSets
from coordlang.required.composition_walk import moves
from coordlang.required.miscoordination import miscoordination
from coordlang.verification.by_definition import verify
from coordlang.verification.walk import Walk
from planners import grounding
from planners.grounding import instantiate
from planners.joint.composition import ComposingStepper
from planners.joint.model import Options, Stepper, Steps
from planners.joint.tables import Rows
from planners.loading import PlanningInstance, load
from planners.search.edge_index import EdgeIndex
from planners.search.optimal_plans import plan_spaces, search
from planners.search.plan_space import PlanSpace
from planners.search.reachable import PieceSizes, count, explore
from planners.system.errors import OutOfMemory, OutOfTime
from planners.system.limits import (
    limited_memory,
    little_time_after,
    reaching,
    run_until_stopped,
    time_left,
    time_limit,
)
from tests.support.domains import DOMAINS


def late() -> OutOfTime:
    """What the alarm raises."""
    try:
        with time_limit(0.01):
            while True:
                pass
    except OutOfTime as error:
        return error


def test_the_innermost_block_speaks() -> None:
    with (
        pytest.raises(OutOfTime) as caught,
        reaching(lambda: "the whole", "less of everything"),
        reaching(lambda: f"{2 + 1} of 9 parts", "fewer parts"),
    ):
        raise late()
    assert str(caught.value).splitlines()[1:] == [
        "  Reached: 3 of 9 parts.",
        "  Use a larger --time-limit, or fewer parts.",
    ]


def test_memory_that_is_used_up_is_an_error_with_a_code() -> None:
    with (
        limited_memory(900 << 30),
        pytest.raises(OutOfMemory) as caught,
        reaching(lambda: "half of it", "fewer parts"),
    ):
        raise MemoryError
    assert caught.value.exit_code == 22
    assert "Reached: half of it." in str(caught.value)
    assert "Use a larger --memory-limit, or fewer parts." in str(caught.value)


def test_an_estimate_keeps_its_own_remedy() -> None:
    with pytest.raises(OutOfMemory) as caught, reaching(lambda: "half of it", "fewer parts"):
        raise OutOfMemory("this would need 9 GiB", remedy="Use fewer robots.")
    assert str(caught.value) == "this would need 9 GiB\n  Reached: half of it.\n  Use fewer robots."


def test_other_errors_pass() -> None:
    with pytest.raises(KeyError), reaching(lambda: "half of it", "fewer parts"):
        raise KeyError


class Finalized:
    """Its end lasts until the alarm rings, and loses what the alarm raises."""

    lost = False

    def __del__(self) -> None:
        try:
            while True:
                pass
        except OutOfTime:
            Finalized.lost = True
            raise


def test_an_alarm_lost_in_a_finalizer_rings_again() -> None:
    def work() -> None:
        Finalized()
        assert Finalized.lost
        for _ in range(200):  # without the second alarm this ends, and nothing is raised
            time.sleep(0.01)

    hook = sys.unraisablehook
    with pytest.raises(OutOfTime), time_limit(0.05):
        work()
    assert sys.unraisablehook is hook


def test_other_lost_errors_are_told_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda unraisable: told.append(unraisable.exc_type))

    class Broken:
        def __del__(self) -> None:
            raise KeyError

    with time_limit(100):
        Broken()
        gc.collect()
    assert told == [KeyError]


def test_time_left() -> None:
    assert time_left() == float("inf")
    with time_limit(100):
        assert 50 < time_left() <= 100
    assert time_left() == float("inf")


def test_limits_within_limits() -> None:
    """The one that is over first rings; leaving the inner block gives the outer its time back."""
    with time_limit(100):
        with time_limit(50):
            assert 25 < time_left() <= 50
        assert 75 < time_left() <= 100
        with time_limit(200):
            assert 75 < time_left() <= 100
        assert 75 < time_left() <= 100
    assert time_left() == float("inf")
    with pytest.raises(OutOfTime, match=r"limit of 0\.05 s"), time_limit(0.05), time_limit(10):
        time.sleep(2)

    def inner_then_outer() -> None:
        with pytest.raises(OutOfTime, match=r"limit of 0\.05 s"), time_limit(0.05):
            time.sleep(2)
        time.sleep(2)

    with pytest.raises(OutOfTime, match=r"limit of 0\.3 s"), time_limit(0.3):
        inner_then_outer()


@dataclass(frozen=True)
class Stopping(Stepper):
    """A stepper that a limit stops after some tables of states."""

    stepper: Stepper
    error: BaseException
    left: list[int]

    def steps(self, rows: Rows, options: Options | None = None) -> Steps:
        self.left[0] -= 1
        if self.left[0] < 0:
            raise self.error
        return self.stepper.steps(rows, options)

    def choices(self, rows: Rows) -> Options:
        return self.stepper.choices(rows)

    def most_steps(self, rows: Rows) -> int:
        return self.stepper.most_steps(rows)

    def why_not(self, row: Rows, labels: Sequence[int]) -> str:
        return self.stepper.why_not(row, labels)


def corners(problem: str = "corners-3x3") -> PlanningInstance:
    return load(DOMAINS / "grid" / "domain.pddl", [DOMAINS / "grid" / f"{problem}.pddl"])


def stopped(loaded: PlanningInstance, after: int, error: BaseException) -> PlanningInstance:
    return replace(
        loaded, model=replace(loaded.model, stepper=Stopping(loaded.model.stepper, error, [after]))
    )


@pytest.mark.parametrize("error", [late(), MemoryError()], ids=["time", "memory"])
def test_search_says_how_far_it_got(error: BaseException) -> None:
    loaded = stopped(corners(), 4, error)  # two tables of states to choose a bound
    with pytest.raises((OutOfTime, OutOfMemory)) as caught:
        search(loaded.model, loaded.tasks[0])
    # Within four steps every step leads nearer: 2 * 2 states after one, and after two both robots
    # are in different ones of three cells between the corners.
    assert (
        f"11 states within 2 steps of the initial state of {loaded.tasks[0].name} with a bound of "
        "4, 6 of them new in the last step" in str(caught.value)
    )


def test_exploring_says_how_far_it_got() -> None:
    loaded = stopped(corners(), 1, late())
    with pytest.raises(OutOfTime, match=r"time limit") as caught:
        explore(loaded.model, loaded.tasks[0].init[None, :])
    assert caught.value.reached == (
        "Reached: 9 states within 1 steps of the initial states, 9 joint steps; 8 states are new in the last step."
    )


def test_the_goals_done_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = corners()
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    groups = [(loaded.tasks[0].goal, None)] * 3
    batches = plan_spaces(space, groups, PieceSizes(pairs=len(space)))
    next(batches)

    def fail(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("planners.search.optimal_plans.distances", fail)
    with pytest.raises(OutOfMemory) as caught:
        next(batches)
    assert "the optimal plans to 1 of 3 goals, over 72 states" in str(caught.value)


def test_grounding_says_how_far_it_got(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise late()

    with monkeypatch.context() as patched:
        patched.setattr(instantiate, "reachable_arguments", fail)
        with pytest.raises(OutOfTime) as caught:
            corners()
    assert "looking for the applicable instances of 1 action schemas over 11 objects" in str(
        caught.value
    )
    assert grounding.FEWER in str(caught.value)
    monkeypatch.setattr(instantiate._Grounder, "action", fail)
    with pytest.raises(OutOfTime, match="time limit") as caught:
        corners()
    assert "0 of at most 48 ground actions" in str(caught.value)


def plans(problem: str) -> PlanSpace:
    loaded = corners(problem)
    return search(loaded.model, loaded.tasks[0])


def test_required_coordination_says_how_far_it_got(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise late()

    space = plans("three-robots-3x3")
    monkeypatch.setattr(LabelSets, "unions", fail)
    with pytest.raises(OutOfTime) as caught:
        Choices(space)
    assert f"choices in 1 sets, over {len(space):,} states on optimal plans" in str(caught.value)


def test_a_size_that_nobody_can_wait_for() -> None:
    space = plans("three-robots-3x3")
    every = np.repeat(np.arange(len(space))[:, None], space.robots + 1, axis=1)
    walked = moves(space, EdgeIndex.of(space), every, most=1000.0)
    with pytest.raises(
        OutOfMemory,
        match=r"nodes of one layer of the walk have .* combinations of 3 plans' next steps",
    ):
        next(walked)


def test_verification_and_the_search_for_a_break_say_how_far_they_got(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    space = plans("corners-3x3")
    table = Partition(
        ("w0",), np.zeros((0, space.rows.shape[1]), np.uint64), np.zeros(0, np.int64), 0
    )

    def fail(*_: object, **__: object) -> None:
        raise late()

    monkeypatch.setattr(Walk, "_children", fail)
    with pytest.raises(OutOfTime) as caught:
        verify(table, [space])
    assert "layer 1 of 5 of the verification, 1 nodes of its walk" in str(caught.value)
    monkeypatch.setattr(Choices, "edges_of", fail)
    with pytest.raises(OutOfTime) as caught:
        miscoordination(space, 0)
    assert "0 of 4 steps to the first break of a mixture, 1 nodes" in str(caught.value)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "problem", ["corners-4x4", pytest.param("three-robots-3x3", marks=pytest.mark.slow)]
)
def test_work_in_pieces_is_the_same_work(problem: str) -> None:
    loaded = corners(problem)
    init = loaded.tasks[0].init[None, :]
    whole, space = search(loaded.model, loaded.tasks[0]), explore(loaded.model, init)
    assert isinstance(loaded.model.stepper, ComposingStepper)
    loaded.model.stepper.piece = 11
    small = PieceSizes(states=7, steps=40)
    for kept in (8_000_000, 100, 0):
        pieces = search(loaded.model, loaded.tasks[0], replace(small, kept=kept))
        for name in ("rows", "state", "layer", "first", "target", "labels", "cost", "starts"):
            assert (getattr(pieces, name) == getattr(whole, name)).all(), name
    assert count(loaded.model, init, small) == (len(space), len(space.target))
    again = explore(loaded.model, init, small)
    for name in ("rows", "first", "target", "labels", "cost"):
        assert (getattr(again, name) == getattr(space, name)).all(), name


def test_combinations_that_do_not_fit_are_not_made() -> None:
    loaded = corners("three-robots-3x3")
    assert isinstance(loaded.model.stepper, ComposingStepper)
    loaded.model.stepper.piece = 10
    loaded.model.stepper.memory_left = lambda: 1000
    # Each robot in its corner may go two ways or stay; two of them may not go to the one cell
    # between them.
    with pytest.raises(
        OutOfMemory, match="3 of 3 robots have 24 combinations of subactions in 1 state: about"
    ):
        search(loaded.model, loaded.tasks[0])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_what_linux_says_of_memory_is_what_psutil_says(monkeypatch: pytest.MonkeyPatch) -> None:
    import psutil

    from planners.system import limits as module

    assert module.address_space() == pytest.approx(psutil.Process().memory_info().vms, rel=0.02)
    left = psutil.virtual_memory().available
    assert module._machine_memory_left() == pytest.approx(left, rel=0.1)
    for name in ("_MEMORY_OF_MACHINE", "_MEMORY_OF_PROCESS"):
        monkeypatch.setattr(module, name, Path("/nowhere"))
    assert module.address_space() == pytest.approx(psutil.Process().memory_info().vms, rel=0.02)
    assert module._machine_memory_left() == pytest.approx(left, rel=0.1)


def test_what_follows_on_stopped_work_is_stopped_soon() -> None:
    def busy() -> None:
        while True:
            pass

    with time_limit(60):
        stopped = run_until_stopped(lambda: _raise(OutOfTime("the time limit of the test is over")))
        assert isinstance(stopped, OutOfTime)
        with pytest.raises(OutOfTime, match="limit of the test"), little_time_after(stopped):
            busy()
        with little_time_after(None):
            assert time_left() == math.inf  # the clock is stopped


def _raise(error: BaseException) -> None:
    raise error
