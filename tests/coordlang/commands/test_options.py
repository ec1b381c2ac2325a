# SPDX-License-Identifier: GPL-3.0-or-later
"""One record of options: keywords, command line, contradictions, what was given."""

from __future__ import annotations

import inspect
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import click
import pytest
from click.testing import CliRunner

from coordlang.commands.command import command_of, positional
from coordlang.commands.inputs import Arguments, public
from coordlang.commands.options import NO_SLACK, CommandOptions, Source
from planners.system.errors import UsageError
from planners.system.options import group, option


@dataclass(frozen=True, slots=True)
class Greeting(CommandOptions):
    """Greet."""

    takes = "DOMAIN PROBLEM"

    tone: Literal["warm", "cold"] = option("warm", "How it sounds.")
    times: int = option(1, "How often.", "N", least=1)
    names: tuple[str, ...] = option((), "Whom.", "NAME", names=("--name",))
    shout: bool = option(False, "In capitals.")
    as_json: bool = option(False, "JSON.", names=("--json",), only="cli")
    progress: Any = option(None, "Called now and then.", only="python")
    output: str | None = option(None, "Where to.", "FILE", names=("-o",), is_output=True)
    source: Source = group(Source, without=NO_SLACK)

    def __post_init__(self) -> None:
        if self.shout and self.tone == "cold":
            raise UsageError("--shout contradicts --tone cold")


@public(Greeting)
def greet(files: Arguments, options: Greeting) -> tuple[Any, Any, Greeting]:
    """Greet."""
    return files.domain, files.values.get("PROBLEM"), options


def show_greet(result: tuple[str, str, Greeting], options: Greeting) -> int:
    domain, problem, greeting = result
    assert greeting is options
    model = greeting.source.model
    click.echo(f"{domain} {problem} {greeting.tone} {greeting.times} {greeting.names}")
    click.echo(f"{model.cost} {model.robots} {sorted(greeting.source.given)}")
    return 3 if greeting.shout else 0


cli = command_of("greet", Greeting, lambda _: sys.modules[__name__])


def run(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(cli, [*arguments], standalone_mode=False)
    if done.exception is not None:
        raise done.exception
    return done.return_value, done.stdout


def test_keywords_become_the_record() -> None:
    _, _, options = greet("d", "p", tone="cold", times=2, cost="makespan+actions", robots="R1,r2")
    assert (options.tone, options.times) == ("cold", 2)
    assert options.source.model.cost == "makespan+actions"
    assert options.source.model.names == ("r1", "r2")
    assert options.source.given == {"cost", "robots"}


def test_what_is_not_given_is_the_default_and_not_among_the_given() -> None:
    _, _, options = greet(domain="d", problem="p", tone=None, remember_actions=False)
    assert options == Greeting()


def test_an_unknown_keyword_is_refused_with_one_that_is_alike() -> None:
    with pytest.raises(TypeError, match=r"greet\(\) got an .* 'tome'; did you mean 'tone'\?"):
        greet("d", "p", tome="cold")


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"tone": "hot"}, "--tone hot: there is no such value"),
        ({"times": 0}, "--times 0: expected 1 or more"),
        ({"times": True}, "--times True: expected 1"),
        ({"shout": 1}, "--shout is given or not: 1 is neither"),
        ({"shout": True, "tone": "cold"}, "--shout contradicts --tone cold"),
        ({"robots": "r1", "robot_type": "robot"}, "both say who the robots are"),
    ],
)
def test_values_that_there_are_not(keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        greet("d", "p", **keywords)


def test_the_command_line_makes_the_same_record() -> None:
    code, text = run("d", "p", "--name", "a", "--name", "b", "--cost", "makespan", "--times", "2")
    assert (code, text) == (0, "d p warm 2 ('a', 'b')\nmakespan () ['cost']\n")
    assert run("d", "p", "--shout")[0] == 3


def test_factored_stands_for_domain_and_problem() -> None:
    assert run("--factored", "folder")[1].startswith("None None warm")
    with pytest.raises(click.UsageError, match="expected DOMAIN PROBLEM, or --factored DIR"):
        run("d", "--factored", "folder")
    for arguments in (("d",), ("d", "p", "q"), ()):
        with pytest.raises(click.UsageError, match="expected DOMAIN PROBLEM"):
            run(*arguments)


@pytest.mark.parametrize(
    ("takes", "given", "is_factored", "read"),
    [
        (
            "LANGUAGE DOMAIN PROBLEMS...",
            "l d p q",
            False,
            {"LANGUAGE": "l", "DOMAIN": "d", "PROBLEMS...": ("p", "q")},
        ),
        ("LANGUAGE DOMAIN PROBLEMS...", "l", True, {"LANGUAGE": "l"}),
        ("LANGUAGE DOMAIN PROBLEM [SENTENCE]", "l w1", True, {"LANGUAGE": "l", "SENTENCE": "w1"}),
        ("DOMAIN PROBLEM [SENTENCE]", "d p", False, {"DOMAIN": "d", "PROBLEM": "p"}),
        ("[NAME]", "", False, {}),
    ],
)
def test_positional(takes: str, given: str, is_factored: bool, read: dict[str, object]) -> None:
    assert positional(takes, tuple(given.split()), is_factored=is_factored) == read


def test_an_output_is_no_input_file(tmp_path: Path) -> None:
    for name in ("d", "p", "coordinates.json", "x.pddl"):
        (tmp_path / name).write_text("")
    files = str(tmp_path / "d"), str(tmp_path / "p")
    for arguments, output in (
        (files, "p"),
        (files, "coordinates.json"),
        (("--factored", str(tmp_path)), "x.pddl"),
    ):
        with pytest.raises(UsageError, match=r"-o .* would overwrite an input file"):
            run(*arguments, "-o", str(tmp_path / output))
    assert run(*files, "-o", str(tmp_path / "new"))[0] == 0


def test_options_of_the_command_line_alone() -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'as_json'"):
        greet("d", "p", as_json=True)
    assert greet("d", "p", slack=1)[2].source.model.slack == 1
    with pytest.raises(click.NoSuchOption, match="--slack"):
        run("d", "p", "--slack", "1")


def test_the_signature_names_what_python_takes() -> None:
    names = [*inspect.signature(greet).parameters]
    assert names[:4] == ["domain", "problem", "tone", "times"]
    assert "as_json" not in names
    assert {"factored", "cost", "slack", "progress"} <= {*names}


def test_help_shows_kinds_and_defaults() -> None:
    text = CliRunner().invoke(cli, ["--help"]).output
    assert "--tone [warm|cold]" in text
    assert "[default: warm]" in text
    assert "--time-limit SECONDS" in text
    assert "--progress" not in text
