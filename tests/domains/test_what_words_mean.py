# SPDX-License-Identifier: GPL-3.0-or-later
"""What the READMEs say in words of a smallest language is true.

Some describe the words: then that partition is a language, and none has fewer words.  Some say what
the sentences tell: then all plans of a sentence agree on it, in every task that requires
coordination.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from coordlang.commands.building import build_language
from coordlang.language.words import Language
from coordlang.verification.by_definition import verify
from planners.joint.states import split_atoms
from tests.support.agreement import Feature, Plan, agreement, exactly, parts, who, who_does_what
from tests.support.pages import candidates

#: Says of a state, given as its atoms, whether it belongs to a word.
Word = Callable[[frozenset[str]], bool]


def only(robot: str) -> Word:
    """Of three robots this one is the only one that is charged, or the only one that is not."""

    def word(atoms: frozenset[str]) -> bool:
        charged = {name for name in ("r1", "r2", "r3") if f"(charged {name})" in atoms}
        return charged in ({robot}, {"r1", "r2", "r3"} - {robot})

    return word


def has(*wanted: str, without: tuple[str, ...] = ()) -> Word:
    return lambda atoms: set(wanted) <= atoms and not atoms & set(without)


def either(*words: Word) -> Word:
    return lambda atoms: any(word(atoms) for word in words)


CARRYING = ("(holds arm1 red)", "(holds arm2 blue)")
OWN = "its own"
BESIDE = has("(holds r1 back)", "(tray-at parlour)")
#: Folder, problem, tasks, options, and what a README says of all words but one, which holds the rest.
MEANINGS: list[tuple[str, str, str, str, tuple[Word, ...]]] = [
    ("three-cells", "problem", "all", "", (has("(at r2 a)"), has("(at r2 b)"))),
    (
        *("t-map", "problem", "all", ""),
        (has("(at r1 c1-1)", "(at r2 c0-1)"), has("(at r1 c1-1)", "(at r2 c1-0)")),
    ),
    ("corridor", "problem", OWN, "", (has("(at r1 c0-4)"),)),
    (
        *("charger", "three-robots", OWN, "--cost makespan+actions"),
        (only("r1"), only("r2"), has("(charged r3)", without=("(charged r1)", "(charged r2)"))),
    ),
    (
        *("elevator", "two-calls", OWN, ""),
        (has("(stops second)", "(outside r1)", "(outside r2)"),),
    ),
    (
        *("handover", "two-doors", OWN, ""),
        (has("(at r1 west-south)", "(at r2 east-south)", "(holds r2 box)"),),
    ),
    (
        *("handover", "exchange", OWN, ""),
        (lambda s: sum("west" in a and "lies" in a for a in s) == 2,),
    ),
    (
        *("lock", "both-in", "all", ""),
        (
            either(has("(at r1 yard)", "(at r2 yard)"), has("(at r1 hall)", "(at r2 hall)")),
            either(has("(at r1 lock)", "(at r2 yard)"), has("(at r1 hall)", "(at r2 lock)")),
        ),
    ),
    (
        *("lock", "three-robots", OWN, "--remember-actions --cost makespan+actions"),
        (lambda s: any(a.startswith("(last r2 (hold") for a in s),),
    ),
    (
        *("push-box", "around", "all", ""),
        tuple(has(f"(at r1 {p})", f"(at r2 {p})", f"(stands box {p})") for p in ("store", "yard")),
    ),
    (
        *("push-box", "around", OWN, ""),
        (has("(at r1 yard)", "(at r2 yard)", "(stands box yard)"),),
    ),
    ("tray", "serve", OWN, "", (BESIDE,)),
    ("tray", "three-robots", OWN, "", (BESIDE,)),
    (
        *("two-arms", "exchange", "exchange.tasks.json", ""),
        (
            has("(over arm1 back)", "(over arm2 front)", *CARRYING),
            either(
                has("(over arm1 back)", "(over arm2 right)", *CARRYING),
                has("(over arm1 back)", "(over arm2 front)", "(on red front)", "(on blue back)"),
            ),
        ),
    ),
    (
        *("vans", "one-van", "one-van.tasks.json", ""),
        (has("(aboard d1 v1)", without=("(at v1 depot)",)),),
    ),
]


@pytest.mark.parametrize(("folder", "problem", "tasks", "options", "words"), MEANINGS)
def test_the_words_of_the_readme_are_a_smallest_language(
    folder: str, problem: str, tasks: str, options: str, words: tuple[Word, ...]
) -> None:
    given = candidates(folder, {"language for": problem, "--tasks": tasks, "options": options})
    states = {}
    for key in map(given.model.codec.key, given.rows):
        mine = [n for n, word in enumerate(words) if word(frozenset(split_atoms(key)))]
        assert len(mine) <= 1, "words do not overlap"
        if mine:
            states[key] = f"w{mine[0]}"
    names = (*(f"w{n}" for n in range(len(words))), "rest")
    assert set(states.values()) == set(names[:-1]), "no word is empty"
    found = verify(Language(names, states, "rest").partition(given.model), given.spaces)
    assert found.holds, found.witness
    guarantee = build_language(given, "minimal").language.guarantee
    assert guarantee.proved_minimal
    assert guarantee.size == len(words) + 1


moves = who_does_what()


def first(schema: str) -> Feature:
    """Who does the first subaction of this schema."""

    def feature(plan: Plan) -> frozenset[int]:
        found = parts(plan, [schema])
        return frozenset(robot for step, robot, _ in found if step == found[0][0])

    return feature


def aside(plan: Plan) -> frozenset[int]:
    return frozenset(robot for _, robot, text in parts(plan, []) if text.endswith(" c0-4)"))


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("folder", "problem", "tasks", "told", "leaves"),
    [
        ("three-cells", "problem", "all", moves, True),
        ("t-map", "problem", "all", exactly, False),
        ("corridor", "problem", "rooms.tasks.json", aside, True),
        ("grid", "gwb5-3x3", "gwb5-3x3.tasks.json", moves, False),
        ("charger", "queue", "queue.tasks.json", who_does_what("mop"), True),
        ("elevator", "two-calls", "its own", first("enter"), False),
        ("handover", "two-doors", "its own", who_does_what("hand-over"), True),
        ("vans", "one-van", "one-van.tasks.json", who("board"), True),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_the_sentences_tell(
    folder: str, problem: str, tasks: str, told: Feature, leaves: bool
) -> None:
    given = candidates(folder, {"language for": problem, "--tasks": tasks, "options": ""})
    figures = agreement(build_language(given, "minimal").language, given, told)
    assert figures["different"] > 0
    assert figures["told"] == figures["different"]
    assert (figures["left"] > 0) == leaves
