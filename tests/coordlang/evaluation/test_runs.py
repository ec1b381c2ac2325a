# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs: killed ones go on, processes do not matter, limits are kept, results say what they were
made with.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from coordlang.evaluation.experiments.registry import RECIPES
from coordlang.evaluation.lab.recipe import Settings
from coordlang.evaluation.lab.results import Results
from coordlang.evaluation.lab.runner import Progress, UnitFailed, run
from planners.errors import BadInput, UsageError
from planners.pieces.processes import Processes
from tests.support.command import Command, own_process
from tests.support.domains import DOMAINS

GAME, COMMUNICATION = RECIPES["game"], RECIPES["communication"]


def settings(folder: Path, **others: Any) -> Settings:
    return Settings(DOMAINS, folder / "cache", samples=2, quick=True, **others)


def lines(folder: Path, name: str) -> list[dict[str, Any]]:
    """The lines of a results file, without what depends on the clock."""
    found = [json.loads(line) for line in (folder / f"{name}.jsonl").read_text().splitlines()]
    return [
        {key: value for key, value in line.items() if key not in ("seconds", "cpu")}
        for line in found
    ]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of `game` in one process."""
    folder = tmp_path_factory.mktemp("finished")
    run([GAME], settings(folder), Results(folder))
    return folder


def test_a_line_says_what_it_was_made_with(finished: Path) -> None:
    for line in lines(finished, "game"):
        assert line["status"] == "done"
        assert line["seed"] == 0
        assert set(line["versions"]) >= {"coordlang", "python", "numpy", "python-sat"}
        assert all(
            len(found) == 64 for found in (line["id"], line["code"], *line["inputs"].values())
        )
        assert any(name.endswith("domain.pddl") for name in line["inputs"])
    keys = [line["key"] for line in lines(finished, "game")]
    assert keys == [unit.key for unit in GAME.units(settings(finished))]


@pytest.mark.thorough
def test_processes_do_not_matter(finished: Path, tmp_path: Path) -> None:
    run([GAME], settings(tmp_path), Results(tmp_path), Processes(jobs=3))
    assert lines(tmp_path, "game") == lines(finished, "game")


@pytest.mark.thorough
def test_known_results_are_not_run_again(finished: Path, tmp_path: Path) -> None:
    whole = (finished / "game.jsonl").read_text()
    kept = whole.splitlines(keepends=True)
    # As a kill leaves it: two lines, in another order, and the third cut off in the middle.
    (tmp_path / "game.jsonl").write_text(kept[3] + kept[0] + kept[1][:50])
    seen: list[Progress] = []
    run([GAME], settings(tmp_path), Results(tmp_path), progress=seen.append)
    assert (seen[0].known, seen[0].done, seen[0].all) == (2, 2, len(kept))
    again = (tmp_path / "game.jsonl").read_text().splitlines(keepends=True)
    assert (again[0], again[3]) == (kept[0], kept[3])  # with their seconds: they were not run
    assert lines(tmp_path, "game") == lines(finished, "game")
    seen.clear()
    run([GAME], settings(tmp_path), Results(tmp_path), progress=seen.append)
    assert [p.done for p in seen] == [len(kept)]


def test_a_first_line_that_was_cut_off(finished: Path, tmp_path: Path) -> None:
    (tmp_path / "game.jsonl").write_bytes((finished / "game.jsonl").read_bytes()[:40])
    results = Results(tmp_path)
    assert results.lines("game") == {}
    results.start("game")
    assert (tmp_path / "game.jsonl").read_bytes() == b""


def test_other_parameters_are_other_results(finished: Path, tmp_path: Path) -> None:
    (tmp_path / "game.jsonl").write_bytes((finished / "game.jsonl").read_bytes())
    units, results = GAME.units(settings(tmp_path)), Results(tmp_path)
    assert len(results.known(units, settings(tmp_path))) == len(units)
    assert results.known(units, settings(tmp_path, seed=1)) == {}
    more = Settings(DOMAINS, tmp_path, samples=3, quick=True)
    assert results.known(GAME.units(more), more) == {}


def start(folder: Path, *arguments: str) -> subprocess.Popen[bytes]:
    options = ("--quick", "--samples", "2", "--results", folder, "--domains", DOMAINS)
    return subprocess.Popen(
        own_process("evaluate", "game", *options, *arguments),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def wait_for_lines(path: Path, number: int, process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + 120
    while not path.exists() or path.read_bytes().count(b"\n") < number:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.thorough
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_run_goes_on(finished: Path, tmp_path: Path, how: signal.Signals) -> None:
    process = start(tmp_path, "--jobs", "1")
    wait_for_lines(tmp_path / "game.jsonl", 2, process)
    os.kill(process.pid, how)
    _, said = process.communicate(timeout=60)
    if how == signal.SIGINT:
        assert process.returncode == 130
        assert b"the same command goes on from there" in said
    else:
        assert process.returncode == -signal.SIGKILL
    before = [json.loads(line) for line in (tmp_path / "game.jsonl").read_text().splitlines()]
    assert 2 <= len(before) < len(GAME.units(settings(tmp_path)))
    again = start(tmp_path, "--jobs", "2")
    _, said = again.communicate(timeout=120)
    assert again.returncode == 0, said
    assert lines(tmp_path, "game") == lines(finished, "game")
    after = {
        line["id"]: line
        for line in map(json.loads, (tmp_path / "game.jsonl").read_text().splitlines())
    }
    assert all(after[line["id"]] == line for line in before)
    assert (tmp_path / "evaluation.md").read_text().startswith("# Evaluation\n")


def test_limits_of_units(tmp_path: Path) -> None:
    quick = settings(tmp_path, unit_limit=0.01)
    found = run([COMMUNICATION], quick, Results(tmp_path))["communication"]
    assert {record.status for record in found} == {"out of time"}
    assert {record.seconds < 20 for record in found} == {True}
    results, units = Results(tmp_path), COMMUNICATION.units(quick)
    assert len(results.known(units, quick)) == len(units)
    assert results.known(units, settings(tmp_path, unit_limit=60)) == {}  # more time: tried again
    section = COMMUNICATION.section(found)
    assert section.figures == ()
    assert section.differences == ()


def test_no_two_runs_into_one_folder(tmp_path: Path) -> None:
    with Results(tmp_path).locked(), pytest.raises(UsageError, match="another run"):
        run([GAME], settings(tmp_path), Results(tmp_path))


def test_a_file_that_holds_no_results(tmp_path: Path) -> None:
    (tmp_path / "game.jsonl").write_text('{"id": "x"}\n[1, 2]\n{"id": "y"}\n')
    with pytest.raises(BadInput, match=r"game.jsonl:2"):
        Results(tmp_path).lines("game")
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be made"):
        Results(tmp_path / "file" / "below")


def test_an_error_ends_the_run_and_keeps_what_is_done(finished: Path, tmp_path: Path) -> None:
    domains = tmp_path / "domains"
    (domains / "handover").mkdir(parents=True)
    (domains / "grid").symlink_to(DOMAINS / "grid")
    (domains / "handover" / "domain.pddl").write_text("(define")
    (domains / "handover" / "two-doors.pddl").write_text("")
    broken = Settings(domains, tmp_path / "cache", samples=2, quick=True)
    with pytest.raises(UnitFailed, match=r"game/handover/.*domain.pddl") as failed:
        run([GAME], broken, Results(tmp_path))
    assert failed.value.exit_code == 31


def test_languages_that_cannot_be_kept_are_no_bug(tmp_path: Path) -> None:
    """A worker meets it when it keeps a language for other units."""
    (tmp_path / "cache").write_text("in the way")
    with pytest.raises(UnitFailed, match=r"cache cannot be written: File exists") as failed:
        run([GAME], settings(tmp_path), Results(tmp_path))
    assert failed.value.exit_code == 2


def test_command(coordlang: Command, tmp_path: Path) -> None:
    common = ("--domains", DOMAINS, "--results", tmp_path, "--jobs", 1)
    done = coordlang("evaluate", "game", "--quick", "--samples", 1, "--json", *common)
    assert done.code == 0
    told = json.loads(done.out)
    assert told["results"]["game"][0]["key"] == "GWB5/greedy"
    assert sorted(path.name for path in tmp_path.glob("*.svg")) == ["game.svg"]
    assert (tmp_path / "png" / "game.png").read_bytes().startswith(b"\x89PNG")
    assert str(tmp_path / "game.svg") in told["files"]
    text = coordlang(
        "evaluate", "game", "--quick", "--samples", 1, "--page", tmp_path / "page.md", *common
    )
    assert "| plan |" in text.out
    assert f"page {tmp_path / 'page.md'}" in text.err
    assert "![Proposals until accepted" in (tmp_path / "page.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["everything"], 2, "there is no experiment 'everything'"),
        ([], 2, "Missing argument"),
        (["game", "--domains", "no/such"], 2, "no domains in no/such"),
        (["game", "--samples", "0"], 2, "--samples"),
        (["game", "--page", "no/such/page.md"], 2, "there is no folder no/such"),
        (["game", "--time-limit", "0.3"], 23, "time limit"),
    ],
)
def test_errors(
    coordlang: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    found = coordlang("evaluate", *arguments)
    assert found.code == code
    assert message in found.err
