# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's own logic: what it may know, and what it chooses."""

from __future__ import annotations

import ast
import dataclasses
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import get_args, get_type_hints

import coordlang.simulation.robot as logic
from coordlang.simulation.pace import Kind, Message
from coordlang.simulation.robot import Sensed, drawn
from tests.support.domains import ROOT
from tests.support.simulation import mission_of

#: What a robot's logic is made of, besides the standard library.
OWN = {
    "coordlang.execution.monitor",
    "coordlang.simulation.pace",
    "coordlang.simulation.robot",
}


def imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            assert node.module
            yield node.module


def test_the_logic_needs_the_standard_library_and_the_monitor_only() -> None:
    waiting, met = [logic.__name__], set[str]()
    while waiting:
        module = waiting.pop()
        met.add(module)
        for name in imported(ROOT / f"{module.replace('.', '/')}.py"):
            if name.split(".")[0] in sys.stdlib_module_names:
                continue
            assert name in OWN, f"{module} imports {name}"
            if name not in met:
                waiting.append(name)
    assert met == OWN


def test_numbers_and_texts_are_all_that_a_robot_is_told() -> None:
    """No object of the simulator, of another robot or of a plan: times, poses, counted messages."""
    assert get_type_hints(Sensed) == {
        "time": float,
        "pose": tuple[float, float, float],
        "ahead": float | None,
        "heard": tuple[Message, ...],
        "wanted": tuple[str, ...],
    }
    assert get_type_hints(Message) == {
        "sender": str,
        "kind": Kind,
        "number": int,
        "subaction": str,
    }
    assert get_args(Kind) == ("step", "word", "ended", "ready")
    assert all(dataclasses.fields(kind) for kind in (Sensed, Message))


def test_each_own_subplan_is_drawn_equally_often() -> None:
    given, _ = mission_of("corridor").team(0)["r1"]
    subplans = given.remaining
    assert subplans > 3
    random, found = Random(5), Counter[tuple[str | None, ...]]()
    for _ in range(100 * subplans):
        monitor, subplan = given.copy(), list[str | None]()
        while not monitor.finished:
            subplan.append(drawn(monitor, random, monitor.allowed()))
            monitor.did(subplan[-1])
        found[tuple(subplan)] += 1
    assert len(found) == subplans
    assert all(60 < number < 145 for number in found.values()), found
