# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes of robots that act under a sentence in buildings of Open-RMF.

    python -m benchmarks.robots [ROW ..] [--runs N] [--kill] [--limit SECONDS] [--kept FILE]

A row is a building and a number of robots, ``office-2``, each of which drives to a place that is
drawn; there are some tasks for each row, those with a language within the limit (30). Every robot
is a process (forked when its choices are known), plays itself, and hears the others over ``--bus
unix``. With ``--kill`` one of them is killed at some moment before all are done, and started again.
The lines that the processes wrote are checked by definition: no event overlaps one that it
interferes with, and all events in the order of their starts are a plan that the independent checker
accepts. The columns: runs; runs in which something overlapped, in which somebody had not ended
after a minute, and in which all arrived; robots killed; events and messages of a run.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
import traceback
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import combinations
from pathlib import Path
from random import Random
from time import monotonic, sleep
from typing import Any

import coordlang
from benchmarks import frame
from benchmarks.frame import Figures, KeptRows, PrintedTable, columns, shared
from coordlang.commands.records import RobotOptions
from coordlang.commands.robot import RobotInTask, robot
from planners.check.rules import validate
from planners.joint.traces import Traces
from planners.loading import PlanningInstance
from planners.pddl import parse_domain, parse_problem
from planners.pddl.sexpr import Source
from planners.system.errors import CoordlangError
from planners.system.limits import time_limit

BUILDINGS = ("office", "hotel", "campus", "triple_H")
ROWS = [f"{name}-{robots}" for name in BUILDINGS for robots in (2, 3, 4)]
#: Tasks of a row, and how many are tried.
TASKS, TRIES = 5, 10
#: Metres a second, and seconds after which a run is stuck.
SPEED, STUCK = 60.0, 60.0
COLUMNS = columns(
    "row -18, tasks 5, runs 5, overlaps 8, stuck 5, arrived 7, killed 6, events 6, messages 8"
)

#: A team in a task, and the task's model.
Task = tuple[Mapping[str, RobotInTask], PlanningInstance]
#: What one robot did: the start, the end, what is done, and with whom it meets.
Span = tuple[float, float, str, tuple[str, ...]]


def spans(lines: Sequence[Mapping[str, Any]]) -> list[Span]:
    """The events of a robot by what its processes wrote; an event that is told again is one."""
    starts: dict[int, Mapping[str, Any]] = {}
    ends: dict[int, float] = {}
    for line in lines:
        if "start" in line:
            starts.setdefault(line["event"], line)
        elif "done" in line:
            ends[line["event"]] = line["time"]
    return [
        (line["time"], ends[number], line["start"], tuple(line.get("with", ())))
        for number, line in sorted(starts.items())
        if number in ends
    ]


def overlaps(did: Mapping[str, Sequence[Span]], loaded: PlanningInstance) -> list[str]:
    """The pairs of events that interfere, meet not, and overlap."""
    model = loaded.model.in_step
    interfering = Traces(model).interfering
    found = []
    for one, other in combinations(model.robots, 2):
        i, j = model.robots.index(one), model.robots.index(other)
        for start, end, text, met in did[one]:
            label = model.labels[i].index(text)
            for its_start, its_end, its, _ in did[other]:
                is_apart = end <= its_start or its_end <= start or other in met
                if not is_apart and interfering[i, j][label, model.labels[j].index(its)]:
                    found.append(f"{text} and {its}")
    return found


def has_arrived(did: Mapping[str, Sequence[Span]], loaded: PlanningInstance) -> bool:
    """Whether all events in the order of their starts, those that meet at once, are a plan."""
    robots, plan = loaded.model.robots, []
    waiting = sorted((span, name) for name in robots for span in did[name])
    while waiting:
        (_, _, text, met), own = waiting.pop(0)
        step = {own: text}
        for other in met:
            at = next(n for n, (_, name) in enumerate(waiting) if name == other)
            step[other] = waiting.pop(at)[0][2]
        plan.append(tuple(map(step.get, robots)))
    return validate(loaded.domain, loaded.problems[0], loaded.team, plan).valid


