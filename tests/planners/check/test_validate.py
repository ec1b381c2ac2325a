# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules of joint steps, kept and broken by plans made by hand; docs/pddl.md has more."""

from __future__ import annotations

import pytest

from planners.check.rules import Labels, Rules, Verdict, validate
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions, Unowned
from planners.pddl.robots import Team, find_team
from planners.system.errors import BadInput
from tests.support.texts import parsed

World = tuple[Domain, Problem, Team]


def world(domain: str, problem: str, unowned: Unowned = "error") -> World:
    """``domain`` and ``problem`` are the sections behind the names."""
    read, task = parsed(
        f"(define (domain d) {domain})", f"(define (problem p) (:domain d) {problem})"
    )
    return read, task, find_team(read, task, ModelOptions(unowned=unowned))


def one_step(setting: World, *labels: str | None) -> str | None:
    """What is wrong with a joint step from the initial state."""
    found = Rules(*setting).step(setting[1].init, labels)
    return found if isinstance(found, str) else None


def after(setting: World, *labels: str | None) -> set[str]:
    """The true fluents after a joint step from the initial state."""
    domain, problem, team = setting
    init = frozenset(a for a in problem.init if a.predicate != "static")
    state = Rules(domain, problem, team).step(init, labels)
    assert not isinstance(state, str)
    return {" ".join((a.predicate, *a.args)) for a in state}


# -- plans

ROOMS = world(
    """(:types robot place) (:predicates (at ?r - robot ?p - place) (static ?a ?b - place))
    (:action move :agent ?r - robot :parameters (?from ?to - place)
      :precondition (and (at ?r ?from) (static ?from ?to))
      :effect (and (not (at ?r ?from)) (at ?r ?to)))""",
    """(:objects r1 r2 - robot a b c - place)
    (:init (at r1 a) (at r2 b) (static a b) (static b a) (static b c) (static c b))
    (:goal (and (at r1 b) (not (at r2 b))))""",
)


@pytest.mark.parametrize(
    "plan",
    [
        [["(move r1 a b)", "(move r2 b c)"]],
        [["( MOVE  r1 a b )", "(move r2 b c)"]],  # texts are read like PDDL
        # Idling is a choice and costs a step.
        [[None, None], [None, "(move r2 b c)"], ["(move r1 a b)", None]],
    ],
)
def test_plans(plan: list[Labels]) -> None:
    verdict = validate(*ROOMS, plan)
    assert verdict == Verdict(True, None, verdict.reason)


@pytest.mark.parametrize(
    ("plan", "step", "words"),
    [
        ([["(move r1 a b)", None]], 1, ("goal", "(at r2 b) is true")),
        ([], 0, ("goal", "(at r1 b) is false")),
        # The first broken step is named.
        (
            [["(move r1 a b)", None], ["(move r1 b a)", "(move r2 a b)"], ["(move r1 b c)", None]],
            1,
            ("r2", "(move r2 a b)", "(at r2 a) is false"),
        ),
        ([["(move r1 a c)", None]], 0, ("(static a c) is false",)),
        ([["(fly r1 a b)", None]], 0, ("r1", "no action")),
        ([["(move r1 a)", None]], 0, ("r1", "2 arguments")),
        ([["(move r1 a r2)", None]], 0, ("r1", "r2 is no object of type place")),
        ([["(move r2 b c)", None]], 0, ("r1", "it belongs to r2")),
        ([["", None]], 0, ("r1", "no action")),
        ([["(move r1 a b)"]], 0, ("1 entries for 2 robots",)),
    ],
)
def test_plans_that_are_none(plan: list[Labels], step: int, words: tuple[str, ...]) -> None:
    verdict = validate(*ROOMS, plan)
    assert (verdict.valid, verdict.step) == (False, step)
    assert all(word in verdict.reason for word in words), verdict


# -- action formulas, owners, quantifiers

