# SPDX-License-Identifier: GPL-3.0-or-later
"""Words as formulas, and languages whose formulas are short, against all formulas tried."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations, product
from random import Random

import numpy as np
import pytest

from coordlang.commands.building import build_language
from coordlang.explanation.minimise import Points, expand, minimise
from coordlang.explanation.simple import _Search, simple
from coordlang.explanation.text import literal_text, pddl_condition, shown
from coordlang.explanation.variables import Variable, truth, valuation
from coordlang.explanation.words import Cover, Literal, all_covers, describe_words, mapped_states
from coordlang.language.candidates import Candidates
from coordlang.language.words import Language
from coordlang.vocabulary.job import Assignment, Outcome
from coordlang.vocabulary.loop import Budget
from planners.joint.model import show
from planners.pddl.lifted import Atom
from planners.pddl.model_options import ModelOptions
from planners.search.reachable import explore
from planners.system.errors import OutOfTime
from tests.support import thorough
from tests.support.candidates import (
    failing,
    is_language,
    partitions,
    random_candidates,
    small_worlds,
)
from tests.support.domains import all_tasks, own_task
from tests.support.task_languages import built_for, language_of, random_language
from tests.support.texts import model_of


def holds(formula: Cover, atoms: set[str]) -> bool:
    return any(
        all((show(atom) in atoms) == value for atom, value in conjunction.items())
        for conjunction in formula.conjunctions()
    )


def check_exact(language: Language, candidates: Candidates, formulas: dict[str, Cover]) -> None:
    model = candidates.model
    for key, word in language.states.items():
        atoms = set(model.codec.decode(model.codec.parse_key(key)))
        assert [w for w, formula in formulas.items() if holds(formula, atoms)] == [word]
    for word, formula in formulas.items():
        assert formula.states == sum(w == word for w in language.states.values())
        for term, count in zip(formula.terms, formula.counts, strict=True):
            alone = Cover((term,), (count,), 0, False)
            mine = [k for k, w in language.states.items() if w == word]
            atoms_of = ({*model.codec.decode(model.codec.parse_key(k))} for k in mine)
            assert count == sum(holds(alone, own) for own in atoms_of) > 0


@pytest.mark.parametrize("robots", [2, *thorough(3)])
def test_exactly_one_formula_is_true_in_every_mapped_state(robots: int) -> None:
    seen: Counter[str] = Counter()
    for seed, candidates in random_candidates(range(24), robots, 600):
        language = random_language(Random(seed), candidates)
        mapped = mapped_states(language.partition(candidates.model), candidates.model)
        formulas = all_covers(mapped)
        check_exact(language, candidates, formulas)
        told = describe_words(mapped, formulas)
        for key, word in language.states.items():
            atoms = {*candidates.model.codec.decode(candidates.model.codec.parse_key(key))}
            true = [w for w, f in told.rules if f is None or holds(f, atoms)]
            assert word in true
            listed = true[:1] if told.in_order else [w for w in true if dict(told.rules)[w]]
            assert listed in ([word], [])
        seen["in order"] += told.in_order
        seen["every other state"] += any(formula is None for _, formula in told.rules)
        seen["each"] += all(formula is not None for _, formula in told.rules)
        seen["several terms"] += any(len(f.terms) > 1 for f in formulas.values())
        seen["a word without states"] += any(not f.states for f in formulas.values())
        seen["several values"] += any(len(v.values) > 2 for v in mapped.variables)
    cases = "every other state", "each", "several terms", "several values", "a word without states"
    assert all(seen[case] for case in cases), seen


def test_where_a_robot_is() -> None:
    """The three words of the running example say where one of the robots is."""
    candidates, language = all_tasks("three-cells"), built_for("three-cells").language
    formulas = all_covers(mapped_states(language.partition(candidates.model), candidates.model))
    said = {shown(f) for f in formulas.values()}
    assert said in [{f"at({robot}) = {cell}" for cell in "abc"} for robot in ("r1", "r2")]
    assert all(f.fewest and f.length == 1 and len(f.conjunctions()) == 1 for f in formulas.values())


def test_text_and_pddl() -> None:
    """One robot's place out of three, and the rest: as text, and as PDDL, with negations."""
    candidates = all_tasks("three-cells")
    keys = [candidates.model.codec.key(row) for row in candidates.rows]
    language = language_of(
        {key: "w1" if "(at r1 a)" in key else "w0" for key in keys}, ("w0", "w1")
    )
    formulas = all_covers(mapped_states(language.partition(candidates.model), candidates.model))
    assert shown(formulas["w1"]) == "at(r1) = a"
    assert pddl_condition(formulas["w1"]) == "(at r1 a)"
    assert shown(formulas["w0"]) == "at(r1) != a"
    assert pddl_condition(formulas["w0"]) == "(not (at r1 a))"
    single = language_of(dict.fromkeys(keys, "w0"), ("w0", "w1")).partition(candidates.model)
    one = all_covers(mapped_states(single, candidates.model))
    assert [shown(one["w0"]), shown(one["w1"])] == ["true", "false"]
    assert [pddl_condition(one["w0"]), pddl_condition(one["w1"])] == ["(and)", "(or)"]


