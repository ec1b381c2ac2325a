# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/cluster.md is executed: a scheduler, workers and the client are processes of their own."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from importlib.util import find_spec
from itertools import pairwise
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


@needs_distributed
@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("openssl") is None, reason="the program openssl is not there")
def test_only_who_has_a_key_joins(folder: Path) -> None:
    key = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=coordlang"]
    subprocess.run(
        [*key, "-keyout", "key.pem", "-out", "cert.pem"],
        cwd=folder,
        check=True,
        capture_output=True,
    )
    shutil.copy(folder / "cert.pem", folder / "ca.pem")
    found = re.search(r"<!-- tls -->\n```sh\n(.*?)```\n", PAGE, re.DOTALL)
    assert found is not None
    (folder / "keys.sh").write_text(found[1])
    here = "--host 127.0.0.1"
    scheduler = (
        f"dask scheduler --protocol tls --no-dashboard {here} --scheduler-file scheduler.json"
    )
    worker = f"dask worker --no-dashboard {here} --protocol tls --scheduler-file scheduler.json"
    task = "domains/grid/domain.pddl domains/grid/corners-3x3.pddl"
    work = f"-m coordlang coordination {task} --scheduler scheduler.json"
    with running_cluster(
        folder, 1, f"sh -c '. ./keys.sh; exec {scheduler}'", f"sh -c '. ./keys.sh; exec {worker}'"
    ):
        for keys, code in (". ./keys.sh; ", 0), ("", 2):
            done = subprocess.run(
                ["sh", "-c", f"{keys}{sys.executable} {work}"],
                cwd=folder,
                env=ENVIRONMENT,
                capture_output=True,
                text=True,
            )
            assert done.returncode == code, done.stderr
            assert ("no Dask scheduler answers" in done.stderr) == (code == 2)


@pytest.mark.skipif(
    find_spec("dask_jobqueue") is None,
    reason="dask-jobqueue is not installed (pip install dask-jobqueue)",
)
def test_the_script_of_a_slurm_job(folder: Path) -> None:
    script = succeeds(command("slurm-print"), folder)
    asked = ("-p normal", "-n 1", "--cpus-per-task=4", "-t 02:00:00", "--job-name=coordlang")
    assert script.startswith("#!")
    assert {f"#SBATCH {option}" for option in asked} <= {*script.splitlines()}
    assert "#SBATCH --mem=" in script
    (started,) = (line for line in script.splitlines() if "distributed.cli.dask_worker" in line)
    options = dict(pairwise(shlex.split(started)))
    assert (options["--nworkers"], options["--nthreads"]) == ("4", "1")
    assert options["--memory-limit"] in ("3.73GiB", "4.00GB")
    assert "OMP_NUM_THREADS=1" in script
    subprocess.run(["sh", "-n"], input=script, text=True, check=True)
