# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/cluster.md is executed: a scheduler, workers and the client are processes of their own."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.support.cluster import ENVIRONMENT, needs_distributed, running_cluster
from tests.support.domains import ROOT
from tests.support.jobs import until
from tests.support.pages import DOCS

PAGE = (DOCS / "cluster.md").read_text()


def command(name: str) -> str:
    """The one line of the block of this name."""
    found = re.search(rf"<!-- {name} -->\n```sh\n(.*)\n```\n", PAGE)
    assert found is not None, name
    return found[1]


def arguments(line: str) -> list[str]:
    """A command of the page for this Python."""
    program, *rest = shlex.split(line)
    known = {"coordlang": ["-m", "coordlang"], "python": []}
    return [sys.executable, *known[program], *rest]


def succeeds(line: str, folder: Path) -> str:
    done = subprocess.run(
        arguments(line), cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def language(path: Path) -> dict[str, Any]:
    """A language file without what depends on the run: the rest must be equal byte for byte."""
    data: dict[str, Any] = json.loads(path.read_text())
    del data["producer"]
    return data


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working directory like that of the page."""
    for name in ("domains", "docs"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


@needs_distributed
@pytest.mark.thorough
def test_one_machine_and_two_terminals(folder: Path) -> None:
    succeeds(command("resume"), folder)
    alone = (folder / "4x4.json").rename(folder / "alone.json")
    with running_cluster(folder, 1, command("scheduler"), command("workers")):
        succeeds(command("build").replace("--resume jobs", "--resume more"), folder)
        assert language(folder / "4x4.json") == language(alone)
        assert succeeds(command("verify"), folder).startswith("verified: ")


@needs_distributed
@pytest.mark.thorough
def test_the_cluster_of_the_page_has_two_workers_and_listens_on_this_machine_only(
    folder: Path,
) -> None:
    with running_cluster(folder, 1, command("scheduler"), command("workers")) as cluster:
        log = cluster.workers[0].log
        until(lambda: log.read_text().count("Registered to") >= 2, 60)
        hosts = [
            connection.laddr.ip
            for started in (cluster.scheduler, *cluster.workers)
            for process in started.processes()
            for connection in process.net_connections("inet")
            if connection.status == psutil.CONN_LISTEN
        ]
    assert len(hosts) >= 4  # the scheduler, two workers, and who starts them
    assert set(hosts) == {"127.0.0.1"}
