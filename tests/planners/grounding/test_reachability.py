# SPDX-License-Identifier: GPL-3.0-or-later
"""Grounding by clingo, within this process: limits, signals, what it says; and what is never possible."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from types import FrameType

import pytest

import planners.grounding.instantiate
from planners.grounding.reachability import reachable_arguments
from planners.loading import PlanningInstance
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Atom, Domain, Problem
from planners.pddl.robots import static_atoms
from planners.pddl.sexpr import Source
from planners.search.optimal_plans import search
from planners.search.reachable import explore
from planners.system.errors import OutOfTime, ProvedImpossible
from planners.system.limits import time_limit
from tests.support import thorough
from tests.support.joint_twin import built, check_model
from tests.support.random_pddl import Kind, RandomModel, random_model
from tests.support.texts import model_of

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
    return reachable_arguments(domain, problem, sorted(problem.init, key=str))


def test_all_arguments_in_the_natural_order_of_the_names() -> None:
    names = [f"p{number}" for number in range(11)]
    assert ground(11)["look"] == [
        (robot, a, b, c) for robot in ("r1", "r2") for a in names for b in names for c in names
    ]


def test_the_time_limit_ends_clingo() -> None:
    begin = time.monotonic()
    with pytest.raises(OutOfTime) as caught, time_limit(0.4):
        ground(200)
    assert str(caught.value) == "the time limit of 0.4 s is over\n  Use a larger --time-limit."
    assert time.monotonic() - begin < 10  # the whole of it takes minutes


@pytest.mark.parametrize("speaks", [False, True], ids=["grounding", "logging"])
def test_an_interrupt_ends_clingo(speaks: bool, capfd: pytest.CaptureFixture[str]) -> None:
    def when_it_speaks(frame: FrameType, _event: str, _argument: object) -> None:
        if frame.f_code.co_name == "note":
            signal.raise_signal(signal.SIGINT)

    # Where the tests are started in the background, Ctrl-C is ignored.
    given = signal.signal(signal.SIGINT, signal.default_int_handler)
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    try:
        signal.setitimer(signal.ITIMER_REAL, 5 if speaks else 0.4)
        sys.setprofile(when_it_speaks if speaks else None)
        with pytest.raises(KeyboardInterrupt):
            ground(2 if speaks else 200)
    finally:
        sys.setprofile(None)
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        after = signal.signal(signal.SIGINT, given)
    assert after is signal.default_int_handler
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
@pytest.mark.parametrize("left", [2, *thorough(14)])
def test_the_memory_limit_ends_clingo(left: int) -> None:
    run = subprocess.run([sys.executable, "-c", SMALL, str(left)], capture_output=True, text=True)
    assert (run.returncode, run.stdout, run.stderr) == (0, "no memory\n", "")


HALLS = """(define (domain halls) (:types robot place - thing hall - place)
  (:constants home - hall)
  (:predicates (at ?r - robot ?p - place) (way ?a ?b) (way ?a) (lit ?p - place) (loop ?a ?b ?c))
  (:action act :agent ?r - robot :parameters (?p - place)
    :precondition (and (at ?r ?p) {condition})
    :effect (and (lit ?p) (forall (?x - place) (when (and (way ?p ?x) (not (lit ?x))) (lit ?x))))))"""
PROBLEM = """(define (problem p) (:domain halls) (:objects r1 r2 - robot p10 p2 p1 - place h - hall)
  (:init (at r1 p1) (at r2 home) (way p1 p2) (way p2 p1) (way p2 p10) (way p1 home) (way home h) (way p1 r2) (way p2 p2)
         (way r1 p1) (way p10) (way home) (loop p1 p1 p2) (loop p1 p1 p1) (loop h home h))
  (:goal (lit home)))"""
#: As the domain has it, and where robots act anywhere from where there is a way home.
CONDITIONS = [
    "(exists (?x - place) (and (way ?p ?x) (lit ?x)))",
    "(exists (?x) (and (lit ?x) (way ?x ?p)))",
    "(exists (?x - hall) (and (way ?p ?x) (not (lit ?x))))",
    "(forall (?x - place) (or (not (way ?p ?x)) (lit ?x)))",
    "(forall (?x - place) (imply (and (way ?p ?x) (way ?x ?p)) (lit ?x)))",
    "(forall (?x ?y - place) (or (not (way ?p ?x)) (not (way ?x ?y)) (lit ?y)))",
    "(exists (?x ?y - place) (and (way ?x ?y) (way ?y ?p) (lit ?x)))",
    "(not (exists (?x - place) (and (way ?p ?x) (lit ?x))))",
    "(not (forall (?x - place) (or (not (way ?p ?x)) (lit ?x))))",
    "(exists (?x - place) (and (way ?x ?x) (lit ?x)))",
    "(exists (?x - place) (and (loop ?x ?x ?p) (lit ?x)))",
    "(exists (?x - place ?y - hall) (and (loop ?y home ?y) (lit ?x)))",
    "(exists (?x - place) (and (way home ?x) (lit ?x)))",
    "(exists (?x - place) (and (way ?x) (lit ?x)))",
    # The inner ?p is another one.
    "(exists (?p - place) (and (way ?p home) (lit ?p)))",
    "(forall (?x - place) (exists (?p - place) (and (way ?x ?p) (not (way ?p ?x)) (lit ?p))))",
    # A guard that is one part of a disjunction is none.
    "(exists (?x - place) (or (way ?p ?x) (lit ?x)))",
    "(forall (?x - place) (and (not (way ?p ?x)) (lit ?x)))",
    "(or (lit home) (forall (?x - place) (and (way ?p ?x) (lit ?x))))",
    # Guards that speak of a step.
    "(forall (?o - robot ?x - place) (or (= ?o ?r) (not (way ?x ?p)) (not (act ?o ?x))))",
    "(exists (?o - robot ?x - place) (and (not (= ?o ?r)) (way ?p ?x) (act ?o ?x)))",
    "(exists (?x) (and (at ?r ?p) (way home ?x) (not (= ?x home))))",
    "(forall (?o - robot ?x - place) (not (act ?o ?x)))",
    "(forall (?x - place) (not (act ?r ?x)))",
    "(forall (?o - robot ?x) (or (= ?o ?r) (not (way ?p ?x)) (not (act ?o ?x))))",
    "(forall (?o - robot ?x - place) (imply (act ?o ?x) (lit ?x)))",
    "(forall (?o - robot ?x - place) (and (lit ?x) (not (act ?o ?x))))",
    "(not (exists (?o - robot) (and (act ?o ?p) (not (lit ?p)))))",
    "(exists (?o - robot ?x - place) (and (not (= ?o ?r)) (act ?o ?x)))",
    "(not (forall (?x - place) (not (act ?r ?x))))",
    "(or (lit home) (not (exists (?o - robot ?x - place) (and (not (= ?o ?r)) (act ?o ?x)))))",
]


def anywhere(condition: str) -> str:
    """The domain in which robots act anywhere from where there is a way home."""
    return HALLS.format(condition=f"(way ?p home) {condition}").replace("(at ?r ?p)", "")


@pytest.mark.parametrize("condition", CONDITIONS)
def test_the_same_joint_steps_as_by_definition(
    condition: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where there are many subactions, of which only the possible ones are tried."""
    met: list[str] = []
    check_model(RandomModel(HALLS.format(condition=condition), PROBLEM), met.append)
    check_model(RandomModel(anywhere(condition), PROBLEM), met.append)
    monkeypatch.setattr(planners.grounding.instantiate, "_MANY", 0)
    check_model(RandomModel(anywhere(condition), PROBLEM), met.append)
    assert "too large" not in met


