# SPDX-License-Identifier: GPL-3.0-or-later
"""Concurrency networks: each constraint by hand, random networks against the naive twin."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.loading import PlanningInstance, build
from planners.pddl import parse_domain
from planners.pddl.factored import read_factored
from planners.pddl.lifted import Domain
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput
from tests.support.joint_twin import check_model
from tests.support.naive_joint_steps import Twin
from tests.support.random_pddl import RandomModel, random_model
from tests.support.texts import model_of

ROWING = """(define (domain rowing) (:types robot boat place)
  (:predicates (on ?r - robot ?b - boat) (moored ?b - boat ?p - place) (lit))
  (:action row :agent ?r - robot :parameters (?b - boat ?to - place)
    :precondition (on ?r ?b) :effect (moored ?b ?to))
  (:action light :agent ?r - robot :parameters (?b - boat) :precondition (on ?r ?b) :effect ())
  NETWORK)"""
CREW = """(define (problem crew) (:domain rowing)
  (:objects r1 r2 r3 - robot b - boat shore - place)
  (:init (on r1 b) (on r2 b) (on r3 b)) (:goal (moored b shore)))"""


def rowing(network: str) -> PlanningInstance:
    return model_of(ROWING.replace("NETWORK", network), CREW)


def crews(network: str) -> set[tuple[str, ...]]:
    """Who does what in the joint steps of the first state: 'row', 'light' or '-'."""
    loaded = rowing(network)
    model = loaded.model
    steps = model.successors(loaded.tasks[0].init[None, :])
    return {
        tuple(text[1:].split(" ")[0] if text else "-" for text in model.texts(row))
        for row in steps.labels
    }


def rowers(network: str) -> set[int]:
    return {crew.count("row") for crew in crews(network)}


def constraint(name: str, bounds: str, action: str) -> str:
    return f"(:concurrency-constraint {name} :parameters (?b - boat) :bounds {bounds} :actions (({action} 1)))"


@pytest.mark.parametrize(
    ("bounds", "numbers"),
    [
        ("(1 1)", {0, 1}),
        ("(2 2)", {0, 2}),
        ("(2 inf)", {0, 2, 3}),
        ("(1 2)", {0, 1, 2}),
        ("(3 3)", {0, 3}),
        ("(4 4)", {0}),
        (f"(2 {10**20})", {0, 2, 3}),
        (f"(2 {'9' * 5000})", {0, 2, 3}),
        (f"({10**20} {10**30})", {0}),
        ("(02 003)", {0, 2, 3}),
    ],
)
def test_bounds(bounds: str, numbers: set[int]) -> None:
    assert rowers(constraint("v", bounds, "row")) == numbers
    assert rowers("") == {0, 1, 2, 3}


@pytest.mark.parametrize(
    ("parameter", "boat"),
    [
        *((f"?b{kind}", "boat") for kind in ("", " - object", " - vessel", " - tub")),
        ("?b - (either boat place)", "boat"),
        ("?b - place", "(either boat place)"),
    ],
)
def test_types_that_some_object_may_share(parameter: str, boat: str) -> None:
    network = constraint("v", "(2 2)", "row").replace("?b - boat", parameter)
    types = "robot place tub - boat boat - vessel"
    domain = ROWING.replace("robot boat place", types).replace("NETWORK", network)
    assert model_of(domain, CREW.replace("b - boat", f"b - {boat}"))


def test_dependence_is_needed_by_the_second_only() -> None:
    network = (
        constraint("v", "(1 1)", "light")
        + constraint("w", "(2 2)", "row")
        + "(:positive-dependence v w)"
    )
    found = crews(network)
    assert {crew for crew in found if "row" in crew} == {
        ("row", "row", "light"),
        ("row", "light", "row"),
        ("light", "row", "row"),
    }
    assert ("light", "-", "-") in found  # a light alone is allowed
    assert ("light", "light", "-") not in found


@pytest.mark.parametrize(
    ("network", "message"),
    [
        (constraint("v", "(1 1)", "swim"), "unknown action 'swim'"),
        (constraint("v", "(2 1)", "row"), "no robots can meet the bounds (2 1)"),
        (constraint("v", "(1)", "row"), "expected '(LOW HIGH)'"),
        (constraint("v", "(x 1)", "row"), "expected a number from 0, found 'x'"),
        (constraint("v", "(1 ²)", "row"), "expected a number from 0, found '²'"),
        (
            constraint("v", "(1 1)", "row").replace("(row 1)", "(row 0)"),
            "argument 0 of row is ?r - robot, which is never ?b - boat: the constraint 'v' would never match",
        ),
        (
            constraint("v", "(1 1)", "row").replace("boat", "place"),
            "argument 1 of row is ?b - boat, which is never ?b - place",
        ),
        (
            constraint("v", "(1 1)", "row").replace("(row 1)", "(row 9)"),
            "expected 1 argument positions below 3",
        ),
        ("(:concurrency-constraint v :bounds (1 1))", "missing: :actions, :parameters"),
        ("(:positive-dependence v w)", "unknown constraint 'v'"),
        (
            constraint("v", "(1 1)", "row") + constraint("v", "(1 1)", "light"),
            "constraint 'v' is declared twice",
        ),
    ],
)
def test_a_wrong_network(network: str, message: str) -> None:
    with pytest.raises(BadInput, match=r"domain.pddl:6:\d+") as error:
        rowing(network)
    assert message in str(error.value)


def write_rowers(folder: Path, *bounds: str) -> Path:
    """Factored files of r1, r2, ..: each robot has an action and a view of the constraint."""
    for number, own in enumerate(bounds, 1):
        action = f"(:action row{number} :parameters (?r - t{number} ?b - boat) :effect (moved ?b))"
        domain = (
            f"(define (domain d) (:types t{number} boat) (:predicates (moved ?b - boat)) {action}"
        )
        (folder / f"domain-r{number}.pddl").write_text(
            f"{domain}\n{constraint('crew', own, f'row{number}')})"
        )
        (folder / f"problem-r{number}.pddl").write_text(
            f"(define (problem p) (:domain d) (:objects r{number} - t{number} b - boat)"
            "(:init) (:goal (moved b)))"
        )
    return folder


def test_a_constraint_of_several_factored_files(tmp_path: Path) -> None:
    domain, problem = read_factored(write_rowers(tmp_path, "(2 2)", "(2 2)", "(2 2)"))
    loaded = build(domain, [problem])
    steps = loaded.model.successors(loaded.tasks[0].init[None, :])
    found = {loaded.model.texts(row) for row in steps.labels}
    assert len(found) == 4  # nobody, or two of three
    twin = Twin(domain, problem, loaded.team)
    assert found == {labels for labels, _ in twin.successors(twin.init)}
    write_rowers(tmp_path, "(2 2)", "(2 inf)")
    with pytest.raises(BadInput, match=r"domain-r2\.pddl:2:2: the constraint 'crew' differs"):
        read_factored(tmp_path)


def random_network(random: Random, domain: Domain) -> str:
    """Up to three constraints over arguments of a random type; maybe two of them depend."""
    kinds = sorted({p.types for s in domain.schemas for p in s.parameters})
    kind = random.choice(kinds)
    places = [
        (s.name, n) for s in domain.schemas for n, p in enumerate(s.parameters) if p.types == kind
    ]
    typed = kind[0] if len(kind) == 1 else f"(either {' '.join(kind)})"
    lines = []
    for number in range(random.randint(1, 3)):
        chosen = random.sample(places, random.randint(1, min(2, len(places))))
        bounds = random.choice(["(1 1)", "(2 inf)", "(2 2)", "(1 2)", "(1 inf)"])
        actions = " ".join(f"({name} {position})" for name, position in chosen)
        lines.append(
            f"(:concurrency-constraint v{number} :parameters (?x - {typed}) :bounds {bounds} :actions ({actions}))"
        )
    if len(lines) > 1 and random.random() < 0.7:
        lines.append("(:positive-dependence v0 v1)")
    return "\n".join(lines)


@pytest.mark.thorough
def test_random_networks() -> None:
    seen: dict[str, int] = {}

    @settings(max_examples=80, deadline=None, derandomize=True)
    @given(st.integers(0, 10**9))
    def compare(seed: int) -> None:
        text = random_model(seed, "agent")
        domain = parse_domain(Source("domain", text.domain))
        network = random_network(Random(seed), domain)
        with_network = text.domain.rstrip().removesuffix(")") + network + ")"

        def note(what: str) -> None:
            seen[what] = seen.get(what, 0) + 1

        check_model(RandomModel(with_network, text.problem, text.unowned), note)

    compare()
    assert seen.get("several states", 0) >= 30, seen


@pytest.mark.parametrize(
    ("effect", "more", "message"),
    [
        (
            *("(p)", "(:concurrency-constraint v :parameters () :bounds (2 2) :actions ((x)))"),
            "a concurrency network in a joint-action domain",
        ),
        ("(when (not (y)) (p))", "", "d:2:7: action 'y' is used as a formula in a joint-action"),
    ],
)
def test_what_joint_actions_do_not_have(effect: str, more: str, message: str) -> None:
    text = f"""(define (domain d) (:predicates (p))
      (:action x :parameters () ; subaction r1 (do)
        :effect {effect})
      (:action y :parameters () ; subaction r1 (do-not)
        :effect (p)) {more})"""
    with pytest.raises(BadInput, match=message):
        parse_domain(Source("d", text))
