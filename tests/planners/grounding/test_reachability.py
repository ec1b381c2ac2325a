# SPDX-License-Identifier: GPL-3.0-or-later
"""Grounding by clingo, within this process: limits, signals and what clingo says reach the user as from anywhere."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

from planners.grounding.reachability import reachable_arguments
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.sexpr import Source
from planners.system.errors import OutOfTime
from planners.system.limits import time_limit

DOMAIN = """(define (domain views) (:requirements :typing :multi-agent) (:types robot place)
  (:predicates (at ?r - robot ?p - place) (seen ?a ?b ?c - place))
  (:action look :agent ?r - robot :parameters (?a ?b ?c - place)
    :precondition (at ?r ?a) :effect (and (seen ?a ?b ?c) (at ?r ?b))))"""


def views(places: int) -> tuple[Domain, Problem]:
    """A problem with two times the third power of ``places`` ground actions."""
    domain = parse_domain(Source("domain", DOMAIN))
    names = " ".join(f"p{number}" for number in range(places))
    problem = f"""(define (problem p) (:domain views) (:objects r1 r2 - robot {names} - place)
      (:init (at r1 p0) (at r2 p0)) (:goal (at r1 p1)))"""
    return domain, parse_problem(Source("problem", problem), domain)


def ground(places: int) -> dict[str, list[tuple[str, ...]]]:
    domain, problem = views(places)
    return reachable_arguments(domain, problem.objects, sorted(problem.init, key=str))


def test_all_arguments_in_the_natural_order_of_the_names() -> None:
    names = [f"p{number}" for number in range(11)]
    assert ground(11)["look"] == [
        (robot, a, b, c) for robot in ("r1", "r2") for a in names for b in names for c in names
    ]


def test_the_time_limit_ends_clingo() -> None:
    begin = time.monotonic()
    with (
        pytest.raises(OutOfTime, match=r"the time limit of 0\.4 s is over") as caught,
        time_limit(0.4),
    ):
        ground(200)
    assert str(caught.value).endswith("\n  Use a larger --time-limit.")
    assert time.monotonic() - begin < 10  # the whole of it takes minutes


def test_an_interrupt_ends_clingo(capfd: pytest.CaptureFixture[str]) -> None:
    # Where the tests are started in the background, Ctrl-C is ignored.
    handler = signal.default_int_handler
    given = signal.signal(signal.SIGINT, handler)

    def interrupt(_signal: int, _frame: object) -> None:
        signal.raise_signal(signal.SIGINT)

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.4)
        with pytest.raises(KeyboardInterrupt):
            ground(200)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        after = signal.signal(signal.SIGINT, given)
    assert after is handler
    assert capfd.readouterr() == ("", "")


SMALL = f"""
import resource, sys
sys.path.insert(0, {__file__.rpartition("/")[0]!r})
import numpy, tarski.reachability, clingo
from test_reachability import ground
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + int(sys.argv[1]) * 2**20, resource.RLIM_INFINITY))
try:
    ground(120)
except MemoryError:
    print("no memory")
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize("left", [2, 14])
def test_the_memory_limit_ends_clingo(left: int) -> None:
    run = subprocess.run([sys.executable, "-c", SMALL, str(left)], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (0, "no memory\n", "")
