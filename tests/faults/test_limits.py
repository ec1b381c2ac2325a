# SPDX-License-Identifier: GPL-3.0-or-later
"""Inputs too large in size, time or digits: right, or the documented end; ``-s`` has a table."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

import coordlang as library
from coordlang.commands.main import COMMANDS
from coordlang.language.file import read_language
from coordlang.sites.movingai import planning_files
from tests.support.command import own_process
from tests.support.domains import DOMAINS
from tests.support.forks import fork_command

GRID = DOMAINS / "grid"
LIMIT = 3.0
#: Seconds after the limit in which a command has to end, and what a busy machine may add to them.
AFTER, BUSY = 2.0, 8.0
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
plan LANGUAGE DOMAIN HUGE w0
choices LANGUAGE DOMAIN HUGE w0
robot LANGUAGE DOMAIN HUGE --robot r1 --play 0
simulate LANGUAGE DOMAIN HUGE
export LANGUAGE DOMAIN HUGE w0 -o exported
explain LANGUAGE DOMAIN HUGE --task
report LANGUAGE DOMAIN HUGE -o report.html
import BIG-MAP BIG-SCEN --robots 2 -o map
import BIG-BUILDING --robots 2 --clearance 9 -o building
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
            (folder / file.replace("problem", f"{name}-{len(ways)}")).write_text(text)
    return folder / f"{name}-{len(ways)}.pddl"


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What `EVERY` has names for."""
    folder = tmp_path_factory.mktemp("given")
    corners = [(0, 0, 19, 19), (19, 19, 0, 0), (0, 19, 19, 0), (19, 0, 0, 19)]
    still = on_open_floor(folder, "still", 20, [(x, y, x, y) for x, y, _, _ in corners])
    on_open_floor(folder, "big", 1500, [(k, 0, k, 9) for k in range(2)])
    (folder / "big.building.yaml").write_text(
        "levels: {L1: {vertices: ["
        + ", ".join(f"[{x}, {y}, 0, '']" for y in range(60) for x in range(60))
        + "], lanes: ["
        + ", ".join(f"[{k}, {k + 1}]" for k in range(3599))
        + "], measurements: [[0, 1, {distance: [3, 1]}]]}}"
    )
    found = {
        "DOMAIN": folder / "domain.pddl",
        "HUGE": on_open_floor(folder, "huge", 20, corners),
        "TWO": on_open_floor(folder, "two", 60, [(0, 0, 59, 59), (59, 59, 0, 0)]),
        "MAP": on_open_floor(folder, "wide", 150, corners),
        "GRID": GRID / "domain.pddl",
        "SMALL": GRID / "gw4-3x3.pddl",
        "LANGUAGE": folder / "language.json",
        "LIFTED": folder / "lifted.json",
        "PLAN": folder / "plan.plan",
        "BIG-MAP": folder / "big.map",
        "BIG-SCEN": folder / "big.scen",
        "BIG-BUILDING": folder / "big.building.yaml",
    }
    library.build(found["DOMAIN"], still, method="greedy").language.save(found["LANGUAGE"])
    library.lift(found["GRID"], GRID / "gw1-2x2.pddl").save(found["LIFTED"])
    found["PLAN"].write_text("0: (move r1 c0-0 c0-1)\n")
    return found


def test_every_command_whose_work_grows_is_in_the_table() -> None:
    assert {line.split()[0] for line in EVERY} | {"schema", "domains"} == set(COMMANDS)


@pytest.mark.slow
@pytest.mark.parametrize("line", EVERY)
def test_it_ends_soon_after_its_limit(line: str, given: dict[str, Path], tmp_path: Path) -> None:
    words = [str(given.get(word, word.replace("_", " "))) for word in line.split()]
    command, begin = own_process(*words, "--time-limit", LIMIT), time.monotonic()
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    seconds = time.monotonic() - begin
    print(f"{line}: {done.returncode} after {seconds:.1f} s")
    assert done.returncode in (3, 23), done
    assert "Traceback" not in done.stderr
    assert f"the time limit of {LIMIT:g} s is over" in done.stderr
    assert LIMIT - 0.5 < seconds < LIMIT + AFTER + BUSY
    if done.returncode == 23:
        assert not [path for path in tmp_path.iterdir() if path.is_file()]


