# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang say``: an optimal plan -> its sentence."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

from coordlang.commands.inputs import Arguments, InTask, public
from coordlang.commands.options import PlanSource
from coordlang.commands.records import SayOptions
from coordlang.commands.terminal import covered_code, echo
from coordlang.execution.plan_sentence import read_plan_file, sentence_of_plan
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.tolerance import tolerance_data
from planners.search.plan_file import Texts
from planners.system.errors import CoordlangError, UsageError


@dataclass(frozen=True, slots=True, repr=False)
class Said(InTask):
    """The sentence of each plan."""

    used: TaskLanguage
    sentences: tuple[str, ...]
    shown = ("sentences", "covered")

    @property
    def sentence(self) -> str:
        """The sentence of the only plan; raises `ValueError` where there are several plans."""
        if len(self.sentences) != 1:
            raise ValueError(f"there are {len(self.sentences)} plans: use .sentences")
        return self.sentences[0]

    def __str__(self) -> str:
        return "\n".join(self.sentences)

    def __iter__(self) -> Iterator[str]:
        return iter(self.sentences)

    def data(self) -> dict[str, Any]:
        """The sentences, and what is guaranteed, as ``--json`` has them."""
        return {
            "sentences": list(self.sentences),
            "covered": self.covered,
            **tolerance_data(self.tolerance),
        }


@public(SayOptions)
def say(files: Arguments, options: SayOptions) -> Said:
    """Say optimal plans: the sentence of a plan is the sequence of words that it passes through.

    ``plan`` is a plan file (which may hold several plans), or the steps of one plan.

    Raises
    ------
    NotAPlan, NotOptimal
        With the first step that breaks: only optimal plans have a sentence.
    """
    plan = files.values.get("PLAN")
    if plan is None:
        raise UsageError("expected a plan", remedy="Give a plan file or the steps of one plan.")
    used = files.task().used
    plans = _plans(plan, used)
    sentences = []
    for number, steps in enumerate(plans, 1):
        try:
            sentences.append(used.text(sentence_of_plan(used, steps)))
        except CoordlangError as error:
            if len(plans) > 1:
                error.what = f"plan {number} of {len(plans)}: {error.what}"
            raise
    return Said(used, tuple(sentences))


def _plans(plan: PlanSource, used: TaskLanguage) -> Sequence[Sequence[Texts]]:
    if isinstance(plan, str | PathLike):
        return read_plan_file(fspath(plan), used.model)
    if isinstance(plan, Mapping):
        raise UsageError(
            "expected a plan file or the steps of one plan",
            remedy="A step has one text for each robot, None where it idles.",
        )
    return [plan]


def show(found: Said, options: SayOptions) -> int:
    """Print the sentences."""
    echo(json.dumps(found.data()) if options.as_json else str(found))
    return covered_code(found.covered, found.tolerance)
