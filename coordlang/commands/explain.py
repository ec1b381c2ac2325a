# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang explain``: a language as a person reads it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from coordlang.commands.inputs import Arguments, coordinates_of, public
from coordlang.commands.plans import plans_text
from coordlang.commands.records import ExplainOptions
from coordlang.commands.terminal import covered_code, echo, warn_of_failures, working
from coordlang.execution.best_sentence import leading_sentences
from coordlang.execution.task_language import InTask, TaskLanguage
from coordlang.explanation import text as texts
from coordlang.explanation import words as wording
from coordlang.explanation.demands import SentenceDemands, meaning, sentence_demands
from coordlang.language.candidates import describe
from coordlang.language.provenance import tolerance_data
from coordlang.language.sentences import Sentence, TaskSentence, number_of_sentences, task_sentences
from planners.joint.model import show
from planners.search.plan_file import json_count
from planners.search.plans import Plans
from planners.system.messages import counted

#: Sentences of a task that the text lists.
SENTENCES_SHOWN = 10


@dataclass(frozen=True, slots=True)
class WordsExplained:
    """Each word as a short formula, exact in every state that the language maps.

    ``lifted``: formulas over features, if the words are functions of features; else None.
    """

    used: TaskLanguage
    mapped: wording.MappedStates
    covers: Mapping[str, wording.Cover]
    descriptions: wording.WordDescriptions
    lifted: wording.LiftedWords | None

    @property
    def pddl(self) -> dict[str, str]:
        """Word -> its formula as a PDDL condition."""
        return {word: texts.pddl_condition(cover) for word, cover in self.covers.items()}

    @property
    def states(self) -> dict[str, int]:
        """Word -> how many of the mapped states it holds."""
        return self.mapped.states

    def data(self) -> dict[str, Any]:
        """Words, variables and formulas, as ``--json`` has them."""
        rules = [
            {"word": word, "text": texts.shown(cover) if cover else None}
            for word, cover in self.descriptions.rules
        ]
        return {
            "words": self.states,
            "default": self.used.language.default,
            "variables": [
                {"name": v.name, "values": [None if a is None else show(a) for a in v.values]}
                for v in self.mapped.variables
            ],
            "formulas": {word: texts.cover_data(cover) for word, cover in self.covers.items()},
            "told": {"in_order": self.descriptions.in_order, "rules": rules},
            **({"lifted": self.lifted.data()} if self.lifted else {}),
        }

    def text(self) -> str:
        """The formulas as text, and what is proved of their lengths."""
        default, told = self.used.language.default, self.descriptions
        lines = [self.lifted.text(), "In this problem:"] if self.lifted else []
        if told.in_order:
            lines.append("The first formula that is true in a state gives its word:")
        lines.append(texts.descriptions_text(told, self.mapped))
        if not self.mapped.word.size:
            return "\n".join([*lines, f"No state is mapped: the word is always {default}."])
        exact = f"Exact in all {counted(len(self.mapped.word), 'mapped state')}"
        if self.used.is_mapped:
            exact += f". No {self.used.model.kept_plan} of these tasks leaves them"
        lines.append(f"{exact}; elsewhere the word is {default}.")
        if long := [word for word, cover in told.rules if cover and not cover.fewest]:
            rest = "for the others it is proved that they do not."
            lines.append(f"Fewer terms may suffice for {', '.join(long)}; {rest}")
        elif told.length > 1:
            lines.append("It is proved that no formula can do with fewer terms.")
        return "\n".join(lines)


