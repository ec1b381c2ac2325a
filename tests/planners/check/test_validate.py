# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules of joint steps (docs/pddl.md), each by hand-worked plans that keep it and that break
it.
"""

from __future__ import annotations

import pytest

from planners.check.rules import Rules
from planners.check.validate import Labels, Verdict, validate
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import And, Atom, Domain, Not, Problem
from planners.pddl.model_options import ModelOptions, Unowned
from planners.pddl.robots import Team, find_team
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput

World = tuple[Domain, Problem, Team]


def world(domain: str, problem: str, unowned: Unowned = "error") -> World:
    """``domain`` and ``problem`` are the sections behind the names."""
    read = parse_domain(Source("domain", f"(define (domain d) {domain})"))
    task = parse_problem(Source("problem", f"(define (problem p) (:domain d) {problem})"), read)
    return read, task, find_team(read, task, ModelOptions(unowned=unowned))


def one_step(setting: World, *labels: str | None) -> str | None:
    """What is wrong with a joint step from the initial state."""
    return Rules(*setting).broken_rule(setting[1].init, labels)


def after(setting: World, *labels: str | None) -> set[str]:
    """The true fluents after a joint step from the initial state."""
    domain, problem, team = setting
    init = frozenset(a for a in problem.init if a.predicate != "static")
    rules = Rules(domain, problem, team)
    assert rules.broken_rule(init, labels) is None
    state = rules.result(init, labels)
    return {" ".join((a.predicate, *a.args)) for a in state}


def rejected(verdict: Verdict, step: int, *words: str) -> bool:
    assert not verdict.valid
    assert verdict.step == step, verdict
    for word in words:
        assert word in verdict.reason, verdict
    return True


# -- a world of rooms
# ---------------------------------------------------------------------------------------------

MOVE = """(:types robot place) (:predicates (at ?r - robot ?p - place) (static ?a ?b - place))
  (:action move :agent ?r - robot :parameters (?from ?to - place)
    :precondition (and (at ?r ?from) (static ?from ?to) {more})
    :effect (and (not (at ?r ?from)) (at ?r ?to)))"""
ROOMS = """(:objects r1 r2 - robot a b c - place)
  (:init (at r1 a) (at r2 b) (static a b) (static b a) (static b c) (static c b))
  (:goal (and (at r1 b) (not (at r2 b))))"""
NO_SWAP = "(forall (?o - robot) (not (move ?o ?to ?from)))"


def rooms(more: str = "") -> World:
    return world(MOVE.format(more=more), ROOMS)


def test_a_plan_of_two_robots() -> None:
    verdict = validate(*rooms(), [["(move r1 a b)", "(move r2 b c)"]])
    assert verdict == Verdict(True, 1, None, verdict.reason)


def test_the_texts_are_read_like_pddl() -> None:
    assert validate(*rooms(), [["( MOVE  r1 a b )", "(move r2 b c)"]]).valid


def test_idling_is_a_choice_and_costs_a_step() -> None:
    plan: list[Labels] = [[None, None], [None, "(move r2 b c)"], ["(move r1 a b)", None]]
    verdict = validate(*rooms(), plan)
    assert verdict == Verdict(True, 3, None, verdict.reason)


def test_the_goal_must_hold_at_the_end() -> None:
    plan: list[Labels] = [["(move r1 a b)", None]]
    assert rejected(validate(*rooms(), plan), 1, "goal", "(at r2 b) is true")
    assert rejected(validate(*rooms(), []), 0, "goal", "(at r1 b) is false")


def test_the_empty_plan_is_one_where_the_goal_holds() -> None:
    verdict = validate(*rooms(), [], goal=Atom("at", ("r2", "b")))
    assert verdict == Verdict(True, 0, None, verdict.reason)


def test_another_task_brings_its_fluents_and_its_goal() -> None:
    init = [Atom("at", ("r1", "c")), Atom("at", ("r2", "c"))]
    goal = And((Atom("at", ("r1", "b")), Not(Atom("at", ("r2", "b")))))
    assert validate(*rooms(), [["(move r1 c b)", None]], init=init, goal=goal).valid
    assert rejected(
        validate(*rooms(), [["(move r1 a b)", None]], init=init, goal=goal), 0, "(at r1 a) is false"
    )


def test_the_first_broken_step_is_named() -> None:
    plan: list[Labels] = [
        ["(move r1 a b)", None],
        ["(move r1 b a)", "(move r2 a b)"],
        ["(move r1 b c)", None],
    ]
    assert rejected(validate(*rooms(), plan), 1, "r2", "(move r2 a b)", "(at r2 a) is false")


def test_statics_come_from_the_problem() -> None:
    assert rejected(validate(*rooms(), [["(move r1 a c)", None]]), 0, "(static a c) is false")


@pytest.mark.parametrize(
    ("label", "words"),
    [
        ("(fly r1 a b)", "no action"),
        ("(move r1 a)", "2 arguments"),
        ("(move r1 a r2)", "r2 is no object of type place"),
        ("(move r2 b c)", "it belongs to r2"),
        ("", "no action"),
    ],
)
def test_a_text_that_is_no_subaction_of_the_robot(label: str, words: str) -> None:
    assert rejected(validate(*rooms(), [[label, None]]), 0, "r1", words)


def test_a_step_has_one_entry_per_robot() -> None:
    assert rejected(validate(*rooms(), [["(move r1 a b)"]]), 0, "1 entries for 2 robots")


# -- when preconditions are read
# ----------------------------------------------------------------------------------

FREE = """(:types robot place) (:predicates (at ?r - robot ?p - place) (free ?p - place))
  (:action move :agent ?r - robot :parameters (?from ?to - place)
    :precondition (and (at ?r ?from) (free ?to))
    :effect (and (not (at ?r ?from)) (free ?from) (at ?r ?to) (not (free ?to))))"""


def test_following_is_allowed_in_the_constraint_style() -> None:
    assert one_step(rooms(NO_SWAP), "(move r1 a b)", "(move r2 b c)") is None


def test_following_is_forbidden_by_a_precondition_in_the_state_before() -> None:
    setting = world(
        FREE,
        """(:objects r1 r2 - robot a b c - place)
        (:init (at r1 a) (at r2 b) (free c)) (:goal (at r1 b))""",
    )
    assert "(free b) is false" in str(one_step(setting, "(move r1 a b)", "(move r2 b c)"))
    assert validate(*setting, [[None, "(move r2 b c)"], ["(move r1 a b)", None]]).valid


# -- action formulas
# ----------------------------------------------------------------------------------------------


def test_a_negative_action_formula_forbids_the_swap() -> None:
    assert one_step(rooms(), "(move r1 a b)", "(move r2 b a)") is None
    reason = one_step(rooms(NO_SWAP), "(move r1 a b)", "(move r2 b a)")
    assert reason == "r1 cannot do (move r1 a b) here: (move r2 b a) is done in the same step"


def test_a_negative_formula_does_not_speak_of_the_acting_robot() -> None:
    alone = "(forall (?o - robot) (not (move ?o ?from ?to)))"
    setting = world(
        MOVE.format(more=alone),
        "(:objects r1 r2 - robot a b - place) (:init (at r1 a) (at r2 a) (static a b)) (:goal (at r1 b))",
    )
    assert one_step(setting, "(move r1 a b)", None) is None
    assert "(move r2 a b) is done" in str(one_step(setting, "(move r1 a b)", "(move r2 a b)"))


def test_a_negative_formula_in_an_effect_condition_may_speak_of_the_acting_robot() -> None:
    setting = world(
        """(:types robot) (:predicates (quiet) (done ?r - robot))
        (:action shout :agent ?r - robot :parameters () :precondition () :effect (and (done ?r)
          (when (forall (?o - robot) (not (shout ?o))) (quiet))))
        (:action nod :agent ?r - robot :parameters () :effect (and (done ?r)
          (when (forall (?o - robot) (not (shout ?o))) (quiet))))""",
        "(:objects r1 r2 - robot) (:init) (:goal (quiet))",
    )
    assert after(setting, "(shout r1)", None) == {"done r1"}
    assert after(setting, "(nod r1)", None) == {"done r1", "quiet"}
    assert after(setting, "(nod r1)", "(shout r2)") == {"done r1", "done r2"}


LIFT = """(:types robot table) (:predicates (up ?t - table) {predicates})
  (:action lift :agent ?r - robot :parameters (?t - table)
    :precondition (exists (?o - robot) (and (not (= ?o ?r)) (lift ?o ?t)))
    :effect (up ?t))"""


def test_a_positive_formula_demands_a_partner() -> None:
    setting = world(
        LIFT.format(predicates=""), "(:objects r1 r2 - robot t u - table) (:init) (:goal (up t))"
    )
    assert one_step(setting, "(lift r1 t)", "(lift r2 t)") is None
    assert "no robot does (lift r2 t)" in str(one_step(setting, "(lift r1 t)", None))
    assert "no robot does (lift r2 t)" in str(one_step(setting, "(lift r1 t)", "(lift r2 u)"))


def test_a_positive_formula_may_be_met_by_the_acting_robot_itself() -> None:
    """Only negative formulas leave the acting robot out."""
    setting = world(
        LIFT.format(predicates="").replace("(not (= ?o ?r))", ""),
        "(:objects r1 r2 - robot t - table) (:init) (:goal (up t))",
    )
    assert one_step(setting, "(lift r1 t)", None) is None


def test_polarity_is_read_through_double_negation_and_implication() -> None:
    """``(imply (nod ?r) ..)`` in the precondition of nod is a negative formula about the acting
    robot: it is true.
    """
    setting = world(
        """(:types robot) (:predicates (never) (done ?r - robot))
        (:action nod :agent ?r - robot :parameters () :precondition (imply (nod ?r) (never)) :effect (done ?r))
        (:action bow :agent ?r - robot :parameters () :precondition (not (not (nod ?r))) :effect (done ?r))
        (:action end :agent ?r - robot :parameters () :effect (never))""",
        "(:objects r1 r2 - robot) (:init) (:goal (done r1))",
    )
    assert one_step(setting, "(nod r1)", None) is None
    assert "no robot does (nod r1)" in str(one_step(setting, "(bow r1)", "(nod r2)"))


def test_a_predicate_wins_over_an_action_of_the_same_name() -> None:
    setting = world(
        """(:types robot) (:predicates (lift ?r - robot))
        (:action lift :agent ?r - robot :parameters () :precondition (not (lift ?r)) :effect (lift ?r))
        (:action rest :agent ?r - robot :parameters () :precondition (lift ?r) :effect (not (lift ?r)))""",
        "(:objects r1 r2 - robot) (:init (lift r2)) (:goal (lift r1))",
    )
    assert one_step(setting, "(lift r1)", "(rest r2)") is None
    assert "(lift r2) is true" in str(one_step(setting, None, "(lift r2)"))


def test_an_action_formula_with_an_argument_of_another_type_speaks_of_no_action() -> None:
    setting = world(
        """(:types robot place) (:constants r1 r2 - robot) (:predicates (p ?r - robot))
        (:action a :agent ?r - robot :parameters (?x - place) :effect (p ?r))
        (:action b :agent ?r - robot :parameters () :precondition (not (a ?r r1)) :effect (p ?r))
        (:action c :agent ?r - robot :parameters () :precondition (a ?r r1) :effect (p ?r))""",
        "(:objects x - place) (:init) (:goal (p r1))",
    )
    assert one_step(setting, "(b r1)", None) is None
    assert one_step(setting, "(c r1)", None) is not None


# -- who owns what
# ------------------------------------------------------------------------------------------------

CARRY = """(:types robot place) (:predicates (at ?r - robot) (up) (rung))
  (:action carry :parameters (?r ?q - robot) :precondition (and (at ?r) (not (up))) :effect (up))
  (:action go :parameters (?r - robot) :precondition (not (at ?r)) :effect (at ?r))
  {more}"""
CARRIERS = "(:objects r1 r2 r3 - robot) (:init (at r1) (at r2)) (:goal (up))"


def test_a_shared_action_is_chosen_by_all_its_owners() -> None:
    setting = world(CARRY.format(more=""), CARRIERS)
    assert one_step(setting, "(carry r1 r2)", "(carry r1 r2)", "(go r3)") is None
    assert (
        one_step(setting, "(carry r1 r2)", None, None) == "(carry r1 r2) needs r2 to choose it too"
    )
    assert "needs r2" in str(one_step(setting, "(carry r1 r2)", "(carry r2 r1)", None))
    assert "belongs to r1 and r2" in str(one_step(setting, None, None, "(carry r1 r2)"))


def test_an_action_with_one_robot_twice_has_one_owner() -> None:
    assert one_step(world(CARRY.format(more=""), CARRIERS), "(carry r1 r1)", None, None) is None


RING = "(:action ring :parameters () :effect (rung))"


def test_actions_of_nobody() -> None:
    mine = world(CARRY.format(more=RING), CARRIERS)
    assert "belongs to no robot" in str(one_step(mine, "(ring)", None, None))
    environment = world(CARRY.format(more=RING), CARRIERS, "environment")
    assert environment[2].robots == ("r1", "r2", "r3", "environment")
    assert one_step(environment, None, None, None, "(ring)") is None
    assert "belongs to environment" in str(one_step(environment, "(ring)", None, None, None))
    shared = world(CARRY.format(more=RING), CARRIERS, "shared")
    assert one_step(shared, "(ring)", "(ring)", "(ring)") is None
    assert "needs r3" in str(one_step(shared, "(ring)", "(ring)", None))


# -- interference
# -------------------------------------------------------------------------------------------------


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


def test_quantified_literals_count_for_every_object_of_the_type() -> None:
    setting = world(
        """(:types robot thing - object box - thing) (:predicates (on ?t - object) (p))
        (:action take :agent ?r - robot :parameters (?t - object) :effect (not (on ?t)))
        (:action look :agent ?r - robot :parameters () :precondition (exists (?t - box) (on ?t)) :effect (p))""",
        "(:objects r1 r2 - robot t - thing b c - box) (:init (on b) (on t)) (:goal (p))",
    )
    assert "deletes (on b)" in str(one_step(setting, "(take r1 b)", "(look r2)"))
    assert "deletes (on c)" in str(one_step(setting, "(take r1 c)", "(look r2)"))
    assert one_step(setting, "(take r1 t)", "(look r2)") is None
    assert one_step(setting, "(take r1 r2)", "(look r2)") is None


def test_a_shared_action_does_not_interfere_with_itself_but_with_others() -> None:
    look = "(:action look :parameters (?r - robot) :precondition (not (up)) :effect (rung))"
    setting = world(CARRY.format(more=look), CARRIERS)
    assert one_step(setting, "(carry r1 r2)", "(carry r1 r2)", None) is None
    assert "adds (up)" in str(one_step(setting, "(carry r1 r2)", "(carry r1 r2)", "(look r3)"))


def test_linked_actions_clash_only_when_one_deletes_what_the_other_adds() -> None:
    linked = ":precondition (and (p) (exists (?o - robot) (one ?o))) :effect (n)"
    alone = ":precondition (p) :effect (n)"
    setting = two(DELETES_P, linked)
    assert one_step(setting, "(one r1)", "(two r2)") is None
    assert one_step(setting, "(two r1)", "(one r2)") is None
    assert "deletes (p)" in str(one_step(two(DELETES_P, alone), "(one r1)", "(two r2)"))
    both = ":precondition (exists (?o - robot) (one ?o)) :effect (p)"
    assert "which (two r2) adds" in str(one_step(two(DELETES_P, both), "(one r1)", "(two r2)"))


def test_a_positive_formula_in_an_effect_condition_links_too() -> None:
    linked = ":precondition (p) :effect (when (one r1) (n))"
    setting = two(DELETES_P, linked)
    assert one_step(setting, "(one r1)", "(two r2)") is None
    assert "deletes (p)" in str(
        one_step(setting, "(two r1)", "(one r2)")
    )  # it names r1's action only


def test_a_negative_formula_does_not_link() -> None:
    """Double negation is positive, an implication's premise is negative."""
    positive = ":precondition (and (p) (or (s) (n) (not (not (one r1))))) :effect (n)"
    assert "deletes (p)" in str(
        one_step(two(DELETES_P, positive), "(one r1)", "(two r2)")
    )  # (s) decides it
    positive = positive.replace("(s)", "(z)")
    assert one_step(two(DELETES_P, positive), "(one r1)", "(two r2)") is None
    negative = ":precondition (and (p) (imply (one r1) (p))) :effect (n)"
    assert "deletes (p)" in str(one_step(two(DELETES_P, negative), "(one r1)", "(two r2)"))


