# SPDX-License-Identifier: GPL-3.0-or-later
"""With slack no answer calls plans optimal that are not."""

from __future__ import annotations

from pathlib import Path

import pytest

import coordlang as library
from tests.support.command import Command
from tests.support.domains import DOMAINS

T_MAP = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
KEPT = "within 1 step of the optimum"


@pytest.fixture(scope="module")
def spoken(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A language for plans within slack 1, and the sentence of the first of them."""
    path = tmp_path_factory.mktemp("slack") / "language.json"
    built = library.build(*T_MAP, slack=1, words_see_slack=True, method="minimal")
    built.language.save(path)
    (plan,) = library.plans(*T_MAP, slack=1).sample(1, 0)
    return path, library.say(path, *T_MAP, plan=plan).sentence


@pytest.mark.parametrize(
    ("arguments", "code", "is_named"),
    [
        (("coordination", *T_MAP, "--slack", 1), 0, True),
        (("build", *T_MAP, "--slack", 1, "--words", 1, "-o", "-"), 0, True),
        (("plans", *T_MAP, "--slack", 1), 0, False),
        (("understand", "LANGUAGE", *T_MAP, "SENTENCE"), 0, False),
        (("understand", "LANGUAGE", *T_MAP, "w0 w1 w0 w1 w0 w1 w0"), 1, True),
        (("plan", "LANGUAGE", *T_MAP, "SENTENCE"), 0, False),
        (("choices", "LANGUAGE", *T_MAP, "SENTENCE", "--check"), 0, True),
        (("explain", "LANGUAGE", *T_MAP), 0, True),
        (("explain", "LANGUAGE", *T_MAP, "--task"), 0, True),
        (("verify", "LANGUAGE", *T_MAP), 0, False),
        (("export", "LANGUAGE", *T_MAP, "SENTENCE", "--to", "bt"), 0, True),
    ],
)
def test_no_answer_says_optimal(
    arguments: tuple[object, ...],
    code: int,
    is_named: bool,
    spoken: tuple[Path, str],
    coordlang: Command,
) -> None:
    given = {"LANGUAGE": spoken[0], "SENTENCE": spoken[1]}
    outcome = coordlang(*(given.get(str(argument), argument) for argument in arguments))
    text = " ".join((outcome.out + outcome.err).split())
    assert outcome.code == code, text
    assert "optimal" not in text
    assert (KEPT in text) == is_named
