# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint steps of packed states are those of the joint model, which knows nothing of packing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planners.joint.model import JointModel
from planners.joint.tables import Rows
from planners.search import packed_steps, state_table
from planners.search.layers import Edges
from planners.search.packed_steps import PackedSteps
from planners.search.state_table import Packing, StateTable
from planners.search.state_variables import StateVariable, state_variables
from tests.support.domains import world_of
from tests.support.random_instances import explored, random_instance

WORLDS = (
    ("grid", "corners-3x3"),
    ("push-box", "around"),
    ("handover", "exchange"),
    ("lock", "let-in"),
)


def assert_same_steps(model: JointModel, rows: Rows, variables: list[StateVariable]) -> bool:
    """Compare both for some states; False if steps cannot be packed."""
    packing = Packing(model.codec, variables)
    packed = PackedSteps.of(model, packing, variables)
    if packed is None:
        return False
    theirs = model.successors(rows)
    ours = packed.successors(rows, packing.packed(rows), lambda _, options: options)
    assert np.array_equal(ours.source, theirs.source)
    assert np.array_equal(ours.labels, theirs.labels)
    assert np.array_equal(ours.cost, theirs.cost)
    assert np.array_equal(packing.rows(ours.result), theirs.result)
    return True


@pytest.mark.parametrize(("folder", "problem"), WORLDS)
def test_steps_of_shipped_worlds(folder: str, problem: str) -> None:
    world = world_of(folder, problem)
    model = world.loaded.model
    variables = state_variables(model, world.loaded.tasks[0].init)
    assert variables
    for some in (variables, variables[1:], []):
        assert assert_same_steps(model, world.space.rows[:2_000], some)


def test_steps_of_random_models() -> None:
    packed = with_variables = 0
    for seed in range(120):
        loaded = random_instance(seed)
        space = None if loaded is None else explored(loaded)
        if loaded is None or space is None:
            continue
        variables = state_variables(loaded.model, loaded.tasks[0].init)
        is_packed = assert_same_steps(loaded.model, space.rows, variables)
        packed += is_packed
        with_variables += is_packed and bool(variables)
    assert packed > 15
    assert with_variables > 5


def test_steps_that_may_clash_are_not_packed(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = world_of("grid", "corners-3x3").loaded
    model, (first, second) = loaded.model, state_variables(loaded.model, loaded.tasks[0].init)
    packing = Packing(model.codec, [first, second])
    # As if where both robots are were one variable, whose value all labels need to be the same.
    facts = tuple(sorted((*first.facts, *second.facts)))
    changes = {n: ((0,), value) for n, (_, value) in {**first.changes, **second.changes}.items()}
    both = StateVariable(facts, changes)
    assert PackedSteps.of(model, packing, [both]) is None
    # As if they set what they need.
    assert PackedSteps.of(model, packing, [replace(both, changes={})]) is not None
    monkeypatch.setattr(packed_steps, "_PAIRS", 10)
    assert PackedSteps.of(model, packing, [replace(both, changes={})]) is None
    assert PackedSteps.of(model, packing, [first, second]) is not None


@pytest.mark.parametrize("most", [0, 127, 128, 32_767, 32_768, 2**31 - 1, 2**31, 2**53])
def test_joint_steps_are_kept_in_few_bytes_and_stay_whole_numbers(most: int) -> None:
    numbers = np.array([0, 1, most])
    edges = Edges(numbers, numbers, numbers[:, None], numbers).compact()
    for kept in (edges.source, edges.target, edges.labels[:, 0], edges.cost):
        assert (kept + np.ones(1, np.int64)).tolist() == [1, 2, most + 1]
        assert (kept + np.ones(1, np.int64)).dtype == np.int64
        assert kept.itemsize == next(size for size in (1, 2, 4, 8) if most < 2 ** (8 * size - 1))


def test_packed_states_are_entered_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_of("grid", "corners-3x3")
    packing = Packing(world.loaded.model.codec, [])
    rows = packing.packed(world.space.rows)
    drawn = np.random.default_rng(0).integers(len(rows), size=1_000)
    monkeypatch.setattr(state_table, "_AT_ONCE", 64)
    table = StateTable(packing)
    numbers, fresh = table.add_packed(rows[drawn])
    assert np.array_equal(table.packed(numbers), rows[drawn])
    assert len(table) == len(set(drawn.tolist())) == fresh.sum() == len(set(numbers.tolist()))
    again, fresh = table.add_packed(rows[drawn])
    assert np.array_equal(again, numbers)
    assert not fresh.any()
    assert [len(part) for part in table.add_packed(rows[:0])] == [0, 0]