def test_conditions_of_sets_of_values() -> None:
    """Exclusions where "none of them" is a value; and text that says which are excluded."""
    atoms = tuple(Atom("at", ("b", place)) for place in "xyz")
    places = tuple(("at(b)", place) for place in "xyz")
    carried = Variable("at(b)", (*atoms, None), (*places, ("at(b)", "none")))
    somewhere = Literal(carried, atoms[:2])
    assert somewhere.conjunctions() == [{atoms[0]: True}, {atoms[1]: True}]
    assert literal_text(somewhere) == "at(b) in {x, y}"
    assert Literal(carried, (atoms[0], None)).conjunctions() == [{atoms[1]: False, atoms[2]: False}]
    assert literal_text(Literal(carried, atoms)) == "at(b) != none"
    lying = Variable("at(b)", atoms, places)
    assert Literal(lying, atoms[:2]).conjunctions() == [{atoms[2]: False}]
    both = Variable(
        "free/holds(r)",
        (Atom("free", ("r",)), Atom("holds", ("r", "b")), Atom("holds", ("r", "c"))),
        (("free(r)", ""), ("holds(r)", "b"), ("holds(r)", "c")),
    )
    assert literal_text(Literal(both, both.values[:1])) == "free(r)"
    assert literal_text(Literal(both, both.values[1:])) == "not free(r)"


def test_further_states_have_the_default() -> None:
    """`also`: states that no candidate task visits must get their word too."""
    candidates = all_tasks("three-cells")
    keys = [candidates.model.codec.key(row) for row in candidates.rows]
    language = language_of({keys[0]: "w0", keys[1]: "w1"}, ("w0", "w1"))
    table = language.partition(candidates.model)
    free = all_covers(mapped_states(table, candidates.model))
    exact = all_covers(mapped_states(table, candidates.model, candidates.rows))
    states = [set(candidates.model.codec.decode(row)) for row in candidates.rows]
    for formulas, are_right in ((exact, True), (free, False)):
        assert are_right == all(
            [w for w, f in formulas.items() if holds(f, s)] == [language.states.get(k, "w0")]
            for k, s in zip(keys, states, strict=True)
        )
    assert exact["w1"].length > free["w1"].length


def every_box(points: Points) -> list[np.ndarray]:
    """All boxes without `off` points."""
    found = []
    for chosen in boxes(points.sizes):
        box = np.zeros(sum(points.sizes), np.bool_)
        for start, values in zip(points.offset, chosen, strict=True):
            box[[start + v for v in values]] = True
        if not points.inside(box[None, :], points.off)[0].any():
            found.append(box)
    return found


def random_points(random: Random) -> Points:
    sizes = tuple(random.randint(2, 3) for _ in range(random.randint(1, 3)))
    every = [list(p) for p in product(*(range(n) for n in sizes))]
    random.shuffle(every)
    on = random.randint(1, min(8, len(every)))
    off = random.randint(0, len(every) - on)
    tables = [
        np.array(part, np.int64).reshape(-1, len(sizes))
        for part in (every[:on], every[on : on + off])
    ]
    return Points(sizes, *tables)


def limited(points: Points, box: np.ndarray) -> int:
    return sum(
        not box[start : start + size].all()
        for start, size in zip(points.offset, points.sizes, strict=True)
    )


def test_fewest_boxes_by_trying_all() -> None:
    numbers: Counter[int] = Counter()
    for seed in range(150):
        points = random_points(Random(seed))
        boxes = minimise(points)
        maximal = every_box(points)
        held = {tuple(np.flatnonzero(points.inside(b[None, :], points.on)[0])) for b in maximal}
        most = [frozenset(h) for h in held if not any(set(h) < set(o) for o in held)]
        best = next(
            k
            for k in range(1, len(points.on) + 1)
            if any(
                len(frozenset().union(*c)) == len(points.on)
                for c in combinations(most, min(k, len(most)))
            )
        )
        assert boxes.fewest
        assert len(boxes.prime) == best
        for least, prime in zip(boxes.least, boxes.prime, strict=True):
            assert (least <= prime).all()
            assert any((prime == box).all() for box in maximal)
            assert not any((prime < box).any() and (prime <= box).all() for box in maximal)
        assert points.inside(boxes.least, points.on).any(axis=0).all()
        if best == 1:  # then with as few variables limited as any box has
            around = [box for box in maximal if points.inside(box[None, :], points.on).all()]
            assert limited(points, boxes.prime[0]) == min(limited(points, box) for box in around)
        numbers[best] += 1
    assert {1, 2, 3, 4} <= set(numbers), numbers


