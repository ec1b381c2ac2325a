# SPDX-License-Identifier: GPL-3.0-or-later
"""`coordlang inspect`: whatever was misread has to show there."""

from __future__ import annotations

import math
import re
import sys
import time
from itertools import permutations
from unittest.mock import DEFAULT, Mock

import pytest

from coordlang.commands.inspect import inspect
from planners.joint.composition import ComposingStepper
from planners.loading import PlanningInstance
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import search
from planners.search.reachable import Exploration, count, explore
from planners.system import limits
from planners.system.errors import OutOfMemory, OutOfTime
from tests.support.domains import loaded_from
from tests.support.random_pddl import random_model
from tests.support.texts import model_of

PUSHING = """(define (domain pushing) (:types robot place heavy light)
  (:predicates (at ?r - robot ?p - place) (in ?x - (either heavy light) ?p - place) (glows ?p - place) (seen ?p - place))
  (:action push :agent ?r - robot :parameters (?x - heavy ?from ?to - place)
    :precondition (and (at ?r ?from) (in ?x ?from) (not (= ?from ?to))
                       (exists (?o - robot) (and (not (= ?o ?r)) (push ?o ?x ?from ?to))))
    :effect (and (not (at ?r ?from)) (at ?r ?to) (not (in ?x ?from)) (in ?x ?to)))
  (:action carry :agent ?r - robot :parameters (?x - light ?from ?to - place)
    :precondition (and (at ?r ?from) (in ?x ?from) (not (= ?from ?to)))
    :effect (and (not (at ?r ?from)) (at ?r ?to) (not (in ?x ?from)) (in ?x ?to)))
  (:action look :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) (forall (?o - robot) (not (look ?o ?p)))) :effect (seen ?p))
  (:action melt :agent ?r - robot :parameters (?x - heavy ?p - place)
    :precondition (and (at ?r ?p) (glows ?p)) :effect (not (in ?x ?p))))"""
TASK = """(define (problem p) (:domain pushing) (:objects r1 r2 - robot a b - place anvil - heavy)
  ; (:goal (in anvil a)) is what it is not
  (:init (at r1 a) (at r2 a) (in anvil a))
  ( :goal (forall (?x - heavy) (or (in ?x b) (not (seen a))))))"""


def test_what_was_understood_is_shown() -> None:
    found = inspect(model_of(PUSHING, TASK))
    assert found.impossible == ("carry", "melt")
    assert found.never == ("glows",)
    assert found.objects == {"heavy": 1, "place": 2, "robot": 2}
    assert found.start == {"at": 2, "in": 1}
    assert found.goal == "(forall (?x - heavy) (or (in ?x b) (not (seen a))))"
    assert found.formulas == (
        "(push r1 anvil a b) speaks of (push r2 anvil a b) in the same step",
        "(look r1 a) forbids (look r2 a) in the same step",
    )
    # The partner's places in the wrong order: it would have to push the other way from where the
    # anvil is not.
    misread = PUSHING.replace("(push ?o ?x ?from ?to)", "(push ?o ?x ?from ?from)")
    shown = inspect(model_of(misread, TASK)).formulas
    assert (
        "(push r1 anvil a b) speaks of (push r2 anvil a a), which no robot can ever do, in the same step"
        in shown
    )


def both_possible(loaded: PlanningInstance, first: str, second: str) -> bool:
    """Whether different robots can choose these subactions in one reachable state, each for itself."""
    model = loaded.model
    assert isinstance(model.stepper, ComposingStepper)
    space = explore(model, loaded.tasks[0].init[None, :])
    choices = model.stepper.choices(space.rows)
    for state in range(len(space)):
        texts = [
            {own[label] for label in labels[begin[state] : begin[state + 1]]}
            for own, (begin, labels) in zip(model.labels, choices, strict=True)
        ]
        if any(first in a and second in b for a, b in permutations(texts, 2)):
            return True
    return False


def named(loaded: PlanningInstance, example: str) -> tuple[str, str]:
    labels = {text for own in loaded.model.labels for text in own}
    first, second = [text for text in re.findall(r"\([^()]*\)", example) if text in labels]
    return first, second


def test_the_example_can_happen_in_random_models() -> None:
    shown = hidden = 0
    for seed in range(60):
        text = random_model(seed, ("agent", "plain")[seed % 2])
        loaded = model_of(text.domain, text.problem, ModelOptions(unowned=text.unowned))
        found = inspect(loaded)
        if found.example is None:
            hidden += found.interfering > 0
            continue
        shown += 1
        assert both_possible(loaded, *named(loaded, found.example)), (seed, found.example)
    assert shown >= 15
    assert hidden >= 2, "some clash only between what is never possible together"


def late() -> OutOfTime:
    """What the alarm raises."""
    try:
        with limits.time_limit(0.01):
            while True:
                pass
    except OutOfTime as error:
        return error


# What is said


def test_the_innermost_block_speaks() -> None:
    with (
        pytest.raises(OutOfTime) as caught,
        limits.reaching(lambda: "the whole", "less of everything"),
        limits.reaching(lambda: f"{2 + 1} of 9 parts", "fewer parts"),
    ):
        raise late()
    assert str(caught.value).splitlines()[1:] == [
        "  Reached: 3 of 9 parts.",
        "  Use a larger --time-limit, or fewer parts.",
    ]


