# SPDX-License-Identifier: GPL-3.0-or-later
"""Both plain forms of a joint model have the optimal cost of the joint model."""

from __future__ import annotations

import heapq
from dataclasses import replace

import pytest
from hypothesis import event, given, reject, settings
from hypothesis import strategies as st

from planners import classical as plain_module
from planners.classical import ClassicalTask, compile_classical, to_pddl
from planners.joint.model import JointModel, PlanningTask
from planners.pddl.model_options import Cost, ModelOptions
from planners.search.optimal_plans import search
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible
from tests.support.classical_models import (
    CORRIDOR,
    CORRIDOR_TASK,
    COSTS,
    FORMS,
    JOINT,
    JOINT_TASK,
    MODELS,
    PARTNERS,
    PARTNERS_TASK,
    TOOL,
    TOOL_TASK,
    WAYS,
    random_state,
    read,
    written,
)
from tests.support.naive_classical import holds, successors
from tests.support.random_pddl import KINDS, Kind, random_model
from tests.support.texts import model_of, parsed


def ours(model: JointModel, task: PlanningTask) -> tuple[int, int] | None:
    try:
        return search(model, task).cost_of(0)
    except ProvedImpossible:
        return None


def solved(plain: ClassicalTask) -> tuple[int, int] | None:
    """The optimal cost of a plain task by Dijkstra's algorithm."""
    total = dijkstra(plain)
    if total is None:
        return None
    cost = plain.cost(total)
    assert cost is not None
    return cost


def dijkstra(plain: ClassicalTask) -> int | None:
    return min(
        (cost for state, cost in reached(plain).items() if holds(plain.goal, state)), default=None
    )


def reached(plain: ClassicalTask) -> dict[frozenset[int], int]:
    """The least total cost of every plain state."""
    best = {plain.init: 0}
    steps = successors(plain)
    queue: list[tuple[int, int, frozenset[int]]] = [(0, 0, plain.init)]
    while queue:
        cost, _, state = heapq.heappop(queue)
        if cost > best[state]:
            continue
        for _, step, after in steps(state):
            if cost + step < best.get(after, 10**9):
                best[after] = cost + step
                heapq.heappush(queue, (best[after], len(best), after))
    return best


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("cost", COSTS)
@pytest.mark.parametrize("name", MODELS)
def test_both_forms_have_the_optimal_cost_of_the_joint_model(
    name: str, cost: Cost, form: str
) -> None:
    loaded = read(*MODELS[name], cost)
    expected = ours(loaded.model, loaded.tasks[0])
    assert expected is not None
    plain = compile_classical(loaded.model, loaded.tasks[0], FORMS[form])
    assert plain.form == form
    assert solved(plain) == expected


def test_the_models_are_not_trivial() -> None:
    read_all = {name: read(*texts, "makespan+actions") for name, texts in MODELS.items()}
    assert {name: ours(loaded.model, loaded.tasks[0]) for name, loaded in read_all.items()} == {
        "tool": (3, 3),
        "solo": (2, 2),
        "corridor": (6, 6),
        "partners": (6, 11),
        "relay": (2, 3),
        "blink": (1, 2),
        "lift": (2, 2),
        "joint-action": (3, 3),
        "basin": (1, 3),
    }


@pytest.mark.parametrize("form", FORMS)
def test_a_goal_that_is_a_full_state(form: str) -> None:
    loaded = read(CORRIDOR, CORRIDOR_TASK)
    model, task = loaded.model, loaded.tasks[0]
    space = search(model, task)
    last = space.rows[space.state[0]]
    full = replace(task, goal=model.full_state(last))
    assert solved(compile_classical(model, full, FORMS[form])) == ours(model, full)
    back = replace(task, init=last, goal=model.full_state(task.init))
    assert solved(compile_classical(model, back, FORMS[form])) == ours(model, back)


@pytest.mark.parametrize("form", FORMS)
def test_a_goal_that_holds_at_the_start_costs_nothing(form: str) -> None:
    loaded = read(
        CORRIDOR, CORRIDOR_TASK.replace("(and (at r1 c) (at r2 a))", "(or (at r1 a) (at r1 b))")
    )
    assert solved(compile_classical(loaded.model, loaded.tasks[0], FORMS[form])) == (0, 0)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "goal",
    ["(and (at r1 c) (at r2 c))", "(and (at r1 a) (or (next a d) (at r1 b)) (not (at r1 a)))"],
)
def test_an_unsolvable_task_stays_unsolvable(goal: str, form: str) -> None:
    loaded = read(CORRIDOR, CORRIDOR_TASK.replace("(and (at r1 c) (at r2 a))", goal))
    assert ours(loaded.model, loaded.tasks[0]) is None
    assert solved(compile_classical(loaded.model, loaded.tasks[0], FORMS[form])) is None


@pytest.mark.parametrize("form", FORMS)
def test_remembered_actions_change_no_cost(form: str) -> None:
    loaded = model_of(CORRIDOR, CORRIDOR_TASK, ModelOptions(remember_actions=True))
    assert solved(compile_classical(loaded.model, loaded.tasks[0], FORMS[form])) == (6, 0)


