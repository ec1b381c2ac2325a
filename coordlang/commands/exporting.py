# SPDX-License-Identifier: GPL-3.0-or-later
"""A task under a sentence for the programs of others: ``export``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import fspath
from typing import Any, Literal

from coordlang.commands.inputs import DomainSource, File, ProblemSource
from coordlang.commands.keywords import with_options
from coordlang.commands.language_inputs import LanguageSource, read_task_language
from coordlang.commands.options import Source
from coordlang.commands.plans import PlanSteps
from coordlang.commands.speaking import SentencePlans, SentenceSource, given_sentence
from coordlang.execution.choices import choices as choices_under
from coordlang.execution.open_plans import OpenPlans
from coordlang.execution.task_language import TaskLanguage
from coordlang.exports.behaviour_tree import behaviour_trees
from coordlang.exports.ltlf import SentenceFormula, export_ltlf
from coordlang.exports.pddl import PddlExport, export_pddl, plan_names
from coordlang.language.tolerance import Tolerance, tolerance_data
from planners.joint.model import JointModel
from planners.search.plan_file import json_count, only_one_plan
from planners.system.errors import BadInput, Position, Refuted
from planners.system.notebook import Presented
from planners.system.options import group, option
from planners.system.writing import write_texts

#: Beyond this many joint actions robots choose one after another in the exported PDDL.
MAX_ACTIONS = 2000


Target = Literal["pddl", "ltlf", "bt"]
#: Planners whose PDDL differs: what Fast Downward and K* read, or STRIPS alone.
Reader = Literal["fd", "kstar", "pyperplan"]


@dataclass(frozen=True, slots=True, repr=False)
class ExportedTask(Presented):
    """A task under a sentence as plain PDDL, whose optimal plans are exactly the plans that fit.

    ``exported`` has its actions as data.
    """

    plans_found: OpenPlans
    exported: PddlExport

    @property
    def domain(self) -> str:
        """The text of the PDDL domain."""
        return self.exported.domain

    @property
    def problem(self) -> str:
        """The text of the PDDL problem."""
        return self.exported.problem

    @property
    def cost(self) -> int:
        """The total cost of its optimal plans."""
        return self.exported.cost

    @property
    def form(self) -> str:
        """How joint steps are written: ``explicit`` (one action each) or robot after robot."""
        return self.exported.classical.form

    @property
    def actions(self) -> int:
        """The number of actions."""
        return len(self.exported.classical.actions)

    @property
    def terms(self) -> int:
        """The number of terms that tell which word a state belongs to."""
        return self.exported.terms

    @property
    def covered(self) -> bool:
        """Whether the task is one that the language guarantees."""
        return self.plans_found.task_language.covered

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under the language; None: nothing."""
        return self.plans_found.task_language.tolerance

    @property
    def open_plans(self) -> SentencePlans:
        """The plans that fit."""
        return SentencePlans(self.plans_found)

    def save(self, folder: File) -> None:
        """Write ``domain.pddl`` and ``problem.pddl`` into a folder, which is made if it is missing.

        Raises
        ------
        UsageError
            If it cannot be written to.
        """
        write_texts(fspath(folder), {"domain.pddl": self.domain, "problem.pddl": self.problem})

    def translate_plan(self, actions: Sequence[str]) -> PlanSteps:
        """Translate a plan of the exported problem, the names of its actions, into joint steps.

        Raises
        ------
        BadInput
            For an action that the exported problem does not have, or a plan that ends in a step.
        Refuted
            If it is no optimal plan of the exported problem.
        """
        numbers = self.exported.joint_plan(actions)
        plan = tuple(self.exported.model.texts(step) for step in numbers)
        if self.open_plans.rank(plan) is None:
            kind = self.exported.model.kept_plan
            raise Refuted(
                f"this is no {kind} of the exported problem",
                remedy="Ask the planner for an optimal plan: the one of least total-cost.",
            )
        return plan

    def translate_text(self, text: str, name: str) -> PlanSteps:
        """Translate the text of a plan file; ``name`` is what messages call it."""
        position = Position(name)
        only_one_plan(text, position)
        try:
            return self.translate_plan(plan_names(text))
        except (BadInput, Refuted) as error:
            error.position = error.position or position
            raise

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {"form": self.form, "actions": self.actions, "cost": self.cost}

    def data(self) -> dict[str, Any]:
        """Return the PDDL, and what each action stands for, as JSON data."""
        model = self.exported.model
        return {
            "domain": self.domain,
            "problem": self.problem,
            "form": self.form,
            "step_cost": self.exported.classical.step_cost,
            "optimal_cost": self.cost,
            "robots": list(model.robots),
            "actions": {
                name: {model.robots[r]: _label_text(model, r, label) for r, label in chosen}
                for name, chosen in self.exported.labels.items()
            },
        }


