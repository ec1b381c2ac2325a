# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang explain``: a language as a person reads it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from coordlang.commands.inputs import Arguments, InTask, public, read_coordinates_of
from coordlang.commands.layout import fitted
from coordlang.commands.records import ExplainOptions
from coordlang.commands.terminal import covered_code, echo, line_width, warn_of_failures, working
from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.demands import SentenceDemands, sentence_demands
from coordlang.explanation.lifted_words import LiftedWords, lifted_words
from coordlang.explanation.text import (
    cover_data,
    demands_data,
    demands_text,
    descriptions_text,
    pddl_condition,
)
from coordlang.explanation.text import shown as formula_text
from coordlang.explanation.words import (
    Cover,
    MappedStates,
    WordDescriptions,
    all_covers,
    describe_words,
    mapped_states,
)
from coordlang.language.candidates import describe
from coordlang.language.sentences import TaskSentence, task_sentences
from coordlang.language.tolerance import tolerance_data
from planners.search.plan_file import json_count
from planners.search.plans import Plans
from planners.system.errors import OutOfMemory
from planners.system.notebook import Presented, counted, html_table

#: Sentences of a task that the text lists.
SENTENCES_SHOWN = 10


@dataclass(frozen=True, slots=True, repr=False)
class WordsExplained(Presented):
    """Each word as a short formula, exact in every state that the language maps.

    ``lifted``: formulas over features, if the words are functions of features; else None.
    """

    used: TaskLanguage
    mapped: MappedStates
    covers: Mapping[str, Cover]
    descriptions: WordDescriptions
    lifted: LiftedWords | None = None

    @property
    def formulas(self) -> dict[str, str]:
        """Word -> its formula as text, exact by itself."""
        return {word: formula_text(cover) for word, cover in self.covers.items()}

    @property
    def pddl(self) -> dict[str, str]:
        """Word -> its formula as a PDDL condition."""
        return {word: pddl_condition(cover) for word, cover in self.covers.items()}

    @property
    def states(self) -> dict[str, int]:
        """Word -> how many of the mapped states it holds."""
        return dict(zip(self.mapped.words, self.mapped.states, strict=True))

    def facts(self) -> Mapping[str, object]:
        """The words with their formulas."""
        return self.formulas

    def data(self) -> dict[str, Any]:
        """Words, variables and formulas, as ``--json`` has them."""
        variables = self.mapped.valuation.variables
        return {
            "words": self.states,
            "default": self.used.language.default,
            "variables": [{"name": v.name, "values": list(v.value_texts)} for v in variables],
            "formulas": {word: cover_data(cover) for word, cover in self.covers.items()},
            "told": {
                "in_order": self.descriptions.in_order,
                "rules": [
                    {"word": word, "text": formula_text(cover) if cover else None}
                    for word, cover in self.descriptions.rules
                ],
            },
            **({"lifted": self.lifted.data()} if self.lifted else {}),
        }

    def __str__(self) -> str:
        return f"{self.head}\n{self.formulas_text()}"

    def formulas_text(self) -> str:
        """Return the formulas as text, without what the language is."""
        lines = [self.lifted.text(), "In this problem:"] if self.lifted else []
        if self.descriptions.in_order:
            lines.append("The first formula that is true in a state gives its word:")
        lines.append(descriptions_text(self.descriptions, self.mapped))
        default = self.used.language.default
        if not self.mapped.word.size:
            return "\n".join([*lines, f"No state is mapped: the word is always {default}."])
        meant = self.used.model.kept_plan
        lines.append(
            f"Exact in all {counted(sum(self.mapped.states), 'mapped state')}. No {meant} of "
            f"these tasks leaves them; elsewhere the word is {default}."
        )
        return "\n".join([*lines, *self._proof()])

    @property
    def head(self) -> str:
        """What the language is, in a line."""
        language = self.used.language
        number = language.provenance.tasks["count"]
        tasks = counted(number, "task") if number else "no recorded task"
        words, robots = counted(len(language.words), "word"), ", ".join(self.used.model.robots)
        line = f"{words} for {tasks} of {robots}; {language.guarantee.claim}."
        tolerance = language.tolerance
        if tolerance is not None and tolerance.warning is not None:
            line += f"\n{tolerance.warning[0].upper()}{tolerance.warning[1:]}."
        return line

    def _proof(self) -> list[str]:
        """Return what is proved of the formulas' lengths, in at most one line."""
        rules = self.descriptions.rules
        long = [word for word, cover in rules if cover and not cover.fewest]
        if long:
            return [
                f"Fewer terms may suffice for {', '.join(long)}; "
                "for the others it is proved that they do not."
            ]
        if self.descriptions.length > 1:
            return ["It is proved that no formula can do with fewer terms."]
        return []


