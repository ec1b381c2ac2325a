# SPDX-License-Identifier: GPL-3.0-or-later
"""What is exported against the definition: the plans that fit, listed; the formula, evaluated on
plans.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import islice, product
from random import Random
from typing import Any

import numpy as np
import pytest

from coordlang.commands.build import build
from coordlang.commands.explain import explain
from coordlang.execution.task_language import NoPlanFits, TaskLanguage, languages_in_tasks
from coordlang.explanation.words import Conjunction
from coordlang.exports import membership as membership_module
from coordlang.exports.ltlf import export_ltlf, symbols_of
from coordlang.exports.membership import membership
from coordlang.exports.pddl import PddlExport, export_pddl, plan_names
from coordlang.language.candidates import from_problems
from coordlang.language.sentences import sentence
from coordlang.language.words import Language
from planners.classical import ClassicalTask, action_names
from planners.joint.model import show
from planners.search.plans import Plan, Plans
from planners.search.reachable import explore
from planners.system.errors import BadInput, ProvedImpossible, UsageError
from tests.support.domains import DOMAINS
from tests.support.naive_classical import optimal_plans
from tests.support.other_planners import rows as answers
from tests.support.random_models import random_chores, random_model
from tests.support.task_languages import task_languages

FORMS = {"explicit": 100_000, "select-then-apply": 0}
#: Seeds of the random tasks; a second lot, much longer, runs on demand.
SEEDS = {"few": range(80), "many": range(80, 600)}
BOTH = pytest.mark.parametrize("lot", ["few", pytest.param("many", marks=pytest.mark.slow)])


def random_task_language(seed: int) -> TaskLanguage | None:
    """A random task with a random partition of its reachable states, some of them left to the
    default.

    None where there is nothing to say, or too much to list.
    """
    random = Random(seed)
    make = random_model if seed % 2 else random_chores
    domain, problem, options = make(seed, random.choice([2, 2, 3]))
    if seed % 4 == 0:
        options = replace(options, remember_actions=True)
    try:
        candidates = from_problems(domain, [problem], options)
    except ProvedImpossible:
        return None
    model, space = candidates.model, candidates.spaces[0]
    if not space.layer[space.starts[0]] or Plans.of(space).count > 60:
        return None
    rows = explore(model, space.rows[space.state[space.starts]]).rows
    if len(rows) > 70:
        return None
    words = tuple(f"w{n}" for n in range(random.randint(1, 4)))
    keys = [model.codec.key(row) for row in rows]
    on_plans = [set(model.codec.decode(space.rows[state])) for state in set(space.state.tolist())]
    changing = sorted(set().union(*on_plans) - set(on_plans[0]).intersection(*on_plans))
    if random.random() < 0.8 and changing:  # words that are about what changes on the way
        atoms = random.sample(changing, min(2, len(changing)))
        meaning = {value: random.choice(words) for value in range(4)}
        word = [meaning[sum(2**n * (atom in key) for n, atom in enumerate(atoms))] for key in keys]
    else:
        word = [random.choice(words) for _ in keys]
    states = {key: w for key, w in zip(keys, word, strict=True) if random.random() < 0.9}
    language = Language(words, states, words[-1])
    return next(languages_in_tasks(language, candidates))


@cache
def tasks(lot: str) -> tuple[TaskLanguage, ...]:
    found = map(random_task_language, SEEDS[lot])
    return tuple(task_language for task_language in found if task_language is not None)


def rich() -> TaskLanguage:
    """A task with several sentences, one of which has several words and leaves several plans open."""
    for task_language in tasks("few"):
        sentences = by_sentence(task_language)
        if len(sentences) > 1 and any(
            len(plans) > 1 and len(words) > 1 for words, plans in sentences.items()
        ):
            return task_language
    raise AssertionError("no such task")


def by_sentence(task_language: TaskLanguage) -> dict[tuple[int, ...], set[Plan]]:
    """The definition: every optimal plan with the words of its states, repeated ones collapsed."""
    plans = Plans.of(task_language.space, task_language.task)
    found: dict[tuple[int, ...], set[Plan]] = {}
    for plan in plans:
        words = task_language.partition.word_of(task_language.space.rows[plans.states(plan)])
        found.setdefault(sentence(words.tolist()), set()).add(plan)
    return found


def planned(exported: PddlExport, plans: Iterable[Sequence[int]] | None = None) -> list[Plan]:
    """The joint plans of plans of an exported problem, by default of all optimal ones."""
    names = action_names(exported.classical)
    listed = optimal_plans(exported.classical) if plans is None else plans
    return [exported.joint_plan([names[n] for n in plan]) for plan in listed]


@pytest.mark.thorough
@BOTH
def test_the_optimal_plans_are_the_plans_that_fit(lot: str) -> None:
    for task_language in tasks(lot):
        for words, plans in islice(by_sentence(task_language).items(), 4):
            for form, limit in FORMS.items():
                exported = export_pddl(task_language, words, limit)
                assert exported.classical.form == form
                assert Counter(planned(exported)) == Counter(plans)
                assert optimal_plans(exported.classical).cost == exported.cost
                assert exported.classical.cost(exported.cost) == task_language.space.cost_of(
                    task_language.task
                )


def test_the_random_tasks_are_worth_it() -> None:
    """Some have several sentences, some sentences leave several plans open; some remember actions,
    some have three robots.
    """
    listed = [(task_language, by_sentence(task_language)) for task_language in tasks("few")]
    both = [any(len(p) > 1 for p in found.values()) for _, found in listed if len(found) > 1]
    assert (len(listed) >= 20, len(both) >= 4, sum(both) >= 3) == (True, True, True)
    assert {task_language.model.remembers for task_language, _ in listed} == {True, False}
    assert {len(task_language.model.robots) for task_language, _ in listed} == {2, 3}
    assert {task_language.model.is_joint_action for task_language, _ in listed} == {True, False}


@BOTH
def test_one_term_in_every_state(lot: str) -> None:
    for used in tasks(lot):
        rows = np.concatenate((used.partition.rows, used.space.rows[used.space.state]))
        words = used.partition.word_of(rows).tolist()
        states = [frozenset(used.model.codec.decode(row)) for row in rows]
        tree, shorter = membership(used, states=0), membership(used, apart=False)
        for found, most in ((membership(used), 1), (tree, 1), (shorter, len(rows))):
            for state, word in zip(states, words, strict=True):
                true = [sum(satisfied(term, state) for term in terms) for terms in found.terms]
                assert [n for n, terms in enumerate(true) if terms] == [word]
                assert sum(true) <= most
        assert tree.size <= len(set(states))


def satisfied(term: Conjunction, state: frozenset[str]) -> bool:
    return all((show(atom) in state) == value for atom, value in term.items())


def test_a_word_named_in_two_ways_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A break of the code: with terms that overlap one plan has several counterparts."""
    words, plans = max(by_sentence(rich()).items(), key=lambda s: len(s[1]))
    assert len(planned(export_pddl(rich(), words))) == len(plans)
    monkeypatch.setattr(membership_module, "disjoint", lambda facts, terms: [*terms, *terms])
    assert len(planned(export_pddl(rich(), words))) > len(plans)