@dataclass(frozen=True, slots=True, repr=False)
class ExportedFormula(Presented):
    """A sentence as an LTLf formula over the states of a plan, the initial state first.

    A plan satisfies ``formula`` exactly if it has the sentence; ``over_words`` is the same with
    words as symbols, ``words`` has each word's formula, ``symbols`` says which atom each symbol
    stands for.
    """

    formula: str
    over_words: str
    words: dict[str, str]
    symbols: dict[str, str]
    covered: bool
    tolerance: Tolerance | None = None

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {"over_words": self.over_words, "symbols": len(self.symbols)}

    def __str__(self) -> str:
        return self.formula

    def data(self) -> dict[str, Any]:
        """Return the formulas as JSON data."""
        return {
            "formula": self.formula,
            "over_words": self.over_words,
            "words": self.words,
            "symbols": self.symbols,
            **tolerance_data(self.tolerance),
        }


@dataclass(frozen=True, slots=True, repr=False)
class ExportedTrees(Presented):
    """Each robot's choices under a sentence as a behaviour tree of its name.

    ``xml`` is a document of BehaviorTree.CPP 4; ``subplans``: how many ways each robot has.
    """

    xml: str
    subplans: dict[str, int]
    guaranteed: bool
    covered: bool
    tolerance: Tolerance | None = None

    def facts(self) -> Mapping[str, object]:
        """Return the main facts, as a notebook shows them."""
        return {"subplans": self.subplans, "guaranteed": self.guaranteed}

    def __str__(self) -> str:
        return self.xml

    def data(self) -> dict[str, Any]:
        """Return the document, and how many ways each robot has, as JSON data."""
        return {
            "xml": self.xml,
            "subplans": {robot: json_count(n) for robot, n in self.subplans.items()},
            "guaranteed": self.guaranteed,
            **tolerance_data(self.tolerance),
        }


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What `export` can be asked for."""

    to: Target = option(
        "pddl",
        "pddl: a planning problem.  ltlf: a temporal formula over plans.  bt: each robot's "
        "choices as a behaviour tree.",
    )
    max_actions: int = option(
        MAX_ACTIONS,
        "Beyond N joint actions robots choose one after another in the PDDL.",
        "N",
        least=0,
    )
    for_planner: Reader = option(
        "fd",
        "Who reads the PDDL: fd (Fast Downward) and kstar the same, pyperplan STRIPS only.",
        names=("--for",),
    )
    source: Source = group(Source)


@with_options(ExportOptions)
def export(
    language: LanguageSource,
    domain: DomainSource | None = None,
    problem: ProblemSource | None = None,
    sentence: SentenceSource | None = None,
    *,
    options: ExportOptions,
) -> Any:
    """Write a task under a sentence for other programs.

    Returns
    -------
    ExportedTask
        A planning problem whose optimal plans are exactly the plans that fit.
    ExportedFormula
        With ``to="ltlf"``: a temporal formula over plans.
    ExportedTrees
        With ``to="bt"``: each robot's choices as a behaviour tree.

    Raises
    ------
    UsageError
        For pyperplan, where STRIPS cannot say what is optimal.
    NoPlanFits
        If no optimal plan has the sentence.
    """
    said = given_sentence(sentence)
    used = read_task_language(language, domain, problem, options.source)
    words = used.words_of(said)
    if options.to == "pddl":
        pddl = _pddl(used, words, options.max_actions, options.for_planner)
        return ExportedTask(OpenPlans.of(used, words), pddl)
    if options.to == "bt":
        return _trees(used, words)
    found: SentenceFormula = export_ltlf(used, words)
    return ExportedFormula(
        found.formula, found.over_words, found.words, found.symbols, used.covered, used.tolerance
    )


def _trees(used: TaskLanguage, words: Sequence[int]) -> ExportedTrees:
    found = choices_under(used, words)
    robots = used.model.robots
    return ExportedTrees(
        xml=behaviour_trees(found),
        subplans={robots[own.robot]: own.automaton.count for own in found.robots},
        guaranteed=found.guaranteed,
        covered=used.covered,
        tolerance=used.tolerance,
    )


def _pddl(used: TaskLanguage, words: Sequence[int], max_actions: int, reader: Reader) -> PddlExport:
    return export_pddl(used, words, max_actions, strips_only=reader == "pyperplan")


def _label_text(model: JointModel, robot: int, label: int) -> str | None:
    return model.labels[robot][label] if label else None
