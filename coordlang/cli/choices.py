"""``coordlang choices``: what each robot may do under a sentence, whatever the others choose."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from coordlang.cli.app import (
    GivenOptions,
    check_outputs,
    counted,
    domain_argument,
    form_of,
    language_argument,
    limits,
    model_options,
    problem_argument,
)

if TYPE_CHECKING:
    from coordlang.use.choices.choices import Choices, RobotChoices
    from coordlang.use.choices.monitor import Answer, Monitor

_STATES_SHOWN = 40


@click.command(name="choices")
@language_argument
@domain_argument
@problem_argument
@click.argument("sentence")
@click.option(
    "--robot",
    "whose",
    multiple=True,
    metavar="R",
    help="Whose choices; may be repeated (default: all).",
)
@click.option(
    "--check",
    is_flag=True,
    help="Walk every combination of all robots' choices: is each an optimal plan?",
)
@click.option(
    "--did",
    multiple=True,
    metavar="SUBACTION",
    help="What the robot did so far, one step each; or idle.",
)
@click.option(
    "--visit", multiple=True, metavar="ATOM", help="A detour: this becomes true, now or later."
)
@click.option("--avoid", multiple=True, metavar="ATOM", help="A detour: this is false from now on.")
@click.option(
    "--do",
    multiple=True,
    metavar="PATTERN",
    help="A detour: it does this at least once; * is any text.",
)
@click.option(
    "--never", multiple=True, metavar="PATTERN", help="A detour: it never does this any more."
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json", "dot"]),
    default="text",
    show_default=True,
)
@click.option("--json", "as_json", is_flag=True, help="Short for --format json.")
@click.option("-o", "--output", metavar="FILE", help="Write to this file instead of stdout.")
@model_options
@limits
def command(
    language: str,
    domain: str,
    problem: str,
    sentence: str,
    whose: tuple[str, ...],
    check: bool,
    did: tuple[str, ...],
    visit: tuple[str, ...],
    avoid: tuple[str, ...],
    do: tuple[str, ...],
    never: tuple[str, ...],
    form: str,
    as_json: bool,
    output: str | None,
    given: GivenOptions,
) -> int:
    """Say which subplans each robot may follow under SENTENCE ("w1 w0").

    Whatever the others choose from theirs, together they follow an optimal plan.

    With --did and the detours: what one robot may do next, and whether the detours can still be
    had, all at once.
    """
    from coordlang.cli.speaking import read_task_language, write
    from coordlang.use.choices.choices import MOST, choices
    from coordlang.use.choices.dot import to_dot
    from coordlang.use.choices.file import to_bytes

    form = form_of(form, as_json)
    check_outputs([("-o", output)], [language, domain, problem])
    spoken = read_task_language(language, domain, problem, given)
    chosen = _numbers(spoken.model.robots, whose)
    found = choices(spoken, spoken.words_of(sentence), most=None if check else MOST)
    if did or visit or avoid or do or never:
        if len(chosen) != 1 or form == "dot":
            raise click.UsageError(
                "--did, --visit, --avoid, --do and --never ask about one --robot, as text or JSON"
            )
        wanted = {"visit": visit, "avoid": avoid, "do": do, "never": never}
        text, code = _ask(found, spoken.model.robots[chosen[0]], did, wanted, form)
    elif form == "text":
        text, code = _text(found, chosen, check), 0
    else:
        text, code = (
            (to_dot(found, chosen) if form == "dot" else to_bytes(found, chosen).decode()),
            0,
        )
    write(text, output)
    return max(code, _judged(found, check))


def _numbers(known: tuple[str, ...], whose: tuple[str, ...]) -> list[int]:
    for robot in whose:
        if robot.lower() not in known:
            raise click.UsageError(
                f"--robot {robot}: there is no such robot; there are {', '.join(known)}"
            )
    return list(dict.fromkeys(known.index(robot.lower()) for robot in whose)) or list(
        range(len(known))
    )


def _judged(found: Choices, check: bool) -> int:
    """What is guaranteed, said on stderr where it is not everything; the exit code."""
    from coordlang.cli.miscoordination import show
    from coordlang.cli.speaking import covered

    walked = found.mixtures
    if walked is not None and walked.violation is not None:
        why = (
            "the file holds no coordination language"
            if found.task_language.covered
            else "the language does not cover it"
        )
        click.echo(f"coordlang: refuted: choices of this task miscoordinate; {why}", err=True)
        click.echo(show(walked.violation), err=True)
        return 1
    if check and not found.task_language.covered:
        click.echo(
            "coordlang: note: the language does not cover this task; --check proved this sentence",
            err=True,
        )
        return 0
    return covered(found.task_language)


def _text(found: Choices, chosen: list[int], check: bool) -> str:
    from coordlang.tasks.candidates import describe
    from planners.search.plans import Plans

    spoken = found.task_language
    plans = counted(Plans.of(found.fits).count, "plan")
    lines = [
        f"The task {describe(spoken.space, spoken.task)}",
        f'"{spoken.text(found.words)}" leaves {plans} open.',
    ]
    if check and found.mixtures is not None and found.mixtures.holds:
        number = 1
        for own in found.robots:
            number *= own.automaton.count
        nodes = counted(found.mixtures.nodes, "node")
        lines.append(
            f"checked: {counted(number, 'combination')} of own subplans, all optimal plans "
            f"({nodes} walked)"
        )
    for robot in chosen:
        lines += ["", *_table(found, found.robots[robot])]
    return "\n".join(lines) + "\n"


def _table(found: Choices, own: RobotChoices) -> list[str]:
    """The automaton state by state: what may be done there, where it leads, what is known there."""
    from coordlang.use.choices.dot import distinguishing

    model, automaton = found.task_language.model, own.automaton
    subplans = counted(automaton.count, "subplan")
    lines = [
        f"{model.robots[own.robot]} may follow {subplans} ({counted(len(automaton), 'state')}):"
    ]
    rows = [("step", "state", "left", "may do", "knows")]
    last = automaton.layers[-1]
    for step, states in enumerate(automaton.layers[:-1], 1):
        if states.start >= _STATES_SHOWN:
            break
        for state, atoms in zip(states, distinguishing(found, own, states), strict=True):
            moves = [
                f"{model.labels[own.robot][label] if label else 'idle'} -> {to}"
                for label, to in automaton.moves(state)
            ]
            rows.append(
                (
                    str(step),
                    str(state),
                    f"{automaton.left[state]:,}",
                    " | ".join(moves),
                    " ".join(atoms),
                )
            )
    del rows[_STATES_SHOWN + 1 :]
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    if len(rows) > 1:
        for row in rows:
            numbers = "  ".join(
                cell.rjust(width) for cell, width in zip(row[:3], widths, strict=False)
            )
            lines.append(f"  {numbers}  {row[3].ljust(widths[3])}  {row[4]}".rstrip())
    rest = last.start - (len(rows) - 1)
    if rest > 0:
        lines.append(f"  .. and {counted(rest, 'state')} more; --format json has all of them")
    return lines


def _ask(
    found: Choices, robot: str, did: tuple[str, ...], wanted: dict[str, tuple[str, ...]], form: str
) -> tuple[str, int]:
    """What a monitor says after what the robot did, and of its detours."""
    from coordlang.use.choices.file import monitor
    from coordlang.use.choices.monitor import MonitorError, NotAllowed
    from planners.errors import Refuted, UsageError

    try:
        at = monitor(found, robot)
        for subaction in did:
            at.did(subaction)
        answer = at.can(**wanted) if any(wanted.values()) else None
    except NotAllowed as error:
        raise Refuted(str(error), remedy="After that nothing is guaranteed any more.") from None
    except MonitorError as error:
        raise UsageError(str(error)) from None
    code = int(answer is not None and not answer)
    if form == "json":
        return json.dumps(_asked_data(at, answer)) + "\n", code
    if at.finished:
        lines = [f"{robot} has done all its {counted(at.step, 'step')}"]
    else:
        may = " or ".join(text or "idle" for text in at.allowed())
        lines = [
            f"step {at.step + 1}: {robot} may do {may}; {counted(at.remaining, 'subplan')} left"
        ]
    if answer is not None and not answer:
        lines.append("the detour is not possible any more, whatever it does")
    elif answer is not None:
        lines.append(
            f"the detour is possible in {counted(answer.subplans, 'subplan')}, the first of them:"
        )
        lines += [
            f"  {step:>4}  {text or 'idle'}"
            for step, text in enumerate(answer.subplan or (), at.step + 1)
        ]
    return "\n".join(lines) + "\n", code


def _asked_data(at: Monitor, answer: Answer | None) -> dict[str, Any]:
    from planners.search.plan_file import json_count

    data: dict[str, Any] = {
        "robot": at.robot,
        "step": at.step,
        "allowed": list(at.allowed()),
        "left": json_count(at.remaining),
        "atoms": at.atoms,
    }
    if answer is not None:
        data["possible"] = bool(answer)
        data["subplans"] = json_count(answer.subplans)
        data["subplan"] = list(answer.subplan) if answer.subplan is not None else None
    return data
