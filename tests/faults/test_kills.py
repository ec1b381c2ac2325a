# SPDX-License-Identifier: GPL-3.0-or-later
"""Kills at random moments: an output is the old file or the new one, and nothing else is left."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import time
from pathlib import Path

import pytest

from tests.support.command import Outcome
from tests.support.domains import DOMAINS
from tests.support.forks import fork_command, fresh_command
from tests.support.writing import OLD, WRITING, Stage, given

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: What a kill that nobody can hear may leave, beside an output and in the temporary directory:
#: there is also a file with which Python tries whether it can write to that directory.
LEFT = re.compile(r"[a-z0-9_]{8}|\.[^/]{1,16}\.[a-z0-9_]{8}|coordlang-[a-z0-9_]{8}(/.*)?|\.lock")


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return given(tmp_path_factory.mktemp("given"))


def kill(stage: Stage, number: signal.Signals, choice: random.Random, *, fresh: bool) -> Outcome:
    """Send the signal at a random moment, or when something in the folder changes."""
    for name in WRITING[stage.name][1]:
        if choice.random() < 0.5:
            stage.make_old(name)
    before = stage.others()
    process = stage.start(fresh=fresh)
    end = time.monotonic() + (60 if choice.random() < 0.4 else choice.uniform(0.0, 1.5))
    while time.monotonic() < end and not process.ended() and stage.others() == before:
        time.sleep(0.0003)
    process.send(number)
    ended, left = process.join(), stage.others() - before
    if number == signal.SIGKILL:
        assert ended.code in (0, -number), ended
        assert all(map(LEFT.fullmatch, left)), left
        return ended
    # Before the first line of the program the system or Python hears the signal.
    codes = [0, 128 + number, -number]
    if number == signal.SIGINT and ended.err.startswith("Fatal Python error: init_import_"):
        codes.append(1)  # Python's own end where it cannot load its module `site`
    assert ended.code in codes, ended
    assert left == set(), (left, number, ended)
    assert ended.code != 128 + number or "Traceback" not in ended.err
    return ended


@pytest.mark.parametrize("name", WRITING)
@pytest.mark.parametrize("times", [2, pytest.param(40, marks=pytest.mark.slow)])
def test_kills(times: int, name: str, tmp_path: Path, said: dict[str, str]) -> None:
    stage, choice = Stage(name, tmp_path, said), random.Random(name)
    seen: set[tuple[str, bytes]] = set()
    for turn in range(times):
        kill(stage, SIGNALS[(turn + len(name)) % len(SIGNALS)], choice, fresh=times > 2)
        seen |= {*stage.outputs().items()}
    ended = stage.start().join(300)
    assert ended.code == 0, ended
    new = stage.outputs()
    for output, held in seen:
        if b'"proved_minimal": false' in held:  # the best language at that moment
            assert json.loads(held)["guarantee"]["lower_bound"] <= 3
        else:
            assert held in (OLD, new[output]), (output, held[:300])


@pytest.mark.parametrize("times", [8, pytest.param(80, marks=pytest.mark.slow)])
def test_copies_of_domains_are_whole_or_not_there(times: int, tmp_path: Path) -> None:
    choice, command = random.Random(2), fork_command if times < 80 else fresh_command
    whole = {p.name: p.read_bytes() for p in (DOMAINS / "grid").iterdir()}
    copies = 0
    for turn in range(times):
        target, number = tmp_path / str(turn), SIGNALS[turn % len(SIGNALS)]
        process = command("domains", "--copy", "grid", target)
        end = time.monotonic() + (60 if choice.random() < 0.6 else choice.uniform(0.0, 0.4))
        seen = choice.randrange(len(whole))  # files that are there
        while time.monotonic() < end and not process.ended():
            if len([name for _, _, names in os.walk(target) for name in names]) > seen:
                break
        process.send(number)
        ended = process.join()
        assert ended.code in (0, 128 + number, -number), ended
        found = {p.name for p in target.iterdir()} if target.exists() else set()
        if "grid" in found:
            copies += 1
            assert {p.name: p.read_bytes() for p in (target / "grid").iterdir()} == whole
        found -= {"grid"}
        assert not found or number == signal.SIGKILL
        assert all(re.fullmatch(r"\.coordlang\.[a-z0-9_]{8}", name) for name in found)
    assert 0 < copies < 80


def test_two_processes_write_one_output(tmp_path: Path, said: dict[str, str]) -> None:
    stage = Stage("tasks", tmp_path, said)
    both = [stage.start(), stage.start()]
    assert [process.join().code for process in both] == [0, 0]
    assert stage.others() == set()
    written = stage.outputs()
    assert stage.start().join().code == 0
    assert stage.outputs() == written
