# SPDX-License-Identifier: GPL-3.0-or-later
"""Former names of options still work, the same, with one note on stderr."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from coordlang.cli.group import COMMANDS, RenamedOptions, cli
from tests.support.command import Command
from tests.support.domains import DOMAINS

CELLS = DOMAINS / "three-cells" / "domain.pddl", DOMAINS / "three-cells" / "problem.pddl"
RENAMED = {
    "verify": {"--lower-bound": "--certificate"},
    "plan": {"--wish": "--prefer"},
    "choices": {"--did": "--history"},
    "export": {"--limit": "--max-actions", "--back": "--translate-plan"},
    "explain": {"--each": "--formula-per-word"},
    "evaluate": {"--unit-limit": "--unit-time-limit"},
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    from coordlang.cli import run

    folder = tmp_path_factory.mktemp("renamed")
    language, proof = folder / "l.json", folder / "proof.json"
    build = ["build", *CELLS, "--method", "minimal", "--certificate", proof, "-o", language]
    assert run([str(part) for part in build]) == 0
    return language, proof


def commands() -> dict[str, click.Command]:
    found = {name: cli.get_command(click.Context(cli), name) for name in COMMANDS}
    return {name: command for name, command in found.items() if command is not None}


def test_every_renamed_option_is_here() -> None:
    found = commands()
    assert {
        name: dict(command.renamed)
        for name, command in found.items()
        if isinstance(command, RenamedOptions)
    } == RENAMED
    for name, renamed in RENAMED.items():
        spellings = {spelling for option in found[name].params for spelling in option.opts}
        assert set(renamed.values()) <= spellings
        assert not set(renamed) & spellings


@pytest.mark.parametrize(
    ("name", "former", "rest"),
    [
        ("verify", ["--lower-bound", "PROOF"], []),
        ("verify", ["--lower-bound=PROOF"], []),
        ("plan", ["--wish", "first:r1", "--wish", "shortest"], []),
        ("choices", ["--did", "idle"], ["w1 w0", "--robot", "r2"]),
        ("export", ["--limit", "0"], ["w1 w0"]),
        ("export", ["--back", "no-such-plan"], ["w1 w0"]),
        ("explain", ["--each"], []),
    ],
)
def test_former_names(
    name: str, former: list[str], rest: list[str], files: tuple[Path, Path], coordlang: Command
) -> None:
    language, proof = files
    old = [part.replace("PROOF", str(proof)) for part in former]
    new = [_present(part, RENAMED[name]) for part in old]
    then = coordlang(name, language, *CELLS, *rest, *old)
    now = coordlang(name, language, *CELLS, *rest, *new)
    spelling = former[0].partition("=")[0]
    note = (
        f"coordlang: note: {spelling} is deprecated: it is called {RENAMED[name][spelling]} now\n"
    )
    assert (then.code, then.out) == (now.code, now.out)
    assert then.err == note + now.err
    assert now.code != 2, now.err


def _present(part: str, renamed: dict[str, str]) -> str:
    name, equals, value = part.partition("=")
    return renamed.get(name, name) + equals + value


def test_the_former_name_of_the_limit_of_a_piece(coordlang: Command) -> None:
    outcome = coordlang("evaluate", "nothing", "--unit-limit", "5")
    assert outcome.code == 2
    assert "--unit-limit is deprecated: it is called --unit-time-limit now" in outcome.err
    assert "there is no experiment 'nothing'" in outcome.err


def test_what_follows_two_dashes_is_no_option(coordlang: Command) -> None:
    outcome = coordlang("plan", "--prefer", "shortest", "--", "--wish", *CELLS)
    assert "deprecated" not in outcome.err
    assert "--wish: there is no such file" in outcome.err