@dataclass(frozen=True, repr=False)
class Explanation(InTask):
    """The words as formulas, and the sentences of one task, found when they are asked for.

    ``only`` is the one sentence that was asked for (word numbers), or None; ``with_demands``:
    whether the text and the data say what each sentence asks of each robot.
    """

    used: TaskLanguage
    words: WordsExplained
    only: tuple[int, ...] | None
    with_demands: bool
    shown = ("formulas", "covered")

    @cached_property
    def all_sentences(self) -> tuple[TaskSentence, ...]:
        """All sentences of the task, those that leave most plans open first.

        Raises `OutOfMemory` beyond 100,000 sentences.
        """
        used = self.used
        return tuple(task_sentences(used.space, used.task, used.partition))

    @property
    def sentences(self) -> tuple[TaskSentence, ...]:
        """The sentences that were asked for: one, or all."""
        if self.only is None:
            return self.all_sentences
        wanted = tuple(self.used.partition.words[word] for word in self.only)
        return tuple(s for s in self.all_sentences if s.words == wanted)

    def demands(self, most: int | None = None) -> list[SentenceDemands]:
        """Return what the (first) sentences ask of each robot."""
        used = self.used
        return [
            sentence_demands(
                used.plans_with(used.words_of(sentence.words)), used.partition, self.words.covers
            )
            for sentence in self.sentences[:most]
        ]

    @property
    def formulas(self) -> dict[str, str]:
        """Word -> its formula as text."""
        return self.words.formulas

    def data(self) -> dict[str, Any]:
        """Words and sentences, as ``--json`` has them."""
        used = self.used
        listed: list[dict[str, Any]] = [
            {
                "sentence": " ".join(sentence.words),
                "plans": json_count(sentence.plans),
                "choices": [[list(own) for own in step] for step in sentence.choices],
            }
            for sentence in self.sentences
        ]
        for entry, asks in zip(listed, self.demands() if self.with_demands else (), strict=False):
            entry |= demands_data(asks)
        return {
            **self.words.data(),
            "task": describe(used.space, used.task),
            "covered": used.covered,
            "sentences": listed,
            **tolerance_data(used.tolerance),
        }

    def __str__(self) -> str:
        return f"{self.words.head}\n\n{self.task_text()}\n\n{self.words.formulas_text()}"

    def _repr_html_(self) -> str:
        states = self.words.states
        rows = [(word, f"{states[word]:,}", text) for word, text in self.formulas.items()]
        return html_table(("word", "states", "formula"), rows)

    def task_text(self) -> str:
        """Return the task's sentences as text, without the words."""
        used = self.used
        total = Plans.of(used.space, used.task).count
        steps, _ = used.space.cost_of(used.task)
        plans = f"{counted(total, 'optimal plan')} of"
        if used.model.slack:
            plans = f"{counted(total, 'plan')} within slack {used.model.slack}, of at most"
        lines = [
            f"The task {describe(used.space, used.task)}",
            f"has {plans} {counted(steps, 'step')} "
            f"in {counted(len(self.all_sentences), 'sentence')}.",
        ]
        if self.with_demands and used.guaranteed:
            lines.append(
                "Each robot may choose for itself: whatever the others choose, "
                f"it is {'a' if used.model.slack else 'an'} {used.model.kept_plan}."
            )
        if self.with_demands:
            for asks in self.demands(SENTENCES_SHOWN):
                lines += ["", demands_text(asks)]
        else:
            for sentence in self.sentences[:SENTENCES_SHOWN]:
                plans = counted(sentence.plans, "plan")
                lines.append(f'  "{" ".join(sentence.words)}" leaves {plans} open.')
        more = len(self.sentences) - SENTENCES_SHOWN
        if more > 0:
            lines.append(f"  .. and {counted(more, 'more sentence')}")
        return "\n".join(lines)


@public(ExplainOptions)
def explain(files: Arguments, options: ExplainOptions) -> Explanation:
    """Explain a language: each word as a short formula, and the sentences of a task.

    Raises
    ------
    OutOfMemory
        If the task has more than 100,000 sentences.
    NoPlanFits
        If no optimal plan has the sentence.
    """
    task = files.task()
    used, first = task.used, task.files.problems[0]
    only = None if options.sentence is None else used.words_of(options.sentence)
    if only is not None:
        used.plans_with(only)
    mapped = mapped_states(used.language, used.model)
    covers = all_covers(mapped)
    descriptions = describe_words(mapped, covers, options.formula_per_word)
    points = read_coordinates_of(None, first)
    lifted = lifted_words(
        used.language, task.files.domain, first, used.model, points, task.position
    )
    words = WordsExplained(used, mapped, covers, descriptions, lifted)
    return Explanation(used, words, only, options.task)


def show_explain(found: Explanation, options: ExplainOptions) -> int:
    """Print the sentences of the task, and the words."""
    if options.as_json:
        with working("listing the sentences of the task"):
            data = found.data()
        echo(json.dumps(data))
    else:
        _show_text(found)
    if options.task:
        return covered_code(found.covered, found.tolerance)
    warn_of_failures(found.tolerance)
    return 0


def _show_text(found: Explanation) -> None:
    """What is easier to read comes first; where a task has too many sentences, the words alone."""
    echo(found.words.head + "\n")
    width = line_width()
    words = fitted(found.words.formulas_text(), width)
    try:
        with working("listing the sentences of the task"):
            task = found.task_text()
    except OutOfMemory:
        echo(words)
        raise
    echo(f"{fitted(task, width)}\n\n{words}")