def test_a_single_term_limits_as_few_variables_as_possible() -> None:
    shorter = 0
    for seed in range(60):
        random = Random(seed)
        off = np.array([[random.randint(0, 1) for _ in range(8)] for _ in range(10)], np.int64)
        on = np.ones((1, 8), np.int64)
        off = off[(off != 1).any(axis=1)]
        points = Points((2,) * 8, on, off)
        (box,) = minimise(points).prime
        needed = next(
            k
            for k in range(9)
            if any((off[:, list(c)] != 1).any(axis=1).all() for c in combinations(range(8), k))
        )
        assert limited(points, box) == needed
        shorter += limited(points, expand(points, points.supercube([0]), on)) > needed
    assert shorter > 10  # expanding alone does not do it


@pytest.mark.parametrize(
    ("folder", "stem", "names"),
    [
        ("grid", "gw2-2x3", {"at(r1)", "at(r2)"}),
        (
            "two-arms",
            "exchange",
            {"over(arm1)", "empty/holds(arm1)", "empty/holds(arm2)", "clear(left)/on(?, left)"},
        ),
        ("vans", "two-vans", {"aboard/at(d1)", "at(v1)", "at(v2)"}),
        ("elevator", "two-calls", {"inside/outside(r1)", "stops"}),
    ],
)
def test_variables_are_invariants(folder: str, stem: str, names: set[str]) -> None:
    """At most one atom of a variable is true at a time; "none" is a value if it can happen."""
    candidates = own_task(folder, stem)
    space = explore(candidates.model, np.stack([task.init for task in candidates.loaded.tasks]))
    variables, value = valuation(candidates.model, space.rows)
    assert names <= {variable.name for variable in variables}
    atoms, holds = truth(candidates.model, space.rows)
    for variable in variables:
        true = holds[:, [atoms.index(atom) for atom in variable.atoms]].sum(axis=1)
        assert true.max() == 1
        assert (true.min() == 0) == (None in variable.values)
    assert len(np.unique(value, axis=0)) == len(space.rows)


#: An object and an action are called none, and an action idle; robots meet in two ways.
NAMED_NONE = """(define (domain d) (:types robot) (:constants none a) (:predicates (at ?p) (met))
 (:action none :agent ?r - robot :parameters () :effect (not (at none)))
 (:action idle :agent ?r - robot :parameters () :precondition (not (at none)) :effect (at a))
 (:action meet :parameters (?r ?o - robot) :precondition (not (= ?r ?o)) :effect (met)))"""


def test_remembered_actions_are_one_variable_a_robot() -> None:
    candidates = own_task("three-cells", options=ModelOptions(remember_actions=True))
    language = build_language(candidates, "greedy").language
    table = language.partition(candidates.model)
    formulas = all_covers(mapped_states(table, candidates.model))
    check_exact(language, candidates, formulas)
    names = {variable.name for variable in valuation(candidates.model, table.rows)[0]}
    assert {"last(r1)", "last(r2)"} <= names
    task = (
        "(define (problem p) (:domain d) (:objects r1 r2 - robot) (:init (at none)) (:goal (met)))"
    )
    texts: dict[str, list[str]] = {}
    for remember in (False, True):
        world = model_of(NAMED_NONE, task, ModelOptions(remember_actions=remember))
        rows = explore(world.model, world.tasks[0].init[None]).rows
        for variable in valuation(world.model, rows)[0]:
            texts[variable.name] = [value for _, value in variable.texts]
            assert len({*variable.texts}) == len(variable.texts)
    assert texts["at"] == ["a", "none", "no value"]
    assert {"none", "idle", "(none r1)", "(meet r1 r2)", "(meet r2 r1)"} < {*texts["last(r1)"]}


# ---- languages whose formulas are short

Lengths = tuple[int, int]
Box = tuple[frozenset[int], ...]


def boxes(sizes: Sequence[int]) -> list[Box]:
    """All terms: for each variable a set of values, not empty."""
    sets = [
        [frozenset(v for v in range(size) if chosen >> v & 1) for chosen in range(1, 2**size)]
        for size in sizes
    ]
    return list(product(*sets))


