# SPDX-License-Identifier: GPL-3.0-or-later
"""Types: of robots that nobody declared, of lists without names, of the arguments of atoms."""

from __future__ import annotations

import re
import warnings
from itertools import product
from pathlib import Path
from random import Random

import pytest

from coordlang.language.provenance import Provenance
from coordlang.language.recorded import options_of
from coordlang.language.words import Language
from planners.loading import PlanningInstance
from planners.pddl import parse_domain, parse_problem
from planners.pddl.model_options import ModelOptions, Unowned
from planners.pddl.robots import find_team
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput, Note
from tests.support.command import Command
from tests.support.hall import DOMAIN, PROBLEM
from tests.support.texts import model_of, parsed

HIKERS = """(define (domain hike) (:types hiker place - object)
 (:predicates (at ?h - hiker ?p - place) (way ?a ?b - place))
 (:action walk :parameters (?h - hiker ?a ?b - place)
  :precondition (and (at ?h ?a) (way ?a ?b)) :effect (and (at ?h ?b) (not (at ?h ?a))))
 (:action rest :parameters (?h - hiker) :precondition (at ?h a) :effect (at ?h a)))"""
HIKE = """(define (problem p) (:domain hike) (:objects h1 h2 - hiker a b - place)
 (:init (at h1 a) (at h2 b) (way a b) (way b a)) (:goal (and (at h1 b) (at h2 a))))"""


def domain(actions: str, types: str = "(:types lift floor cell)") -> str:
    return f"(define (domain d) {types} (:predicates (on ?x)) {actions})"


def action(name: str, parameters: str) -> str:
    first = parameters.split()[0]
    return f"(:action {name} :parameters ({parameters}) :effect (on {first}))"


def read(domain_text: str, objects: str) -> PlanningInstance:
    text = f"(define (problem p) (:domain d) (:objects {objects}) (:init) (:goal (on x)))"
    return model_of(domain_text, text)


def test_a_guess_is_said_once_with_the_type_and_the_objects(
    coordlang: Command, tmp_path: Path
) -> None:
    files = tmp_path / "domain.pddl", tmp_path / "problem.pddl"
    files[0].write_text(HIKERS.replace(" (:predicates", " (:constants a - place) (:predicates"))
    files[1].write_text(HIKE.replace(" a b - place", " b - place"))
    outcome = coordlang("plans", *files, "--count")
    assert (outcome.code, outcome.out) == (0, "1\n")
    assert outcome.err == (
        f"coordlang: note: {files[0]}:1:24: the robots are taken to be h1, h2: every action takes an "
        "object of type 'hiker'\n"
        "  Say --robot-type hiker if that is so; --robots NAME,NAME names others.\n"
    )
    assert coordlang("plans", *files, "--count", "--robot-type", "hiker").err == ""


@pytest.mark.parametrize(
    ("actions", "objects", "why"),
    [
        (action("go", "?a ?b - cell"), "x y - cell", "they are all its objects"),
        (
            action("go", "?a ?b - cell"),
            " ".join(f"c{n}" for n in range(80)) + " - cell x - lift",
            "they are 80",
        ),
        (
            action("up", "?p - lift ?f - floor") + action("board", "?c - cell ?f - floor"),
            "x - lift f1 f2 - floor c - cell",
            "they are never the first argument of an action",
        ),
    ],
    ids=["every object", "80 cells", "never first"],
)
def test_an_implausible_guess_is_an_error_with_candidates(
    actions: str, objects: str, why: str
) -> None:
    with pytest.raises(BadInput) as caught:
        read(domain(actions), objects)
    text = str(caught.value)
    assert text.startswith("domain.pddl:1:21: which objects are the robots? Every action takes")
    assert why in text
    assert "Say --robot-type TYPE or --robots NAME,NAME. Candidates: " in text


