# SPDX-License-Identifier: GPL-3.0-or-later
"""The tasks of a report: those of problems, then candidate tasks of the language.

Which ones it shows, drawn at random if they are many, and what its page needs of each: its plans,
its sentences, what goes wrong without them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from operator import itemgetter
from random import Random
from typing import Any

import numpy as np

from coordlang.execution.automaton import determinise
from coordlang.execution.best_sentence import leading_sentences
from coordlang.execution.plan_sentence import carried_out
from coordlang.execution.task_language import TaskLanguage, language_in_task
from coordlang.language.candidates import describe, explored_if_small
from coordlang.language.listed import goal_text, ground_tasks
from coordlang.language.recorded import recorded_list
from coordlang.language.sentences import Sentence, number_of_sentences
from coordlang.language.words import Language
from coordlang.report.layout import layer_orders
from coordlang.required.failure import TooManyToCount, failure_probability
from coordlang.required.miscoordination import Miscoordination, miscoordination
from coordlang.sites.world import World
from coordlang.verification.by_definition import Verdict, verify
from planners.joint.model import FullState, JointModel, PlanningTask
from planners.joint.states import split_atoms
from planners.joint.tables import Ints, Rows, unique_rows
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.asynchronous import as_executed
from planners.search.kept_plans import search
from planners.search.optimal_plans import plan_space
from planners.search.plan_file import json_count
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, counts
from planners.system.errors import OutOfMemory, ProvedImpossible, UsageError

#: Tasks looked at for each one shown, so that enough of them require coordination.
_TRIES = 12
#: The share of the drawn tasks that should require coordination, if there are such tasks.
_REQUIRING = 0.75
#: Pairs of states that are drawn.
_PAIRS = 100_000
#: Plan-space edges of one task beyond which plans are drawn.
EDGES = 4_000
#: Sentences listed for one task.
SENTENCES = 60
#: Members of the subsets with which one robot's own subplans are counted; beyond, they are not.
_SUBSETS = 200_000
#: Additions beyond which it is not counted how often robots fail in a task.
_ADDITIONS = 300_000
#: Plan-space edges beyond which a task is not verified again for the page.
_VERIFIED = 20_000


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
) -> Selection:
    """Select at most ``number`` tasks: those of the problems, then different candidate tasks.

    Candidate tasks are drawn with ``seed``.  Tasks that require coordination are preferred, up to
    three quarters of those drawn.  Raises `UsageError` if there are more than ``number`` problems,
    `ProvedImpossible` if a problem cannot be solved.
    """
    if len(problems) > number:
        what = f"{len(problems)} problems are given and {number} tasks are to be shown"
        raise UsageError(what, remedy="Give fewer problems.")
    given = [_examined(p.name, language_in_task(language, domain, p, options)) for p in problems]
    candidates = _candidates(given[0].language, Random(seed))
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


def _candidates(first: TaskLanguage, random: Random) -> Iterator[TaskLanguage]:
    """Yield the language's candidate tasks in random order, some of them more than once."""
    kind, explored, model = first.language.provenance.tasks.get("kind"), None, first.model.in_step
    rows, codec = model.forgetting_slack(first.partition.rows), model.codec
    nothing = np.full_like(codec.last_labels(rows), -1)
    states, _ = unique_rows(codec.remembering(codec.facts_part(rows), nothing))  # at a start
    if kind != "problems":  # many tasks: where states are few they are searched once for all
        explored = explored_if_small(model, states)
    if kind == "all":
        tasks = _pairs(model, states, random)
    else:
        listed = recorded_list(first.language)
        random.shuffle(listed)
        ground = ground_tasks(*first.declared, listed, first.language.position)
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


def _pairs(model: JointModel, rows: Rows, random: Random) -> Iterator[PlanningTask]:
    """Yield ordered pairs of different listed states, at most 100,000.

    Under ``--tasks all`` every state of a candidate task is listed in the language.
    """
    number = len(rows)
    total = number * (number - 1)
    for code in random.sample(range(total), min(total, _PAIRS)):
        init, goal = divmod(code, number - 1)
        goal += goal >= init
        yield PlanningTask(f"pair {code}", rows[init], model.full_state(rows[goal]))