# LTLf by definition (De Giacomo and Vardi 2013): a formula is true at a place of a finite sequence
# of states.


def parse(text: str) -> tuple[object, ...]:
    """The text of a formula, with all operations in brackets, as nested tuples."""
    tokens = re.findall(r"[()!&|UG]|[a-z][a-z0-9_]*", text)
    assert "".join(tokens) == text.replace(" ", "")

    def read() -> tuple[object, ...]:
        token = tokens.pop(0)
        if token in "!G":
            return (token, read())
        if token != "(":
            return ("symbol", token)
        left = read()
        while tokens[0] != ")":
            left = (tokens.pop(0), left, read())
        tokens.pop(0)
        return left

    formula = read()
    assert not tokens
    return formula


def true_at(formula: Any, states: Sequence[frozenset[str]], place: int) -> bool:
    match formula:
        case ("symbol", name):
            return name == "true" or name in states[place]
        case ("!", part):
            return not true_at(part, states, place)
        case ("&", left, right):
            return true_at(left, states, place) and true_at(right, states, place)
        case ("|", left, right):
            return true_at(left, states, place) or true_at(right, states, place)
        case ("G", part):
            return all(true_at(part, states, j) for j in range(place, len(states)))
        case ("U", left, right):
            return any(
                true_at(right, states, j) and all(true_at(left, states, k) for k in range(place, j))
                for j in range(place, len(states))
            )
    raise AssertionError(formula)