PARTNER = world(
    """(:types robot table) (:predicates (up ?t - table))
    (:action lift :agent ?r - robot :parameters (?t - table)
      :precondition (exists (?o - robot) (and (not (= ?o ?r)) (lift ?o ?t))) :effect (up ?t))""",
    "(:objects r1 r2 - robot t u - table) (:init) (:goal (up t))",
)
#: ``(imply (nod ?r) ..)`` in the precondition of nod is a negative formula about the acting robot.
NOD = world(
    """(:types robot) (:predicates (never) (done ?r - robot))
    (:action nod :agent ?r - robot :parameters () :precondition (imply (nod ?r) (never)) :effect (done ?r))
    (:action bow :agent ?r - robot :parameters () :precondition (not (not (nod ?r))) :effect (done ?r))
    (:action end :agent ?r - robot :parameters () :effect (never))""",
    "(:objects r1 r2 - robot) (:init) (:goal (done r1))",
)
PREDICATE = world(
    """(:types robot) (:predicates (lift ?r - robot))
    (:action lift :agent ?r - robot :parameters () :precondition (not (lift ?r)) :effect (lift ?r))
    (:action rest :agent ?r - robot :parameters () :precondition (lift ?r) :effect (not (lift ?r)))""",
    "(:objects r1 r2 - robot) (:init (lift r2)) (:goal (lift r1))",
)
TYPES = world(
    """(:types robot place) (:constants r1 r2 - robot) (:predicates (p ?r - robot))
    (:action a :agent ?r - robot :parameters (?x - place) :effect (p ?r))
    (:action b :agent ?r - robot :parameters () :precondition (not (a ?r r1)) :effect (p ?r))
    (:action c :agent ?r - robot :parameters () :precondition (a ?r r1) :effect (p ?r))""",
    "(:objects x - place) (:init) (:goal (p r1))",
)
CARRY = """(:types robot place) (:predicates (at ?r - robot) (up) (rung))
  (:action carry :parameters (?r ?q - robot) :precondition (and (at ?r) (not (up))) :effect (up))
  (:action go :parameters (?r - robot) :precondition (not (at ?r)) :effect (at ?r))
  (:action look :parameters (?r - robot) :precondition (not (up)) :effect (rung))
  {more}"""
CARRIERS = "(:objects r1 r2 r3 - robot) (:init (at r1) (at r2)) (:goal (up))"
SHARED = world(CARRY.format(more=""), CARRIERS)
BELL = CARRY.format(more="(:action ring :parameters () :effect (rung))")
ENVIRONMENT, ALL = world(BELL, CARRIERS, "environment"), world(BELL, CARRIERS, "shared")
#: It spills if one lifts alone; with three, each pair has one that leans.
TABLE = world(
    """(:types robot) (:predicates (level) (up ?r - robot) (spilled))
    (:action lift :agent ?r - robot :parameters () :precondition (level) :effect (and (up ?r)
      (when (forall (?o - robot) (or (= ?o ?r) (not (lift ?o)))) (and (not (level)) (spilled)))))
    (:action lean :agent ?r - robot :parameters () :precondition (level) :effect (up ?r))""",
    "(:objects r1 r2 r3 - robot) (:init (level)) (:goal (spilled))",
)
BOXES = world(
    """(:types robot thing - object box - thing) (:predicates (on ?t - object) (p))
    (:action take :agent ?r - robot :parameters (?t - object) :effect (not (on ?t)))
    (:action look :agent ?r - robot :parameters () :precondition (exists (?t - box) (on ?t)) :effect (p))""",
    "(:objects r1 r2 - robot t - thing b c - box) (:init (on b) (on t)) (:goal (p))",
)


@pytest.mark.parametrize(
    ("setting", "labels", "reason"),
    [
        # A positive formula demands a partner.
        (PARTNER, ("(lift r1 t)", "(lift r2 u)"), "no robot does (lift r2 t)"),
        # Polarity is read through double negation and implication.
        (NOD, ("(nod r1)", None), None),
        (NOD, ("(bow r1)", "(nod r2)"), "no robot does (nod r1)"),
        # A predicate wins over an action of the same name.
        (PREDICATE, ("(lift r1)", "(rest r2)"), None),
        (PREDICATE, (None, "(lift r2)"), "(lift r2) is true"),
        # A formula with an argument of another type speaks of no action.
        (TYPES, ("(b r1)", None), None),
        (TYPES, ("(c r1)", None), ""),
        # A shared action is chosen by all its owners; with one robot twice it has one.
        (SHARED, ("(carry r1 r2)", "(carry r1 r2)", "(go r3)"), None),
        (SHARED, ("(carry r1 r2)", None, None), "(carry r1 r2) needs r2 to choose it too"),
        (SHARED, ("(carry r1 r2)", "(carry r2 r1)", None), "needs r2"),
        (SHARED, (None, None, "(carry r1 r2)"), "belongs to r1 and r2"),
        (SHARED, ("(carry r1 r1)", None, None), None),
        # It does not interfere with itself, but with others.
        (SHARED, ("(carry r1 r2)", "(carry r1 r2)", None), None),
        (SHARED, ("(carry r1 r2)", "(carry r1 r2)", "(look r3)"), "adds (up)"),
        # Actions of nobody.
        (world(BELL, CARRIERS), ("(ring)", None, None), "belongs to no robot"),
        (ENVIRONMENT, (None, None, None, "(ring)"), None),
        (ENVIRONMENT, ("(ring)", None, None, None), "belongs to environment"),
        (ALL, ("(ring)", "(ring)", "(ring)"), None),
        (ALL, ("(ring)", "(ring)", None), "needs r3"),
        # Effects that two actions themselves rule out count between others.
        (TABLE, ("(lift r1)", "(lift r2)", "(lean r3)"), "deletes (level)"),
        # Quantified literals count for every object of the type.
        (BOXES, ("(take r1 b)", "(look r2)"), "deletes (on b)"),
        (BOXES, ("(take r1 c)", "(look r2)"), "deletes (on c)"),
        (BOXES, ("(take r1 t)", "(look r2)"), None),
        (BOXES, ("(take r1 r2)", "(look r2)"), None),
    ],
)
def test_steps(setting: World, labels: Labels, reason: str | None) -> None:
    found = one_step(setting, *labels)
    assert found is None if reason is None else reason in str(found)
    assert (found is None) == (reason is None)