# ---- what a page needs of a task


class Tables:
    """States and labels that the page mentions, in the order of their first mention.

    ``states`` are mentioned already, by their keys.
    """

    def __init__(self, robots: int, states: Sequence[str]) -> None:
        self.states = {key: number for number, key in enumerate(states)}
        self.labels: list[dict[str | None, int]] = [{None: 0} for _ in range(robots)]

    def state(self, key: str) -> int:
        """Return the number of a state, given by its key."""
        return self.states.setdefault(key, len(self.states))

    def label(self, robot: int, text: str | None) -> int:
        """Return the number of a robot's label; None is idling."""
        own = self.labels[robot]
        return own.setdefault(text, len(own))


def task_data(shown: ShownTask, tables: Tables, seed: int) -> dict[str, Any]:
    """Return a task as JSON data, with states and labels as numbers into ``tables``."""
    language, space = shown.language, shown.language.space
    part = drawn_part(language, seed)
    leading = leading_sentences(language, SENTENCES)
    number = number_of_sentences(space, language.word, language.start)
    verdict = _verdict(language)
    violation = verdict.witness if verdict else None  # plans of one sentence that miscoordinate
    makespan, second = space.cost_of(language.task)
    requires = None if not shown.decided else shown.witness is not None
    return {
        "name": shown.name,
        "covered": language.covered and (violation is None or language.language.may_fail),
        "requires": requires,
        "silence": _failure(language, None) if requires else None,
        "failure": _failure(language, language.word) if violation else None,
        "verified": verdict.holds if verdict else None,
        "steps": makespan,
        "second": second if language.model.cost != "makespan" else None,
        "plans": str(counts(space)[language.start]),
        "complete": part is space,
        "all_nodes": len(space),
        "all_edges": len(space.target),
        **_graph_data(part, tables),
        "sentences": [
            {"words": list(words), "plans": str(plans), "own": _own_counts(language, words)}
            for words, plans in leading
        ],
        "all_sentences": number if number is None else json_count(number),
        "witness": _witness_data(language, shown.witness, tables),
        "violation": _witness_data(language, violation, tables),
    }


def _verdict(language: TaskLanguage) -> Verdict | None:
    """Whether the language coordinates the task; None if it is too large to find out."""
    if len(language.space.target) > _VERIFIED:
        return None
    with suppress(OutOfMemory):
        return language.verdict or verify(language.partition, [language.space])
    return None


def _failure(language: TaskLanguage, word: Ints | None) -> float | None:
    """How often robots that choose by themselves fail in the task, None if that is too much work.

    ``word`` has the word number of each node; None: without a word.
    """
    with suppress(TooManyToCount):
        return float(failure_probability([language.space], [word], _ADDITIONS).mean)
    return None


def _graph_data(part: PlanSpace, tables: Tables) -> dict[str, Any]:
    """Nodes by step, then by their place in its column; edges as a CSR table.

    The table is ``first``, ``target`` and ``labels``, the edges of a node in the order of labels.
    """
    model, steps = part.model, int(part.layer[-1])
    by_step = part.reordered(np.argsort(steps - part.layer, kind="stable"))
    sizes = np.bincount(steps - part.layer).tolist()
    ends = zip(by_step.sources.tolist(), by_step.target.tolist(), strict=True)
    order = np.array(layer_orders(sizes, list(ends)))
    drawn = by_step.reordered(np.lexsort((order, steps - by_step.layer)))
    keys = map(model.codec.key, drawn.rows[drawn.state])
    return {
        "nodes": {
            "state": [*map(tables.state, keys)],
            "step": (steps - drawn.layer).tolist(),
            "order": [place for size in sizes for place in range(size)],
        },
        "first": drawn.first.tolist(),
        "target": drawn.target.tolist(),
        "labels": [
            [
                tables.label(robot, model.label_text(robot, label))
                for label in drawn.robot_labels(robot).tolist()
            ]
            for robot in range(len(model.robots))
        ],
    }


