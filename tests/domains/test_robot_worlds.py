# SPDX-License-Identifier: GPL-3.0-or-later
"""What the README files of the domains say is true."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from coordlang.commands.building import build_language
from coordlang.required.miscoordination import Inseparable, miscoordination
from coordlang.verification.by_definition import verify
from planners.loading import PlanningInstance, build
from planners.pddl import read_domain
from planners.pddl.model_options import Cost, ModelOptions
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from tests.support.domains import DOMAINS, read, world_of
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

#: Columns of numbers of plans, under another cost.
COSTS: dict[Cost, str] = {
    "makespan+actions": "with fewest actions",
    "makespan+cost": "with least fuel",
}
#: The maps, whose tables have fewer columns.
MAPS = ("grid", "grid-joint", "three-cells", "t-map", "corridor")
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
                loaded = loaded_under(folder, row, cost)
                plans = Plans.of(search(loaded.model, loaded.tasks[0]))
                assert plans.count == int(row[column])
        required = miscoordination(here.plans, 0) is not None
        assert row["coordination"] == ("required" if required else "not required")


def loaded_under(folder: str, row: Row, cost: Cost) -> PlanningInstance:
    domain, problem = read(folder, row["problem"])
    return build(domain, [problem], ModelOptions(cost=cost))


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
        assert built.first_differences.requiring == int(row["requiring coordination"])
        assert guarantee.size == int(row[f"{method} words"])
        assert guarantee.proved_minimal or method == "greedy"
        assert verify(built.language.partition(tasks.model), tasks.spaces).holds


@pytest.mark.parametrize("folder", [*WORLDS, "corridor"])
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


def test_no_state_tells_who_holds_the_switch() -> None:
    """Two actions without effects, either of which will do: only remembering tells them apart."""
    row = {"language for": "three-robots", "--tasks": "its own", "options": ""}
    with pytest.raises(Inseparable):
        build_language(candidates("lock", row))
