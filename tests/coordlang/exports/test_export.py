# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports by definition: the plans that fit, listed; the formula, evaluated on plans."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import chain, islice, product
from random import Random
from typing import Any

import numpy as np
import pytest

from benchmarks.paper.task_choices import languages_in_tasks
from coordlang.commands.build import build
from coordlang.commands.building import build_language
from coordlang.commands.explain import explain
from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.words import Conjunction
from coordlang.exports.ltlf import export_ltlf, symbols_of
from coordlang.exports.membership import exclusive_terms, short_terms
from coordlang.exports.pddl import ExportedTask, plan_names
from planners.classical.task import ClassicalTask, action_names
from planners.joint.model import show
from planners.pddl.model_options import ModelOptions
from planners.search.plans import Plan, Plans
from planners.system.errors import BadInput, UsageError
from tests.support import slow, thorough
from tests.support.domains import DOMAINS, own_task
from tests.support.naive import numbered_sentences
from tests.support.naive_classical import optimal_plans
from tests.support.task_languages import random_language, random_task_languages

FORMS = {"explicit": 100_000, "select-then-apply": 0}
#: How many random models of each number of robots; a second lot, much longer, runs on demand.
NUMBER = {"few": 5, "some": 10, "many": 150}
EACH = pytest.mark.parametrize("lot", ["few", *thorough("some"), *slow("many")])


@cache
def tasks(lot: str) -> tuple[TaskLanguage, ...]:
    """Random models of all kinds, words at random; one says both "w0" and "w0 w2 w1 w0"."""
    t_map = own_task("t-map")
    found = [*languages_in_tasks(build_language(t_map, "minimal").language, t_map)]
    found += [u for robots in (2, 3) for _, _, u in random_task_languages(robots, NUMBER[lot])]
    for name, remember in product(("grid-joint/three-cells", "handover/one-door"), (True, False)):
        candidates = own_task(*name.split("/"), ModelOptions(remember_actions=remember))
        for seed in range(4):
            language = random_language(Random(seed), candidates)
            found.append(next(languages_in_tasks(language, candidates)))
    return tuple(used for used in found if 1 < Plans.of(used.space, used.task).count <= 60)


def rich() -> TaskLanguage:
    """A task with several sentences, one of which has several words and leaves several plans open."""
    for used in tasks("few"):
        several = [len(w) > 1 and len(plans) > 1 for w, plans in numbered_sentences(used).items()]
        if len(several) > 1 and any(several):
            return used
    raise AssertionError("no such task")


def planned(exported: ExportedTask, plans: Iterable[Sequence[int]] | None = None) -> list[Plan]:
    """The joint plans of plans of an exported problem, by default of all optimal ones."""
    names = action_names(exported.classical)
    listed = optimal_plans(exported.classical) if plans is None else plans
    return [exported.joint_plan([names[n] for n in plan]) for plan in listed]


