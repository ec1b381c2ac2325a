# SPDX-License-Identifier: GPL-3.0-or-later
"""What the program prints and writes on the shipped domains, for comparing two versions of it.

    python benchmarks/outputs.py FOLDER [--program PATH] [--jobs N]

Runs a fixed list of commands in the current directory, a checkout, each as a process of its own.
``FOLDER/WORLD/COMMAND.txt`` holds the exit code and stdout of a command, beside it lie the files
that it wrote. Versions behave alike if and only if ``diff -r`` of their folders is empty. What
differs from run to run is left out: seconds, the ``producer`` of a file and the place of FOLDER.
Messages on stderr are not compared.
"""

from __future__ import annotations

import argparse
import gzip
import json
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from time import perf_counter

DOMAINS = Path("domains")

#: World -> the problems that every general command is run on, the world's example first.
PROBLEMS = {
    "charger": "queue in-turn three-robots",
    "corridor": "problem",
    "elevator": "two-calls one-robot same-floor",
    "flags": "parade two-up",
    "grid": "corners-4x4 corners-3x3 gw1-2x2 gw2-2x3 gwb1-2x4 gwb5-3x3 three-robots-3x3",
    "grid-joint": "corners-3x3 gw1-2x2 gwb1-2x4 t-map three-cells",
    "handover": "two-doors exchange one-door three-rooms",
    "lock": "both-in let-in three-robots",
    "push-box": "around next-door three-robots",
    "t-map": "problem",
    "three-cells": "problem",
    "tray": "serve in-hand three-robots",
    "two-arms": "exchange own-sides pass-on",
    "vans": "one-van alone two-each two-vans",
}

#: Run on every problem ``P``.
ON_EVERY_PROBLEM = """
inspect D P --json
plans D P --max 3 --format ipc
plans D P --max 3 --format json
coordination D P --json
"""

#: Run on the example ``P`` of every world.
ON_EVERY_EXAMPLE = """
coordination D P
build D P -o @example.json --method minimal --json
verify @example.json D P
explain @example.json D P --task
plan @example.json D P --prefer most-plans --json
plan @example.json D P --prefer shortest
report @example.json D P -o @example.html
"""