def _witness_data(
    language: TaskLanguage, witness: Miscoordination | None, tables: Tables
) -> dict[str, Any] | None:
    """Plans that miscoordinate, and what happens: robot i executes its part of plan i.

    ``together`` are the states passed, the start first; ``stops`` is the number of the first step
    that is not applicable (None: all are), and ``why``; ``reaches``: the goal holds at last.
    """
    if witness is None:
        return None
    space, model = language.space, language.model
    why: str | None = witness.reason
    together, reaches = list(witness.mixed_states), False
    if not model.is_asynchronous:  # else nobody does them step by step
        parts = [map(itemgetter(robot), plan) for robot, plan in enumerate(witness.plans)]
        steps = filter(None, map(model.numbers, zip(*parts, strict=True)))
        rows, _, why = carried_out(model, space.rows[space.state[language.start]], steps)
        together = [*map(model.codec.key, rows)]
        goal = space.goals[space.goal[language.start]]
        reaches = why is None and bool(model.holds(goal, rows[-1][None, :])[0])
    return {
        "plans": [
            [[tables.label(robot, text) for robot, text in enumerate(step)] for step in plan]
            for plan in witness.plans
        ],
        "states": [[*map(tables.state, keys)] for keys in witness.states],
        "breaks": witness.step,
        "reason": witness.reason,
        "together": [*map(tables.state, together)],
        "stops": None if why is None else len(together) - 1,
        "why": why,
        "reaches": reaches,
    }


def task_summary(language: TaskLanguage, world: World) -> dict[str, Any]:
    """Return the start and goal of a task in words and, as ``goals``, on the map."""
    space, model = language.space, language.model
    init = model.codec.decode(model.forgetting_slack(space.rows[space.state[language.start]]))
    goal = space.goals[space.goal[language.start]]
    literals = split_atoms(goal_text(model, goal))
    starts, goals = world.located(init), world.located(literals)
    facts = {*model.codec.facts.texts}
    done = {*init, *(f"(not {fact})" for fact in facts - {*init})}
    others = [a for a in literals if world.role(a)[0] != "at" and a not in done]
    if isinstance(goal, FullState) and not others and goals.items() <= starts.items():
        others = [f"(not {fact})" for fact in sorted(facts & {*init} - {*literals})]
    return {
        "title": _title(starts, goals, others),
        "goals": [[world.things.index(t), world.places.index(p)] for t, p in goals.items()],
    }


def _title(starts: Mapping[str, str], goals: Mapping[str, str], others: list[str]) -> str:
    """What is to be done: what moves where, what else becomes true; else what comes back."""
    moves = [f"{t} {starts[t]} → {p}" for t, p in goals.items() if starts.get(t, p) != p]
    arrivals = [f"{t} at {p}" for t, p in goals.items() if t not in starts]
    stays = [f"{t} back at {p}" for t, p in goals.items()]  # if nothing else is to be done
    plain = [text.strip("()") if text.count("(") == 1 else text for text in others]
    return ", ".join([*moves, *arrivals, *plain] or stays) or "nothing to do"


# ---- plans and sentences


def drawn_part(language: TaskLanguage, seed: int, most: int = EDGES) -> PlanSpace:
    """Return the plan space of a task; of one of more than ``most`` edges plans drawn of it."""
    space = language.space
    if len(space.target) <= most:
        return space
    plans, kept = Plans.of(space, language.task), set[int]()
    for plan in plans.sample(most, seed):
        path = space.path_with(plans.start, plan)
        assert path is not None, "a plan is a path of its plan space"
        if len(kept.union(path)) > most // 4:
            break
        kept.update(path)
    drawn = np.zeros(len(space.target), np.bool_)
    drawn[sorted(kept)] = True
    return space.along(drawn)


def _own_counts(language: TaskLanguage, words: Sentence) -> list[str | None]:
    """The numbers of the robots' own subplans under a sentence; None for too many to count."""
    found: list[str | None] = []
    open_plans = language.plans_with(words)
    for robot in range(len(language.model.robots)):
        found.append(None)
        with suppress(OutOfMemory):
            found[robot] = str(determinise(open_plans, robot, most=_SUBSETS).count)
    return found