@dataclass(frozen=True, repr=False, eq=False)
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
    def sentences(self) -> tuple[TaskSentence, ...]:
        """The sentence that was asked for, or all, those that leave most plans open first.

        Raises `OutOfMemory` beyond 100,000 sentences, or where it is too much work.
        """
        used, only = self.used, self.only
        found = task_sentences(used.space, used.task, used.partition, used.plans_with)
        return tuple(one for one in found if only is None or used.words_of(one.words) == only)

    def demands(self, sentences: Iterable[Sentence] | None = None) -> list[SentenceDemands]:
        """Return what sentences (word numbers; default: `sentences`) ask of each robot."""
        used, covers = self.used, self.words.covers
        if sentences is None:
            sentences = [used.words_of(own.words) for own in self.sentences]
        return [sentence_demands(used.plans_with(s), used.partition, covers) for s in sentences]

    @property
    def formulas(self) -> dict[str, str]:
        """Word -> its formula as text, exact by itself."""
        return {word: texts.shown(cover) for word, cover in self.words.covers.items()}

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
            entry |= asks.data()
        return {
            **self.words.data(),
            "task": describe(used.space, used.task),
            "covered": used.covered,
            "sentences": listed,
            **tolerance_data(used.language.tolerance),
        }

    def __str__(self) -> str:
        return f"{self.head}\n\n{self.task_text()}\n\n{self.words.text()}"

    @property
    def head(self) -> str:
        """What the language is, in a line, and in another one what it tolerates."""
        language, tolerance = self.used.language, self.used.language.tolerance
        number = language.provenance.tasks["count"]
        tasks = counted(number, "task") if number else "no recorded task"
        words, robots = counted(len(language.words), "word"), ", ".join(self.used.model.robots)
        line = f"{words} for {tasks} of {robots}; {language.guarantee.claim}."
        if tolerance is not None and tolerance.warning is not None:
            line += f"\n{tolerance.warning[0].upper()}{tolerance.warning[1:]}."
        return line

    def task_text(self) -> str:
        """Return the task's sentences as text, without the words."""
        used = self.used
        total, most = Plans.of(used.space, used.task).count, used.space.cost_of(used.task)[0]
        number = number_of_sentences(used.space, used.word, used.start)
        said = "too many sentences to count" if number is None else counted(number, "sentence")
        leading = leading_sentences(used, SENTENCES_SHOWN)
        listed = [words for words, _ in leading]
        lines = [
            f"The task {describe(used.space, used.task)}",
            f"has {plans_text(total, most, used.model.slack)} in {said}.",
        ]
        if 1 < len(listed) == number:
            meant = meaning([*map(used.plans_with, listed)])
            lines.append(texts.meaning_text([*map(used.text, listed)], meant))
        if self.with_demands:
            lines += self._demand_lines(listed if self.only is None else [self.only])
        else:
            for words, plans in leading:
                lines.append(f'  "{used.text(words)}" leaves {counted(plans, "plan")} open.')
        if self.only is None and number != len(listed):
            lines.append(f"  .. and {'more' if number is None else f'{number - len(listed):,}'}")
        return "\n".join(lines)

    def _demand_lines(self, sentences: Iterable[Sentence]) -> Iterator[str]:
        """What sentences ask of each robot, and that it may then choose for itself."""
        if self.used.guaranteed:
            yield (
                "Each robot may choose for itself: whatever the others choose, "
                f"it is {'a' if self.used.model.slack else 'an'} {self.used.model.kept_plan}."
            )
        for asks in self.demands(sentences):
            yield f"\n{texts.demands_text(asks)}"


@public(ExplainOptions)
def explain(files: Arguments, options: ExplainOptions) -> Explanation:
    """Explain a language: each word as a short formula, and the sentences of a task.

    Raises `NoPlanFits` if no optimal plan has the sentence.
    """
    used = files.task()
    only = None if options.sentence is None else used.words_of(options.sentence)
    if only is not None:
        used.plans_with(only)
    mapped = wording.mapped_states(used.partition, used.model)
    covers = wording.all_covers(mapped)
    descriptions = wording.describe_words(mapped, covers)
    points = coordinates_of(None, used.declared[1])
    lifted = wording.lifted_words(used.language, used.declared, used.model, points)
    words = WordsExplained(used, mapped, covers, descriptions, lifted)
    return Explanation(used, words, only, options.task)


def show_explain(found: Explanation, options: ExplainOptions) -> int:
    """Print the sentences of the task, then the words: what is easier to read comes first."""
    if not options.as_json:
        echo(found.head + "\n")
    with working("listing the sentences of the task"):
        text = json.dumps(found.data()) if options.as_json else found.task_text()
    echo(text if options.as_json else f"{text}\n\n{found.words.text()}", fit=not options.as_json)
    if options.task:
        return covered_code(found)
    warn_of_failures(found.tolerance)
    return 0