@pytest.mark.parametrize("form", FORMS)
def test_without_its_conflicts_a_model_is_cheaper(
    form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = read(TOOL, TOOL_TASK)
    monkeypatch.setattr(
        plain_module.selectors, "clashes", lambda actions: (frozenset(),) * len(actions)
    )
    assert solved(compile_classical(loaded.model, loaded.tasks[0], FORMS[form])) == (1, 0)


def test_few_joint_actions_are_written_explicitly_and_many_are_not() -> None:
    loaded = read(TOOL, TOOL_TASK)
    plain = compile_classical(loaded.model, loaded.tasks[0], 5)
    assert sorted(action.name for action in plain.actions) == [
        "(release r1) idle",
        "(work r1) idle",
        "idle (release r2)",
        "idle (work r2)",
        "idle idle",
    ]
    assert compile_classical(loaded.model, loaded.tasks[0], 4).form == "select-then-apply"


def test_actions_without_effects_survive() -> None:
    loaded = read(PARTNERS, PARTNERS_TASK)
    names = {action.name for action in compile_classical(loaded.model, loaded.tasks[0], 0).actions}
    assert {"choose r1 (press r1)", "choose r2 (press r2)"} <= names


def test_joint_actions_with_one_label_tuple_and_one_meaning_are_written_once() -> None:
    twice = JOINT.replace("(:action first", "(:action again", 1)
    again = twice[twice.index("(:action again") :]
    loaded = read(JOINT.rstrip().removesuffix(")") + again, JOINT_TASK)
    once = read(JOINT, JOINT_TASK)
    assert len(loaded.model.actions) > len(once.model.actions)
    assert len(compile_classical(loaded.model, loaded.tasks[0]).actions) == len(
        compile_classical(once.model, once.tasks[0]).actions
    )


def test_a_second_cost_that_outgrows_the_step_cost_is_noticed() -> None:
    loaded = read(CORRIDOR, CORRIDOR_TASK, "makespan+actions")
    plain = compile_classical(loaded.model, loaded.tasks[0], 0, longest=2)
    total = dijkstra(plain)
    assert total is not None
    assert plain.cost(total) is None
    enough = compile_classical(loaded.model, loaded.tasks[0], 0, longest=total // plain.step_cost)
    assert solved(enough) == (6, 6)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", MODELS)
def test_the_pddl_says_the_same(name: str, form: str) -> None:
    loaded = read(*MODELS[name])
    plain = compile_classical(loaded.model, loaded.tasks[0], FORMS[form])
    domain_text, problem_text = to_pddl(plain)
    domain, problem = parsed(domain_text, problem_text)
    assert len(domain.predicates) == len(plain.facts)
    assert len(domain.schemas) == len(plain.actions)
    assert len(problem.init) == len(plain.init)
    for action, schema in zip(plain.actions, domain.schemas, strict=True):
        assert (len(action.adds) + len(action.deletes), action.cost) == (
            len(schema.effects),
            schema.cost,
        )
    for user_name in (*plain.facts, *(action.name for action in plain.actions)):
        assert f"; {user_name}\n" in domain_text


def test_equal_names_after_cleaning_stay_apart() -> None:
    names = plain_module.task._safe_names(
        ["(at r_1 a)", "(at r 1_a)", "(at r 1 a)", "and", "9", "(#)"]
    )
    assert len(set(names)) == len(names)
    assert all(name[0].isalpha() for name in names)


def distances(model: JointModel, task: PlanningTask) -> dict[frozenset[str], tuple[int, int]]:
    """The cost of reaching each joint state from the initial one, by the state's true facts."""
    space = explore(model, task.init[None, :])
    keys = [frozenset(model.codec.decode(row)) for row in space.rows]
    costs = {int(space.numbers(task.init[None, :])[0]): (0, 0)}
    layer = [*costs]
    while layer:
        fresh: dict[int, tuple[int, int]] = {}
        for state in layer:
            makespan, second = costs[state]
            for edge in range(space.first[state], space.first[state + 1]):
                target = int(space.target[edge])
                cost = (makespan + 1, second + int(space.cost[edge]))
                if target not in costs:
                    fresh[target] = min(cost, fresh.get(target, cost))
        costs |= fresh
        layer = [*fresh]
    return {keys[state]: cost for state, cost in costs.items()}


def plain_distances(
    plain: ClassicalTask, facts: int
) -> dict[frozenset[str], tuple[int, int] | None]:
    """The same of a plain task; between two steps what is new in it is as at the beginning."""
    own = set(range(facts, len(plain.facts)))
    found = {}
    for state, total in reached(plain).items():
        if (plain.between is None or plain.between in state) and state & own == plain.init & own:
            found[frozenset(plain.facts[fact] for fact in state - own)] = plain.cost(total)
    return found


@pytest.mark.thorough
@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 100_000), kind=st.sampled_from(KINDS), cost=st.sampled_from(COSTS))
def test_every_state_of_random_models_costs_the_same(seed: int, kind: Kind, cost: Cost) -> None:
    text = random_model(seed, kind)
    try:
        loaded = read(text.domain, text.problem, cost, text.unowned)
        task = replace(loaded.tasks[0], init=random_state(loaded, seed))
        expected = distances(loaded.model, task)
    except BadInput:  # one label tuple, two results
        reject()
    event(f"{kind}: farthest state {max(expected.values())[0]}")
    for form, way in (("explicit", "usual"), *(("select-then-apply", way) for way in WAYS)):
        with written(way):
            plain = compile_classical(loaded.model, task, FORMS[form])
        assert plain.form == form
        assert plain_distances(plain, len(loaded.model.codec.facts)) == expected, way