# -- effects
# ------------------------------------------------------------------------------------------------------

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


def things(init: str) -> World:
    return world(
        EFFECTS, f"(:objects r1 r2 - robot t - thing b c - box) (:init {init}) (:goal (p))"
    )


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
    assert after(things(init), label, None) == {*result[1:-1].split(") (")}


def test_effects_of_all_robots_happen_together() -> None:
    assert after(rooms(), "(move r1 a b)", "(move r2 b c)") == {"at r1 b", "at r2 c"}
    assert after(rooms(), None, None) == {"at r1 a", "at r2 b"}
    assert "(at r1 b) is false" in str(one_step(rooms(), "(move r1 b a)", None))


# -- joint-action PDDL
# --------------------------------------------------------------------------------------------

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


def test_the_parts_name_the_joint_action() -> None:
    setting = world(JOINT, PLACES)
    assert validate(*setting, [["(move a b)", "(move b c)"]]).valid
    assert validate(*setting, [[None, "(look)"], ["(MOVE a b)", "(move b c)"]]).valid
    # A swap is one joint action: nothing but its own precondition forbids it.
    assert one_step(setting, "(move a b)", "(move b a)") is None


def test_parts_that_no_joint_action_has() -> None:
    setting = world(JOINT, PLACES)
    assert "no joint action" in str(
        one_step(setting, None, None)
    )  # idling is written, or it is not there
    assert "no joint action" in str(one_step(setting, None, "(move b c)"))
    assert "no joint action" in str(one_step(setting, "(look)", "(look)"))
    assert "no joint action" in str(one_step(setting, "(move a a b)", None))