# -- interference


def two(first: str, second: str, init: str = "(p) (s)") -> World:
    """r1 may do ``one`` and r2 ``two``; p, q and n are fluents, s and z statics (s is true)."""
    return world(
        f"""(:types robot thing) (:constants r1 r2 - robot)
        (:predicates (p) (q) (n) (s) (z) (on ?t - thing))
        (:action one :agent ?r - robot :parameters () {first})
        (:action two :agent ?r - robot :parameters () {second})
        (:action other :agent ?r - robot :parameters (?t - thing)
          :effect (and (p) (q) (n) (on ?t) (not (on ?t))))""",
        f"(:objects x y - thing) (:init {init}) (:goal (p))",
    )


def clash(first: str, second: str, init: str = "(p) (s)") -> str | None:
    """What is wrong with the two together; each alone must be fine.  Read in both orders."""
    setting = two(first, second, init)
    assert one_step(setting, "(one r1)", None) is None
    assert one_step(setting, None, "(two r2)") is None
    reason = one_step(setting, "(one r1)", "(two r2)")
    assert (one_step(setting, "(two r1)", "(one r2)") is None) == (reason is None)
    return reason


DELETES_P = ":effect (not (p))"
ADDS_Q = ":effect (q)"
NEEDS_P = ":precondition (p) :effect (n)"
NO_Q = ":precondition (not (q)) :effect (n)"
#: An atom both deleted and added counts as added.
BOTH = ":effect (and (not (p)) (p))"


def needing(formula: str) -> str:
    return f":precondition {formula} :effect (n)"


@pytest.mark.parametrize(
    ("first", "second", "reason"),
    [
        (DELETES_P, NEEDS_P, "(one r1) deletes (p), which (two r2) requires"),
        (DELETES_P, ":effect (p)", "(one r1) deletes (p), which (two r2) adds"),
        (ADDS_Q, NO_Q, "(one r1) adds (q), which (two r2) requires to be false"),
        (DELETES_P, BOTH, "(one r1) deletes (p), which (two r2) adds"),
        (":effect (and (not (q)) (q))", NO_Q, "adds (q)"),
        # Conditional effects count as if they fired, and their conditions as required.
        (":effect (when (and (q) (n)) (not (p)))", ":precondition (p) :effect (q)", "deletes (p)"),
        (DELETES_P, ":effect (when (p) (n))", "requires"),
        (ADDS_Q, ":effect (when (not (q)) (n))", "requires to be false"),
        # A negative formula of the acting robot is left in the condition of an effect: there it may
        # be false, so that the other literals of the disjunction count; in a precondition it is true.
        (DELETES_P, ":effect (when (or (not (two ?r)) (p)) (n))", "requires"),
        # Every literal of a disjunction counts, and only statics, equalities and types are decided.
        (DELETES_P, needing("(or (p) (q))"), "deletes (p)"),
        (DELETES_P, needing("(or (q) (not (not (p))))"), "deletes (p)"),
        (DELETES_P, needing("(imply (not (p)) (q))"), "deletes (p)"),
        (ADDS_Q, needing("(or (p) (not (q)))"), "adds (q)"),
        (DELETES_P, needing("(or (z) (p))"), "deletes (p)"),
        (DELETES_P, needing("(and (s) (p))"), "deletes (p)"),
        (DELETES_P, needing("(or (p) (not (= ?r ?r)))"), "deletes (p)"),
        (DELETES_P, needing("(or (p) (not (p)))"), "deletes (p)"),
    ],
)
def test_interference(first: str, second: str, reason: str) -> None:
    assert reason in str(clash(first, second))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (DELETES_P, DELETES_P),
        (ADDS_Q, ADDS_Q),
        (DELETES_P, NO_Q),
        (":precondition (p) :effect (q)", NEEDS_P),
        # It requires what it deletes, but that is its own affair.
        (":precondition (p) :effect (not (p))", ":effect (n)"),
        # Adding what the other requires, deleting what it requires to be false.
        (":effect (p)", NEEDS_P),
        (":effect (not (q))", NO_Q),
        (BOTH, NEEDS_P),
        (BOTH, ":effect (p)"),
        # Counted as adding p, although q is false and p goes.
        (":effect (and (not (p)) (when (q) (p)))", NEEDS_P),
        (DELETES_P, needing("(or (not (two ?r)) (p))")),
        # An effect that can never fire touches nothing.
        (DELETES_P, ":effect (and (n) (when (and (p) (z)) (n)) (when (z) (p)))"),
        # What statics, equalities and types decide requires nothing.
        (DELETES_P, needing("(or (s) (p))")),
        (DELETES_P, needing("(or (p) (not (z)))")),
        (DELETES_P, needing("(or (p) (= ?r ?r))")),
        (DELETES_P, needing("(imply (z) (p))")),
        (DELETES_P, needing("(forall (?t - (either robot thing)) (or (p) (not (z))))")),
        (DELETES_P, needing("(or (s) (and (p) (q)))")),
        # Nothing is both a robot and a thing: no such subaction, so the negative formula is true.
        (DELETES_P, needing("(or (p) (not (other ?r ?r)))")),
    ],
)
def test_no_interference(first: str, second: str) -> None:
    assert clash(first, second) is None


