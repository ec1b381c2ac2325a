# SPDX-License-Identifier: GPL-3.0-or-later
"""A language used in one task: ``say``, ``understand``, ``plan``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

from coordlang.commands.inputs import DomainSource, File, ProblemSource
from coordlang.commands.keywords import with_options
from coordlang.commands.language_inputs import LanguageSource, read_task_language
from coordlang.commands.options import Source
from coordlang.commands.plans import OptimalPlans, PlanSteps
from coordlang.execution.best_sentence import BestSentence, best_sentence
from coordlang.execution.drawing import cut_note, plans_dot
from coordlang.execution.guided_search import ExpandedStates, GuidedPlan, plan_under_sentence
from coordlang.execution.open_plans import OpenPlans, PlanDag, open_plans_data, plan_dag
from coordlang.execution.plan_sentence import read_plan_file, sentence_of_plan
from coordlang.execution.preferences import Preference, read_preference
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.tolerance import Tolerance, tolerance_data
from planners.search.heuristics import HeuristicName
from planners.search.plan_file import Texts, json_count
from planners.system.errors import CoordlangError, UsageError
from planners.system.notebook import Presented
from planners.system.options import group, option

#: A sentence: ``"w1 w0"``, its words ``("w1", "w0")``, or one of `explain`.
SentenceSource = str | Iterable[str]
#: A plan file, or the steps of one plan, each with one text or None for every robot.
PlanSource = File | Sequence[Texts]

#: Nodes of a drawn DAG.
NODES_DRAWN = 200


@dataclass(frozen=True, slots=True, repr=False)
class Said(Presented):
    """The sentence of each plan; ``covered`` says whether the language guarantees the task.

    ``tolerance`` says what may go wrong, or be longer, all the same; None: nothing.
    """

    sentences: tuple[str, ...]
    covered: bool
    tolerance: Tolerance | None = None

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

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {"sentences": self.sentences, "covered": self.covered}

    def data(self) -> dict[str, Any]:
        """Return the sentences as JSON data."""
        return {
            "sentences": list(self.sentences),
            "covered": self.covered,
            **tolerance_data(self.tolerance),
        }


def given_sentence(sentence: SentenceSource | None) -> SentenceSource:
    """Return the sentence; `UsageError` where none is given."""
    if sentence is None:
        raise UsageError("expected a sentence", remedy='Give its words, as in "w1 w0".')
    return sentence


@dataclass(frozen=True, slots=True)
class SayOptions:
    """What `say` can be asked for."""

    source: Source = group(Source)


@with_options(SayOptions)
def say(
    language: LanguageSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    plan: PlanSource | None = None,
    *,
    options: SayOptions,
) -> Said:
    """Say optimal plans: the sentence of a plan is the sequence of words that it passes through.

    ``plan`` is a plan file (which may hold several plans), or the steps of one plan.

    Raises
    ------
    NotAPlan, NotOptimal
        With the first step that breaks: only optimal plans have a sentence.
    """
    if plan is None:
        raise UsageError("expected a plan", remedy="Give a plan file or the steps of one plan.")
    used = read_task_language(language, domain, problem, options.source)
    plans = _plans(plan, used)
    sentences = []
    for number, steps in enumerate(plans, 1):
        try:
            sentences.append(used.text(sentence_of_plan(used, steps)))
        except CoordlangError as error:
            if len(plans) > 1:
                error.what = f"plan {number} of {len(plans)}: {error.what}"
            raise
    return Said(tuple(sentences), used.covered, used.tolerance)


class SentencePlans(OptimalPlans):
    """The optimal plans that a sentence leaves open, as `OptimalPlans` with a drawn DAG."""

    __slots__ = ("_open",)

    def __init__(self, open_plans: OpenPlans) -> None:
        super().__init__(open_plans.plans)
        self._open = open_plans

    @property
    def sentence(self) -> str:
        """The sentence."""
        return self._open.task_language.text(self._open.words)

    @property
    def covered(self) -> bool:
        """Whether the task is one that the language guarantees: then the plans mix freely."""
        return self._open.task_language.covered

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under the language; None: nothing."""
        return self._open.task_language.tolerance

    def dag(self, nodes: int | None = None) -> PlanDag:
        """Return the plans as the paths of a DAG, cut to about so many nodes (None: all)."""
        return plan_dag(self._open, nodes)

    def dot(self, nodes: int = NODES_DRAWN) -> str:
        """Return the DAG in the language of Graphviz."""
        return plans_dot(self.dag(nodes))

    def cut_note(self, nodes: int = NODES_DRAWN) -> str | None:
        """Return what a picture with so many nodes leaves out, or None."""
        return cut_note(self.dag(nodes)) or None

    def data_with(self, listed: Sequence[Sequence[Texts]], graph: PlanDag | None) -> dict[str, Any]:
        """Return a JSON plan file with sentence and guarantee, and with the DAG if one is given."""
        return open_plans_data(self._open, [self._known(plan) for plan in listed], graph)

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {"sentence": self.sentence, **super().facts(), "covered": self.covered}


