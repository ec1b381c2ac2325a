# SPDX-License-Identifier: GPL-3.0-or-later
"""Odd but legal PDDL is read as meant: the number of optimal plans was worked out by hand for each
case.

Two robots in a row of rooms a - b - c: r1 goes from a to c (two steps), r2 from b to a (one step,
first or second), so there are 2 optimal plans wherever a case only says the same thing in another
way.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from planners.pddl.sexpr import Source, parse
from planners.system.errors import BadInput
from tests.support.command import Command

DOMAIN = """(define (domain hall)
  (:requirements :typing)
  (:types robot room)
  (:predicates (at ?r - robot ?x - room) (door ?x ?y - room))
  (:action go :agent ?r - robot :parameters (?x ?y - room)
    :precondition (and (at ?r ?x) (door ?x ?y))
    :effect (and (at ?r ?y) (not (at ?r ?x)))))
"""
PROBLEM = """(define (problem two) (:domain hall)
  (:objects r1 r2 - robot a b c - room)
  (:init (at r1 a) (at r2 b) (door a b) (door b a) (door b c) (door c b))
  (:goal (and (at r1 c) (at r2 a))))
"""
GOAL = "(and (at r1 c) (at r2 a))"
AGENT = ":agent ?r - robot :parameters (?x ?y - room)"
OBJECTS = "r1 r2 - robot a b c - room"
EFFECT = "(and (at ?r ?y) (not (at ?r ?x)))"


def change(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    return text


def domain(*pairs: tuple[str, str]) -> str:
    return change(DOMAIN, *pairs)


def problem(*pairs: tuple[str, str]) -> str:
    return change(PROBLEM, *pairs)


def with_action(action: str, text: str = DOMAIN) -> str:
    return text.rstrip()[:-1] + f"(:action {action}))"


def where(condition: str) -> str:
    """The domain with one more conjunct in the precondition."""
    return domain(("(door ?x ?y))\n", f"(door ?x ?y) {condition})\n"))


def goal(formula: str) -> str:
    return problem((GOAL, formula))


@dataclass(frozen=True)
class Case:
    """``expected``: the number of optimal plans, or the exit code and a piece of the message."""

    expected: int | tuple[int, str]
    domain: str = DOMAIN
    problem: str = PROBLEM
    options: tuple[str, ...] = field(default=())


ENVIRONMENT = ("--unowned", "environment")
PLAIN = domain((AGENT, ":parameters (?r - robot ?x ?y - room)"))
BELL = with_action(
    "ring :parameters () :effect (rung)",
    domain(("(door ?x ?y - room)", "(door ?x ?y - room) (rung)")),
)
UNTYPED = """(define (domain hall) (:predicates (robot ?r) (at ?r ?x) (door ?x ?y))
  (:action go :agent ?r :parameters (?x ?y)
    :precondition (and (robot ?r) (at ?r ?x) (door ?x ?y)) :effect (and (at ?r ?y) (not (at ?r ?x)))))"""
UNTYPED_PROBLEM = problem((OBJECTS, "r1 r2 a b c"), ("(:init", "(:init (robot r1) (robot r2)"))
COSTLY = domain(
    (
        "(door ?x ?y - room))",
        "(door ?x ?y - room)) (:functions (total-cost) - number (far ?x ?y - room) - number)",
    ),
    (EFFECT, "(and (at ?r ?y) (not (at ?r ?x)) (increase (total-cost) (far ?x ?y)))"),
)
VALUES = "(= (far a b) 3) (= (far b a) 1) (= (far b c) 1) (= (far c b) 1)"
COSTLY_PROBLEM = problem(("(:init", f"(:init (= (total-cost) 0) {VALUES}"))
MOBILE = with_action(
    "fly :agent ?d - drone :parameters (?x ?y - room) :precondition (and (at ?d ?x) (not (= ?x ?y))) :effect "
    "(and (at ?d ?y) (not (at ?d ?x)))",
    domain(
        ("(:types robot room)", "(:types robot drone - mobile mobile room - object)"),
        ("(at ?r - robot ", "(at ?r - mobile "),
    ),
)
MEET = with_action(
    "meet :parameters (?p ?q - robot ?x - room) :precondition (and (at ?p ?x) (at ?q ?x) (not (= ?p ?q))) "
    ":effect (met ?p ?q)",
    change(PLAIN, ("(door ?x ?y - room)", "(door ?x ?y - room) (met ?p ?q - robot)")),
)

CASES = {
    "as it is": Case(2),
    # who acts
    "no agent": Case(2, PLAIN),
    "agent inside the parameters": Case(
        2, domain((AGENT, ":parameters (:agent ?r - robot ?x ?y - room)"))
    ),
    "agent at the end of the parameters": Case(
        2, domain((AGENT, ":parameters (?x ?y - room :agent ?r - robot)"))
    ),
    "agent again in the parameters": Case(
        2, domain((AGENT, ":agent ?r :parameters (?r - robot ?x ?y - room)"))
    ),
    "agent in parentheses": Case(2, domain((":agent ?r - robot", ":agent (?r - robot)"))),
    "agent behind the parameters": Case(
        2, domain((AGENT, ":parameters (?x ?y - room) :agent ?r - robot"))
    ),
    "untyped agent": Case(2, UNTYPED, UNTYPED_PROBLEM),
    "several types of agents": Case(
        3, MOBILE, problem((OBJECTS, "r1 - robot r2 - drone a b c - room"))
    ),
    "--robots in upper case": Case(2, PLAIN, options=("--robots", "R1,R2")),
    "a shared action": Case(2, MEET, goal("(met r1 r2)")),
    "one robot": Case(
        1, problem=problem(("r1 r2 -", "r1 -"), ("(at r2 b)", ""), ("(at r2 a)", ""))
    ),
    "three robots": Case(
        4,
        problem=problem(
            ("r1 r2 -", "r1 r2 r3 -"),
            ("(at r2 b)", "(at r2 b) (at r3 b)"),
            ("(at r2 a)", "(at r2 a) (at r3 a)"),
        ),
    ),
    "nobody's action": Case((31, "d.pddl:7:47: action (ring) names no robot"), BELL),
    "nobody's action, environment": Case(6, BELL, goal("(rung)"), ENVIRONMENT),
    "nobody's action, fewest actions": Case(
        1, BELL, goal("(rung)"), (*ENVIRONMENT, "--cost", "makespan+actions")
    ),
    "nobody's action, shared": Case(1, BELL, goal("(rung)"), ("--unowned", "shared")),
    "--robot-type of others than the agents": Case(
        (2, "--robot-type"), options=("--robot-type", "room")
    ),
    "--robot-type that is nothing": Case((2, "--robot-type"), options=("--robot-type", "nonsense")),
    "a robot called environment": Case(
        (2, "environment"), BELL, change(goal("(rung)"), ("r1", "environment")), ENVIRONMENT
    ),
    # types and objects
    "supertypes forward and undeclared": Case(
        2, domain(("(:types robot room)", "(:types robot - mobile mobile - thing room - place)"))
    ),
    "two parents": Case(
        2, domain(("(:types robot room)", "(:types robot - m robot - n room m n - object)"))
    ),
    "either parents": Case(
        2, domain(("(:types robot room)", "(:types robot - (either m n) room m n)"))
    ),
    "object among the types": Case(
        2, domain(("(:types robot room)", "(:types object - thing robot room - object)"))
    ),
    "either in a parameter": Case(
        2, domain(("?x ?y - room)\n    :pre", "?x ?y - (either room robot))\n    :pre"))
    ),
    "an object of either type": Case(
        2, problem=problem(("a b c - room", "a b c - (either room robot)"))
    ),
    "a parameter of type object": Case(
        2, domain(("?x ?y - room)\n    :pre", "?x ?y - object)\n    :pre"))
    ),
    "a cycle": Case(
        (31, "d.pddl:3:11: the types form a cycle"),
        domain(("robot room)", "robot - room room - robot)")),
    ),
    "constants before the predicates": Case(
        2, domain(("(:pred", "(:constants a - room) (:pred")), problem(("a b c", "b c"))
    ),
    "constants at the end": Case(
        2, DOMAIN.rstrip()[:-1] + "(:constants a - room))", problem(("a b c", "b c"))
    ),
    "a constant is an object again": Case(
        2,
        domain(("(:pred", "(:constants a - room) (:pred")),
        problem((OBJECTS, "r1 r2 - robot b c - room a")),
    ),
    "constants only": Case(
        2,
        domain(("(:pred", f"(:constants {OBJECTS}) (:pred")),
        problem((f"(:objects {OBJECTS})", "")),
    ),
    "no space before variables": Case(
        2, domain(("(at ?r - robot ?x", "(at?r - robot?x"), ("(door ?x ?y))", "(door?x?y))"))
    ),
    "private predicates": Case(
        2,
        domain(
            (
                "(:predicates (at ?r - robot ?x - room)",
                "(:predicates (:private ?r - robot (at ?r - robot ?x - room))",
            )
        ),
    ),
    "private objects": Case(
        2, problem=problem((OBJECTS, "r2 - robot a b c - room (:private r1 - robot)"))
    ),
    # sections
    "no requirements": Case(2, domain(("(:requirements :typing)", ""))),
    "requirements of others": Case(
        2, domain((":typing", ":typing :foo :durative-actions :numeric-fluents"))
    ),
    "all sections of a problem": Case(
        2,
        problem=problem(
            (
                "(:objects",
                "(:requirements :typing) (:metric minimize (total-cost)) (:length (:serial 5)) (:objects",
            )
        ),
    ),
    "two object sections": Case(
        2, problem=problem((OBJECTS, "r1 r2 - robot) (:objects a b c - room"))
    ),
    "no initial state": Case(
        (11, "task two: the goal cannot be reached"),
        problem=problem(
            ("(:init (at r1 a) (at r2 b) (door a b) (door b a) (door b c) (door c b))", "")
        ),
    ),
    "init with and, not": Case(
        2,
        problem=problem(
            (
                "(:init (at r1 a) (at r2 b)",
                "(:init (and (at r1 a) (at r2 b)) (not (at r1 b)) (at r1 a)",
            )
        ),
    ),
    # preconditions and effects that are not there
    "an empty action": Case(2, with_action("wait :agent ?r - robot")),
    "empty parentheses": Case(
        2, with_action("wait :agent ?r - robot :parameters () :precondition () :effect ()")
    ),
    "keywords alone": Case(
        2, with_action("wait :agent ?r - robot :parameters () :precondition :effect")
    ),
    # formulas
    "an empty goal": Case(1, problem=goal("()")),
    "a goal without conjuncts": Case(1, problem=goal("(and)")),
    "a goal that holds already": Case(1, problem=goal("(and (at r1 a) (at r2 b))")),
    "a negative goal": Case(3, problem=goal("(not (at r1 a))")),
    "imply in the goal": Case(3, problem=goal("(imply (at r1 a) (at r1 b))")),
    "or in the goal": Case(4, problem=goal("(or (at r1 b) (at r2 c))")),
    "shadowing in the goal": Case(
        1, problem=goal("(exists (?x - room) (and (at r1 ?x) (exists (?x - room) (at r2 ?x))))")
    ),
    "a goal that no action changes": Case((11, "cannot be reached"), problem=goal("(door a c)")),
    "an action in the goal": Case(
        (31, "p.pddl:4:10: unknown predicate 'go'"), problem=goal("(go r1 a b)")
    ),
    "two goals": Case(
        (31, "expected one '(:goal FORMULA)'"),
        problem=problem((GOAL + ")", "(at r1 c)) (:goal (at r2 a))")),
    ),
    "imply": Case(2, where("(imply (= ?x ?x) (door ?x ?y))")),
    "equality of objects": Case(2, where("(not (= ?x ?y)) (= ?r ?r)")),
    "a parameter shadowed": Case(2, where("(exists (?x - room) (at ?r ?x))")),
    "a quantifier shadowed": Case(2, where("(forall (?x - room) (exists (?x - room) (at ?r ?x)))")),
    "quantifier without variables": Case(2, where("(forall () (and))")),
    "forall over nothing": Case(
        2,
        change(
            where("(forall (?g - ghost) (not (= ?g ?g)))"), ("robot room)", "robot room ghost)")
        ),
    ),
    "exists over nothing": Case(
        (11, ""), change(where("(exists (?g - ghost) (and))"), ("robot room)", "robot room ghost)"))
    ),
    "an empty or": Case((11, ""), where("(or)")),
    "effects under forall and when": Case(
        2,
        domain(
            (
                EFFECT,
                "(and (at ?r ?y) (forall (?x - room) "
                "(when (and (at ?r ?x) (not (= ?x ?y))) (not (at ?r ?x)))))",
            )
        ),
    ),
    "when inside when": Case(
        2,
        domain(
            (
                EFFECT,
                "(forall (?p - room) (and (when (= ?p ?y) (at ?r ?p)) "
                "(when (at ?r ?p) (when (not (= ?p ?y)) (not (at ?r ?p))))))",
            )
        ),
    ),
    "forall shadowing forall in effects": Case(
        2,
        domain(
            (
                EFFECT,
                "(and (at ?r ?y) (forall (?p - room) "
                "(forall (?p - room) (when (= ?p ?x) (not (at ?r ?p))))))",
            )
        ),
    ),
    "an atom both deleted and added": Case(
        2, domain((EFFECT, "(and (not (at ?r ?y)) (at ?r ?y) (not (at ?r ?x)))"))
    ),
    # names
    "a predicate named like the action": Case(
        (11, ""),
        change(
            where("(go ?r ?x ?y)"), ("(door ?x ?y - room)", "(door ?x ?y - room) (go ?r ?x ?y)")
        ),
    ),
    "objects named like predicates and actions": Case(
        2,
        problem=problem(
            ("a b c", "at go door"),
            ("r1 a)", "r1 at)"),
            ("r2 b)", "r2 go)"),
            (
                "(door a b) (door b a) (door b c) (door c b)",
                "(door at go) (door go at) (door go door) (door door go)",
            ),
            ("(at r1 c) (at r2 a)", "(at r1 door) (at r2 at)"),
        ),
    ),
    "a predicate named like a type": Case(
        2, DOMAIN.replace("(door", "(room"), PROBLEM.replace("(door", "(room")
    ),
    "names with all kinds of signs": Case(2, problem=problem(("r1", "1r.1_+@x,'"))),
    "numbers as names": Case(
        2,
        problem=problem(("r1 r2 - robot", "1 2 - robot"), ("(at r1", "(at 1"), ("(at r2", "(at 2")),
    ),
    "upper case": Case(2, DOMAIN.upper(), PROBLEM.upper()),
    # layout
    "CRLF": Case(2, DOMAIN.replace("\n", "\r\n"), PROBLEM.replace("\n", "\r\n")),
    "CR": Case(
        2,
        DOMAIN.replace("(:types", "; x\n(:types").replace("\n", "\r"),
        PROBLEM.replace("\n", "\r"),
    ),
    "tabs": Case(2, DOMAIN.replace(" ", "\t"), PROBLEM.replace(" ", "\t")),
    "byte order mark": Case(2, "\ufeff" + DOMAIN, "\ufeff" + PROBLEM),
    "comments everywhere": Case(2, DOMAIN.replace(" ", ";x)(\n"), PROBLEM.replace(" ", ";x)(\n")),
    "no spaces that are not needed": Case(2, DOMAIN.replace(" (", "("), PROBLEM.replace(" (", "(")),
    # costs
    "costs do not count by themselves": Case(2, COSTLY, COSTLY_PROBLEM),
    "costs that count": Case(2, COSTLY, COSTLY_PROBLEM, ("--cost", "makespan+cost")),
    "a cost with a point": Case(
        2, COSTLY, change(COSTLY_PROBLEM, (" 3)", " 3.0)")), ("--cost", "makespan+cost")
    ),
    "a cost that is missing": Case(
        (31, "the cost (far a b) has no whole value"),
        COSTLY,
        change(COSTLY_PROBLEM, ("(= (far a b) 3)", "")),
        ("--cost", "makespan+cost"),
    ),
    "a cost that is a fraction": Case(
        (31, "the cost (far a b) has no whole value"),
        COSTLY,
        change(COSTLY_PROBLEM, (" 3)", " 3.5)")),
        ("--cost", "makespan+cost"),
    ),
    # once wrong
    "untyped agent before typed parameters": Case(2, domain((":agent ?r - robot", ":agent ?r"))),
    "= among the predicates": Case(
        2, change(where("(= ?r ?r)"), ("(door ?x ?y - room)", "(door ?x ?y - room) (= ?x ?y)"))
    ),
    "costs whose sum passes 2^63": Case(
        (31, "cost"),
        COSTLY,
        change(COSTLY_PROBLEM, (" 3)", f" {9 * 10**18})"), ("b a) 1", f"b a) {9 * 10**18}")),
        ("--cost", "makespan+cost"),
    ),
    "a cost above 2^63": Case(
        (31, "cost"),
        COSTLY,
        change(COSTLY_PROBLEM, (" 3)", f" {10**20})")),
        ("--cost", "makespan+cost"),
    ),
    "a cost of 400 digits": Case(
        (31, "cost"),
        COSTLY,
        change(COSTLY_PROBLEM, (" 3)", f" {'9' * 400})")),
        ("--cost", "makespan+cost"),
    ),
    "a constant cost of 400 digits": Case(
        (34, "d.pddl"),
        change(COSTLY, ("(far ?x ?y)))", f"{'9' * 400}))")),
        options=("--cost", "makespan+cost"),
    ),
    "a constant cost of 400 digits that is ignored": Case(
        2, change(COSTLY, ("(far ?x ?y)))", f"{'9' * 400}))"))
    ),
    "a superscript as a name": Case(2, problem=problem(("r1", "\u00b2"))),
    "a name of 5000 digits": Case(2, problem=problem(("r1", "9" * 5000))),
    "--robots without a name": Case((2, "--robots"), options=("--robots", ",")),
    "two variables behind :agent": Case(
        (31, "d.pddl:5"), domain((":agent ?r - robot", ":agent ?r ?q - robot"))
    ),
    "a comment about subactions": Case(
        2, domain((":precondition", "; subactions of one robot\n :precondition"))
    ),
    "a predicate called last": Case(
        (2, "has a predicate 'last'"),
        DOMAIN.replace("(at ", "(last "),
        PROBLEM.replace("(at ", "(last "),
        options=("--remember-actions",),
    ),
    "types robot and agent": Case(
        (31, "Several types"),
        change(PLAIN, ("robot room)", "robot room agent)")),
        problem(("a b c - room", "a b c - room x - agent")),
    ),
    "a value with the wrong number of arguments": Case(
        (31, "p.pddl:3"), COSTLY, problem(("(:init", "(:init (= (far a) 3)"))
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_odd(name: str, coordlang: Command, tmp_path: Path) -> None:
    case, d, p = CASES[name], tmp_path / "d.pddl", tmp_path / "p.pddl"
    d.write_bytes(case.domain.encode())
    p.write_bytes(case.problem.encode())
    outcome = coordlang("plans", d, p, "--count", *case.options)
    if isinstance(case.expected, int):
        assert (outcome.code, outcome.out) == (0, f"{case.expected}\n"), outcome.err
    else:
        code, message = case.expected
        assert outcome.code == code, outcome
        assert message in outcome.err


@pytest.mark.parametrize(
    ("one", "other", "is_refused"),
    [
        ("k1", "\N{KELVIN SIGN}1", True),
        ("\N{KELVIN SIGN}1", "k1", True),
        ("stra\N{LATIN SMALL LETTER SHARP S}e", "strasse", True),
        ("\N{GREEK SMALL LETTER SIGMA}", "\N{GREEK SMALL LETTER FINAL SIGMA}", True),
        ("caf\N{LATIN SMALL LETTER E WITH ACUTE}", "cafe\N{COMBINING ACUTE ACCENT}", True),
        ("r\N{LATIN SMALL LETTER E WITH ACUTE}", "re", False),
        ("\N{KELVIN SIGN}1", "k2", False),
    ],
)
def test_names_that_are_one_name_to_unicode(one: str, other: str, is_refused: bool) -> None:
    text = PROBLEM.replace("r1", one).replace("r2", other)
    with pytest.raises(BadInput, match="are one name to Unicode") if is_refused else nullcontext():
        parse(Source("problem.pddl", text))


def test_capital_letters_with_accents_are_the_small_ones() -> None:
    accent = "r\N{LATIN SMALL LETTER E WITH ACUTE}"
    text = PROBLEM.replace("r1", accent).replace(accent, accent.upper(), 1)
    assert parse(Source("problem.pddl", text))
