"""``coordlang explain``: a language as a person reads it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from coordlang.cli.app import (
    GivenOptions,
    counted,
    domain_argument,
    language_argument,
    limits,
    model_options,
    problem_argument,
    read_files,
)

if TYPE_CHECKING:
    from coordlang.explanation.cover import Cover
    from coordlang.explanation.demands import SentenceDemands
    from coordlang.explanation.descriptions import WordDescriptions
    from coordlang.explanation.words import MappedStates
    from coordlang.language.sentences import TaskSentence
    from coordlang.use.sentence.task_language import TaskLanguage

_SENTENCES_SHOWN = 10


@click.command(name="explain")
@language_argument
@domain_argument
@problem_argument
@click.option(
    "--task", is_flag=True, help="What each sentence of PROBLEM's task asks of each robot."
)
@click.option("--sentence", metavar="WORDS", help='With --task: this sentence only, as in "w1 w0".')
@click.option(
    "--each",
    is_flag=True,
    help="A formula of its own for every word, also where less would say the same.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(
    language: str,
    domain: str,
    problem: str,
    task: bool,
    sentence: str | None,
    each: bool,
    as_json: bool,
    given: GivenOptions,
) -> int:
    """Show each word of a language as a short formula.

    With --task also show what the sentences of a task demand of each robot.
    """
    from coordlang.explanation.descriptions import describe_words
    from coordlang.explanation.words import all_covers, mapped_states
    from coordlang.language.file import read_language
    from coordlang.language.sentences import task_sentences
    from coordlang.use.sentence.task_language import language_in_task
    from planners.errors import Position

    if sentence is not None and not task:
        raise click.UsageError("--sentence: only with --task")
    read = read_language(language)
    lifted, (lifted_problem,) = read_files(domain, (problem,))
    spoken = language_in_task(
        read, lifted, lifted_problem, given.for_language(read), Position(language)
    )
    mapped = mapped_states(read, spoken.model)
    formulas = all_covers(mapped)
    told = describe_words(mapped, formulas, each)
    if not as_json:
        click.echo(
            _words(spoken, mapped, told) + "\n"
        )  # first: a task may have too many sentences to list
    every = task_sentences(spoken.space, spoken.task, spoken.partition)
    sentences = every if sentence is None else _only(spoken, every, sentence)
    asks = (
        [
            _asked(spoken, formulas, s)
            for s in (sentences if as_json else sentences[:_SENTENCES_SHOWN])
        ]
        if task
        else []
    )
    if as_json:
        click.echo(json.dumps(_data(spoken, mapped, formulas, told, sentences, asks)))
    else:
        click.echo(_task(spoken, len(every), sentences, asks))
    if task and not spoken.covered:
        click.echo(
            "coordlang: warning: the language does not cover this task: it guarantees nothing here",
            err=True,
        )
        return 1
    return 0


def _only(spoken: TaskLanguage, sentences: list[TaskSentence], sentence: str) -> list[TaskSentence]:

    words = spoken.words_of(sentence)
    said = [s for s in sentences if s.words == tuple(spoken.partition.words[w] for w in words)]
    if not said:
        spoken.plans_with(words)  # raises, and says where no plan fits any more
    return said


def _asked(
    spoken: TaskLanguage, formulas: dict[str, Cover], sentence: TaskSentence
) -> SentenceDemands:
    from coordlang.explanation.demands import sentence_demands

    return sentence_demands(
        spoken.plans_with(spoken.words_of(sentence.words)), spoken.partition, formulas
    )


def _data(
    spoken: TaskLanguage,
    mapped: MappedStates,
    formulas: dict[str, Cover],
    told: WordDescriptions,
    sentences: list[TaskSentence],
    asks: list[SentenceDemands],
) -> dict[str, Any]:
    from coordlang.explanation.text import cover_data, demands_data, shown
    from coordlang.tasks.candidates import describe
    from planners.search.plan_file import json_count

    listed = [
        {
            "sentence": " ".join(s.words),
            "plans": json_count(s.plans),
            "choices": [[list(own) for own in step] for step in s.choices],
        }
        for s in sentences
    ]
    for entry, ask in zip(listed, asks, strict=False):
        entry |= demands_data(ask)
    return {
        "words": dict(zip(mapped.words, mapped.states, strict=True)),
        "default": spoken.language.default,
        "variables": [
            {"name": v.name, "values": list(v.value_texts)} for v in mapped.valuation.variables
        ],
        "formulas": {word: cover_data(formula) for word, formula in formulas.items()},
        "told": {
            "in_order": told.in_order,
            "rules": [
                {"word": word, "text": shown(formula) if formula else None}
                for word, formula in told.rules
            ],
        },
        "task": describe(spoken.space, spoken.task),
        "covered": spoken.covered,
        "sentences": listed,
    }


def _words(spoken: TaskLanguage, mapped: MappedStates, told: WordDescriptions) -> str:
    from coordlang.explanation.text import descriptions_text

    language = spoken.language
    g = language.guarantee
    proof = "proved minimal" if g.proved_minimal else f"at least {g.lower_bound} needed"
    tasks = (
        counted(number, "task")
        if (number := language.provenance.tasks["count"])
        else "no recorded task"
    )
    lines = [
        f"{counted(len(language.words), 'word')} ({g.method}, {proof}) for {tasks} "
        f"of {', '.join(spoken.model.robots)}."
    ]
    if told.in_order:
        lines.append("The first formula that is true in a state gives its word:")
    lines.append(descriptions_text(told, mapped))
    long = [word for word, formula in told.rules if formula and not formula.fewest]
    if not mapped.word.size:
        return "\n".join([*lines, f"No state is mapped: the word is always {language.default}."])
    lines.append(
        f"Exact in all {counted(sum(mapped.states), 'mapped state')}. No optimal plan of these "
        "tasks leaves them; "
        f"elsewhere the word is {language.default}."
    )
    if long:
        lines.append(
            f"Fewer terms may suffice for {', '.join(long)}; for the others it is proved that "
            "they do not."
        )
    elif told.length > 1:
        lines.append("It is proved that no formula can do with fewer terms.")
    return "\n".join(lines)


def _task(
    spoken: TaskLanguage, number: int, sentences: list[TaskSentence], asks: list[SentenceDemands]
) -> str:
    from coordlang.explanation.text import demands_text
    from coordlang.tasks.candidates import describe
    from planners.search.plans import Plans

    total = Plans.of(spoken.space, spoken.task).count
    steps = int(spoken.space.layer[spoken.start])
    lines = [f"The task {describe(spoken.space, spoken.task)}"]
    lines.append(
        f"has {counted(total, 'optimal plan')} of {counted(steps, 'step')} "
        f"in {counted(number, 'sentence')}."
    )
    if asks and spoken.covered:
        lines.append(
            "Each robot may choose for itself: whatever the others choose, it is an optimal plan."
        )
    for place, sentence in enumerate(sentences[:_SENTENCES_SHOWN]):
        if asks:
            lines += ["", demands_text(asks[place])]
        else:
            lines.append(
                f'  "{" ".join(sentence.words)}" leaves {counted(sentence.plans, "plan")} open.'
            )
    if len(sentences) > _SENTENCES_SHOWN:
        lines.append(f"  .. and {counted(len(sentences) - _SENTENCES_SHOWN, 'more sentence')}")
    return "\n".join(lines)