def symbols_in(
    task_language: TaskLanguage, plan: Plan, symbols: dict[str, str]
) -> list[frozenset[str]]:
    """The states of a plan as the sets of symbols that hold."""
    space, codec = task_language.space, task_language.model.codec
    states = [codec.decode(space.rows[n]) for n in Plans.of(space, task_language.task).states(plan)]
    return [frozenset(symbol for symbol, atom in symbols.items() if atom in s) for s in states]


@BOTH
def test_the_formula_is_true_of_the_plans_that_fit_and_of_no_other(lot: str) -> None:
    answers = Counter[bool]()
    for task_language in tasks(lot):
        sentences = by_sentence(task_language)
        for words in islice(sentences, 3):
            exported = export_ltlf(task_language, words)
            formula = parse(exported.formula)
            for other, plans in sentences.items():
                for plan in islice(sorted(plans), 10):
                    held = true_at(formula, symbols_in(task_language, plan, exported.symbols), 0)
                    assert held == (other == words)
                    answers[held] += 1
    assert min(answers[True], answers[False]) > 10


def test_no_word_may_be_skipped() -> None:
    """A plan that stays in w0 does not say "w0 w2 w1 w0", though nothing else is wrong with it."""
    (task_language,) = task_languages("t-map", "problem", everything=False)
    sentences = by_sentence(task_language)
    assert any(len(set(words)) == 1 for words in sentences)
    assert any(words[0] == words[-1] and len(words) > 2 for words in sentences)
    for words in sentences:
        exported = export_ltlf(task_language, words)
        held = {
            other: true_at(
                parse(exported.formula), symbols_in(task_language, min(plans), exported.symbols), 0
            )
            for other, plans in sentences.items()
        }
        assert held == {other: other == words for other in sentences}


def test_an_independent_library_says_the_same() -> None:
    parser = pytest.importorskip(
        "flloat.parser.ltlf", reason="flloat is not installed"
    ).LTLfParser()
    answers = Counter[bool]()
    for task_language in tasks("few"):
        sentences = by_sentence(task_language)
        for words in islice(sentences, 2):
            exported = export_ltlf(task_language, words)
            formula = parser(exported.formula)
            for other, plans in islice(sentences.items(), 4):
                states = symbols_in(task_language, min(plans), exported.symbols)
                trace = [
                    {symbol: symbol in state for symbol in exported.symbols} for state in states
                ]
                answers[held := bool(formula.truth(trace, 0))] += 1
                assert held == (other == words)
    assert min(answers[True], answers[False]) > 5


def test_the_formula_over_words_is_the_same_with_their_formulas() -> None:
    task_language = rich()
    exported = export_ltlf(task_language, max(by_sentence(task_language), key=len))
    text = re.sub(r"[a-z][a-z0-9_]*", lambda m: exported.words[m.group()], exported.over_words)
    assert text == exported.formula


def test_symbols_are_readable_and_stay_apart() -> None:
    found = symbols_of(["(at r1 c0-1)", "(at r1 c0_1)", "(last r1 none)", "(true)", "(#)", "(END)"])
    assert found[:3] == ["at_r1_c0_1", "at_r1_c0_1__2", "p_last_r1_none"]
    assert len(set(found)) == 6
    assert all(re.fullmatch(r"(?!true|end|last)[a-z][a-z0-9_]*", symbol) for symbol in found)


def test_a_sentence_that_no_plan_has() -> None:
    task_language = rich()
    longest = max(by_sentence(task_language), key=len)
    for export in (export_pddl, export_ltlf):
        with pytest.raises(NoPlanFits):
            export(task_language, (*longest, longest[-2]))


def test_plan_files_of_other_planners() -> None:
    text = "(go_a )\n; cost = 3 (general cost)\n 0.000: (Go_B)  [1.0]\ngo_c\ngo_d()\n\n"
    assert plan_names(text) == ["go_a", "Go_B", "go_c", "go_d"]
    with pytest.raises(BadInput, match="line 2"):
        plan_names("(go)\n(go a b)\n")


