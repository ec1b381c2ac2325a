# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands that write, with their outputs, and what of an output is the same in every run."""

from __future__ import annotations

import gzip
import json
import re
from dataclasses import dataclass
from pathlib import Path

import coordlang
from coordlang.verification.certificate_file import write_certificate
from tests.support.domains import DOMAINS

FILES = [str(DOMAINS / "grid" / name) for name in ("domain.pddl", "gw1-2x2.pddl")]


ALL = [*FILES, "--tasks", "all", "--method", "minimal"]


OLD = b"the old file\n"


@dataclass(frozen=True)
class Writing:
    """A command that writes: its arguments, and its outputs in the working directory."""

    arguments: tuple[str, ...]
    outputs: tuple[str, ...] = ()


SAID = ("LANGUAGE", *FILES, "SENTENCE")


WRITING = {
    "build": Writing(("build", *ALL, "-o", "l.json"), ("l.json",)),
    "certificate": Writing(
        ("build", *ALL, "-o", "l.json.gz", "--certificate", "c.json.gz"),
        ("l.json.gz", "c.json.gz"),
    ),
    "tasks": Writing(
        ("tasks", *FILES, "--start", "(at r1 ?)", "--goal", "(at r1 ?)", "-o", "t.json"),
        ("t.json",),
    ),
    "lift": Writing(("lift", *FILES, "--complexity", "5", "-o", "f.json.gz"), ("f.json.gz",)),
    "ground": Writing(("ground", "LIFTED", *FILES, "-o", "l.json"), ("l.json",)),
    "understand": Writing(("understand", *SAID, "--max", "5", "-o", "p.txt"), ("p.txt",)),
    "choices": Writing(("choices", *SAID, "--json", "-o", "c.json"), ("c.json",)),
    "export": Writing(("export", *SAID, "-o", "."), ("domain.pddl", "problem.pddl")),
    "inspect": Writing(("inspect", *FILES, "--write", "."), ("domain.pddl", "problem.pddl")),
    "verify": Writing(
        ("verify", "LANGUAGE", *FILES, "--certificate", "PROOF", "--dimacs", "f.cnf"), ("f.cnf",)
    ),
    "report": Writing(("report", "LANGUAGE", *FILES, "-o", "page.html"), ("page.html",)),
    "check": Writing(("check", *FILES)),
}


def given(folder: Path) -> dict[str, str]:
    """A language file, its certificate, a lifted file and a sentence, by the names that `WRITING` has for them."""
    language, proof = folder / "language.json", folder / "proof.json"
    lifted = folder / "lifted.json"
    built = coordlang.build(*FILES, tasks="all", method="minimal")
    built.language.save(language)
    write_certificate(built.certificate(), proof)
    coordlang.lift(*FILES, tasks="all", jobs=1).save(lifted)
    plan = coordlang.plan(built.language, *FILES, prefer=["shortest"])
    files = {"LANGUAGE": str(language), "PROOF": str(proof), "LIFTED": str(lifted)}
    return {**files, "SENTENCE": plan.sentence}


def normal(name: str, data: bytes) -> bytes:
    """The content, without the seconds that work took; the last line of results may be cut off."""
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    if name.endswith(".jsonl"):
        lines = [json.loads(line) for line in data.split(b"\n")[:-1]]
        for line in lines:
            line.pop("seconds"), line.pop("cpu")
        return b"\n".join(sorted(json.dumps(line).encode() for line in lines))
    data = re.sub(rb"\d+ seconds of processor time", b"0 seconds", data)
    return re.sub(rb"\d+\.\d+( s)?(?=\D)", b"0.0", data)
