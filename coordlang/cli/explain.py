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
    from coordlang.language import Language
    from coordlang.sentences import TaskSentence

_STATES_SHOWN = 4
_SENTENCES_SHOWN = 10


@click.command(name="explain")
@language_argument
@domain_argument
@problem_argument
@click.option("--json", "as_json", is_flag=True, help="One JSON object.")
@model_options
@limits
def command(language: str, domain: str, problem: str, as_json: bool, given: GivenOptions) -> None:
    """Show a language: its words and their sizes, and what the sentences of PROBLEM's task ask of each robot."""
    from coordlang.file import check_source, read_language
    from coordlang.language import WordTable
    from coordlang.sentences import task_sentences
    from coordlang.tasks import describe, from_problems
    from planners.errors import Place

    spoken = read_language(language)
    lifted, read = read_files(domain, (problem,))
    check_source(spoken, lifted, read, Place(language))
    candidates = from_problems(lifted, read, given.for_language(spoken))
    space = candidates.spaces[0]
    sentences = task_sentences(space, 0, WordTable.of(spoken, candidates.model))
    if as_json:
        click.echo(json.dumps(_data(spoken, describe(space, 0), sentences)))
        return
    click.echo(_words(spoken))
    click.echo()
    click.echo(_sentences(describe(space, 0), candidates.model.robots, sentences))


def _data(language: Language, task: str, sentences: list[TaskSentence]) -> dict[str, Any]:
    from planners.planfile import json_count

    return {
        "words": language.sizes(),
        "default": language.default,
        "task": task,
        "sentences": [
            {
                "sentence": " ".join(s.words),
                "plans": json_count(s.plans),
                "choices": [[list(own) for own in step] for step in s.choices],
            }
            for s in sentences
        ],
    }


def _words(language: Language) -> str:
    members: dict[str, list[str]] = {word: [] for word in language.words}
    for key, word in language.states.items():
        members[word].append(key)
    g = language.guarantee
    proof = "proved minimal" if g.proved_minimal else f"at least {g.lower_bound} needed"
    lines = [f"{counted(len(language.words), 'word')} ({g.method}, {proof}) for {counted(language.tasks['count'], 'task')} "
             f"of {', '.join(language.robots)}:"]  # fmt: skip
    for word, states in members.items():
        rest = len(states) - _STATES_SHOWN
        size = counted(len(states), "state")
        other = " and every state not listed" if word == language.default else ""
        lines.append(f"  {word}: {size}{other}")
        lines += [f"      {state}" for state in states[:_STATES_SHOWN]]
        if rest > 0:
            lines.append(f"      .. and {rest} more")
    return "\n".join(lines)


def _sentences(task: str, robots: tuple[str, ...], sentences: list[TaskSentence]) -> str:
    total = sum(s.plans for s in sentences)
    lines = [f"The task {task}"]
    lines.append(f"has {counted(total, 'optimal plan')} in {counted(len(sentences), 'sentence')}:")
    for sentence in sentences[:_SENTENCES_SHOWN]:
        lines.append(
            f'  "{" ".join(sentence.words)}" leaves {counted(sentence.plans, "plan")} open:'
        )
        for number, step in enumerate(sentence.choices, 1):
            parts = [f"{robot} {_either(own)}" for robot, own in zip(robots, step, strict=True)]
            lines.append(f"    step {number}: " + "; ".join(parts))
    if len(sentences) > _SENTENCES_SHOWN:
        lines.append(f"  .. and {len(sentences) - _SENTENCES_SHOWN} more sentences")
    return "\n".join(lines)


def _either(choices: tuple[str | None, ...]) -> str:
    return " or ".join(text or "idles" for text in choices)
