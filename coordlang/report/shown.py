# SPDX-License-Identifier: GPL-3.0-or-later
"""Which tasks a report shows: those of problems, then candidate tasks of the language.

Candidate tasks are drawn at random if they are many.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random

from coordlang.execution.task_language import TaskLanguage, language_in_task
from coordlang.language.candidates import describe, explored_if_small
from coordlang.language.listed import ground_task
from coordlang.language.recorded import recorded_list
from coordlang.language.words import Language
from coordlang.required.miscoordination import Miscoordination, miscoordination
from planners.joint.model import PlanningTask
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.asynchronous import as_executed
from planners.search.kept_plans import search
from planners.search.optimal_plans import plan_space
from planners.system.errors import OutOfMemory, Position, ProvedImpossible, UsageError

#: Tasks looked at for each one shown, so that enough of them require coordination.
_TRIES = 12
#: The share of the drawn tasks that should require coordination, if there are such tasks.
_REQUIRING = 0.75
#: Pairs of states that are drawn.
_PAIRS = 100_000


@dataclass(frozen=True, slots=True)
class ShownTask:
    """A task that is shown, with the language in it.

    ``name`` is that of its problem, None for a candidate task; ``witness`` has plans that
    miscoordinate (None: there are none); ``decided``: the memory sufficed to find out.
    """

    name: str | None
    language: TaskLanguage
    witness: Miscoordination | None
    decided: bool


@dataclass(frozen=True, slots=True)
class Selection:
    """The tasks shown: those of the problems, then those that were drawn.

    Of the candidate tasks so many were ``looked`` at, and so many are ``requiring`` coordination;
    ``complete``: all of them are shown.
    """

    tasks: tuple[ShownTask, ...]
    looked: int
    requiring: int
    complete: bool

    @property
    def others(self) -> int:
        """How many tasks of problems are no candidate tasks of the language."""
        used = [shown.language for shown in self.tasks]
        return sum(not own.covered and own.verdict is None for own in used)


def select_tasks(
    language: Language,
    domain: Domain,
    problems: Sequence[Problem],
    number: int,
    seed: int,
    options: ModelOptions | None = None,
    position: Position | None = None,
) -> Selection:
    """Select at most ``number`` tasks: those of the problems, then different candidate tasks.

    Candidate tasks are drawn with ``seed``.  Tasks that require coordination are preferred, up to
    three quarters of those drawn.  Raises `UsageError` if there are more than ``number`` problems,
    `ProvedImpossible` if a problem cannot be solved.
    """
    if len(problems) > number:
        what = f"{len(problems)} problems are given and {number} tasks are to be shown"
        raise UsageError(what, remedy="Give fewer problems.")
    given = [
        _examined(p.name, language_in_task(language, domain, p, options, position))
        for p in problems
    ]
    candidates = _candidates(given[0].language, domain, problems[0], Random(seed), position)
    known = {describe(task.language.space, task.language.task) for task in given}
    room = number - len(given)
    wanted = round(room * _REQUIRING)
    requiring, others, complete = _looked_at(candidates, known, room, wanted)
    kept = [*requiring[: max(wanted, room - len(others))], *others][:room]
    looked = len(requiring) + len(others)
    found = Selection((*given, *kept), looked, len(requiring), complete and looked <= room)
    if found.complete and language.provenance.tasks.get("kind") == "all":  # of listed states
        count = int(language.provenance.tasks.get("count", 0))
        return replace(found, complete=len(found.tasks) - found.others >= count)
    return found


def _looked_at(
    candidates: Iterable[TaskLanguage], known: set[str], room: int, wanted: int
) -> tuple[list[ShownTask], list[ShownTask], bool]:
    """Tasks that require coordination and others, until there are enough; whether these are all."""
    requiring, others = list[ShownTask](), list[ShownTask]()
    for candidate in candidates:
        looked = len(requiring) + len(others)
        enough = len(requiring) >= wanted and looked >= room
        if enough or looked >= _TRIES * room:
            return requiring, others, False
        if (text := describe(candidate.space, candidate.task)) not in known:
            known.add(text)
            task = _examined(None, candidate)
            (others if task.witness is None else requiring).append(task)
    return requiring, others, True


def _examined(name: str | None, language: TaskLanguage) -> ShownTask:
    """Find out whether a task requires coordination."""
    try:
        return ShownTask(name, language, miscoordination(language.space, language.task), True)
    except OutOfMemory:
        return ShownTask(name, language, None, False)


def _candidates(
    first: TaskLanguage, domain: Domain, problem: Problem, random: Random, position: Position | None
) -> Iterator[TaskLanguage]:
    """Yield the language's candidate tasks in random order, some of them more than once."""
    kind, explored, model = first.language.provenance.tasks.get("kind"), None, first.model.in_step
    if kind != "problems":  # many tasks: where states are few they are searched once for all
        explored = explored_if_small(model, first.partition.rows)
    if kind == "all":
        tasks = _pairs(first, random)
    else:
        listed = recorded_list(first.language)
        random.shuffle(listed)
        ground = (ground_task(domain, problem, one, position) for one in listed)
        tasks = (PlanningTask("listed", first.model.state(init), goal) for init, goal in ground)
    for task in tasks:
        init = task.init[None, :]
        try:
            if explored is not None and (explored.numbers(init) >= 0).all():
                space = as_executed(plan_space(explored, [(task.goal, init)]))
            else:
                space = as_executed(search(model, task))
        except ProvedImpossible:
            continue  # of two states one need not be reachable from the other
        word = first.partition.word_of(space.rows)[space.state]
        yield replace(
            first, space=space, task=0, word=word, covered=True, guaranteed=False, verdict=None
        )


def _pairs(first: TaskLanguage, random: Random) -> Iterator[PlanningTask]:
    """Yield ordered pairs of different listed states, at most 100,000.

    Under ``--tasks all`` every state of a candidate task is listed in the language.
    """
    model = first.model
    rows = first.partition.rows
    rows = rows[(model.codec.last_labels(rows) < 0).all(axis=1)]
    number = len(rows)
    total = number * (number - 1)
    for code in random.sample(range(total), min(total, _PAIRS)):
        init, goal = divmod(code, number - 1)
        goal += goal >= init
        yield PlanningTask(f"pair {code}", rows[init], model.full_state(rows[goal]))
