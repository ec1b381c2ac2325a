# SPDX-License-Identifier: GPL-3.0-or-later
"""Odd but legal PDDL is read as meant: the number of optimal plans was worked out by hand for each
case.

Two robots in a row of rooms a - b - c: r1 goes from a to c (two steps), r2 from b to a (one step,
first or second), so there are 2 optimal plans wherever a case only says the same thing in another
way.
"""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import pytest

from planners.pddl.sexpr import Source, parse
from planners.system.errors import BadInput
from tests.support.command import Command
from tests.support.hall import DOMAIN

PROBLEM = """(define (problem two) (:domain hall)
  (:objects r1 r2 - robot a b c - room)
  (:init (at r1 a) (at r2 b) (door a b) (door b a) (door b c) (door c b))
  (:goal (and (at r1 c) (at r2 a))))
"""
DOORS = "(door a b) (door b a) (door b c) (door c b)"
PREDICATE = "(door ?x ?y - room)"
AGENT = ":agent ?r - robot :parameters (?x ?y - room)"
OBJECTS = "r1 r2 - robot a b c - room"
EFFECT = "(and (at ?r ?y) (not (at ?r ?x)))"
WHEN = "(and (at ?r ?y) (when (door ?x ?y) (not (at ?r ?x))))"
#: A case: the number of optimal plans, or the exit code and a piece of the message; the domain, the
#: problem, options.
Case = tuple[int | tuple[int, str], str, str, tuple[str, ...]]


def case(
    expected: int | tuple[int, str], domain: str = DOMAIN, problem: str = PROBLEM, options: str = ""
) -> Case:
    return expected, domain, problem, tuple(options.split())


def change(text: str, *words: str) -> str:
    """Each word with the one after it in its place."""
    for old, new in zip(words[::2], words[1::2], strict=True):
        assert old in text, old
        text = text.replace(old, new)
    return text


def d(*words: str) -> str:
    return change(DOMAIN, *words)


def p(*words: str) -> str:
    return change(PROBLEM, *words)


def where(condition: str, *words: str) -> str:
    """The domain with one more conjunct in the precondition."""
    return d("(door ?x ?y))\n", f"(door ?x ?y) {condition})\n", *words)


def with_action(action: str, text: str = DOMAIN) -> str:
    return text.rstrip()[:-1] + f"(:action {action}))"


def goal(formula: str, *words: str) -> str:
    return p("(and (at r1 c) (at r2 a))", formula, *words)


PLAIN = d(AGENT, ":parameters (?r - robot ?x ?y - room)")
BELL = with_action("ring :parameters () :effect (rung)", d(PREDICATE, f"{PREDICATE} (rung)"))
RUNG = goal("(rung)")
UNTYPED = """(define (domain hall) (:predicates (robot ?r) (at ?r ?x) (door ?x ?y))
  (:action go :agent ?r :parameters (?x ?y)
    :precondition (and (robot ?r) (at ?r ?x) (door ?x ?y)) :effect (and (at ?r ?y) (not (at ?r ?x)))))"""
JOINT = """(define (domain lift) (:predicates (up)) (:action lift :parameters () :effect (up)
  ; subaction r1 (lift)
  MORE
)"""
FAR = "(:functions (total-cost) - number (far ?x ?y - room) - number)"
COSTLY = d(
    *(f"{PREDICATE})", f"{PREDICATE}) {FAR}"),
    *(EFFECT, "(and (at ?r ?y) (not (at ?r ?x)) (increase (total-cost) (far ?x ?y)))"),
)
VALUES = "(= (far a b) 3) (= (far b a) 1) (= (far b c) 1) (= (far c b) 1)"
PRICED = p("(:init", f"(:init (= (total-cost) 0) {VALUES}")
COST = "--cost makespan+cost"
MOBILE = with_action(
    "fly :agent ?d - drone :parameters (?x ?y - room) :precondition (and (at ?d ?x) (not (= ?x ?y)))"
    " :effect (and (at ?d ?y) (not (at ?d ?x)))",
    d(
        *("(:types robot room)", "(:types robot drone - mobile mobile room - object)"),
        *("(at ?r - robot ", "(at ?r - mobile "),
    ),
)
MEET = with_action(
    "meet :parameters (?p ?q - robot ?x - room) :precondition (and (at ?p ?x) (at ?q ?x) "
    "(not (= ?p ?q))) :effect (met ?p ?q)",
    change(PLAIN, PREDICATE, f"{PREDICATE} (met ?p ?q - robot)"),
)
THREE = p(
    "r1 r2 -", "r1 r2 r3 -", "(at r2 b)", "(at r2 b) (at r3 b)", "(at r2 a)", "(at r2 a) (at r3 a)"
)
#: Behind the effect of an action: one more action.  With it r1 has 3 ways to be elsewhere, r2 six.
HOP = ") (:action hop :agent ?r - robot :parameters (?y - room) :effect (at ?r ?y)"
ELSEWHERE = ("(and (at r1 c) (at r2 a))", "(exists (?x - room) (and (not (= ?x a)) (at r1 ?x)))")
LONG = "9" * 400
HUGE = f"{9 * 10**18}"