#: All actions take crossings, which never move or hold anything.
CROSSINGS = """(define (domain d) (:types crossing cart lane)
 (:predicates (on ?c - cart ?l - lane) (at ?c - cart ?x - crossing) (gone ?c - cart ?x - crossing)
  (empty ?x - crossing) (joins ?l - lane ?x ?y - crossing))
 (:action enter :parameters (?x ?y - crossing ?c - cart ?l - lane)
  :precondition (and (at ?c ?x) (joins ?l ?x ?y)) :effect (and (on ?c ?l) (empty ?x) (not (at ?c ?x))))
 (:action leave :parameters (?x ?y - crossing ?c - cart ?l - lane)
  :precondition (and (on ?c ?l) (joins ?l ?x ?y) (empty ?y))
  :effect (and (at ?c ?y) (not (empty ?y)) (not (on ?c ?l))))
 (:action pave :parameters (?x ?y - crossing ?l - lane) :effect (joins ?l ?x ?y))
 (:action tear :parameters (?x ?y - crossing ?l - lane)
  :precondition (joins ?l ?x ?y) :effect (not (joins ?l ?x ?y)))
 (:action park :parameters (?x - crossing ?c - cart) :precondition (at ?c ?x)
  :effect (and (gone ?c ?x) (empty ?x) (not (at ?c ?x)))))"""
#: They stand still, and hold things.
CRANES = """(define (domain d) (:types crane box)
 (:predicates (holds ?c - crane ?b - box) (idle ?c - crane) (down ?b - box))
 (:action take :parameters (?c - crane ?b - box) :precondition (and (idle ?c) (down ?b))
  :effect (and (holds ?c ?b) (not (idle ?c)) (not (down ?b))))
 (:action put :parameters (?c - crane ?b - box) :precondition (holds ?c ?b)
  :effect (and (idle ?c) (down ?b) (not (holds ?c ?b))))
 (:action rest :parameters (?c - crane)))"""


def team(domain_text: str, objects: str) -> tuple[str, ...]:
    text = f"(define (problem p) (:domain d) (:objects {objects}) (:goal (and)))"
    return find_team(*parsed(domain_text, text), ModelOptions()).robots


def test_what_never_moves_or_holds_anything_is_no_robot() -> None:
    with pytest.raises(BadInput, match="they never move or hold anything") as caught:
        team(CROSSINGS, "x y - crossing c - cart l - lane")
    assert caught.value.what.startswith("which objects are the robots?")
    assert "crossing (" in (caught.value.remedy or "")


def test_what_moves_or_holds_something_may_be_robots() -> None:
    with pytest.warns(Note, match="the robots are taken to be c1, c2"):
        assert team(CRANES, "c1 c2 - crane b - box") == ("c1", "c2")
    hikers = HIKERS.replace("domain hike)", "domain d)").replace("(at ?h a)", "(and)")
    with pytest.warns(Note, match="the robots are taken to be h1, h2"):
        assert team(hikers, "h1 h2 - hiker a - place") == ("h1", "h2")


def test_all_of_ferry_are_objects() -> None:
    """Without types no guess is made, and what may be robots is listed with its objects."""
    text = domain(action("sail", "?a ?b"), types="")
    with pytest.raises(BadInput, match=r"No type is taken by every action\n  Say --robot-type"):
        read(text, "x l1 l2")


@pytest.mark.parametrize("kind", ["robot", "agent"])
def test_a_type_of_that_name_is_no_guess(kind: str) -> None:
    text = domain(action("go", f"?a - {kind}"), types=f"(:types {kind} cell)")
    with warnings.catch_warnings():
        warnings.simplefilter("error", Note)
        assert read(text, f"x y - {kind} z - cell").team.robots == ("x", "y")


def test_typed_lists_without_names_are_read_with_a_note() -> None:
    text = domain(action("go", "?a - robot"), types="(:types robot board)")
    with pytest.warns(
        Note, match="problem.pddl:1:43: no object stands before '- board': nothing is declared"
    ):
        loaded = read(text, "- board x y - robot - board")
    assert loaded.team.robots == ("x", "y")
    assert "board" not in {kind for own in loaded.problems[0].objects.values() for kind in own}


# ---- arguments of atoms have a type in common with the declared one