#: Nobody can ever lift anything, and a robot may look; what stands beside that counts.
LOOK = """(define (domain d) (:types robot) (:predicates (never) (lit) (a) (b))
 (:action break :agent ?r - robot :parameters () :effect (not (lit)))
 (:action mark :agent ?r - robot :parameters () :effect (b))
 (:action lift :agent ?r - robot :parameters () :precondition (never) :effect (a))
 (:action look :agent ?r - robot :parameters () :precondition (or (lit) {}) :effect (a)))"""
LIT = "(define (problem p) (:domain d) (:objects r1 r2 - robot) (:init (lit)) (:goal (a)))"
NEVER = ("(forall (?o - robot) (not (lift ?o)))", "(exists (?o - robot) (and (lift ?o) (not (b))))")


@pytest.mark.parametrize("condition", NEVER)
def test_literals_beside_what_is_never_possible(
    condition: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planners.grounding.instantiate, "_MANY", 0)
    met: list[str] = []
    check_model(RandomModel(LOOK.format(condition), LIT), met.append)
    assert "several states" in met


def test_few_instances_are_tried() -> None:
    """Looking at all instances takes minutes: of 9,000 subactions, and of 3,000 places, few are."""
    places = " ".join(f"q{n}" for n in range(3000))
    problem = PROBLEM.replace("p1 - place", f"p1 {places} - place")
    forbidding = anywhere("(forall (?o - robot ?x - place) (not (act ?o ?x)))")
    nested = "(forall (?x ?y - place) (or (not (way ?p ?x)) (not (way ?x ?y)) (lit ?y)))"
    with time_limit(30):
        for domain in (forbidding, HALLS.format(condition=nested)):
            assert {a.label for a in model_of(domain, problem).model.actions} >= {"(act r1 p1)"}


# ---- subactions that are never possible