@pytest.mark.parametrize(
    ("second", "labels", "reason"),
    [
        # Linked actions clash only when one deletes what the other adds.
        (":precondition (and (p) (exists (?o - robot) (one ?o))) :effect (n)", "one two", None),
        (":precondition (and (p) (exists (?o - robot) (one ?o))) :effect (n)", "two one", None),
        (":precondition (p) :effect (n)", "one two", "deletes (p)"),
        (":precondition (exists (?o - robot) (one ?o)) :effect (p)", "one two", "(two r2) adds"),
        # A positive formula in the condition of an effect links, too; this one names r1's action.
        (":precondition (p) :effect (when (one r1) (n))", "one two", None),
        (":precondition (p) :effect (when (one r1) (n))", "two one", "deletes (p)"),
        # A negative formula does not; statics decide, double negation is positive, the premise of
        # an implication is negative.
        (needing("(and (p) (or (s) (n) (not (not (one r1)))))"), "one two", "deletes (p)"),
        (needing("(and (p) (or (z) (n) (not (not (one r1)))))"), "one two", None),
        (needing("(and (p) (imply (one r1) (p)))"), "one two", "deletes (p)"),
    ],
)
def test_linked_actions(second: str, labels: str, reason: str | None) -> None:
    chosen = [f"({name} r{n})" for n, name in enumerate(labels.split(), 1)]
    found = one_step(two(DELETES_P, second), *chosen)
    assert found is None if reason is None else reason in str(found)


# -- effects

EFFECTS = """(:types robot thing - object box - thing) (:predicates (on ?t - object) (big ?t - object) (p) (q))
  (:action swap :agent ?r - robot :parameters ()
    :effect (and (when (p) (and (q) (not (p)))) (when (q) (and (p) (not (q))))))
  (:action keep :agent ?r - robot :parameters () :effect (and (p) (not (p))))
  (:action clear :agent ?r - robot :parameters (?t - thing)
    :effect (forall (?t - box) (when (big ?t) (forall (?u - (either robot box)) (when (on ?u) (not (on ?u)))))))
  (:action put :agent ?r - robot :parameters (?t - thing)
    :effect (and (on ?t) (when (not (exists (?t - box) (on ?t))) (q))))
  (:action wipe :agent ?r - robot :parameters ()
    :effect (forall (?t - thing) (when (big ?t) (forall (?t - box) (not (on ?t))))))"""


