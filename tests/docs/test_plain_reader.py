# SPDX-License-Identifier: GPL-3.0-or-later
"""The reader of docs/formats.md, without coordlang, says the same sentences as the package."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest

from coordlang.commands.main import run
from coordlang.language.candidates import all_pairs
from coordlang.language.file import read_language
from coordlang.language.listed import read_task_file
from coordlang.language.recorded import options_of
from coordlang.language.sentences import sentence
from planners.search.plans import Plans, counts
from tests.support.domains import ROOT, read
from tests.support.pages import DOCS, blocks

DOMAIN, PROBLEM = (ROOT / "domains" / "t-map" / name for name in ("domain.pddl", "problem.pddl"))


@pytest.fixture(scope="module")
def reader() -> dict[str, Any]:
    text = next(b.text for b in blocks(DOCS / "formats.md") if b.kind == "python")
    namespace: dict[str, Any] = {}
    exec(text, namespace)
    return namespace


def test_reader_needs_the_standard_library_only() -> None:
    text = next(b.text for b in blocks(DOCS / "formats.md") if b.kind == "python")
    assert len(text.splitlines()) < 40
    imported = set(re.findall(r"(?m)^ *(?:import|from) (\w+)", text))
    assert imported
    assert imported <= sys.stdlib_module_names


@pytest.mark.parametrize("flags", [[], ["--remember-actions"]], ids=["states", "actions"])
@pytest.mark.parametrize("ending", [".json", ".json.gz"])
def test_reader_says_the_same(
    flags: list[str], ending: str, reader: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / f"language{ending}"
    build = "build", str(DOMAIN), str(PROBLEM), "--method", "greedy"
    assert run([*build, "--tasks", "all", "-o", str(path), *flags]) == 0
    plain = reader["read_language"](path)
    language = read_language(path)
    domain, problem = read("t-map")
    candidates = all_pairs(domain, [problem], options_of(language))
    table = language.partition(candidates.model)
    codec = candidates.model.codec
    compared, words = 0, set()
    for space in candidates.spaces:
        counted, word = counts(space), table.word_of(space.rows)
        for start in space.starts.tolist():
            for plan in Plans(space, start, counted):
                states = Plans(space, start, counted).states(plan)
                expected = [language.words[w] for w in sentence(int(word[s]) for s in states)]
                atoms = [set(codec.decode(space.rows[s])) for s in states]  # in no order
                assert reader["sentence"](plain, atoms) == expected
                compared += 1
                words.update(expected)
    assert compared >= 132
    assert len(words) > 2


def test_files_of_the_page(reader: dict[str, Any], tmp_path: Path) -> None:
    """Tasks can be built for; the language by hand is one, also for the plain reader."""
    tasks, by_hand, built = (tmp_path / name for name in ("tasks.json", "hand.json", "l.json"))
    shown = [b.text for b in blocks(DOCS / "formats.md") if b.kind == "json"]
    for path, text in zip((tasks, by_hand), shown, strict=False):
        path.write_text(text)
    cells = [str(ROOT / "domains" / "three-cells" / f"{n}.pddl") for n in ("domain", "problem")]
    assert len(read_task_file(tasks)) == 2
    build = ["build", *cells, "--tasks", str(tasks), "--method", "greedy", "-o", str(built)]
    assert run(build) == 0
    assert run(["verify", str(by_hand), *cells, "--tasks", "all"]) == 0
    assert reader["word"](reader["read_language"](by_hand), ["(at r2 b)", "(at r1 c)"]) == "r2-in-b"
