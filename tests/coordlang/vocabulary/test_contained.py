# SPDX-License-Identifier: GPL-3.0-or-later
"""Bounds from contained instances: what is said of a part is checked by definition in the whole."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, combinations, islice, permutations, product
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, all_pairs
from coordlang.language.warping import pair
from coordlang.symmetry.group import Symmetry, symmetries_of_part, symmetry_group
from coordlang.verification.certificate_file import Certificate, Reason
from coordlang.verification.check_certificate import Checked, check
from coordlang.verification.make_certificate import _reason
from coordlang.vocabulary.contained import ContainedInstance, part_of, parts, tasks_of_one_orbit
from coordlang.vocabulary.languages import ends
from coordlang.vocabulary.loop import Budget
from planners.joint.tables import Bools
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plan
from planners.system.errors import Refuted
from tests.support import naive, thorough
from tests.support.candidates import small_candidates
from tests.support.domains import all_tasks
from tests.support.symmetric_worlds import GRID, rename, world
from tests.support.texts import parsed

MOST = 25


def on_graph(cells: int, edges: list[tuple[int, int]]) -> Candidates:
    """All tasks of two robots on a graph of cells."""
    return all_pairs(GRID, [world(cells, edges, 2)])


def without(candidates: Candidates, *names: str) -> Bools:
    """The states in which nothing true names one of these objects."""
    keys = [candidates.model.codec.key(row) for row in candidates.rows]
    return np.array([not set(names) & set(re.findall(r"[^ ()]+", key)) for key in keys])


def plans_by_task(space: PlanSpace, most: int = MOST) -> Iterator[tuple[int, int, int, list[Plan]]]:
    """Each task: its number, the states at its two ends, and its plans."""
    end = ends(space)
    for task, node in enumerate(space.starts.tolist()):
        plans = naive.listed(space, task, most)
        yield task, int(space.state[node]), int(end[space.goal[node]]), plans


@pytest.mark.parametrize("number", [14, *thorough(120)])
def test_mixtures_of_plans_in_a_part_fail_in_the_part_iff_in_the_whole(number: int) -> None:
    """Any set of states: its plans are those that stay in it, or it is said to be no part."""
    good = bad = failing = 0
    models = [
        small_candidates(robots, states=40, plans=MOST, tasks=400, separable=False)
        for robots in (2, 3)
    ]
    for seed, candidates in chain(*(islice(own, number) for own in models)):
        space, random = candidates.spaces[0], Random(seed)
        if candidates.kind != "all" or len(candidates.rows) < 3:
            continue
        tasks = list(plans_by_task(space))
        for share in (0.6, 0.8, 0.9, 0.9):
            inside = np.array([random.random() < share for _ in candidates.rows])
            part = part_of(space, inside, ends(space))
            escapes = wrong = 0
            staying = {}
            for task, start, end, plans in tasks:
                own = [p for p in plans if inside[list(naive.states(space, task, p))].all()]
                if own:
                    staying[start, end] = sorted(own)
                    made = {naive.mixture(some) for some in product(own, repeat=space.robots)}
                    escapes += len(made & set(plans) - set(own))
                    wrong += len(made - set(plans))
            if part is None:
                bad += escapes > 0
                continue
            found = {(start, end): sorted(plans) for _, start, end, plans in plans_by_task(part)}
            assert found == staying
            assert not escapes
            good += 1
            failing += wrong
    assert good > 10
    assert bad > 0
    assert failing > 20


def edges_of(space: PlanSpace, renaming: dict[str, str]) -> set[object]:
    """The edges as texts, under a renaming of objects."""
    codec, robots, end = space.model.codec, space.model.robots, ends(space)
    order = sorted(range(len(robots)), key=lambda n: renaming.get(robots[n], robots[n]))
    keys = [frozenset(rename(a, renaming) for a in codec.decode(row)) for row in space.rows]
    found: set[object] = set()
    for edge, source in enumerate(space.sources.tolist()):
        texts = space.model.texts(space.labels_of(edge))
        labels = tuple([texts[n] and rename(str(texts[n]), renaming) for n in order])
        target = space.state[space.target[edge]]
        goal = end[space.goal[source]]
        found.add((keys[space.state[source]], labels, keys[target], keys[goal]))
    return found


def states_under(space: PlanSpace, renaming: dict[str, str]) -> list[int]:
    """Where a renaming takes the states of a table, by their texts; all of them must go somewhere."""
    codec = space.model.codec
    number = {frozenset(codec.decode(row)): n for n, row in enumerate(space.rows)}
    return [number[frozenset(rename(a, renaming) for a in atoms)] for atoms in number]


@pytest.mark.parametrize("seeds", [5, *thorough(16)])
def test_symmetries_of_a_part_are_the_renamings_that_keep_its_edges(seeds: int) -> None:
    """All renamings of the objects of random maps, on what is left without one of their cells."""
    more = fewer = 0
    for seed in range(seeds):
        random = Random(seed)
        cells = random.choice([4, 5])
        edges = [e for e in combinations(range(cells), 2) if random.random() < 0.7]
        candidates = on_graph(cells, edges)
        space, last = candidates.spaces[0], f"c{cells - 1}"
        if len(candidates.rows) < cells * (cells - 1):
            continue
        part = part_of(space, without(candidates, last), ends(space))
        assert part is not None, "who enters the last cell leaves the part"
        if not len(part.target):
            continue
        names = [f"c{n}" for n in range(cells - 1)]
        proposed = [
            dict(zip([*names, "r1", "r2", last], [*to, *robots, last], strict=True))
            for to in permutations(names)
            for robots in permutations(["r1", "r2"])
        ]
        here, found = np.unique(part.state).tolist(), set[tuple[int, ...]]()
        for own in (space, part):
            plain, found = edges_of(own, {}), set()
            for renaming in proposed[1:]:
                accepted = symmetries_of_part(own, ends(space), [renaming]).symmetries
                assert bool(accepted) == (edges_of(own, renaming) == plain)
                if accepted:
                    to = states_under(space, renaming)
                    first = next(s for s in accepted if s.renaming == renaming)
                    assert [first.states[s] for s in here] == [to[s] for s in here]
                    found.add(tuple(first.states.tolist()))
        group = symmetries_of_part(part, ends(space), proposed)
        assert {tuple(s.states.tolist()) for s in group.symmetries} == found
        more += len(found) > len(symmetry_group(candidates).symmetries)
        fewer += len(found) < len(proposed) - 1
    assert min(more, fewer) > 0


def test_two_labels_must_not_become_one() -> None:
    """A robot turns its switch slowly or fast: both are plans, and not one plan."""
    domain, problem = parsed(
        """(define (domain switches) (:types robot way) (:predicates (on ?r - robot))
          (:action turn :agent ?r - robot :parameters (?w - way)
           :precondition (and (not (on ?r))) :effect (and (on ?r))))""",
        """(define (problem p) (:domain switches) (:objects r1 r2 - robot slow fast - way)
          (:init) (:goal (and (on r1) (on r2))))""",
    )
    space = all_pairs(domain, [problem]).spaces[0]
    for ways, holds in (
        ({}, True),
        ({"slow": "fast", "fast": "slow"}, True),
        ({"slow": "fast"}, False),
        ({"slow": "slower"}, False),
    ):
        renaming = {"r1": "r2", "r2": "r1", **ways}
        assert bool(symmetries_of_part(space, ends(space), [renaming]).symmetries) == holds


def proves(candidates: Candidates, instance: ContainedInstance, refuted: int) -> Checked:
    """What all clauses of a part show of the whole."""
    reasons = [_reason(*known) for known in instance.languages.evidence.items()]
    return check(certificate(candidates, refuted, reasons), candidates)


def certificate(candidates: Candidates, refuted: int, reasons: list[Reason]) -> Certificate:
    model = candidates.model
    return Certificate(candidates.loaded.domain.name, list(model.robots), refuted, reasons)


def test_a_bound_of_a_part_holds_with_every_clause_checked_in_the_whole() -> None:
    """The square in the 2x3 grid needs three words; all that is said about it holds in the grid."""
    candidates = all_tasks("grid", "gw2-2x3")
    row, square = parts(candidates, symmetry_group(candidates))
    assert row.refute(1, Budget()) is None
    refuted = square.refute(2, Budget())
    assert refuted is not None
    whole = symmetry_group(candidates).symmetries
    own = [e.symmetry for e in refuted.values() if e.symmetry is not None]
    assert any(all((s.states != w.states).any() for w in whole) for s in own)
    answer = proves(candidates, square, 2)
    assert (answer.lower_bound, answer.reasons) == (3, len(refuted))
    assert square.refute(3, Budget()) is None
    for instance in (row, square):
        instance.close()


def test_a_forged_symmetry_of_a_part_is_refused() -> None:
    """The clause of what would be the image: its plans are no optimal plans of the whole."""
    candidates = all_tasks("grid", "gw2-2x3")
    instance = parts(candidates, symmetry_group(candidates))[-1]
    instance.refute(2, Budget())
    instance.close()
    moved = {
        name for s in instance.group.symmetries for name, to in s.renaming.items() if name != to
    }
    one, other, *others = sorted(moved - set(candidates.model.robots))
    # Two neighbours change names, and all others stay: no symmetry of any part with them.
    forged = {
        one: other,
        other: one,
        **{name: name for name in (*others, *candidates.model.robots)},
    }
    to = np.array(states_under(candidates.spaces[0], forged))
    refused = 0
    for clause, evidence in list(instance.languages.evidence.items())[:20]:
        if evidence.symmetry is None:
            image = frozenset(pair(int(to[a]), int(to[b])) for a, b in clause)
            reason = _reason(image, replace(evidence, symmetry=Symmetry(forged, to)))
            with pytest.raises(Refuted, match="reason 1 of the certificate is wrong"):
                check(certificate(candidates, 1, [reason]), candidates)
            refused += 1
    assert refused > 0


def ring(cells: int) -> list[tuple[int, int]]:
    return [(n, (n + 1) % cells) for n in range(cells)]


@pytest.mark.thorough
def test_tasks_of_one_orbit_are_those_whose_plans_pass_through_images_of_one_state() -> None:
    """Random maps and rings, each plan listed; orbits by the texts of states."""
    random, found_any, left_out = Random(0), 0, 0
    for number in range(15):
        cells = random.choice([4, 5, 6])
        edges = [e for e in combinations(range(cells), 2) if random.random() < 0.6]
        candidates = on_graph(cells, ring(cells) if number % 3 == 0 else edges)
        group = symmetry_group(candidates)
        orbit = list(range(len(candidates.rows)))
        for symmetry in group.symmetries:
            to = states_under(candidates.spaces[0], dict(symmetry.renaming))
            for state, image in enumerate(to):
                orbit[state] = min(orbit[state], image)
        expected: dict[int, set[tuple[int, int]]] = {}
        several = set()
        for space in candidates.spaces:
            for task, start, end, plans in plans_by_task(space, most=5_000):
                passed = {orbit[s] for p in plans for s in naive.states(space, task, p)}
                if len(passed) == 1 and space.cost_of(task)[0] > 1:
                    expected.setdefault(orbit[start], set()).add((start, end))
                    several |= passed if len(plans) > 1 else set()
                left_out += len(passed) > 1
        expected = {orbit: tasks for orbit, tasks in expected.items() if orbit in several}
        found = {}
        for part in tasks_of_one_orbit(candidates, group):
            tasks = {(start, end) for _, start, end, _ in plans_by_task(part.space, most=5_000)}
            found[orbit[min(tasks)[0]]] = tasks
        assert found == (expected if group.symmetries else {})
        found_any += len(found)
    assert found_any > 10
    assert left_out > 100


@pytest.mark.parametrize("cells", [4, 6])
def test_two_words_are_too_few_on_a_ring_and_states_of_one_distance_show_it(cells: int) -> None:
    """As a proof by hand says of every ring. Each clause is checked in the whole."""
    candidates = on_graph(cells, ring(cells))
    instance = tasks_of_one_orbit(candidates, symmetry_group(candidates))[0]
    refuted = instance.refute(2, Budget())
    instance.close()
    assert refuted is not None
    assert {s for clause in refuted for states in clause for s in states} <= set(instance.states)
    assert len(instance.states) <= 2 * cells
    assert proves(candidates, instance, 2).lower_bound == 3
    built = build_language(candidates, "minimal")
    assert built.language.guarantee.lower_bound == 3
    assert check(built.certificate(), candidates).lower_bound == 3