def test_a_plan_that_is_cut_off_or_none() -> None:
    exported = export_pddl(rich(), max(by_sentence(rich()), key=len), 0)
    names = action_names(exported.classical)
    plan = [names[n] for n in next(iter(optimal_plans(exported.classical)))]
    whole = exported.joint_plan([name.upper() for name in plan])
    assert exported.joint_plan(plan) == whole
    last = max(place for place, name in enumerate(plan) if exported.labels[name])
    with pytest.raises(BadInput, match="cut off"):
        exported.joint_plan(plan[:last])
    with pytest.raises(BadInput, match="none of the exported problem"):
        exported.joint_plan([*plan, "fly"])


# Other planners.


def test_the_table_without_other_planners() -> None:
    rows = [row for name in ("three-cells", "t-map") for row in answers(name, 60.0, other=False)]
    assert {row.form for row in rows} == {"explicit", "select-then-apply"}
    assert all(row.agrees and row.graph == row.listing for row in rows)
    assert not replace(rows[0], listing=rows[0].graph + 1).agrees
    assert not replace(rows[0], fast_downward=rows[0].cost + 1).agrees


@pytest.mark.slow
@pytest.mark.parametrize(
    "folder",
    sorted(
        {path.parent.name for path in DOMAINS.glob("*/domain.pddl")}
        - {"flags", "grid", "grid-joint"}
    ),
)
def test_other_planners_find_exactly_the_plans_that_fit(folder: str) -> None:
    pytest.importorskip("kstar_planner", reason="K* is not installed (extra oracles)")
    rows = [*answers(folder, 300.0)]
    assert rows
    for row in rows:
        assert row.agrees, row
        assert row.kstar == row.graph == row.listing, row
        assert row.fast_downward == row.cost, row


# Within slack.

WITHIN_SLACK = [
    ("three-cells", 1),
    pytest.param("three-cells", 2, marks=pytest.mark.thorough),
    pytest.param("t-map", 1, marks=pytest.mark.thorough),
]


def within_slack(folder: str, slack: int, **given: Any) -> TaskLanguage:
    """Three words for the plans within slack of a shipped problem; they may be inseparable."""
    domain, problem = (DOMAINS / folder / f"{name}.pddl" for name in ("domain", "problem"))
    built = build(domain, problem, slack=slack, words=3, seed=1, **given)
    used: TaskLanguage = explain(built.language, domain, problem).used
    return used


def every_plan(task: ClassicalTask) -> Iterator[tuple[int, ...]]:
    """All sequences of actions that lead from the initial state to the goal."""
    todo: list[tuple[tuple[int, ...], frozenset[int]]] = [((), task.init)]
    while todo:
        plan, state = todo.pop()
        if all((fact in state) == wanted for fact, wanted in task.goal):
            yield plan
        for number, action in enumerate(task.actions):
            if all((fact in state) == wanted for fact, wanted in action.preconditions):
                todo.append(((*plan, number), state.difference(action.deletes).union(action.adds)))


@pytest.mark.parametrize(("folder", "slack"), WITHIN_SLACK)
def test_every_plan_within_slack_has_the_sentence(folder: str, slack: int) -> None:
    """All of them, with all, some or none of the steps at rest at the end."""
    task_language = within_slack(folder, slack)
    sentences = by_sentence(task_language)
    assert len(sentences) > 1
    of_task = Plans.of(task_language.space, task_language.task)
    for words, plans in sentences.items():
        least = {plan: len(of_task.without_rest(plan)) for plan in plans}
        wanted = {plan[:n] for plan in plans for n in range(least[plan], len(plan) + 1)}
        for limit in FORMS.values():
            exported = export_pddl(task_language, words, limit)
            assert Counter(planned(exported, every_plan(exported.classical))) == Counter(wanted)
            assert exported.cost == min(map(len, wanted))


def test_the_formula_within_slack() -> None:
    task_language = within_slack("three-cells", 1)
    sentences = by_sentence(task_language)
    for words, (other, plans) in product(sentences, sentences.items()):
        exported = export_ltlf(task_language, words)
        for plan in plans:
            states = symbols_in(task_language, plan, exported.symbols)
            assert true_at(parse(exported.formula), states, 0) == (other == words)


def test_slack_that_pddl_cannot_say_is_refused() -> None:
    seen = within_slack("three-cells", 1, words_see_slack=True)
    for export in (export_pddl, export_ltlf):
        with pytest.raises(UsageError, match="see how much is left of the slack"):
            export(seen, [0])
    dear = within_slack("three-cells", 1, cost="makespan+actions")
    with pytest.raises(UsageError, match="counts the joint steps"):
        export_pddl(dear, [0])
