# SPDX-License-Identifier: GPL-3.0-or-later
"""What the README files of the domains say is true, in numbers and in words.

Of words: some describe them: then that partition is a language, and none has fewer words.  Some say
what the sentences tell: then all plans of a sentence agree on it, in every task that requires
coordination.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from coordlang.commands.building import build_language
from coordlang.language.words import Language
from coordlang.required.miscoordination import miscoordination
from coordlang.verification.by_definition import verify
from planners.joint.states import split_atoms
from planners.pddl import read_domain
from planners.pddl.model_options import Cost, ModelOptions
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from tests.support import thorough
from tests.support.domains import DOMAINS, MAPS, loaded_from, world_of
from tests.support.pages import Row, blocks, candidates, commands, run_command, table

#: The folders, and how the robots are found in each.
WORLDS = {
    "handover": "type robot",
    "two-arms": "type robot",
    "push-box": ":agent of type robot",
    "tray": ":agent of type robot",
    "vans": ":agent of type driver, van",
    "lock": ":agent of type robot",
    "charger": ":agent of type robot",
    "elevator": "type robot",
    "flags": ":agent of type robot",
}

READ = sorted({*WORLDS, "corridor"} - {"two-arms", "lock"})
#: Columns of numbers of plans, under another cost.
COSTS: dict[Cost, str] = {
    "makespan+actions": "with fewest actions",
    "makespan+cost": "with least fuel",
}
#: The tables of maps have fewer columns.
PROBLEMS = [(folder, row) for folder in (*WORLDS, *MAPS) for row in table(folder, "problem")]
LANGUAGES = [(folder, row) for folder in (*WORLDS, *MAPS) for row in table(folder, "language for")]


def marks(folder: str, row: Row) -> list[pytest.MarkDecorator]:
    """Maps are many, and some are large."""
    large = [pytest.mark.slow] * (int(row["states"]) > 4000)
    return [pytest.mark.thorough, *large] if folder in MAPS else []


def test_every_folder_is_described() -> None:
    there = {(p.parent.name, p.stem) for p in DOMAINS.glob("*/*.pddl") if p.stem != "domain"}
    assert {(folder, row["problem"]) for folder, row in PROBLEMS} == there
    names = {path.parent.name: read_domain(path).name for path in DOMAINS.glob("*/domain.pddl")}
    assert all(name == folder for folder, name in names.items())
    for readme in DOMAINS.glob("*/README.md"):
        assert re.search(
            "What the words mean here|#what-the-words-mean-here", readme.read_text()
        ), readme


@pytest.mark.parametrize(
    ("folder", "row"),
    [pytest.param(f, r, id=f"{f}-{r['problem']}", marks=marks(f, r)) for f, r in PROBLEMS],
)
def test_the_table_of_problems(folder: str, row: Row) -> None:
    here = world_of(folder, row["problem"])
    assert len(here.space) == int(row["states"])
    assert here.plans.cost_of(0)[0] == int(row["makespan"])
    assert Plans.of(here.plans).count == int(row["optimal plans"])
    if folder in WORLDS:
        assert len(here.loaded.model.robots) == int(row["robots"])
        assert here.loaded.team.by == WORLDS[folder]
        for cost, column in COSTS.items():
            if column in row:
                loaded = loaded_from(folder, row["problem"], ModelOptions(cost=cost))
                plans = Plans.of(search(loaded.model, loaded.tasks[0]))
                assert plans.count == int(row[column])
        required = miscoordination(here.plans, 0) is not None
        assert row["coordination"] == ("required" if required else "not required")


@pytest.mark.parametrize(
    ("folder", "row"),
    [
        pytest.param(
            *(folder, row),
            id=f"{folder}-{row['language for']}-{row['--tasks']}",
            marks=[pytest.mark.thorough] * (folder in WORLDS),
        )
        for folder, row in LANGUAGES
    ],
)
def test_the_table_of_languages(folder: str, row: Row) -> None:
    tasks = candidates(folder, row)
    assert tasks.count == int(row["tasks"])
    for method in ("greedy", "minimal"):
        built = build_language(tasks, method)
        guarantee = built.language.guarantee
        assert built.job.first_differences.requiring == int(row["requiring coordination"])
        assert guarantee.size == int(row[f"{method} words"])
        assert guarantee.proved_minimal or method == "greedy"
        assert verify(built.language.partition(tasks.model), tasks.spaces).holds


@pytest.mark.parametrize("folder", ["two-arms", "lock", *thorough(*READ)])
def test_the_commands_in_the_readme(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "domains").symlink_to(DOMAINS)
    monkeypatch.chdir(tmp_path)
    page = DOMAINS / folder / "README.md"
    run = [
        command for block in blocks(page) if block.kind == "console" for command in commands(block)
    ]
    assert {command.text.split()[1] for command in run} >= {"build", "verify"}
    for command in run:
        run_command(command, folder, monkeypatch)


# ---- what they say in words of a smallest language

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
    ("elevator", "two-calls", OWN, "", (has("(stops second)", "(outside r1)", "(outside r2)"),)),
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
    ("push-box", "around", OWN, "", (has("(at r1 yard)", "(at r2 yard)", "(stands box yard)"),)),
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