#: World -> further commands. ``D`` is the world's domain, ``@name`` a file in FOLDER; other names
#: of files are looked up in the world's directory.
COMMANDS = {
    "three-cells": """
        inspect D problem.pddl --states
        plans D problem.pddl --count
        plans D problem.pddl --sample 3 --seed 1
        plans D problem.pddl --cost makespan+actions --json
        check D problem.pddl --json
        tasks D problem.pddl --start "(at r1 ?)" --goal "(at r2 ?)" -o @some.tasks.json --json
        build D problem.pddl --tasks @some.tasks.json --method minimal -o @some.json --json
        build D problem.pddl -o @one.json
        build D problem.pddl --tasks all -o @greedy.json --json
        build D problem.pddl --tasks all --method separating -o @separating.json
        build D problem.pddl --tasks all --method separating --alpha-only -o @alpha.json
        build D problem.pddl --tasks all --method exhaustive -o @exhaustive.json --json
        build D problem.pddl --tasks all --method minimal --certificate @proof.json -o @minimal.json
        build D problem.pddl --tasks all --method minimal --prefer flexible -o @flexible.json --json
        build D problem.pddl --tasks all --method minimal -o -
        verify @minimal.json D problem.pddl --certificate @proof.json --dimacs @proof.cnf
        verify @one.json D problem.pddl
        verify @one.json D problem.pddl --tasks all
        verify @one.json D problem.pddl --tasks all --json
        explain @one.json D problem.pddl
        explain @one.json D problem.pddl --task
        explain @one.json D problem.pddl --task --json
        understand @one.json D problem.pddl "w1 w2 w0" --json -o @plans.json
        understand @one.json D problem.pddl "w1 w2 w0"
        understand @one.json D problem.pddl "w1 w2 w0" --count
        understand @one.json D problem.pddl "w1 w2 w0" --sample 3 --seed 1
        understand @one.json D problem.pddl "w1 w2"
        say @one.json D problem.pddl @plans.json
        say @one.json D problem.pddl @plans.json --json
        plan @one.json D problem.pddl "w1 w0"
        plan @one.json D problem.pddl --prefer first:r2 --prefer most-plans --json
        plan @one.json D problem.pddl --prefer shortest --prefer "avoid:(at r1 c)"
        choices @one.json D problem.pddl "w1 w0"
        choices @one.json D problem.pddl "w1 w0" --format json -o @choices.json
        choices @one.json D problem.pddl "w1 w0" --robot r2 --json
        export @one.json D problem.pddl "w1 w0"
        export @one.json D problem.pddl "w1 w0" --json
        export @one.json D problem.pddl "w1 w0" --to ltlf
        export @one.json D problem.pddl "w1 w0" --to ltlf --json
        schema
        """,
    "t-map": """
        plans D problem.pddl --sample 3 --seed 1 --json
        check D problem.pddl --json
        build D problem.pddl --tasks all -o @greedy.json
        build D problem.pddl --tasks all --method separating -o @separating.json --json
        build D problem.pddl --tasks all --method minimal --certificate @proof.json -o @minimal.json
        build D problem.pddl --tasks all --method minimal --prefer flexible -o @flexible.json --json
        verify @minimal.json D problem.pddl --certificate @proof.json --json
        verify @minimal.json D problem.pddl --dimacs @proof.cnf --certificate @proof.json
        explain @minimal.json D problem.pddl
        explain @minimal.json D problem.pddl --json
        explain @minimal.json D problem.pddl --task
        explain @greedy.json D problem.pddl --task --json
        plan @minimal.json D problem.pddl --prefer first:r1 --json
        understand @minimal.json D problem.pddl "w0 w2 w1 w0"
        understand @minimal.json D problem.pddl "w0" --json
        choices @minimal.json D problem.pddl "w0 w2 w1 w0"
        export @minimal.json D problem.pddl "w0"
        export @minimal.json D problem.pddl "w0" --to ltlf
        """,
    "charger": """
        coordination D queue.pddl in-turn.pddl
        build D queue.pddl --tasks queue.tasks.json -o @greedy.json
        build D three-robots.pddl --method minimal -o @three.json
        build D three-robots.pddl --method separating -o @separating.json
        explain @three.json D three-robots.pddl --task --json
        """,
    "corridor": """
        build D problem.pddl --tasks rooms.tasks.json -o @greedy.json --json
        tasks D problem.pddl --start "(at r1 ?)" --goal "(at r1 c0-8)" --goal "(at r2 ?)" -o @t.json
        explain @greedy.json D problem.pddl --json
        plan @example.json D problem.pddl --prefer most-plans --heuristic projections
        """,
    "elevator": """
        check D one-robot.pddl --json
        build D two-calls.pddl --tasks all --method minimal -o @minimal.json
        build D two-calls.pddl --tasks all -o @greedy.json --json
        """,
    "flags": """
        plans D parade.pddl --sample 3 --seed 1
        build D parade.pddl --method minimal -o @minimal.json --certificate @proof.json
        build D parade.pddl --method separating -o @separating.json --json
        verify @minimal.json D parade.pddl --certificate @proof.json
        """,
    "grid": """
        inspect D gw3-2x4.pddl --states
        plans D corners-10x10.pddl --count
        plans D corners-8x8.pddl --sample 3 --seed 1
        plans D corners-8x8.pddl --count --json --cost makespan+actions
        build D gw1-2x2.pddl --tasks all -o @gw1-greedy.json --json
        build D gw1-2x2.pddl --tasks all --method minimal -o @gw1.json --certificate @gw1.proof.json
        build D gw2-2x3.pddl --tasks all --method minimal -o @gw2.json --json
        build D gw2-2x3.pddl --tasks all --method separating --alpha-only -o @gw2-alpha.json
        build D gw3-2x4.pddl --tasks all -o @gw3.json.gz
        build D gwb1-2x4.pddl --tasks all --method minimal -o @gwb1.json --prefer flexible
        build D gwb5-3x3.pddl --tasks gwb5-3x3.tasks.json --method minimal -o @gwb5.json
        build D corners-4x4.pddl --cost makespan+actions --method minimal -o @few-actions.json
        build D corners-3x3.pddl gw4-3x3.pddl --method separating -o @two-problems.json --json
        build D three-robots-3x3.pddl --method minimal -o @three.json --json
        build D three-robots-3x3.pddl -o @three-greedy.json
        verify @gw1.json D gw1-2x2.pddl --certificate @gw1.proof.json --json
        verify @three.json D three-robots-3x3.pddl
        verify @two-problems.json D corners-3x3.pddl gw4-3x3.pddl --json
        explain @gw2.json D gw2-2x3.pddl
        explain @gwb5.json D gwb5-3x3.pddl --task --json
        plan @few-actions.json D corners-4x4.pddl --prefer shortest
        plan @three.json D three-robots-3x3.pddl --prefer first:r3 --json
        report @gwb5.json D gwb5-3x3.pddl --seed 3 -o @gwb5.html
        """,
    "grid-joint": """
        coordination D t-map.pddl
        check D three-cells.pddl
        build D gw1-2x2.pddl --tasks all --method minimal -o @gw1.json --json
        """,
    "handover": """
        build D two-doors.pddl --tasks all -o @greedy.json --json
        build D three-rooms.pddl --method minimal -o @three.json
        plan @three.json D three-rooms.pddl --prefer shortest
        """,
    "lock": """
        build D three-robots.pddl -o @inseparable.json
        build D three-robots.pddl --remember-actions --method minimal -o @remember.json --json
        build D three-robots.pddl --remember-actions --cost makespan+actions -o @remember-cost.json
        build D both-in.pddl --tasks all --method minimal -o @minimal.json --certificate @proof.json
        verify @remember.json D three-robots.pddl
        verify @minimal.json D both-in.pddl --certificate @proof.json --json
        explain @remember.json D three-robots.pddl --task
        plan @remember.json D three-robots.pddl --prefer most-plans --json
        """,
    "push-box": """
        build D around.pddl --tasks all -o @greedy.json --json
        build D three-robots.pddl --method separating -o @three.json
        plan @three.json D three-robots.pddl --prefer shortest --json
        """,
    "tray": """
        build D serve.pddl --tasks all --method minimal -o @minimal.json --json
        build D three-robots.pddl --method minimal -o @three.json
        explain @three.json D three-robots.pddl --task
        plan @three.json D three-robots.pddl --prefer most-plans --json
        """,
    "two-arms": """
        build D exchange.pddl --tasks exchange.tasks.json -o @greedy.json --json
        """,
    "vans": """
        plans D alone.pddl --cost makespan+cost --json
        build D one-van.pddl --tasks one-van.tasks.json --method minimal -o @minimal.json --json
        build D two-vans.pddl --cost makespan+cost --method minimal -o @cost.json
        """,
}


