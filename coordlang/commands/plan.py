# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang plan``: one optimal plan under a sentence, or under the best sentence."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from coordlang.commands.inputs import Arguments, InTask, public
from coordlang.commands.plans import PlanSteps
from coordlang.commands.records import PlanOptions
from coordlang.commands.terminal import covered_code, echo
from coordlang.commands.understand import SentencePlans
from coordlang.execution.best_sentence import BestSentence, best_sentence
from coordlang.execution.guided_search import ExpandedStates, GuidedPlan, plan_under_sentence
from coordlang.execution.open_plans import OpenPlans
from coordlang.execution.preferences import Preference, read_preference
from coordlang.execution.task_language import TaskLanguage
from planners.search.heuristics import HeuristicName
from planners.search.plan_file import Texts, json_count
from planners.system.errors import UsageError
from planners.system.notebook import counted


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
        return {
            "wish": self.preference,
            "granted": self.is_granted,
            "worst_plan": self.worst_plan,
            "best_plan": self.best_plan,
        }

    def text(self) -> str:
        """How the sentence meets the preference, in a line or two."""
        if self.preference == "shortest":
            return f"{self.preference}: {counted(self.value or 0, 'word')}"
        if self.value is not None:
            return f"{self.preference}: leaves {counted(self.value, 'plan')} open"
        if self.worst_plan == self.best_plan:
            return f"{self.preference}: in every plan {self.worst_plan}"
        worst = f"{self.preference}: at worst {self.worst_plan}"
        return f"{worst}\n{self.preference}: at best {self.best_plan}"


@dataclass(frozen=True, slots=True, repr=False)
class PlanUnderSentence(InTask):
    """One optimal plan with a sentence, and the work of the A* search.

    ``steps`` is the plan; ``without_sentence`` the same search with no sentence to keep to;
    ``fulfilled`` has one entry for each preference.
    """

    used: TaskLanguage
    sentence: str
    steps: PlanSteps
    heuristic: HeuristicName
    search: GuidedPlan
    without_sentence: GuidedPlan
    fulfilled: tuple[Fulfilled, ...]
    open_plans: SentencePlans

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

    def __len__(self) -> int:
        return len(self.steps)

    def facts(self) -> Mapping[str, object]:
        """The sentence, and how much work the plan was with and without it."""
        return {
            "sentence": self.sentence,
            "makespan": self.cost[0],
            "expanded": self.expanded,
            "without_sentence": self.without_sentence.expanded,
            "covered": self.covered,
        }

    def ipc(self) -> str:
        """Return the plan as an IPC plan file, with its sentence in a comment."""
        return f"{self.open_plans.ipc(self.steps)}; sentence = {self.sentence}\n"

    def plansys2(self) -> str:
        """Return the plan as PlanSys2 reads it."""
        return self.open_plans.plansys2(self.steps)

    def data(self) -> dict[str, Any]:
        """A JSON plan file (docs/formats.md) with the search and the preferences."""
        data = self.open_plans.data_with([self.steps], None)
        data["search"] = {
            "heuristic": self.heuristic,
            **_work(self.search),
            "without_sentence": _work(self.without_sentence),
        }
        if self.fulfilled:
            data["wishes"] = [entry.data() for entry in self.fulfilled]
        return data


@public(PlanOptions)
def plan(files: Arguments, options: PlanOptions) -> PlanUnderSentence:
    """Find one optimal plan that has a sentence, by A* that prunes what does not fit.

    Raises
    ------
    NoPlanFits
        If no optimal plan has the sentence.
    UsageError
        For an unknown preference, and for both or neither of sentence and ``prefer``.
    """
    sentence = files.values.get("SENTENCE")
    if (sentence is None) == (not options.prefer):
        raise UsageError(
            "expected a SENTENCE or --prefer, one of the two",
            remedy="--prefer shortest finds the sentence with the fewest words.",
        )
    used = files.task().used
    preferences = [read_preference(used, text) for text in options.prefer]
    best = best_sentence(used, preferences) if preferences else None
    words = best.words if best else used.words_of(sentence or ())
    expanded = ExpandedStates(used.model, used.partition)
    found = plan_under_sentence(used, words, options.heuristic, expanded)
    return PlanUnderSentence(
        used,
        used.text(words),
        tuple(used.model.texts(step) for step in found.plan),
        options.heuristic,
        found,
        plan_under_sentence(used, None, options.heuristic, expanded),
        tuple(_fulfilled(preferences, best)) if best else (),
        SentencePlans(OpenPlans.of(used, words)),
    )


def _fulfilled(preferences: Sequence[Preference], best: BestSentence) -> Iterator[Fulfilled]:
    for preference, value in zip(preferences, best.values, strict=True):
        if isinstance(preference, str):
            assert isinstance(value, int)
            yield Fulfilled(preference, value)
        else:
            assert not isinstance(value, int)
            worst, well = (preference.grades[grade] for grade in value)
            yield Fulfilled(preference.text, None, value[0] == 0, worst, well)


def _work(search: GuidedPlan) -> dict[str, int]:
    return {"expanded": search.expanded, "generated": search.generated, "states": search.states}


def show(found: PlanUnderSentence, options: PlanOptions) -> int:
    """Print the plan, and the work of the search."""
    if options.form == "json":
        echo(json.dumps(found.data()))
        return covered_code(found.covered, found.tolerance)
    echo(found.plansys2() if options.form == "plansys2" else found.ipc(), nl=False)
    for entry in found.fulfilled:
        echo(entry.text(), err=True)
    expanded = counted(found.expanded, "node")
    without = f"without the sentence {found.without_sentence.expanded:,}"
    echo(f"A* ({found.heuristic}) expanded {expanded}; {without}", err=True)
    return covered_code(found.covered, found.tolerance)
