# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang understand``: a sentence -> the plans that it leaves open."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from coordlang.commands.command import command_of
from coordlang.commands.files import write
from coordlang.commands.inputs import InTask, given_sentence, read_task
from coordlang.commands.keywords import with_options
from coordlang.commands.listing import Listing, form_of
from coordlang.commands.options import (
    NO_SLACK,
    DomainSource,
    LanguageSource,
    ProblemSource,
    SentenceSource,
    Source,
    json_option,
    output_option,
)
from coordlang.commands.plans import OptimalPlans
from coordlang.commands.terminal import covered_code, note
from coordlang.execution.drawing import cut_note, plans_dot
from coordlang.execution.open_plans import OpenPlans, PlanDag, open_plans_data, plan_dag
from planners.search.plan_file import Texts
from planners.system.errors import UsageError
from planners.system.options import group, option

#: Nodes of a drawn DAG.
NODES_DRAWN = 200


class SentencePlans(OptimalPlans, InTask):
    """The optimal plans that a sentence leaves open, as `OptimalPlans` with a drawn DAG."""

    __slots__ = ("_open", "used")
    shown = ("sentence", *OptimalPlans.shown, "covered")

    def __init__(self, open_plans: OpenPlans) -> None:
        super().__init__(open_plans.plans)
        self._open = open_plans
        self.used = open_plans.task_language

    @property
    def sentence(self) -> str:
        """The sentence."""
        return self.used.text(self._open.words)

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


@dataclass(frozen=True, slots=True)
class UnderstandOptions:
    """What `understand` can be asked for."""

    listing: Listing = group(Listing)
    form: Literal["ipc", "json", "dot"] = option(
        "ipc", "How plans are written; dot: drawn as one DAG.", names=("--format",), only="cli"
    )
    as_json: bool = json_option("Short for --format json.")
    nodes: int | None = option(
        None,
        f"Cut the DAG to about N nodes (default: {NODES_DRAWN} for dot; json: not cut).",
        "N",
        least=1,
        only="cli",
    )
    output: str | None = output_option()
    source: Source = group(Source, without=NO_SLACK)
    given: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        object.__setattr__(self, "form", form_of(self.form, self.as_json, self.given))
        if self.form == "dot" and not self.listing.is_default:
            raise UsageError(
                "--format dot draws the DAG of all plans",
                remedy="Leave out --count, --max and --sample.",
            )
        if self.nodes is not None and (self.form == "ipc" or self.listing.only_count):
            raise UsageError(
                "--nodes cuts the DAG: it belongs to --format dot or json, without --count",
                remedy="Leave out --nodes.",
            )


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
    said = given_sentence(sentence)
    used = read_task(language, domain, problem, options.source).used
    return SentencePlans(OpenPlans.of(used, used.words_of(said)))


@command_of(
    understand, "LANGUAGE DOMAIN PROBLEM SENTENCE", doing="finding the plans with the sentence"
)
def command(found: SentencePlans, options: UnderstandOptions) -> int:
    """Understand a sentence ("w1 w0").

    The optimal plans that it leaves open are counted, listed, sampled or drawn.

    --format dot draws them as one DAG, whose paths they are; json has both the listed plans and
    the DAG.
    """
    listing, nodes = options.listing, options.nodes or NODES_DRAWN
    listed = listing.chosen(found)
    if options.form == "dot":
        write(found.dot(nodes), options.output)
        if cut := found.cut_note(nodes):
            note(f"{cut}; --nodes N draws more")
    elif options.form == "json":
        data = found.data_with(listed, None if listing.only_count else found.dag(options.nodes))
        if listing.sample:
            data["complete"] = False
        write(json.dumps(data) + "\n", options.output)
    elif listing.only_count:
        write(f"{found.count}\n", options.output)
    else:
        write(listing.text(found, listed), options.output)
        listing.note_more(found, listed, "plans")
    return covered_code(found.covered, found.tolerance)
