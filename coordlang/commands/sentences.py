# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang say``, ``understand`` and ``plan``: plans and their sentences."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from os import PathLike, fspath
from typing import Any

from coordlang.commands.inputs import Arguments, public, wishes_in
from coordlang.commands.plans import OptimalPlans, PlanSteps, show_listed
from coordlang.commands.records import PlanOptions, SayOptions, UnderstandOptions
from coordlang.commands.terminal import covered_code, echo
from coordlang.execution.best_sentence import Preference, best_sentence, read_preference
from coordlang.execution.guided_search import BOUND, GuidedPlan, plan_under_sentence
from coordlang.execution.plan_sentence import PlanDag, sentence_of_plan
from coordlang.execution.task_language import InTask, TaskLanguage
from coordlang.language.candidates import describe
from coordlang.language.provenance import tolerance_data
from planners.search.plan_file import json_count, read_plans
from planners.search.plans import Plans, Texts, texts
from planners.system.errors import CoordlangError, UsageError
from planners.system.messages import counted


@dataclass(frozen=True, slots=True, repr=False)
class Said(InTask):
    """The sentence of each plan."""

    used: TaskLanguage = field(compare=False)
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

    ``plan`` is a plan file (which may hold several plans), or the steps of one plan.  Raises
    `NotAPlan` or `NotOptimal` with the first step that breaks: only optimal plans have a sentence.
    """
    plan = files.needed("PLAN")
    used = files.task()
    is_file = isinstance(plan, str | PathLike)
    plans = read_plans(fspath(plan), used.model.in_step) if is_file else [tuple(plan)]
    sentences = []
    for number, steps in enumerate(plans, 1):
        try:
            sentences.append(used.text(sentence_of_plan(used, steps)))
        except CoordlangError as error:
            if len(plans) > 1:
                error.what = f"plan {number} of {len(plans)}: {error.what}"
            raise
    return Said(used, tuple(sentences))


def show_say(found: Said, options: SayOptions) -> int:
    """Print the sentences."""
    echo(json.dumps(found.data()) if options.as_json else found)
    return covered_code(found)


class SentencePlans(OptimalPlans, InTask):
    """The optimal plans that a sentence leaves open, as `OptimalPlans` with a DAG."""

    __slots__ = ("_words", "used")
    shown = ("sentence", *OptimalPlans.shown, "covered")

    def __init__(self, used: TaskLanguage, words: Sequence[int]) -> None:
        super().__init__(Plans.of(used.plans_with(words)))
        self.used, self._words = used, words

    @property
    def sentence(self) -> str:
        """The sentence."""
        return self.used.text(self._words)

    def dag(self) -> PlanDag:
        """Return the plans as the paths of a DAG."""
        return PlanDag(self.used, self._words, self._plans.space)

    def data(
        self, listed: Sequence[Sequence[Texts]] | None = None, *, with_dag: bool = True
    ) -> dict[str, Any]:
        """Return a JSON plan file, as `OptimalPlans.data`, with sentence, guarantee and DAG."""
        return {
            "sentence": self.sentence,
            "covered": self.covered,
            "task": describe(self.used.space, self.used.task),
            **tolerance_data(self.tolerance),
            **super().data(listed),
            **(self.dag().data() if with_dag else {}),
        }


@public(UnderstandOptions)
def understand(files: Arguments, options: UnderstandOptions) -> SentencePlans:
    """Understand a sentence: the optimal plans of the task that have it.

    Raises `NoPlanFits` if no optimal plan has the sentence; it says where it first breaks, and
    `BadInput` for a word that the language does not have, or one said twice in a row.
    """
    said = files.needed("SENTENCE")
    used = files.task()
    return SentencePlans(used, used.words_of(said))


def show_understand(found: SentencePlans, options: UnderstandOptions) -> int:
    """Print or write the plans."""
    data = partial(found.data, with_dag=not options.listing.only_count)
    show_listed(found, options, data, "plans", options.output)
    return covered_code(found)


@dataclass(frozen=True, slots=True)
class Fulfilled:
    """What became of one preference.

    ``value`` is the number of words or plans (``shortest``, ``most-plans``); for a preference over
    plans it is None, and ``worst_plan`` and ``best_plan`` say how the plans of the sentence meet
    it.
    """

    preference: str
    value: int | None = None
    is_granted: bool = True
    worst_plan: str = ""
    best_plan: str = ""

    def data(self) -> dict[str, Any]:
        """An entry of ``wishes`` in the JSON plan file."""
        if self.value is not None:
            return {"wish": self.preference, "value": json_count(self.value)}
        plans = {"worst_plan": self.worst_plan, "best_plan": self.best_plan}
        return {"wish": self.preference, "granted": self.is_granted, **plans}

    def text(self) -> str:
        """How the sentence meets the preference, in a line or two."""
        lines = [f"at worst {self.worst_plan}", f"at best {self.best_plan}"]
        if self.value is not None:
            size = counted(self.value, "word")
            is_size = self.preference == "shortest"
            lines = [size if is_size else f"leaves {counted(self.value, 'plan')} open"]
        elif self.worst_plan == self.best_plan:
            lines = [f"in every plan {self.worst_plan}"]
        return "\n".join(f"{self.preference}: {line}" for line in lines)


@dataclass(frozen=True, slots=True, repr=False)
class PlanUnderSentence(InTask):
    """One optimal plan with a sentence, and the work of the A* search.

    ``steps`` is the plan; ``without_sentence`` the same search with no sentence to keep to;
    ``fulfilled`` has one entry for each preference.
    """

    used: TaskLanguage = field(compare=False)
    sentence: str
    steps: PlanSteps
    search: GuidedPlan
    without_sentence: GuidedPlan
    fulfilled: tuple[Fulfilled, ...]
    open_plans: SentencePlans = field(compare=False)
    shown = ("sentence", "cost", "expanded", "covered")

    @property
    def cost(self) -> tuple[int, int]:
        """The optimal cost: joint steps, second component."""
        return self.search.cost

    @property
    def expanded(self) -> int:
        """The number of nodes that the search expanded."""
        return self.search.expanded

    def __iter__(self) -> Iterator[Texts]:
        return iter(self.steps)

    def data(self) -> dict[str, Any]:
        """A JSON plan file (docs/formats.md) with the search and the preferences."""
        data = self.open_plans.data([self.steps], with_dag=False)
        work = [
            {"expanded": own.expanded, "generated": own.generated, "states": own.states}
            for own in (self.search, self.without_sentence)
        ]
        data["search"] = {"heuristic": BOUND, **work[0], "without_sentence": work[1]}
        if self.fulfilled:
            data["wishes"] = [entry.data() for entry in self.fulfilled]
        return data


@public(PlanOptions)
def plan(files: Arguments, options: PlanOptions) -> PlanUnderSentence:
    """Find one optimal plan that has a sentence, by A* that prunes what does not fit.

    Raises `NoPlanFits` if no optimal plan has the sentence, and `UsageError` for an unknown
    preference, and for both or neither of sentence and ``prefer``.
    """
    sentence = files.values.get("SENTENCE")
    if (sentence is None) == (not options.prefer):
        raise UsageError(
            "expected a SENTENCE or --prefer, one of the two",
            remedy="--prefer shortest finds the sentence with the fewest words.",
        )
    used = files.task()
    preferences = [read_preference(used, text) for text in wishes_in(options.prefer)]
    best = best_sentence(used, preferences) if preferences else None
    words = best.words if best else used.words_of(sentence or ())
    found = plan_under_sentence(used, words)
    return PlanUnderSentence(
        used,
        used.text(words),
        texts(used.model.in_step, found.plan),
        found,
        plan_under_sentence(used, None),
        tuple(_fulfilled(preferences, best.values)) if best else (),
        SentencePlans(used, words),
    )


def _fulfilled(
    preferences: Sequence[Preference], values: Sequence[int | tuple[int, int]]
) -> Iterator[Fulfilled]:
    for preference, value in zip(preferences, values, strict=True):
        if isinstance(value, int):
            yield Fulfilled(str(preference), value)
        else:
            assert not isinstance(preference, str)
            worst, well = (preference.grades[grade] for grade in value)
            yield Fulfilled(preference.text, None, value[0] == 0, worst, well)


def show_plan(found: PlanUnderSentence, options: PlanOptions) -> int:
    """Print the plan, and the work of the search."""
    if options.form == "json":
        echo(json.dumps(found.data()))
        return covered_code(found)
    if options.form == "plansys2":
        text = found.open_plans.plansys2(found.steps)
    else:
        text = f"{found.open_plans.ipc(found.steps)}; sentence = {found.sentence}\n"
    echo(text, nl=False)
    for entry in found.fulfilled:
        echo(entry.text(), err=True)
    if found.search.generated:  # else it is read off the plans
        expanded = counted(found.expanded, "node")
        without = f"without the sentence {found.without_sentence.expanded:,}"
        echo(f"A* ({BOUND}) expanded {expanded}; {without}", err=True)
    return covered_code(found)