@pytest.mark.thorough
@EACH
def test_the_optimal_plans_are_the_plans_that_fit(
    lot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for used in tasks(lot):
        for words, plans in islice(numbered_sentences(used).items(), 4):
            for form, limit in FORMS.items():
                monkeypatch.setattr("coordlang.exports.pddl.MAX_ACTIONS", limit)
                exported = ExportedTask(used, words)
                assert exported.classical.form == form
                assert Counter(planned(exported)) == Counter(plans)
                assert optimal_plans(exported.classical).cost == exported.cost
                assert exported.classical.cost(exported.cost) == used.space.cost_of(used.task)


@EACH
def test_one_term_in_every_state(lot: str) -> None:
    for used in tasks(lot):
        rows = np.concatenate((used.partition.rows, used.space.rows[used.space.state]))
        words = used.partition.word_of(rows).tolist()
        states = [frozenset(used.model.codec.decode(row)) for row in rows]
        tree = exclusive_terms(used)
        assert short_terms(used, states=0) == tree
        for found, most in ((tree, 1), (short_terms(used), len(rows))):
            for state, word in zip(states, words, strict=True):
                true = [sum(satisfied(term, state) for term in terms) for terms in found]
                assert [n for n, terms in enumerate(true) if terms] == [word]
                assert sum(true) <= most
        assert sum(map(len, tree)) <= len(set(states))


def satisfied(term: Conjunction, state: frozenset[str]) -> bool:
    return all((show(atom) in state) == value for atom, value in term.items())


# LTLf by definition (De Giacomo and Vardi 2013): a formula is true at a place of a finite sequence
# of states.


@cache
def parsed(text: str) -> tuple[object, ...]:
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


def asked(
    tasks: Iterable[TaskLanguage], sentences: int, plans: int
) -> Iterator[tuple[str, list[dict[str, bool]], bool]]:
    """Formulas of sentences; plans as symbols that hold in their states; which plan has which."""
    for used in tasks:
        codec, every = used.model.codec, Plans.of(used.space, used.task)
        listed = numbered_sentences(used)
        for words in islice(listed, sentences):
            exported = export_ltlf(used, words)
            for other, found in listed.items():
                for plan in islice(sorted(found), plans):
                    states = [codec.decode(used.space.rows[n]) for n in every.states(plan)]
                    symbols = exported.symbols.items()
                    trace = [{s: atom in true for s, atom in symbols} for true in states]
                    yield exported.formula, trace, other == words


@EACH
def test_the_formula_is_true_of_the_plans_that_fit_and_of_no_other(lot: str) -> None:
    answers = Counter[bool]()
    slack = asked([within_slack("three-cells", 1)], 99, 99)
    for formula, trace, expected in chain(asked(tasks(lot), 3, 10), slack):
        states = [frozenset(s for s, holds in true.items() if holds) for true in trace]
        assert true_at(parsed(formula), states, 0) == expected
        answers[expected] += 1
    assert min(answers[True], answers[False]) > 10


def test_an_independent_library_says_the_same() -> None:
    flloat = pytest.importorskip("flloat.parser.ltlf", reason="flloat is not installed")
    read = cache(flloat.LTLfParser())
    for formula, trace, expected in asked(tasks("few")[::2], 2, 1):
        assert read(formula).truth(trace, 0) == expected


def test_the_formula_over_words_is_the_same_with_their_formulas() -> None:
    task_language = rich()
    exported = export_ltlf(task_language, max(numbered_sentences(task_language), key=len))
    text = re.sub(r"[a-z][a-z0-9_]*", lambda m: exported.words[m.group()], exported.over_words)
    assert text == exported.formula


def test_symbols_are_readable_and_stay_apart() -> None:
    found = symbols_of(["(at r1 c0-1)", "(at r1 c0_1)", "(last r1 none)", "(true)", "(#)", "(END)"])
    assert found[:3] == ["at_r1_c0_1", "at_r1_c0_1__2", "p_last_r1_none"]
    assert len(set(found)) == 6
    assert all(re.fullmatch(r"(?!true|end|last)[a-z][a-z0-9_]*", symbol) for symbol in found)


def test_plan_files_of_other_planners() -> None:
    text = "(go_a )\n; cost = 3 (general cost)\n 0.000: (Go_B)  [1.0]\ngo_c\ngo_d()\n\n"
    assert plan_names(text) == ["go_a", "Go_B", "go_c", "go_d"]
    with pytest.raises(BadInput, match="line 2"):
        plan_names("(go)\n(go a b)\n")


def test_a_plan_that_is_cut_off_or_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coordlang.exports.pddl.MAX_ACTIONS", 0)
    exported = ExportedTask(rich(), max(numbered_sentences(rich()), key=len))
    names = action_names(exported.classical)
    plan = [names[n] for n in next(iter(optimal_plans(exported.classical)))]
    whole = exported.joint_plan([name.upper() for name in plan])
    assert exported.joint_plan(plan) == whole
    last = max(place for place, name in enumerate(plan) if exported.labels[name])
    with pytest.raises(BadInput, match="cut off"):
        exported.joint_plan(plan[:last])
    with pytest.raises(BadInput, match="none of the exported problem"):
        exported.joint_plan([*plan, "fly"])


# Within slack.

WITHIN_SLACK = [
    ("three-cells", 1, False),
    *thorough(("three-cells", 1, True), ("three-cells", 2, False), ("t-map", 1, False)),
]


def within_slack(folder: str, slack: int, words: int = 3, **given: Any) -> TaskLanguage:
    """Some words for the plans within slack of a shipped problem; they may be inseparable."""
    domain, problem = (DOMAINS / folder / f"{name}.pddl" for name in ("domain", "problem"))
    built = build(domain, problem, slack=slack, words=words, seed=1, **given)
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


@pytest.mark.parametrize(("folder", "slack", "sees"), WITHIN_SLACK)
def test_every_plan_within_slack_has_the_sentence(
    folder: str, slack: int, sees: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With all, some or none of the steps at rest at the end; with all if words ``sees`` a rest."""
    task_language = within_slack(folder, slack, remember_actions=sees)
    sentences = numbered_sentences(task_language)
    assert len(sentences) > 1
    of_task = Plans.of(task_language.space, task_language.task)
    for words, plans in sentences.items():
        least = {plan: len(plan if sees else of_task.steps(plan)) for plan in plans}
        wanted = {plan[:n] for plan in plans for n in range(least[plan], len(plan) + 1)}
        for limit in FORMS.values():
            monkeypatch.setattr("coordlang.exports.pddl.MAX_ACTIONS", limit)
            exported = ExportedTask(task_language, words)
            assert Counter(planned(exported, every_plan(exported.classical))) == Counter(wanted)
            assert exported.cost == min(map(len, wanted))


def test_slack_that_pddl_cannot_say_is_refused() -> None:
    """Words that see what is left: tests/coordlang/commands/test_slack.py."""
    dear = within_slack("three-cells", 1, 1, cost="makespan+actions")
    with pytest.raises(UsageError, match="counts the joint steps"):
        ExportedTask(dear, [0])