class Run:
    """One run of forked processes; ``lines`` are what each robot's processes wrote.

    ``bus`` is that of each robot; by default sockets in the folder.
    """

    def __init__(
        self,
        team: Mapping[str, RobotInTask],
        folder: Path,
        seed: int,
        bus: Mapping[str, str] | None = None,
    ) -> None:
        self.team, self.folder, self.random, self.seed = team, folder, Random(seed), seed
        self.bus = bus or dict.fromkeys(team, f"unix:{folder}")
        self.pids = {name: self._fork(name) for name in team}
        self.killed = 0

    def _fork(self, name: str) -> int:
        pid = os.fork()
        if pid:
            return pid
        code = 1
        try:
            with open(self.folder / f"{name}.lines", "a", buffering=1) as file:
                sys.stdin = None
                own = self.team[name]
                bus = self.bus[name]
                options = RobotOptions(robot=name, bus=bus, play=self.seed)
                own.act(options, lambda line: print(json.dumps(line), file=file), SPEED)
                file.write(json.dumps({"messages": own.executive.sent}) + "\n")
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)

    def wait(self, kill_at: float | None) -> bool:
        """Whether all ended well in time; one process is killed and started again at some time."""
        begun = monotonic()
        again: tuple[float, str] | None = None
        while self.pids or again:
            now = monotonic() - begun
            if now > STUCK:
                return self._end()
            is_due = kill_at is not None and now > kill_at and len(self.pids) == len(self.team)
            # When all parts are done, nobody stays for one that comes back.
            if is_due and not all(map(self._has_finished, self.team)):
                name = self.random.choice(sorted(self.pids))
                os.kill(self.pids[name], signal.SIGKILL)
                os.waitpid(self.pids.pop(name), 0)
                self.killed, kill_at = 1, None
                again = now + self.random.uniform(0, 0.3), name
            if again and now > again[0]:
                self.pids[again[1]] = self._fork(again[1])
                again = None
            for name, pid in [*self.pids.items()]:
                done, status = os.waitpid(pid, os.WNOHANG)
                if done:
                    del self.pids[name]
                    if status:
                        return self._end()
            sleep(0.002)
        return True

    def _has_finished(self, name: str) -> bool:
        return any("finished" in line for line in self.lines(name))

    def _end(self) -> bool:
        """End what has not ended: the run has failed."""
        for pid in self.pids.values():
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        return False

    def lines(self, name: str) -> list[dict[str, Any]]:
        """What the processes of a robot wrote; a last line that was cut off is left out."""
        path = self.folder / f"{name}.lines"
        text = path.read_text() if path.exists() else ""
        return [json.loads(line) for line in text.split("\n") if line.endswith("}")]


def tasks_of(name: str, robots: int, limit: float) -> Iterator[Task]:
    """Teams in tasks in a building, each robot to another place that is drawn.

    Tasks without a plan or a language within ``limit`` seconds are left out.
    """
    random = Random(f"{name} {robots}")
    path = shared("rmf") / f"{name}.building.yaml"
    site = coordlang.import_site(path, robots=robots)
    read = json.loads(site.texts["coordinates.json"])["coordinates"]
    points = {place: (x, y) for place, (x, y) in read.items()}
    found = 0
    for _ in range(TRIES):
        goals = random.sample(sorted(points), robots)
        pairs = [f"{own}:{place}" for own, place in zip(site.robots, goals, strict=True)]
        with suppress(CoordlangError), time_limit(limit):
            texts = coordlang.import_site(path, robots=robots, task=pairs).texts
            domain = parse_domain(Source("domain.pddl", texts["domain.pddl"]))
            problem = parse_problem(Source("problem.pddl", texts["problem.pddl"]), domain)
            loaded = coordlang.load(domain, problem, asynchronous=True)
            language = coordlang.build(loaded, problem, method="greedy").language
            of = partial(robot, language, loaded, problem, coordinates=points)
            team = {own: of(robot=own) for own in loaded.model.robots}
            found += 1
            yield team, loaded
        if found == TASKS:
            return


def measured(key: str, row: str, given: Namespace) -> Figures:
    """The figures of a row, to be kept under a key."""
    name, _, robots = row.rpartition("-")
    tasks, runs = [*tasks_of(name, int(robots), given.limit)], given.runs
    figures: Figures = dict.fromkeys(dict(COLUMNS), 0)
    figures |= {"row": key, "tasks": len(tasks), "runs": runs if tasks else 0}
    for seed in range(figures["runs"]):
        team, loaded = tasks[seed % len(tasks)]
        with tempfile.TemporaryDirectory() as folder:
            run = Run(team, Path(folder), seed)
            has_ended = run.wait(run.random.uniform(0, 0.6) if given.kill else None)
            lines = {own: run.lines(own) for own in team}
        did = {own: spans(its) for own, its in lines.items()}
        figures["stuck"] += not has_ended
        figures["killed"] += run.killed
        figures["overlaps"] += bool(overlaps(did, loaded))
        figures["arrived"] += has_ended and has_arrived(did, loaded)
        figures["events"] += sum(map(len, did.values()))
        figures["messages"] += sum(
            line.get("messages", 0) for its in lines.values() for line in its
        )
    for head in ("events", "messages"):
        figures[head] = round(figures[head] / max(1, runs))
    return figures


def main() -> None:
    """Print the rows that are asked for."""
    parser = frame.arguments(__doc__, 30)
    parser.add_argument("--runs", type=int, default=100, help="of a row (100)")
    parser.add_argument("--kill", action="store_true", help="kill one process in each run")
    given = parser.parse_args()
    kept = KeptRows(given.kept)
    table = PrintedTable(*COLUMNS)
    for row in frame.asked_for(ROWS, given.rows):
        key = f"{row}, {given.runs} runs{', killed' * given.kill}, {given.limit} s"
        figures = kept.get(key, partial(measured, key, row, given))
        table.print(row, *(figures[head] for head, _ in COLUMNS[1:]))


if __name__ == "__main__":
    main()
