# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits and workers on the command line: defaults, contradictions, and remedies that are none yet."""

from __future__ import annotations

import resource
from dataclasses import dataclass
from pathlib import Path

import pytest
from click.testing import CliRunner

from coordlang.commands.command import command_of
from coordlang.commands.inputs import Arguments, public
from coordlang.commands.options import CommandOptions
from planners.search import portions
from planners.search.portions import estimate, require_room
from planners.system.errors import OutOfMemory
from planners.system.limits import address_space, default_memory_limit, limited_memory, more_memory
from tests.support.cluster import needs_distributed
from tests.support.command import Command
from tests.support.domains import all_tasks

FREE = resource.RLIM_INFINITY


@dataclass(frozen=True, slots=True)
class Nothing(CommandOptions):
    """No options."""

    keeps_plans = False


class Probe:
    """A command that prints the soft limit."""

    @staticmethod
    @public(Nothing)
    def probe(_: Arguments, __: Nothing) -> int:
        return resource.getrlimit(resource.RLIMIT_AS)[0]

    @staticmethod
    def show_probe(found: int, _: Nothing) -> None:
        print(found)


def limit_of(*arguments: str) -> int:
    probe = command_of("probe", Nothing, lambda _: Probe)
    done = CliRunner().invoke(probe, arguments, standalone_mode=False)
    assert done.exception is None, done.exception
    return int(done.output)


def test_the_memory_limit_has_a_default_that_can_be_switched_off() -> None:
    import psutil

    before = resource.getrlimit(resource.RLIMIT_AS)
    found = limit_of()
    most = address_space() + 0.81 * psutil.virtual_memory().available
    assert address_space() < found < most + (1 << 30)
    assert limit_of("--memory-limit", "none") == before[0]
    assert limit_of("--memory-limit", "900G") == 900 << 30
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_a_control_group_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from planners.system import limits as module

    own = tmp_path / "job"
    own.mkdir()
    (own / "memory.max").write_text("1073741824\n")
    (own / "memory.current").write_text("536870912\n")
    (own / "memory.stat").write_text("anon 1\ninactive_file 268435456\n")
    monkeypatch.setattr(module, "_memory_groups", lambda: iter([tmp_path, own]))
    assert module._group_memory_left() == (1024 - 512 + 256) << 20
    assert default_memory_limit() <= address_space() + int(0.8 * (768 << 20)) + (64 << 20)
    (own / "memory.max").write_text("max\n")
    assert module._group_memory_left() > 1 << 50


def test_no_remedy_that_is_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    model = all_tasks("grid", "gw1-2x2").model
    assert model.smaller("fewer robots", "b") == "fewer robots, b or --cost makespan+actions"
    with limited_memory(900 << 30):
        assert "--memory-limit" in more_memory()
    if resource.getrlimit(resource.RLIMIT_AS)[0] == FREE:
        assert "--memory-limit" not in more_memory()


def test_the_size_is_said_before_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    candidates = all_tasks("grid", "gw1-2x2")
    found = estimate(candidates.source)
    assert (found.goals, found.nodes, found.robots) == (12, sum(map(len, candidates.spaces)), 2)
    require_room(candidates.source)
    monkeypatch.setattr(portions, "_LARGE", 0)
    monkeypatch.setattr(portions, "memory_left", lambda: 1000)
    with pytest.raises(OutOfMemory, match=r"12 goals, up to 144 nodes of plans x 2 robots"):
        require_room(candidates.source)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--jobs", "0"), "--jobs"),
        (("--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"), "Give one of them"),
        pytest.param(
            ("--scheduler", "none.json"), "dask scheduler --scheduler-file", marks=needs_distributed
        ),
        (("--memory-limit", "much"), "or none"),
        (("--resume", ""), "--resume"),
        (("--resume", "/dev/null/folder"), "--resume"),
    ],
)
def test_what_cannot_be_done_is_said_at_once(
    arguments: tuple[str, ...], message: str, coordlang: Command, t_map: tuple[Path, Path]
) -> None:
    outcome = coordlang("coordination", *t_map, *arguments)
    assert outcome.code == 2
    assert message in outcome.err


def test_pieces_on_the_command_line(
    coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    outcomes = {
        coordlang("coordination", *t_map, "--json", *arguments)
        for arguments in ((), ("--jobs", 1), ("--jobs", 2), ("--resume", tmp_path / "kept"))
    }
    assert len(outcomes) == 1
    assert len(list((tmp_path / "kept").iterdir())) == 1


def test_every_command_hands_on_who_does_the_pieces(
    coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path
) -> None:
    language = tmp_path / "l.json"
    assert coordlang("build", *t_map, "--method", "greedy", "-o", language).code == 0
    for command in (
        ("coordination", *t_map),
        ("build", *t_map, "-o", language),
        ("verify", language, *t_map),
    ):
        outcome = coordlang(*command, "--jobs", "2", "--scheduler", "tcp://127.0.0.1:9")
        assert (outcome.code, "Give one of them" in outcome.err) == (2, True)
        coordlang(*command, "--resume", tmp_path / "kept" / command[0])
        assert (tmp_path / "kept" / command[0]).is_dir()
