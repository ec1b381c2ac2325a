# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages and their programs are run: Python blocks in one namespace, console output compared."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from coordlang.commands.main import run
from coordlang.language.file import read_language
from coordlang.language.listed import read_task_file
from coordlang.language.recorded import options_of
from coordlang.language.sentences import sentence
from planners.search.plans import Plans, counts
from tests.support.command import Command, program
from tests.support.domains import ROOT, T_MAP, all_tasks, files_of
from tests.support.pages import DOCS, PAGES, blocks, commands, matches, run_command, run_python

#: Pages of many commands, and scripts, which take a while.
LONG = {
    *("asynchronous", "cli", "gallery", "library", "lifted", "simulation", "sites"),
    *("unified-planning", "use", "words", "five-domains", "benchmark_tasks"),
}


def by_name(paths: Iterable[Path]) -> list[Any]:
    """Those that are long are for thorough tests."""
    return [
        pytest.param(p, id=p.stem, marks=[pytest.mark.thorough] * (p.stem in LONG)) for p in paths
    ]


@pytest.mark.parametrize("page", by_name(filter(blocks, PAGES)))
def test_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "domains").symlink_to(ROOT / "domains")
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {"__name__": "__docs__"}
    printed: str | None = None
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.kind == "python":
            printed = run_python(block, where, namespace)
        elif block.kind == "output":
            assert printed is not None, f"{where}: no Python block before this output"
            assert matches(block.text.splitlines(), printed.splitlines()), (
                f"{where}: printed\n{printed}"
            )
            printed = None
        elif block.kind == "console":
            for command in commands(block):
                run_command(command, page.name, monkeypatch)


def test_there_is_something_to_run() -> None:
    """A page whose blocks are no longer found would pass in silence."""
    kinds = {page.name: {block.kind for block in blocks(page)} for page in PAGES}
    for name in ("tutorial.md", "formats.md"):
        assert {"python", "output", "console"} <= kinds[name]
    assert {"python", "output"} <= kinds["words.md"]
    assert "console" in kinds["cli.md"] & kinds["README.md"]


EXAMPLES = [*(DOCS / "examples").glob("*.py"), *(DOCS / "notebooks").glob("*.ipynb")]
#: It registers an engine, which has no function of its own.
DEEPER = {"unified_planning_example"}


def cells_of(path: Path) -> list[str]:
    """The cells of a script, or the code cells of a notebook, which holds none of their outputs."""
    if path.suffix == ".py":
        return re.split(r"^(?=# %% )", path.read_text(), flags=re.MULTILINE)
    cells = [c for c in json.loads(path.read_text())["cells"] if c["cell_type"] == "code"]
    assert all(cell["outputs"] == [] for cell in cells)
    return ["".join(cell["source"]) + "\n" for cell in cells]


@pytest.mark.parametrize("path", by_name(p for p in sorted(EXAMPLES) if p.stem not in DEEPER))
def test_example(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "domains").symlink_to(ROOT / "domains")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    cells, line = cells_of(path), 0
    assert len(cells) > 3
    namespace: dict[str, Any] = {"__name__": "__example__"}
    for cell in cells:
        exec(compile("\n" * line + cell, str(path), "exec"), namespace)
        line += cell.count("\n")
    imported = set(
        re.findall(r"(?m)^ *(?:import|from) ((?:coordlang|planners)[\w.]*)", "".join(cells))
    )
    assert imported == {"coordlang"}
    if path.suffix == ".ipynb":
        assert namespace["plt"].get_fignums()
        namespace["plt"].close("all")


SCRIPT = ROOT / "docs" / "examples" / "check_certificate.sh"
SOLVER, CHECKER = os.environ.get("SOLVER", "cadical"), os.environ.get("DRAT_TRIM", "drat-trim")
installed = pytest.mark.skipif(
    not (shutil.which(SOLVER) and shutil.which(CHECKER)),
    reason=f"{SOLVER} and {CHECKER} are not both installed (SOLVER and DRAT_TRIM name others)",
)


def refutation(formula: Path, **environment: object) -> subprocess.CompletedProcess[str]:
    named = {name: str(value) for name, value in environment.items()}
    return subprocess.run(
        ["sh", SCRIPT, formula], capture_output=True, text=True, env=os.environ | named
    )


@pytest.fixture
def formula(coordlang: Command, tmp_path: Path) -> Path:
    language, proof, formula = tmp_path / "l.json", tmp_path / "c.json", tmp_path / "f.cnf"
    options = ("--tasks", "all", "--method", "minimal", "-o", language, "--certificate", proof)
    assert coordlang("build", *T_MAP, *options).code == 0
    made = coordlang("verify", language, *T_MAP, "--certificate", proof, "--dimacs", formula)
    assert made.code == 0
    return formula


@installed
def test_a_certificate_is_verified(formula: Path) -> None:
    done = refutation(formula)
    assert done.returncode == 0, done.stderr
    assert f"refuted by {SOLVER} in " in done.stdout
    assert f"proof verified by {CHECKER} in " in done.stdout


def test_the_answers_of_both_programs_count(tmp_path: Path) -> None:
    """No answer but "unsatisfiable" of the one and "verified" of the other is taken for a proof."""
    formula = tmp_path / "f.cnf"
    formula.write_text("p cnf 1 2\n1 0\n-1 0\n")
    refutes = program(tmp_path / "refutes", 'echo "s UNSATISFIABLE"; echo 0 > "$2"; exit 20')
    satisfied = program(tmp_path / "satisfied", "exit 10")
    gives_up = program(tmp_path / "gives-up", "exit 0")
    verifies = program(tmp_path / "verifies", 'echo "s VERIFIED"')
    refuses = program(tmp_path / "refuses", 'echo "s NOT VERIFIED"; exit 1')
    fails = program(tmp_path / "fails", "exit 139")
    codes = {
        (refutes, verifies): 0,
        (refutes, refuses): 1,
        (refutes, fails): 1,
        (satisfied, verifies): 1,
        (gives_up, verifies): 1,
        (refutes, tmp_path / "missing"): 77,
        (tmp_path / "missing", verifies): 77,
    }
    for (solver, checker), code in codes.items():
        assert refutation(formula, SOLVER=solver, DRAT_TRIM=checker).returncode == code
    assert refutation(tmp_path / "none.cnf").returncode == 2


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


@pytest.mark.parametrize(("flags", "ending"), [([], ".json.gz"), (["--remember-actions"], ".json")])
def test_reader_says_the_same(
    flags: list[str], ending: str, reader: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / f"language{ending}"
    build = "build", *map(str, T_MAP), "--method", "greedy"
    assert run([*build, "--tasks", "all", "-o", str(path), *flags]) == 0
    plain = reader["read_language"](path)
    language = read_language(path)
    candidates = all_tasks("t-map", options=options_of(language))
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
    cells = [*map(str, files_of("three-cells"))]
    assert len(read_task_file(tasks)) == 2
    build = ["build", *cells, "--tasks", str(tasks), "--method", "greedy", "-o", str(built)]
    assert run(build) == 0
    assert run(["verify", str(by_hand), *cells, "--tasks", "all"]) == 0
    assert reader["word"](reader["read_language"](by_hand), ["(at r2 b)", "(at r1 c)"]) == "r2-in-b"