@dataclass(frozen=True, slots=True)
class UnderstandOptions:
    """What `understand` can be asked for."""

    source: Source = group(Source)


@with_options(UnderstandOptions)
def understand(
    language: LanguageSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    sentence: SentenceSource | None = None,
    *,
    options: UnderstandOptions,
) -> SentencePlans:
    """Understand a sentence: the optimal plans of the task that have it.

    Raises
    ------
    NoPlanFits
        If no optimal plan has the sentence; it says where it first breaks.
    BadInput
        For a word that the language does not have, or one said twice in a row.
    """
    words = given_sentence(sentence)
    used = read_task_language(language, domain, problem, options.source)
    return SentencePlans(OpenPlans.of(used, used.words_of(words)))


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
        """Return it as JSON data."""
        if self.value is not None:
            return {"wish": self.preference, "value": json_count(self.value)}
        return {
            "wish": self.preference,
            "granted": self.is_granted,
            "worst_plan": self.worst_plan,
            "best_plan": self.best_plan,
        }


@dataclass(frozen=True, slots=True, repr=False)
class PlanUnderSentence(Presented):
    """One optimal plan with a sentence, and the work of the A* search.

    ``steps`` is the plan; ``without_sentence`` the same search with no sentence to keep to;
    ``fulfilled`` has one entry for each preference.
    """

    sentence: str
    steps: PlanSteps
    covered: bool
    heuristic: HeuristicName
    search: GuidedPlan
    without_sentence: GuidedPlan
    fulfilled: tuple[Fulfilled, ...]
    open_plans: SentencePlans

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under the language; None: nothing."""
        return self.open_plans.tolerance

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
        """Return the main facts, as a notebook shows them."""
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
        """Return the plan, the search and the preferences as JSON data."""
        data = self.open_plans.data_with([self.steps], None)
        data["search"] = {
            "heuristic": self.heuristic,
            **_work(self.search),
            "without_sentence": _work(self.without_sentence),
        }
        if self.fulfilled:
            data["wishes"] = [entry.data() for entry in self.fulfilled]
        return data


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """What `plan` can be asked for."""

    prefer: str | Sequence[str] = option(
        (),
        "In place of SENTENCE: the best one by shortest, most-plans, first:ROBOT or avoid:(ATOM); "
        "of several, a later one decides among equals.",
        "PREFERENCE",
    )
    heuristic: HeuristicName = option("relaxed", "The lower bound of A*.")
    source: Source = group(Source)


@with_options(PlanOptions)
def plan(
    language: LanguageSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    sentence: SentenceSource | None = None,
    *,
    options: PlanOptions,
) -> PlanUnderSentence:
    """Find one optimal plan that has a sentence, by A* that prunes what does not fit.

    Raises
    ------
    NoPlanFits
        If no optimal plan has the sentence.
    UsageError
        For an unknown preference, and for both or neither of sentence and ``prefer``.
    """
    preferences = [options.prefer] if isinstance(options.prefer, str) else list(options.prefer)
    if (sentence is None) == (not preferences):
        raise UsageError(
            "expected a SENTENCE or --prefer, one of the two",
            remedy="--prefer shortest finds the sentence with the fewest words.",
        )
    used = read_task_language(language, domain, problem, options.source)
    read = [read_preference(used, text) for text in preferences]
    best = best_sentence(used, read) if read else None
    words = best.words if best else used.words_of(sentence or ())
    expanded = ExpandedStates(used.model, used.partition)
    found = plan_under_sentence(used, words, options.heuristic, expanded)
    without = plan_under_sentence(used, None, options.heuristic, expanded)
    return PlanUnderSentence(
        used.text(words),
        tuple(used.model.texts(step) for step in found.plan),
        used.covered,
        options.heuristic,
        found,
        without,
        tuple(_fulfilled(read, best)) if best else (),
        SentencePlans(OpenPlans.of(used, words)),
    )


def _plans(plan: PlanSource, used: TaskLanguage) -> Sequence[Sequence[Texts]]:
    if isinstance(plan, str | PathLike):
        return read_plan_file(fspath(plan), used.model)
    if isinstance(plan, Mapping):
        raise UsageError(
            "expected a plan file or the steps of one plan",
            remedy="A step has one text for each robot, None where it idles.",
        )
    return [plan]


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
