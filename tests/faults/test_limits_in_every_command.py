# SPDX-License-Identifier: GPL-3.0-or-later
"""Every command hears ``--time-limit``: on an input that is too large it ends soon after it.

One table line for each command is printed (``-s``).
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

import coordlang
from coordlang.commands.main import COMMANDS
from coordlang.sites.movingai import planning_files
from tests.support.command import own_process
from tests.support.domains import DOMAINS

LIMIT = 3.0
#: Seconds after the limit in which a command has to end, and what a busy machine may add to them.
AFTER, BUSY = 2.0, 8.0
#: Commands that do no work that grows.
WITHOUT = {"schema"}
#: Words in capitals are files that `given` has.
EVERY = """
inspect DOMAIN MAP
plans DOMAIN HUGE --count
check DOMAIN HUGE
coordination DOMAIN HUGE
tasks DOMAIN HUGE --start (at_r1_?) --start (at_r2_?) -o tasks.json
build DOMAIN HUGE -o out.json
build DOMAIN HUGE -o out.json --method separating
build DOMAIN HUGE -o out.json --method minimal
build DOMAIN HUGE -o out.json --words 2
build DOMAIN HUGE -o out.json --slack 1 --words-see-slack
build DOMAIN HUGE -o out.json --tasks all
build DOMAIN HUGE -o out.json --start LANGUAGE
build GRID SMALL -o out.json --tasks all --method minimal
build GRID SMALL -o out.json --tasks all --words 6
verify LANGUAGE DOMAIN HUGE --tasks all
lift GRID SMALL TWO -o lifted.json
ground LIFTED GRID TWO -o out.json
say LANGUAGE DOMAIN HUGE PLAN
understand LANGUAGE DOMAIN HUGE w0
plan LANGUAGE DOMAIN HUGE w0 --heuristic blind
choices LANGUAGE DOMAIN HUGE w0
simulate LANGUAGE DOMAIN HUGE
export LANGUAGE DOMAIN HUGE w0 -o exported
explain LANGUAGE DOMAIN HUGE --task
report LANGUAGE DOMAIN HUGE -o report.html
domains --map BIG-MAP --scen BIG-SCEN --agents 2 -o map
""".strip().splitlines()


def on_open_floor(
    folder: Path, name: str, side: int, ways: Sequence[tuple[int, int, int, int]]
) -> Path:
    """The problem of robots on a floor without walls: their start and goal, x and y."""
    grid, scenario = folder / f"{name}.map", folder / f"{name}.scen"
    grid.write_text(f"type octile\nheight {side}\nwidth {side}\nmap\n" + f"{'.' * side}\n" * side)
    lines = ["\t".join(map(str, (0, "m", side, side, *way, 0))) for way in ways]
    scenario.write_text("\n".join(["version 1", *lines, ""]))
    if name != "big":
        for file, text in planning_files(grid, scenario, len(ways)).items():
            (folder / file).write_text(text)
    return folder / f"{name}-{len(ways)}.pddl"


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What `EVERY` has names for."""
    folder = tmp_path_factory.mktemp("given")
    corners = [(0, 0, 19, 19), (19, 19, 0, 0), (0, 19, 19, 0), (19, 0, 0, 19)]
    still = on_open_floor(folder, "still", 20, [(x, y, x, y) for x, y, _, _ in corners])
    on_open_floor(folder, "big", 1500, [(k, 0, k, 9) for k in range(2)])
    found = {
        "DOMAIN": folder / "domain.pddl",
        "HUGE": on_open_floor(folder, "huge", 20, corners),
        "TWO": on_open_floor(folder, "two", 60, [(0, 0, 59, 59), (59, 59, 0, 0)]),
        "MAP": on_open_floor(folder, "wide", 150, corners),
        "GRID": DOMAINS / "grid" / "domain.pddl",
        "SMALL": DOMAINS / "grid" / "gw4-3x3.pddl",
        "LANGUAGE": folder / "language.json",
        "LIFTED": folder / "lifted.json",
        "PLAN": folder / "plan.plan",
        "BIG-MAP": folder / "big.map",
        "BIG-SCEN": folder / "big.scen",
    }
    coordlang.build(found["DOMAIN"], still, method="greedy").language.save(found["LANGUAGE"])
    coordlang.lift(found["GRID"], DOMAINS / "grid" / "gw1-2x2.pddl").save(found["LIFTED"])
    found["PLAN"].write_text("0: (move r1 c0-0 c0-1)\n")
    return found


def test_every_command_is_in_the_table() -> None:
    assert {line.split()[0] for line in EVERY} | WITHOUT == set(COMMANDS)


@pytest.mark.slow
@pytest.mark.parametrize("line", EVERY)
def test_it_ends_soon_after_its_limit(line: str, given: dict[str, Path], tmp_path: Path) -> None:
    command = [str(given.get(word, word.replace("_", " "))) for word in line.split()]
    begin = time.monotonic()
    done = subprocess.run(
        own_process(*command, "--time-limit", LIMIT),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    seconds = time.monotonic() - begin
    print(f"{line}: {done.returncode} after {seconds:.1f} s")
    assert done.returncode in (3, 23), done
    assert "Traceback" not in done.stderr
    assert f"the time limit of {LIMIT:g} s is over" in done.stderr
    assert LIMIT - 0.5 < seconds < LIMIT + AFTER + BUSY
    if done.returncode == 23:
        assert not [path for path in tmp_path.iterdir() if path.is_file()]
