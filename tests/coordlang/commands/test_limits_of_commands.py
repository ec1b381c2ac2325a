# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits, workers and kept plans on the command line: defaults, contradictions, remedies, damage."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from coordlang.language.file import read_language
from planners.search import portions
from planners.search.portions import estimate, require_room
from planners.system.errors import BadInput, OutOfMemory
from planners.system.limits import address_space, default_memory_limit, limited_memory, more_memory
from tests.support.cluster import needs_distributed
from tests.support.command import Command, on_a_terminal, own_process
from tests.support.domains import DOMAINS, T_MAP, all_tasks


@pytest.fixture
def limit_of(coordlang: Command, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """The soft limit of the memory while a command reads its files."""
    found: list[int] = []

    def reads(*_: object) -> None:
        found.append(resource.getrlimit(resource.RLIMIT_AS)[0])
        raise BadInput("enough")

    def call(*arguments: str) -> int:
        assert coordlang("plans", *T_MAP, *arguments).code == 31
        return found.pop()

    monkeypatch.setattr("coordlang.commands.inputs.read_domain", reads)
    return call


def test_the_memory_limit_has_a_default_that_can_be_switched_off(
    limit_of: Callable[..., int],
) -> None:
    import psutil

    before = resource.getrlimit(resource.RLIMIT_AS)
    found = limit_of()
    most = address_space() + 0.81 * psutil.virtual_memory().available
    assert address_space() < found < most + (1 << 30)
    for size, bytes_ in (("none", before[0]), ("900G", 900 << 30), ("9" * 400, 2**63 - 1)):
        assert limit_of("--memory-limit", size) == bytes_
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


def test_no_remedy_that_is_in_use() -> None:
    model = all_tasks("grid", "gw1-2x2").model
    assert model.smaller("fewer robots", "b") == "fewer robots, b or --cost makespan+actions"
    with limited_memory(900 << 30):
        assert "--memory-limit" in more_memory()
    if resource.getrlimit(resource.RLIMIT_AS)[0] == resource.RLIM_INFINITY:
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
        pytest.param(
            ("--scheduler", "none.json"), "dask scheduler --scheduler-file", marks=needs_distributed
        ),
        (("--memory-limit", "much"), "or none"),
        (("--resume", ""), "--resume"),
        (("--resume", "/dev/null/folder"), "--resume"),
    ],
)
def test_what_cannot_be_done_is_said_at_once(
    arguments: tuple[str, ...], message: str, coordlang: Command
) -> None:
    outcome = coordlang("coordination", *T_MAP, *arguments)
    assert outcome.code == 2
    assert message in outcome.err


def test_who_does_the_pieces_changes_nothing(coordlang: Command, tmp_path: Path) -> None:
    language = tmp_path / "l.json"
    assert coordlang("build", *T_MAP, "--method", "greedy", "-o", language).code == 0
    for command in (
        ("coordination", *T_MAP, "--json"),
        ("build", *T_MAP, "--method", "greedy", "-o", "-"),
        ("verify", language, *T_MAP, "--json"),
    ):
        kept = tmp_path / "kept" / command[0]
        given = ((), ("--jobs", 1), ("--jobs", 2), ("--resume", kept))
        answers = [json.loads(coordlang(*command, *arguments).out) for arguments in given]
        for answer in answers:
            answer.pop("producer", None)
        assert answers == answers[:1] * 4
        assert kept.is_dir()
        outcome = coordlang(*command, "--jobs", "2", "--scheduler", "tcp://127.0.0.1:9")
        assert (outcome.code, "Give one of them" in outcome.err) == (2, True)


#: Three words are found soon; whether two suffice is open after minutes.
HARD = [DOMAINS / "handover" / f"{stem}.pddl" for stem in ("domain", "exchange")]


def test_the_best_language_is_written(tmp_path: Path) -> None:
    """Interrupted once the first one is found, as the progress tells; with a time limit it is so in
    tests/coordlang/verification/test_certificate.py.
    """
    path, sent = tmp_path / "language.json", list[int]()

    def heard(said: str, process: subprocess.Popen[str]) -> None:
        if not sent and " needed: round " in said:
            process.send_signal(signal.SIGINT)
            sent.append(signal.SIGINT)

    build = ("build", *HARD, "--tasks", "all", "--method", "minimal", "-o", path, "--json")
    ended = on_a_terminal(own_process(*build), heard)
    assert ended.code == 130, ended
    assert "interrupted; the best language so far is written" in ended.err
    assert json.loads(ended.out)["proved_minimal"] is False
    guarantee = read_language(path).guarantee
    assert guarantee.method == "minimal"
    assert 2 <= guarantee.lower_bound < guarantee.size
    assert not guarantee.proved_minimal
    assert [p.name for p in path.parent.iterdir()] == [path.name]


# ---- plans that are kept

GRID = DOMAINS / "grid" / "domain.pddl", DOMAINS / "grid" / "gw4-3x3.pddl"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("COORDLANG_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_no_command_searches_again(
    coordlang: Command, folder: Path, tmp_path: Path, searches: list[str]
) -> None:
    language, plan = tmp_path / "l.json", tmp_path / "plan"
    build = ("build", *GRID, "--method", "greedy", "-o", language, "--jobs", 1)
    assert coordlang(*build).code == 0
    (entry,) = folder.glob("plans-*/*")
    outcome = coordlang("plans", *GRID, "--max", 1, "--format", "ipc")
    plan.write_text(outcome.out)
    sentence = coordlang("say", language, *GRID, plan).out.strip()
    every = (
        ("plans", *GRID, "--count"),
        ("coordination", *GRID, "--jobs", 1),
        ("verify", language, *GRID, "--jobs", 1),
        ("say", language, *GRID, plan),
        ("understand", language, *GRID, sentence, "--count"),
        ("plan", language, *GRID, sentence),
        ("choices", language, *GRID, sentence, "--robot", "r1"),
        ("explain", language, *GRID),
        ("export", language, *GRID, sentence, "--to", "ltlf"),
        ("report", language, *GRID, "-o", "-"),
    )
    before = [coordlang(*arguments, "--no-cache") for arguments in every]
    searches.clear()
    for arguments, outcome in zip(every, before, strict=True):
        assert coordlang(*arguments) == outcome, arguments
        assert outcome.code == 0, arguments
    assert coordlang(*build).code == 0
    assert searches == []
    assert list(folder.glob("plans-*/*")) == [entry]


def test_no_cache_reads_and_keeps_nothing(
    coordlang: Command, folder: Path, monkeypatch: pytest.MonkeyPatch, searches: list[str]
) -> None:
    arguments = ("plans", *GRID, "--count")
    assert coordlang(*arguments, "--no-cache").out == "18\n"
    monkeypatch.setenv("COORDLANG_CACHE", "off")
    assert coordlang(*arguments).out == "18\n"
    assert not folder.exists()
    monkeypatch.setenv("COORDLANG_CACHE", str(folder))
    assert coordlang(*arguments).out == "18\n"
    assert len(searches) == 3
    assert coordlang(*arguments).out == "18\n"
    assert len(searches) == 3
    assert coordlang(*arguments, "--no-cache").out == "18\n"
    assert len(searches) == 4