#: Inputs in the order of their size; the number of plans, and of words that are known to suffice.
PLANS = {"corners-4x4": 236, "corners-6x6": 42_252, "corners-10x10": 1_756_863_020}
LANGUAGES = {"gw1-2x2": 3, "gw4-3x3": None, "gwb8-4x4": None, "three-robots-3x3": None}


@pytest.mark.slow
@pytest.mark.parametrize("mib", [200, 500, 1024, 2048, 4096])
@pytest.mark.parametrize("problem", [*PLANS, *LANGUAGES])
def test_memory(problem: str, mib: int, tmp_path: Path) -> None:
    """The peak of resident memory is that of the process."""
    path, files = tmp_path / "l.json", (GRID / "domain.pddl", GRID / f"{problem}.pddl")
    build = ("--tasks", "all", "--method", "minimal", "--jobs", "1", "-o", path)
    work = ("plans", *files, "--count") if problem in PLANS else ("build", *files, *build)
    command = own_process(*work, "--memory-limit", f"{mib}M", "--time-limit", "20")
    with subprocess.Popen(command, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout and process.stderr  # noqa: PT018
        out, err = process.stdout.read(), process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = code = os.waitstatus_to_exitcode(status)
    print(f"{problem}, {mib} MiB: {code}, {usage.ru_maxrss >> 10} MiB")
    assert code in ((0, 22, 23) if problem in PLANS else (0, 3, 22, 23)), err
    assert "Traceback" not in err
    assert usage.ru_maxrss <= mib << 10
    assert code != 23 or "the time limit of" in err
    written = problem in LANGUAGES and code in (0, 3)
    assert [p.name for p in tmp_path.iterdir()] == ["l.json"] * written
    if written:
        guarantee = read_language(path).guarantee
        assert guarantee.proved_minimal == (code == 0)
        assert guarantee.size >= guarantee.lower_bound
        assert code != 0 or LANGUAGES[problem] in (None, guarantee.size)
    elif code == 0:
        assert out == f"{PLANS[problem]}\n"


# ---- numbers of more digits than Python writes by default (4,300)

WALK = """(:action walk%s :agent ?r - robot :parameters (?a ?b - place)
   :precondition (and (at ?r ?a) (next ?a ?b)) :effect (and (at ?r ?b) (not (at ?r ?a))))"""
DOMAIN = f"""(define (domain road) (:requirements :typing :multi-agent) (:types robot place)
  (:predicates (at ?r - robot ?p - place) (next ?a ?b - place))
  {" ".join(WALK % n for n in range(16))})"""


@pytest.mark.thorough
def test_a_count_of_many_digits(tmp_path: Path) -> None:
    """Each of 550 steps of a road is walked in 16 ways; the interpreter writes 640 digits."""
    roads = " ".join(f"(next p{n} p{n + 1})" for n in range(550))
    names = " ".join(f"p{n}" for n in range(551))
    (tmp_path / "domain.pddl").write_text(DOMAIN)
    (tmp_path / "problem.pddl").write_text(
        f"(define (problem long) (:domain road) (:objects r1 - robot {names} - place) "
        f"(:init (at r1 p0) {roads}) (:goal (at r1 p550)))"
    )
    ended = fork_command(
        *("plans", tmp_path / "domain.pddl", tmp_path / "problem.pddl", "--count"),
        before=lambda: sys.set_int_max_str_digits(640),
    ).join(600)
    assert (ended.code, ended.out) == (0, f"{16**550}\n"), ended