TYPES = ("t0", "t1", "t2", "t3", "t4")


def typed(names: tuple[str, ...]) -> str:
    return f" - (either {' '.join(names or ('object',))})"


def above(parents: dict[str, tuple[str, ...]], name: str) -> set[str]:
    """The definition: the type, and all above one of its parents."""
    return {name}.union(*(above(parents, parent) for parent in parents[name]))


def test_random_types_against_the_definition() -> None:
    refused = read = 0
    for seed in range(300):
        pick = Random(seed)
        parents = {
            name: tuple(pick.sample(TYPES[:n], pick.choice((0, 1, 1, 2)) if n > 1 else 0))
            for n, name in enumerate(TYPES)
        }
        declared, own = (tuple(pick.sample(TYPES, pick.choice((0, 1, 1, 2)))) for _ in range(2))
        pairs = product(own, declared)
        fits = not (own and declared) or any(
            {a, b} <= above(parents, c) for a, b in pairs for c in TYPES
        )
        types = " ".join(f"{name}{typed(parents[name])}" for name in TYPES)
        domain = parse_domain(
            Source(
                "d",
                f"(define (domain d) (:types {types}) (:predicates (p ?x{typed(declared)}) (q))"
                " (:action a :parameters () :effect (q)))",
            )
        )
        sections = {
            "(:init (p o)) (:goal (q))": "argument 1 of 'p', 'o', is of type",
            "(:init) (:goal (p o))": "argument 1 of 'p', 'o', is of type",
            f"(:init) (:goal (forall (?v{typed(own)}) (p ?v)))": "argument 1 of 'p', '?v', is of",
        }
        for section, message in sections.items():
            text = f"(define (problem x) (:domain d) (:objects o{typed(own)}) {section})"
            if fits:
                parse_problem(Source("p", text), domain)
                read += 1
            else:
                with pytest.raises(BadInput, match=re.escape(message)) as caught:
                    parse_problem(Source("p", text), domain)
                position = caught.value.position
                assert position is not None
                assert text[position.column - 1 :].startswith(("o)", "?v)"))
                refused += 1
    assert refused > 100
    assert read > 100


@pytest.mark.parametrize(
    ("agent", "unowned"),
    [
        *product([":agent ?r - robot :parameters ("], ["error", "environment", "shared"]),
        *product([":parameters (?r - robot "], ["error", "shared"]),
    ],
)
def test_a_robot_called_environment_that_can_do_nothing(agent: str, unowned: Unowned) -> None:
    """It is a robot as others; only an extra one that owns nothing is left out.  Files may name it."""
    domain = DOMAIN.replace(":agent ?r - robot :parameters (", agent)
    problem = PROBLEM.replace("r1", "car").replace("r2", "environment").replace("(door b a)", "")
    recorded = Provenance(("car", "environment"), None, model={"unowned": unowned})
    language = Language(("w",), {}, "w", recorded)
    for options in (ModelOptions(unowned=unowned), options_of(language)):
        assert model_of(domain, problem, options).model.robots == ("car", "environment")


def test_an_undeclared_type_and_several_declarations_restrict_nothing_more() -> None:
    domain = parse_domain(
        Source(
            "d",
            "(define (domain d) (:types robot room) (:predicates (p ?x - thing) (at ?r - robot)"
            " (:private (at ?r - room)) (at ?r - robot ?x - room))"
            " (:action a :parameters (?r - robot) :effect (and (p ?r) (at ?r))))",
        )
    )
    text = (
        "(define (problem x) (:domain d) (:objects r - robot a - room)"
        " (:init (p r) (p a) (at r) (at a) (at r a)) (:goal (at a r)))"
    )
    parse_problem(Source("p", text.replace("(at a r)", "(at r a)")), domain)
    with pytest.raises(BadInput) as caught:
        parse_problem(Source("p", text), domain)
    assert str(caught.value) == (
        "p:1:117: argument 1 of 'at', 'a', is of type room, not robot\n"
        "  It is declared as (at robot room): are arguments swapped, or is a type missing there?"
    )