@pytest.mark.parametrize(
    ("init", "label", "result"),
    [
        # Conditions are read in the state before.
        ("(p)", "(swap r1)", "(q)"),
        ("(p) (q)", "(swap r1)", "(p) (q)"),
        # Adding wins over deleting within one action.
        ("", "(keep r1)", "(p)"),
        # The inner ?t of clear ranges over boxes and has nothing to do with its argument; big is
        # static here, and only the boxes are asked.
        ("(on r2) (on t) (on b) (on c)", "(clear r1 t)", "(on r2) (on t) (on b) (on c)"),
        ("(on r2) (on t) (on b) (big t)", "(clear r1 t)", "(on r2) (on t) (on b) (big t)"),
        ("(on r2) (on t) (on b) (on c) (big c)", "(clear r1 t)", "(on t) (big c)"),
        # If anything at all is big, wipe clears every box.
        ("(on t) (on b) (big t)", "(wipe r1)", "(on t) (big t)"),
        ("(on t) (on b)", "(wipe r1)", "(on t) (on b)"),
        # A hidden variable in a condition.
        ("", "(put r1 t)", "(on t) (q)"),
        ("(on t)", "(put r1 t)", "(on t) (q)"),
        ("(on b)", "(put r1 t)", "(on t) (on b)"),
    ],
)
def test_effects(init: str, label: str, result: str) -> None:
    objects = "(:objects r1 r2 - robot t - thing b c - box)"
    things = world(EFFECTS, f"{objects} (:init {init}) (:goal (p))")
    assert after(things, label, None) == {*result[1:-1].split(") (")}


# -- joint-action PDDL

JOINT = """(:types place) (:predicates (at1 ?p - place) (at2 ?p - place) (link ?a ?b - place))
  (:action both :parameters (?a ?b ?c ?d - place)
    ; subaction r1 (move ?a ?b)
    ; subaction r2 (move ?c ?d)
    :precondition (and (at1 ?a) (at2 ?c) (link ?a ?b) (link ?c ?d) (not (= ?b ?d)))
    :effect (and (not (at1 ?a)) (at1 ?b) (not (at2 ?c)) (at2 ?d)))
  (:action first :parameters (?a ?b ?z - place)
    ; subaction r1 (move ?a ?b)
    :precondition (and (at1 ?a) (at2 ?z) (link ?a ?b) (not (= ?b ?z)))
    :effect (and (not (at1 ?a)) (at1 ?b)))
  (:action none :parameters ()
    ; subaction r1 idle
    ; subaction r2 (look)
    :precondition ()
    :effect ())"""
PLACES = """(:objects a b c - place) (:init (at1 a) (at2 b) (link a b) (link b c) (link b a))
  (:goal (and (at1 b) (at2 c)))"""


@pytest.mark.parametrize(
    ("labels", "reason"),
    [
        # A swap is one joint action: nothing but its own precondition forbids it.
        (("(move a b)", "(move b a)"), None),
        ((None, None), "no joint action"),  # idling is written, or it is not there
        ((None, "(move b c)"), "no joint action"),
        (("(look)", "(look)"), "no joint action"),
        (("(move a a b)", None), "no joint action"),
        (("(move a b)", "(move b b)"), "(both a b b b) is not applicable: (link b b) is false"),
        # A missing line means idle; the third parameter is found by trying: r2 stands in b.
        (("(move a b)", None), "not applicable"),
    ],
)
def test_the_parts_name_the_joint_action(labels: Labels, reason: str | None) -> None:
    found = one_step(world(JOINT, PLACES), *labels)
    assert found is None if reason is None else reason in str(found)


def test_plans_of_joint_actions() -> None:
    setting = world(JOINT, PLACES)
    assert validate(*setting, [["(move a b)", "(move b c)"]]).valid
    assert validate(*setting, [[None, "(look)"], ["(MOVE a b)", "(move b c)"]]).valid
    moved = after(world(JOINT, PLACES.replace("(at2 b)", "(at2 c)")), "(move a b)", None)
    assert moved >= {"at1 b", "at2 c"}


@pytest.mark.parametrize(
    ("when", "effect", "fits"),
    [("()", "(q)", False), ("()", "(and (p) (not (q)))", True), ("(q)", "(q)", True)],
)
def test_the_parts_determine_the_result(when: str, effect: str, fits: bool) -> None:
    """The same result, or only one of them applicable: no harm."""
    setting = world(
        f"""(:predicates (p) (q))
        (:action x :parameters ()
          ; subaction r1 (do)
          ; subaction r2 idle
          :precondition () :effect (p))
        (:action y :parameters ()
          ; subaction r1 (do)
          :precondition {when} :effect {effect})""",
        "(:objects) (:init) (:goal (p))",
    )
    if fits:
        assert validate(*setting, [["(do)", None]]).valid
    else:
        with pytest.raises(BadInput, match="different results"):
            validate(*setting, [["(do)", None]])