def shortest_formulas(values: list[tuple[int, ...]], sizes: Sequence[int]) -> dict[int, Lengths]:
    """For each set of states (bits) the fewest terms, then limits, that hold in just these."""
    of_set: dict[int, int] = {}
    for box in boxes(sizes):
        held = sum(
            1 << n
            for n, value in enumerate(values)
            if all(v in allowed for v, allowed in zip(value, box, strict=True))
        )
        limits = sum(len(own) < size for own, size in zip(box, sizes, strict=True))
        of_set[held] = min(limits, of_set.get(held, limits))
    best: dict[int, Lengths] = {0: (0, 0)}
    for target in range(1, 2 ** len(values)):
        inside = {held: limits for held, limits in of_set.items() if held and not held & ~target}
        # The fewest terms for each part of the target, a term at a time.
        covered: dict[int, Lengths] = {0: (0, 0)}
        layer = {0: (0, 0)}
        while layer and target not in covered:
            following: dict[int, Lengths] = {}
            for part, (terms, limits) in layer.items():
                for held, more in inside.items():
                    both, length = part | held, (terms + 1, limits + more)
                    if both not in covered and length < following.get(both, (99, 99)):
                        following[both] = length
            covered |= following
            layer = following
        best[target] = covered[target]
    return best


def length(word: Assignment, states: list[int], shortest: dict[int, Lengths]) -> Lengths:
    """The formulas of all words but one, whichever is best."""
    lengths = [
        shortest[sum(1 << n for n, state in enumerate(states) if word[state] == name)]
        for name in set(word.values())
    ]
    terms, limits = (sum(own) for own in zip(*lengths, strict=True))
    return min((terms - own[0], limits - own[1]) for own in lengths)


@cache
def by_trying_all(number: int) -> tuple[Lengths, list[int], dict[int, Lengths]]:
    """The shortest formulas of any smallest language of a small world."""
    candidates = small_worlds(6, number + 1)[number]
    least = build_language(candidates, "minimal")
    size, states = least.language.guarantee.size, list(least.job.states)
    variables, value = valuation(candidates.model, candidates.rows[states])
    sizes = [len(variable.values) for variable in variables]
    shortest = shortest_formulas([tuple(row) for row in value.tolist()], sizes)
    bad = failing(candidates)
    languages = [w for w in partitions(states, size) if is_language(w, bad)]
    return min(length(word, states, shortest) for word in languages), states, shortest


@pytest.mark.parametrize("number", [3, *thorough(*range(10))])
def test_shortest_by_trying_all(number: int) -> None:
    candidates = small_worlds(6, number + 1)[number]
    best, states, shortest = by_trying_all(number)
    found = build_language(candidates, "minimal", prefer="simple")
    figures = found.figures
    assert (figures["terms"], figures["limits"]) == best
    assert (figures["terms_lower_bound"], figures["limits_lower_bound"]) == best
    assert (figures["terms_before"], figures["limits_before"]) >= best
    word = found.language.partition(candidates.model).word_of(candidates.rows).tolist()
    assert length({s: word[s] for s in states}, states, shortest) == best
    assert found.verdict.holds
    assert found.language.guarantee.proved_minimal


@pytest.mark.parametrize("phase", ["terms", "limits"])
def test_stopped_searches_return_languages(phase: str, monkeypatch: pytest.MonkeyPatch) -> None:
    candidates, made = all_tasks("grid", "gw2-2x3"), built_for("grid", "gw2-2x3")
    word = made.language.partition(candidates.model).word_of(candidates.rows).tolist()
    found = Outcome({s: word[s] for s in made.job.states}, 5)
    checked: list[Assignment] = []

    finds = _Search._finds

    def late(self: _Search, terms: int, limits: int | None, budget: Budget) -> bool:
        if (phase == "terms") == (limits is None):
            raise OutOfTime("late")
        return finds(self, terms, limits, budget)

    monkeypatch.setattr(_Search, "_finds", late)
    outcome = simple(replace(made.job, check=checked.append), found)
    assert isinstance(outcome.stopped, OutOfTime)
    assert outcome.partition is (checked[-1] if checked else found.partition)
    assert outcome.figures["terms_lower_bound"] <= 4 <= outcome.figures["terms"]
    assert (phase == "limits") == bool(checked)


def test_a_search_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """With no conflicts to spend: the formulas that there were, and a bound that is true."""
    candidates, made = all_tasks("grid", "gw2-2x3"), built_for("grid", "gw2-2x3")
    mapped = mapped_states(made.language.partition(candidates.model), candidates.model)
    found = Outcome(dict(zip(made.job.states, mapped.word.tolist(), strict=True)), 5)
    monkeypatch.setattr("coordlang.explanation.simple._CONFLICTS", 0)
    outcome = simple(made.job, found)
    assert outcome.stopped is None
    assert outcome.partition is found.partition
    assert outcome.figures["terms"] == outcome.figures["terms_before"]
    assert outcome.figures["terms_lower_bound"] == 4