@dataclass(frozen=True, slots=True)
class Command:
    """One command, as it is written above, of one world."""

    world: str
    line: str

    @property
    def name(self) -> str:
        """``WORLD/COMMAND`` with a file name made of the line."""
        words = re.sub(r"[^\w@.+=:-]+", "_", self.line).strip("_")
        return f"{self.world}/{words.replace('@', '')}"

    def arguments(self, folder: Path) -> list[str]:
        """The command line, with names of files in full."""
        here = DOMAINS / self.world
        words = [quoted or bare for quoted, bare in re.findall(r'"([^"]*)"|(\S+)', self.line)]
        return [self._argument(word, here, folder) for word in words]

    def _argument(self, word: str, here: Path, folder: Path) -> str:
        if word == "D":
            return str(here / "domain.pddl")
        if word.startswith("@"):
            return str(folder / self.world / word[1:])
        return str(here / word) if word.endswith((".pddl", ".tasks.json")) else word


def commands() -> list[Command]:
    """All commands, each after those that write what it reads."""
    found: list[Command] = []
    for world, named in PROBLEMS.items():
        problems = named.split()
        for lines, over in (
            (ON_EVERY_PROBLEM, problems),
            (ON_EVERY_EXAMPLE, problems[:1]),
            (COMMANDS[world], ["P"]),
        ):
            found += (
                Command(world, re.sub(r"\bP\b", f"{problem}.pddl", line.strip()))
                for problem in over
                for line in lines.strip().splitlines()
            )
    return found


def without_times(text: str, folder: Path) -> str:
    """The text without what differs from run to run."""
    text = text.replace(str(folder), "FOLDER")
    text = re.sub(r"\b\d+(\.\d+)? s\b", "# s", text)
    return re.sub(r'"seconds": (\{[^{}]*\}|[\d.e+-]+)', '"seconds": 0', text)


def run(program: str, command: Command, folder: Path) -> None:
    """Run one command; write its exit code and its stdout."""
    ended = subprocess.run(
        [program, *command.arguments(folder)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    place = folder / command.world / f"{command.name.split('/', 1)[1][:180]}.txt"
    place.write_text(f"exit code {ended.returncode}\n{without_times(ended.stdout, folder)}")


def settle(path: Path, folder: Path) -> None:
    """Take out of a written file what differs from run to run."""
    if path.suffix == ".json":
        record = json.loads(path.read_text())
        record.pop("producer", None)
        path.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    elif path.suffix == ".html":
        path.write_text(without_times(path.read_text(), folder))
    elif path.suffix == ".gz":
        plain = path.with_suffix("")
        plain.write_bytes(gzip.decompress(path.read_bytes()))
        path.unlink()
        settle(plain, folder)


def run_world(program: str, listed: list[Command], folder: Path) -> None:
    """Run the commands of one world in their order."""
    place = folder / listed[0].world
    place.mkdir(parents=True)
    for command in listed:
        run(program, command, folder)
    for path in sorted(place.iterdir()):
        settle(path, folder)


def main() -> int:
    """Run all commands, world by world."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the outputs go; emptied before")
    parser.add_argument("--program", default="coordlang", help="the executable of the version")
    parser.add_argument("--jobs", type=int, default=1, help="worlds at the same time (default: 1)")
    options = parser.parse_args()
    folder = options.folder.resolve()
    listed = commands()
    if shutil.which(options.program) is None:
        parser.error(f"there is no program {options.program}")
    if not DOMAINS.is_dir() or Path.cwd().is_relative_to(folder):
        parser.error("run it in a checkout, with another folder than that")
    shutil.rmtree(folder, ignore_errors=True)
    begin = perf_counter()
    worlds = [[*own] for _, own in groupby(listed, key=lambda command: command.world)]
    with ThreadPoolExecutor(options.jobs) as pool:
        list(pool.map(lambda here: run_world(options.program, here, folder), worlds))
    print(f"{len(listed)} commands in {perf_counter() - begin:.0f} s: {folder}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