#: The domain said in another way, each text with what stands in its place: there are 2 plans.
SAME_DOMAIN: dict[str, tuple[str, ...]] = {
    # who acts
    "agent inside the parameters": (AGENT, ":parameters (:agent ?r - robot ?x ?y - room)"),
    "agent again in them": (AGENT, ":agent ?r :parameters (?r - robot ?x ?y - room)"),
    "agent behind them": (AGENT, ":parameters (?x ?y - room) :agent ?r - robot"),
    "untyped names before the agent": (AGENT, ":parameters (?x ?y :agent ?r - robot)"),
    "untyped agent before typed parameters": (":agent ?r - robot", ":agent ?r"),
    # types and objects
    "supertypes forward and undeclared": (
        *("(:types robot room)", "(:types robot - mobile mobile - thing room - place)"),
    ),
    "two parents": ("robot room)", "robot - m robot - n room m n - object)"),
    "object among the types": ("robot room)", "object - thing robot room - object)"),
    "either in a parameter": (AGENT, ":agent ?r - robot :parameters (?x ?y - (either room robot))"),
    "a parameter of type object": (AGENT, ":agent ?r - robot :parameters (?x ?y - object)"),
    "no space before ?": ("(at ?r - robot ?x", "(at?r - robot?x", "(door ?x ?y))", "(door?x?y))"),
    "private predicates": (
        *("(:predicates (at", "(:predicates (:private ?r - robot (at"),
        *("?x - room)", "?x - room))"),
    ),
    # sections and effects
    "requirements of others": (":typing", ":typing :foo :durative-actions :numeric-fluents"),
    "effects under forall and when": (
        EFFECT,
        "(and (at ?r ?y) (forall (?x - room) "
        "(when (and (at ?r ?x) (not (= ?x ?y))) (not (at ?r ?x)))))",
    ),
    "when inside when": (
        EFFECT,
        "(forall (?p - room) (and (when (= ?p ?y) (at ?r ?p)) "
        "(when (at ?r ?p) (when (not (= ?p ?y)) (not (at ?r ?p))))))",
    ),
    "forall shadowing forall in effects": (
        EFFECT,
        "(and (at ?r ?y) (forall (?p - room) "
        "(forall (?p - room) (when (= ?p ?x) (not (at ?r ?p))))))",
    ),
    "a name that a shadowing variable could get": (
        EFFECT,
        "(and (at ?r ?y) (forall (?x - room) (forall (?x.1 - room) "
        "(when (and (at ?r ?x) (= ?x.1 ?y) (not (= ?x ?x.1))) (not (at ?r ?x))))))",
    ),
    "an atom deleted and added": (EFFECT, "(and (not (at ?r ?y)) (at ?r ?y) (not (at ?r ?x)))"),
    "a comment about subactions": (":precondition", "; subactions of one robot\n :precondition"),
}
#: The problem said in another way.
SAME_PROBLEM: dict[str, tuple[str, ...]] = {
    "private objects": (OBJECTS, "r2 - robot a b c - room (:private r1 - robot)"),
    "all sections of a problem": (
        "(:objects",
        "(:requirements :typing) (:metric minimize (total-cost)) (:length (:serial 5)) (:objects",
    ),
    "two object sections": (OBJECTS, "r1 r2 - robot) (:objects a b c - room"),
    "init with and, not": (
        "(:init (at r1 a) (at r2 b)",
        "(:init (and (at r1 a) (at r2 b)) (not (at r1 b)) (at r1 a)",
    ),
    "objects named like predicates and actions": (
        *("a b c", "at go door", "r1 a)", "r1 at)", "r2 b)", "r2 go)"),
        *(DOORS, "(door at go) (door go at) (door go door) (door door go)"),
        *("(at r1 c) (at r2 a)", "(at r1 door) (at r2 at)"),
    ),
    "names with all kinds of signs": ("r1", "1r.1_+@x,'"),
    "numbers as names": ("r1 r2 - robot", "1 2 - robot", "(at r1", "(at 1", "(at r2", "(at 2"),
    "a superscript as a name": ("r1", "\u00b2"),
    "a name of 5000 digits": ("r1", "9" * 5000),
}
CASES: dict[str, Case] = {
    **{name: case(2, d(*words)) for name, words in SAME_DOMAIN.items()},
    **{name: case(2, DOMAIN, p(*words)) for name, words in SAME_PROBLEM.items()},
    "as it is": case(2),
    # who acts
    "no agent": case(2, PLAIN),
    "untyped agent": case(
        2, UNTYPED, p(OBJECTS, "r1 r2 a b c", "(:init", "(:init (robot r1) (robot r2)")
    ),
    "two agents": case((31, "d.pddl:5"), d(":agent ?r - robot", ":agent ?r ?q - robot")),
    "an agent inside the parameters and outside": case(
        (31, "d.pddl:5:46: ':agent' stands among the :parameters and outside of them"),
        d(AGENT, ":agent ?q - robot :parameters (:agent ?r - robot ?x ?y - room)"),
    ),
    "an agent whose type is behind :agent only": case(
        2, with_action("hop :agent ?r - robot :parameters (?y - room ?r) :effect (at ?r ?y)")
    ),
    "an agent of two types": case(
        (31, "d.pddl:5:22: ?r is of type robot behind :agent, but room among the :parameters"),
        d(AGENT, ":agent ?r - robot :parameters (?r ?x ?y - room)"),
    ),
    "several types of agents": case(3, MOBILE, p(OBJECTS, "r1 - robot r2 - drone a b c - room")),
    "--robots in upper case": case(2, PLAIN, PROBLEM, "--robots R1,R2"),
    "--robots without a name": case((2, "--robots"), options="--robots ,"),
    "a shared action": case(2, MEET, goal("(met r1 r2)")),
    "one robot": case(1, DOMAIN, p("r1 r2 -", "r1 -", "(at r2 b)", "", "(at r2 a)", "")),
    "three robots": case(4, DOMAIN, THREE),
    "nobody's action": case((31, "d.pddl:7:47: action (ring) names no robot"), BELL),
    "of the environment": case(6, BELL, RUNG, "--unowned environment"),
    "of all together": case(1, BELL, RUNG, "--unowned shared"),
    "--robot-type of others": case((2, "--robot-type"), options="--robot-type room"),
    "--robot-type that is nothing": case((2, "--robot-type"), options="--robot-type nonsense"),
    "a robot called environment": case(
        (2, "environment"), BELL, change(RUNG, "r1", "environment"), "--unowned environment"
    ),
    "types robot and agent": case(
        (31, "Several types"),
        change(PLAIN, "robot room)", "robot room agent)"),
        p("a b c - room", "a b c - room x - agent"),
    ),
    # types, objects and sections
    **{
        f"an owner of private objects, declared in {place}": case(
            18,
            d("(:pred", f"{constants}(:pred", EFFECT, EFFECT + HOP),
            p(OBJECTS, objects, *ELSEWHERE),
        )
        for place, constants, objects in (
            (
                "constants",
                "(:constants r1 - robot) ",
                "r2 - robot a - room (:private r1 b c - room)",
            ),
            ("a section", "", "(:private r1 a b c - room)) (:objects r1 r2 - robot"),
            ("a group", "", "(:private r1 - robot r2 - robot) (:private r1 a b c - room)"),
        )
    },
    "a private constant": case(
        18,
        d("(:pred", "(:constants r1 - robot) (:pred", EFFECT, EFFECT + HOP),
        p(OBJECTS, "(:private r1 - robot) r2 - robot a b c - room", *ELSEWHERE),
    ),
    "a cycle": case(
        (31, "d.pddl:3:11: the types form a cycle"), d("robot room)", "robot - room room - robot)")
    ),
    "constants before the predicates": case(
        2, d("(:pred", "(:constants a - room) (:pred"), p("a b c", "b c")
    ),
    "a constant is an object again": case(
        2, d("(:pred", "(:constants a - room) (:pred"), p(OBJECTS, "r1 r2 - robot b c - room a")
    ),
    "constants only": case(
        2, d("(:pred", f"(:constants {OBJECTS}) (:pred"), p(f"(:objects {OBJECTS})", "")
    ),
    "no initial state": case(
        (11, "task two: the goal cannot be reached"),
        DOMAIN,
        p(f"(:init (at r1 a) (at r2 b) {DOORS})", ""),
    ),
    # preconditions and effects that are not there
    "an empty action": case(2, with_action("wait :agent ?r - robot")),
    "empty parentheses": case(
        2, with_action("wait :agent ?r - robot :parameters () :precondition () :effect ()")
    ),
    "keywords alone": case(
        2, with_action("wait :agent ?r - robot :parameters () :precondition :effect")
    ),
    # formulas
    "an empty goal": case(1, DOMAIN, goal("()")),
    "a goal that holds already": case(1, DOMAIN, goal("(and (at r1 a) (at r2 b))")),
    "a negative goal": case(3, DOMAIN, goal("(not (at r1 a))")),
    "imply in the goal": case(3, DOMAIN, goal("(imply (at r1 a) (at r1 b))")),
    "or in the goal": case(4, DOMAIN, goal("(or (at r1 b) (at r2 c))")),
    "shadowing in the goal": case(
        1, DOMAIN, goal("(exists (?x - room) (and (at r1 ?x) (exists (?x - room) (at r2 ?x))))")
    ),
    "a goal that no action changes": case((11, "is false in every"), DOMAIN, goal("(door a c)")),
    "an action in the goal": case(
        (31, "p.pddl:4:10: unknown predicate 'go'"), DOMAIN, goal("(go r1 a b)")
    ),
    "or in an effect": case((31, "'or' cannot stand here"), d(EFFECT, "(or (at ?r ?y))")),
    "two goals": case(
        (31, "expected one '(:goal FORMULA)'"), DOMAIN, goal("(at r1 c)) (:goal (at r2 a)")
    ),
    "imply": case(2, where("(imply (= ?x ?x) (door ?x ?y))")),
    "= among the predicates": case(2, where("(= ?r ?r)", PREDICATE, f"{PREDICATE} (= ?x ?y)")),
    "a parameter shadowed": case(2, where("(exists (?x - room) (at ?r ?x))")),
    "a quantifier shadowed": case(2, where("(forall (?x - room) (exists (?x - room) (at ?r ?x)))")),
    "quantifier without variables": case(2, where("(forall () (and))")),
    "forall over nothing": case(
        2, where("(forall (?g - ghost) (not (= ?g ?g)))", "robot room)", "robot room ghost)")
    ),
    "exists over nothing": case(
        (11, ""), where("(exists (?g - ghost) (and))", "robot room)", "robot room ghost)")
    ),
    "an empty or": case((11, ""), where("(or)")),
    "a predicate that is a formula": case((31, ":63: (or) is"), d(PREDICATE, f"{PREDICATE} (or)")),
    "an action that is one": case((31, "(and) is a formula"), with_action("and :parameters ()")),
    "words of PDDL as names": case(
        1,
        change(
            where("(forall (?o - robot) (not (go ?o ?y ?x)))", EFFECT, WHEN),
            *("(door ", "(and ", "(at ", "(not ", "(go", "(or", ":action go", ":action or"),
        ),
        p("(door ", "(and ", "(at ", "(not "),
    ),
    # names
    "a predicate named like the action": case(
        (11, ""), where("(go ?r ?x ?y)", PREDICATE, f"{PREDICATE} (go ?r ?x ?y)")
    ),
    "a predicate named like a type": case(2, d("(door", "(room"), p("(door", "(room")),
    "a predicate called last": case(
        (2, "has a predicate 'last'"),
        d("(at ", "(last "),
        p("(at ", "(last "),
        "--remember-actions",
    ),
    "upper case": case(2, DOMAIN.upper(), PROBLEM.upper()),
    # layout
    "CRLF": case(2, d("\n", "\r\n"), p("\n", "\r\n")),
    "CR": case(2, d("(:types", "; x\n(:types", "\n", "\r"), p("\n", "\r")),
    "tabs": case(2, d(" ", "\t"), p(" ", "\t")),
    "byte order mark": case(2, "\ufeff" + DOMAIN, "\ufeff" + PROBLEM),
    "comments everywhere": case(2, d(" ", ";x)(\n"), p(" ", ";x)(\n")),
    "a comment about the subaction of one action": case(
        (31, "action 'go' has no '; subaction' comment"),
        with_action("wait :agent ?r - robot ; subaction r1 (wait)\n", where("(not (wait ?r))")),
    ),
    **{
        f"comments in a joint action: {more}": case(
            (31, "this subaction comment is not read") if is_refused else 1,
            JOINT.replace("MORE", more),
            "(define (problem p) (:domain lift) (:init) (:goal (up)))",
        )
        for more, is_refused in (
            (") ;subaction r2 (lift)", True),
            (") ; end\n; Subaction", True),
            (";; Subaction: r2 (lift)\n)", True),
            (";subaction(r2 lift)\n)", True),
            ("; subaction r2 (lift)\n)", False),
            ("; subactions: subaction r2\n)", False),
            ("; sub-action\n; subaction-like\n)", False),
        )
    },
    "comments of plain PDDL that begin so": case(
        2, "; subaction r1 (x)\n" + d(":precondition", "; subaction: x\n :precondition")
    ),
    "no spaces that are not needed": case(2, d(" (", "("), p(" (", "(")),
    # costs
    "costs do not count by themselves": case(2, COSTLY),
    "costs that count": case(2, COSTLY, PRICED, COST),
    "a cost with a point": case(2, COSTLY, change(PRICED, " 3)", " 3.0)"), COST),
    "a cost that is missing": case(
        (31, "the cost (far a b) has no whole value"),
        COSTLY,
        change(PRICED, "(= (far a b) 3)", ""),
        COST,
    ),
    "costs whose sum passes 2^63": case(
        (31, "cost"), COSTLY, change(PRICED, " 3)", f" {HUGE})", "b a) 1", f"b a) {HUGE}"), COST
    ),
    "a cost of 400 digits": case((31, "cost"), COSTLY, change(PRICED, " 3)", f" {LONG})"), COST),
    "a constant cost of 400 digits": case(
        (34, "d.pddl"), change(COSTLY, "(far ?x ?y)))", f"{LONG}))"), PROBLEM, COST
    ),
    "one that is ignored": case(2, change(COSTLY, "(far ?x ?y)))", f"{LONG}))")),
    "two values of one function": case(
        (31, "another value already"), COSTLY, change(PRICED, " 3)", " 3) (= (far A b) 4)")
    ),
    "a value with the wrong number of arguments": case(
        (31, "p.pddl:3"), COSTLY, p("(:init", "(:init (= (far a) 3)")
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_odd(name: str, coordlang: Command, tmp_path: Path) -> None:
    expected, domain, problem, options = CASES[name]
    (tmp_path / "d.pddl").write_bytes(domain.encode())
    (tmp_path / "p.pddl").write_bytes(problem.encode())
    outcome = coordlang("plans", tmp_path / "d.pddl", tmp_path / "p.pddl", "--count", *options)
    if isinstance(expected, int):
        assert (outcome.code, outcome.out) == (0, f"{expected}\n"), outcome.err
    else:
        code, message = expected
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


@pytest.mark.parametrize("text", ["PK", "(define (domain d)) PK"])
def test_what_is_no_pddl_is_shown_as_it_stands_in_the_file(text: str) -> None:
    with pytest.raises(BadInput, match="'PK'"):
        parse(Source("d", text))
