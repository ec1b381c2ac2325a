# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that write, run under a fault: what they leave, and what is the same in every run."""

from __future__ import annotations

import gzip
import os
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import coordlang
from coordlang.verification.certificate_file import write_certificate
from tests.support.domains import DOMAINS
from tests.support.forks import Fork, fork_command, fresh_command

FILES = [str(DOMAINS / "grid" / name) for name in ("domain.pddl", "gw1-2x2.pddl")]
ALL = (*FILES, "--tasks", "all", "--method", "minimal")
SAID = ("LANGUAGE", *FILES, "SENTENCE")
OLD = b"the old file\n"
#: Commands: their arguments, and their outputs in the working directory.
WRITING: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "build": (("build", *ALL, "-o", "l.json"), ("l.json",)),
    "certificate": (
        ("build", *ALL, "-o", "l.json.gz", "--certificate", "c.json.gz"),
        ("l.json.gz", "c.json.gz"),
    ),
    "tasks": (
        ("tasks", *FILES, "--start", "(at r1 ?)", "--goal", "(at r1 ?)", "-o", "t.json"),
        ("t.json",),
    ),
    "lift": (("lift", *FILES, "--complexity", "5", "-o", "f.json.gz"), ("f.json.gz",)),
    "ground": (("ground", "LIFTED", *FILES, "-o", "l.json"), ("l.json",)),
    "understand": (("understand", *SAID, "--max", "5", "-o", "p.txt"), ("p.txt",)),
    "choices": (("choices", *SAID, "--json", "-o", "c.json"), ("c.json",)),
    "export": (("export", *SAID, "-o", "."), ("domain.pddl", "problem.pddl")),
    "inspect": (("inspect", *FILES, "--write", "."), ("domain.pddl", "problem.pddl")),
    "verify": (
        ("verify", "LANGUAGE", *FILES, "--certificate", "PROOF", "--dimacs", "f.cnf"),
        ("f.cnf",),
    ),
    "report": (("report", "LANGUAGE", *FILES, "-o", "page.html"), ("page.html",)),
    "check": (("check", *FILES), ()),
}


def given(folder: Path) -> dict[str, str]:
    """What `WRITING` has names for; the libraries that commands use are loaded then."""
    files = {name: str(folder / f"{name}.json") for name in ("LANGUAGE", "PROOF", "LIFTED")}
    built = coordlang.build(*FILES, tasks="all", method="minimal")
    built.language.save(files["LANGUAGE"])
    write_certificate(built.certificate(), files["PROOF"])
    coordlang.lift(*FILES, tasks="all", jobs=1).save(files["LIFTED"])
    plan = coordlang.plan(built.language, *FILES, prefer=["shortest"])
    return {**files, "SENTENCE": plan.sentence}


@dataclass
class Stage:
    """A working directory and one for temporary files, in which one of `WRITING` is run."""

    name: str
    folder: Path
    said: dict[str, str]

    def __post_init__(self) -> None:
        for name in ("work", "tmp"):
            (self.folder / name).mkdir(parents=True)

    def start(self, fault: Callable[[], object] = lambda: None, *, fresh: bool = False) -> Fork:
        """Run it under a fault that is made in its process."""
        arguments = [self.said.get(argument, argument) for argument in WRITING[self.name][0]]

        def before() -> None:
            os.chdir(self.folder / "work")
            os.environ["TMPDIR"] = tempfile.tempdir = str(self.folder / "tmp")
            fault()

        return (fresh_command if fresh else fork_command)(*arguments, before=before)

    def make_old(self, name: str) -> None:
        """An output that was there before."""
        (self.folder / "work" / name).write_bytes(OLD)

    def outputs(self) -> dict[str, bytes]:
        """What its outputs hold, but for what differs from run to run."""
        paths = {name: self.folder / "work" / name for name in WRITING[self.name][1]}
        return {name: normal(path.read_bytes()) for name, path in paths.items() if path.exists()}

    def others(self) -> set[str]:
        """All other files and folders."""
        roots = (self.folder / "work", self.folder / "tmp")
        found = {str(p.relative_to(root)) for root in roots for p in root.rglob("*")}
        return found - {*WRITING[self.name][1]}


def normal(data: bytes) -> bytes:
    """The content, without the seconds that work took."""
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    data = re.sub(rb"\d+ seconds of processor time", b"0 seconds", data)
    return re.sub(rb"\d+\.\d+( s)?(?=\D)", b"0.0", data)