def test_memory_that_is_used_up_is_an_error_with_a_code() -> None:
    with (
        limits.limited_memory(900 << 30),
        pytest.raises(OutOfMemory) as caught,
        limits.reaching(lambda: "half of it", "fewer parts"),
    ):
        raise MemoryError
    assert caught.value.exit_code == 22
    assert "Reached: half of it." in str(caught.value)
    assert "Use a larger --memory-limit, or fewer parts." in str(caught.value)


def test_an_estimate_keeps_its_own_remedy_and_other_errors_pass() -> None:
    with pytest.raises(OutOfMemory) as caught, limits.reaching(lambda: "half of it", "fewer parts"):
        raise OutOfMemory("this would need 9 GiB", remedy="Use fewer robots.")
    assert str(caught.value) == "this would need 9 GiB\n  Reached: half of it.\n  Use fewer robots."
    with pytest.raises(KeyError), limits.reaching(lambda: "half of it", "fewer parts"):
        raise KeyError


# The clock


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
    with pytest.raises(OutOfTime), limits.time_limit(0.05):
        work()
    assert sys.unraisablehook is hook


def test_limits_within_limits() -> None:
    """The one that is over first rings; leaving the inner block gives the outer its time back."""
    with limits.time_limit(100):
        with limits.time_limit(50):
            assert 25 < limits.time_left() <= 50
        assert 75 < limits.time_left() <= 100
        with limits.time_limit(200):
            assert 75 < limits.time_left() <= 100
        assert 75 < limits.time_left() <= 100
    assert limits.time_left() == math.inf
    over = pytest.raises(OutOfTime, match=r"limit of 0\.05 s")
    with over, limits.time_limit(0.05), limits.time_limit(10):
        time.sleep(2)
    for nothing in (0, -1):
        with pytest.raises(OutOfTime), limits.time_limit(nothing):
            time.sleep(2)

    def inner_then_outer() -> None:
        with over, limits.time_limit(0.05):
            time.sleep(2)
        time.sleep(2)

    with pytest.raises(OutOfTime, match=r"limit of 0\.3 s"), limits.time_limit(0.3):
        inner_then_outer()


def test_what_follows_on_stopped_work_is_stopped_soon() -> None:
    def work() -> None:
        raise OutOfTime("the time limit of the test is over")

    def busy() -> None:
        while True:
            pass

    with limits.time_limit(60):
        stopped = limits.run_until_stopped(work)
        assert isinstance(stopped, OutOfTime)
        with pytest.raises(OutOfTime, match="limit of the test"), limits.little_time_after(stopped):
            busy()
        with limits.little_time_after(None):
            assert limits.time_left() == math.inf  # the clock is stopped


# How far work got


def stop(monkeypatch: pytest.MonkeyPatch, after: int, error: BaseException) -> None:
    """Steps are not made any more after some tables of states."""
    made = Mock(side_effect=[*[DEFAULT] * after, error], wraps=ComposingStepper.steps)
    monkeypatch.setattr(ComposingStepper, "steps", lambda *given: made(*given))


@pytest.mark.parametrize("error", [late(), MemoryError()], ids=["time", "memory"])
def test_search_says_how_far_it_got(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = loaded_from("grid", "corners-3x3")
    stop(monkeypatch, 4, error)  # two tables of states to choose a bound
    with pytest.raises((OutOfTime, OutOfMemory)) as caught:
        search(loaded.model, loaded.tasks[0])
    # Within four steps every step leads nearer: 2 * 2 states after one, and after two both robots
    # are in different ones of three cells between the corners.
    assert (
        f"11 states within 2 steps of the initial state of {loaded.tasks[0].name} with a bound of "
        "4, 6 of them new in the last step" in str(caught.value)
    )


def test_exploring_says_how_far_it_got(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = loaded_from("grid", "corners-3x3")
    stop(monkeypatch, 1, late())
    with pytest.raises(OutOfTime, match=r"time limit") as caught:
        explore(loaded.model, loaded.tasks[0].init[None, :])
    assert caught.value.reached == (
        "Reached: 9 states within 1 steps of the initial states, 9 joint steps; 8 states are new in the last step."
    )


def test_exploring_in_pieces_is_the_same_work(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = loaded_from("grid", "corners-4x4")
    init = loaded.tasks[0].init[None, :]
    space = explore(loaded.model, init)
    monkeypatch.setattr(Exploration, "states_at_once", 7)
    monkeypatch.setattr(Exploration, "steps_at_once", 40)
    assert count(loaded.model, init) == (len(space), len(space.target))
    again = explore(loaded.model, init)
    for name in ("rows", "first", "target", "labels", "cost"):
        assert (getattr(again, name) == getattr(space, name)).all(), name


def test_combinations_that_do_not_fit_are_not_made() -> None:
    loaded = loaded_from("grid", "three-robots-3x3")
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
def test_what_linux_says_of_memory_is_what_psutil_says() -> None:
    import psutil

    assert limits.address_space() == pytest.approx(psutil.Process().memory_info().vms, rel=0.02)
    assert limits.memory_left() <= psutil.virtual_memory().available * 1.1