def test_a_joint_action_that_is_not_applicable() -> None:
    setting = world(JOINT, PLACES)
    assert "(both a b b b) is not applicable: (link b b) is false" in str(
        one_step(setting, "(move a b)", "(move b b)")
    )
    # A missing line means idle; the third parameter is found by trying: r2 stands in b.
    assert "not applicable" in str(one_step(setting, "(move a b)", None))
    assert after(world(JOINT, PLACES.replace("(at2 b)", "(at2 c)")), "(move a b)", None) >= {
        "at1 b",
        "at2 c",
    }


AMBIGUOUS = """(:predicates (p) (q))
  (:action x :parameters ()
    ; subaction r1 (do)
    ; subaction r2 idle
    :precondition () :effect (p))
  (:action y :parameters ()
    ; subaction r1 (do)
    :precondition {when} :effect {effect})"""


def test_the_parts_determine_the_result() -> None:
    problem = "(:objects) (:init) (:goal (p))"
    with pytest.raises(BadInput, match="different results"):
        validate(*world(AMBIGUOUS.format(when="()", effect="(q)"), problem), [["(do)", None]])
    # The same result, or only one of them applicable: no harm.
    assert validate(
        *world(AMBIGUOUS.format(when="()", effect="(and (p) (not (q)))"), problem), [["(do)", None]]
    ).valid
    assert validate(
        *world(AMBIGUOUS.format(when="(q)", effect="(q)"), problem), [["(do)", None]]
    ).valid