CARRY = """(define (domain carry) (:types robot box room)
 (:predicates (at ?r - robot ?x - room) (in ?b - box ?x - room) (empty ?r - robot)
  (holds ?r - robot ?b - box) (strong ?r - robot))
 (:action go :agent ?r - robot :parameters (?x ?y - room)
  :precondition (at ?r ?x) :effect (and (at ?r ?y) (not (at ?r ?x))))
 (:action lift :agent ?r - robot :parameters (?b - box ?x - room)
  :precondition (and (at ?r ?x) (in ?b ?x) (strong ?r) (empty ?r))
  :effect (and (holds ?r ?b) (not (empty ?r)) (not (in ?b ?x))))
 (:action put :agent ?r - robot :parameters (?b - box ?x - room)
  :precondition (and (at ?r ?x) (holds ?r ?b))
  :effect (and (in ?b ?x) (empty ?r) (not (holds ?r ?b)))))"""
ALL = "(at r1 a) (at r2 a) (in b1 a) (in b2 a) (empty r1) (empty r2) (strong r1) (strong r2)"
#: Nobody can hold two boxes.
TWO = "(and (holds r1 b1) (holds r1 b2))"


def carry(init: str, goal: str) -> PlanningInstance:
    return model_of(
        CARRY,
        "(define (problem p) (:domain carry) (:objects r1 r2 - robot b1 b2 - box a b - room)"
        f" (:init {init}) (:goal {goal}))",
    )


LIFT = "Action lift of r1 is never possible: nothing makes (empty r1) true."
PUT = "Action put of r1 is never possible: nothing makes (holds r1 ?b) true."


@pytest.mark.parametrize(
    ("forgotten", "goal", "said"),
    [
        ("(empty r1)", TWO, ["needs (holds r1 b1), and nothing makes it true.", LIFT, PUT]),
        ("(empty r1)", "(and (holds r2 b1) (holds r2 b2))", [LIFT, PUT]),
        (
            "(at r1 a)",
            "(and (holds r2 b1) (holds r2 b2))",
            ["Action go of r1 is never possible: nothing makes (at r1 ?x)"],
        ),
        (
            "(strong r1)",
            TWO,
            ["needs (holds r1 b1)", "r1 is never possible: nothing makes (strong r1)", PUT],
        ),
        # Perhaps it is meant to be weak: not said of a goal that is about another robot.
        ("(strong r1)", "(and (holds r2 b1) (holds r2 b2))", []),
        ("(at r9 a)", TWO, []),
    ],
)
def test_what_is_said(forgotten: str, goal: str, said: list[str]) -> None:
    loaded = carry(ALL.replace(forgotten, ""), goal)
    with pytest.raises(ProvedImpossible) as caught:
        search(loaded.model, loaded.tasks[0])
    text = caught.value.remedy or ""
    for part in (LIFT, PUT, "never possible", *said):
        assert (part in text) == any(part in one for one in said), text


def test_an_unreachable_goal_comes_with_the_interference_met_most_often() -> None:
    loaded = model_of(
        """(define (domain tables) (:types robot) (:predicates (level) (up ?r - robot))
         (:action lift :agent ?r :parameters () :precondition (level)
          :effect (and (up ?r) (not (level)))))""",
        "(define (problem t) (:domain tables) (:objects r1 r2 - robot) (:init (level))"
        " (:goal (and (up r1) (up r2))))",
    )
    with pytest.raises(ProvedImpossible) as caught:
        search(loaded.model, loaded.tasks[0])
    said = "(1 of 1 states looked at): (lift r1) deletes (level), which (lift r2) needs."
    assert said in str(caught.value.remedy)


@pytest.mark.parametrize("kind", ["agent", *thorough("plain")])
def test_in_random_models_what_is_said_is_true_of_every_reachable_state(kind: Kind) -> None:
    told = 0
    for seed in range(80):
        loaded = built(random_model(seed, kind))
        model = loaded.model
        space = explore(model, loaded.tasks[0].init[None, :])
        facts = {
            model.codec.facts.atoms[f] for row in space.rows for f in model.codec.true_facts(row)
        }
        facts |= static_atoms(loaded.domain, loaded.problems[0])
        for one in model.impossible:
            told += 1
            robot = model.robots.index(one.robot)
            used = {model.labels[robot][k] for k in space.labels[:, robot].tolist()}
            assert not any(text.startswith(f"({one.action} ") for text in used)
            assert not any(matches(one.atom, fact) for fact in facts)
    assert told >= 10


def matches(atom: Atom, fact: Atom) -> bool:
    if (atom.predicate, len(atom.args)) != (fact.predicate, len(fact.args)):
        return False
    return all(a.startswith("?") or a == b for a, b in zip(atom.args, fact.args, strict=True))
