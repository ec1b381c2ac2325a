"""Which tasks a report shows: those of problems, then candidate tasks of the language.

Candidate tasks are drawn at random if they are many.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random

from coordlang.language.recorded import recorded_list
from coordlang.language.words import Language
from coordlang.required.miscoordination import Miscoordination, miscoordination
from coordlang.tasks.listed import goal_text, planning_task
from coordlang.use.sentence.task_language import TaskLanguage, language_in_task
from planners.errors import OutOfMemory, Position, ProvedImpossible, UsageError
from planners.joint.model import PlanningTask
from planners.loading import ModelOptions
from planners.pddl.lifted import Domain, Problem
from planners.search.optimal_plans import search

#: Tasks looked at for each one shown, so that enough of them require coordination.
_TRIES = 12
#: The share of the drawn tasks that should require coordination, if there are such tasks.
_REQUIRING = 0.75


@dataclass(frozen=True, slots=True)
class ShownTask:
    """A task that is shown.

    ``name`` is that of its problem, None for a candidate task of the language.  ``witness``: plans
    that miscoordinate, None if there are none.  ``decided`` is False where the memory did not
    suffice to find out.
    """

    name: str | None
    spoken: TaskLanguage
    witness: Miscoordination | None
    decided: bool


@dataclass(frozen=True, slots=True)
class Selection:
    """The tasks shown.

    ``looked`` tasks were drawn for it, ``requiring`` of which require coordination; ``complete``:
    all candidate tasks are shown.
    """

    tasks: tuple[ShownTask, ...]
    looked: int
    requiring: int
    complete: bool


def select_tasks(
    language: Language,
    domain: Domain,
    problems: Sequence[Problem],
    number: int,
    seed: int,
    options: ModelOptions | None = None,
    position: Position | None = None,
) -> Selection:
    """At most ``number`` tasks.

    The problems' own first, then candidate tasks drawn without repetition.

    Of those drawn, tasks that require coordination are preferred, up to three quarters.  Raises
    `UsageError` if the problems alone are more, `ProvedImpossible` for an unsolvable one.
    """
    if len(problems) > number:
        raise UsageError(
            f"{len(problems)} problems are given and {number} tasks are to be shown",
            remedy="Give fewer problems, or a larger --tasks-shown.",
        )
    given = [
        _looked_at(p.name, language_in_task(language, domain, p, options, position))
        for p in problems
    ]
    known = {_identity(task.spoken) for task in given}
    room = number - len(given)
    first = given[0].spoken
    drawn: tuple[list[ShownTask], list[ShownTask]] = ([], [])
    wanted = round(room * _REQUIRING)
    looked, complete = 0, True
    for spoken in _candidates(first, domain, problems[0], Random(seed), position):
        if (
            len(drawn[1]) >= wanted and len(drawn[0]) + len(drawn[1]) >= room
        ) or looked >= _TRIES * room:
            complete = False
            break
        if _identity(spoken) in known:
            continue
        known.add(_identity(spoken))
        looked += 1
        task = _looked_at(None, spoken)
        drawn[task.witness is not None].append(task)
    complete = complete and len(drawn[0]) + len(drawn[1]) <= room
    kept = [*drawn[1][: max(wanted, room - len(drawn[0]))], *drawn[0]][:room]
    requiring = len(drawn[1])
    return Selection((*given, *kept), looked, requiring, complete)


def _looked_at(name: str | None, spoken: TaskLanguage) -> ShownTask:
    try:
        return ShownTask(name, spoken, miscoordination(spoken.space, spoken.task), True)
    except OutOfMemory:
        return ShownTask(name, spoken, None, False)


def _identity(spoken: TaskLanguage) -> tuple[str, str]:
    space = spoken.space
    init = space.model.codec.key(space.rows[space.state[spoken.start]])
    return init, goal_text(space.model, space.goals[0])


def _candidates(
    first: TaskLanguage, domain: Domain, problem: Problem, random: Random, position: Position | None
) -> Iterator[TaskLanguage]:
    """The language's candidate tasks in random order.

    Under ``--tasks all`` endless repetition is cut off.
    """
    language = first.language
    tasks = (
        _pairs(first, random)
        if language.provenance.tasks.get("kind") == "all"
        else _recorded(first, domain, problem, random, position)
    )
    for task in tasks:
        try:
            space = search(first.model, task)
        except ProvedImpossible:
            continue  # of two states one need not be reachable from the other
        word = first.partition.word_of(space.rows)[space.state]
        yield replace(first, space=space, task=0, word=word, covered=True)


def _recorded(
    first: TaskLanguage, domain: Domain, problem: Problem, random: Random, position: Position | None
) -> Iterator[PlanningTask]:
    listed = recorded_list(first.language)
    random.shuffle(listed)
    for one in listed:
        yield planning_task(first.model, domain, problem, one, position)


def _pairs(first: TaskLanguage, random: Random) -> Iterator[PlanningTask]:
    """Ordered pairs of different mapped states.

    Under ``--tasks all`` every state of a candidate task is mapped.
    """
    model = first.model
    rows = first.partition.rows
    rows = rows[(model.codec.last_labels(rows) < 0).all(axis=1)]
    number = len(rows)
    total = number * (number - 1)
    order = random.sample(range(total), min(total, 100_000))
    for code in order:
        a, b = divmod(code, number - 1)
        b += b >= a
        yield PlanningTask(f"pair {code}", rows[a], model.full_state(rows[b]))
