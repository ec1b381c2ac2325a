# SPDX-License-Identifier: GPL-3.0-or-later
"""What a language's provenance implies: model options, checks of the files, candidate tasks."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import msgspec

from coordlang.language.candidates import Candidates, Kind, all_pairs, from_listed, from_problems
from coordlang.language.listed import ListedTask, first_of_equal, goal_text, ground_tasks
from coordlang.language.provenance import domain_sha256, states_sha256, world_sha256
from coordlang.language.words import Language
from planners.joint.model import show
from planners.joint.tables import unique_rows
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import ENVIRONMENT
from planners.system.errors import BadInput, Position, UsageError
from planners.system.messages import echoed


def options_of(
    language: Language, model: ModelOptions | None = None, given: Collection[str] = ()
) -> ModelOptions:
    """How the language's model is built: as its file records it.

    ``given`` names the fields of ``model`` that the user gave.  Raises `UsageError` for one that
    contradicts the file.
    """
    provenance, model = language.provenance, model or ModelOptions()
    entries = provenance.model
    recorded = ModelOptions(
        provenance.robots or model.names,
        unowned=entries.get("unowned", "error"),
        cost=entries.get("cost", "makespan"),
        remember_actions=entries.get("remember_actions", False),
        slack=provenance.slack or 0,
        words_see_slack=entries.get("words_see_slack", False),
        asynchronous=entries.get("execution") == "asynchronous",
        recorded=bool(provenance.robots),
    )
    for name in sorted(given):
        mine, own = getattr(model, name), getattr(recorded, name)
        if name == "robots" and recorded.unowned == "environment":  # it may be the extra one
            mine, own = (tuple(r for r in names if r != ENVIRONMENT) for names in (mine, own))
        _require_same(name, mine, own)
    return recorded


def _require_same(name: str, given: Any, recorded: Any) -> None:
    """Raise `UsageError` for a model option that contradicts the language file."""
    flag = f"--{name.replace('_', '-')}"
    if name == "robot_type":
        what = f"{flag}: a language file names its robots already"
    elif name == "robots":
        if set(given) == set(recorded):
            return
        what = f"{flag} contradicts the language file: its robots are {', '.join(recorded)}"
    elif given != recorded:
        option = flag if given is True else f"{flag} {given}"
        built = f"without {flag}" if recorded is False else f"with {flag} {recorded}"
        what = f"{option} contradicts the language file, which was built {built}"
    else:
        return
    raise UsageError(what, remedy=f"Leave out {flag}.")


def check_source(language: Language, domain: Domain, problems: list[Problem]) -> None:
    """Raise `BadInput` when domain or problem are not those that the language was built for.

    The recorded hash is that of what the domain says; in older files that of its text, or of the
    files of all robots one below the other.
    """
    check_domain(language, domain)
    for problem in problems:
        if not _is_of_world(language, domain, problem):
            raise language.position.fail(
                f"{problem.source.name} has other objects or static facts than the language's "
                "problem",
                "A language serves the problems of one world: same objects, same static facts.",
            )


def check_domain(language: Language, domain: Domain) -> None:
    """Raise `BadInput` when a domain is not that of the language; see `check_source`."""
    wanted = language.provenance.domain.get("sha256")
    known = domain_sha256(domain), domain.source.sha256, domain.source.text_sha256
    if wanted not in (None, *known):
        raise language.position.fail(
            "this language belongs to another domain "
            f"({echoed(language.provenance.domain.get('name'))}): what "
            f"{domain.source.name} says has another hash",
            "Give the domain file that the language was built from.",
        )


def _is_of_world(language: Language, domain: Domain, problem: Problem) -> bool:
    """Whether a problem has the objects and static facts that a language records, if it does."""
    world = language.provenance.model.get("world_sha256")
    return world is None or bool(world == world_sha256(domain, problem))


def recorded_list(language: Language) -> list[ListedTask]:
    """The candidate tasks that a language file lists; none under ``--tasks all``."""
    return msgspec.convert(language.provenance.tasks.get("tasks", []), list[ListedTask])


def recorded_candidates(
    language: Language, domain: Domain, problems: list[Problem], options: ModelOptions
) -> Candidates:
    """The candidate tasks that a language file records, else the problems' own ones."""
    kind, count = language.provenance.tasks["kind"], language.provenance.tasks["count"]
    listed = recorded_list(language)
    if kind == "problems" and not (count or listed):
        return from_problems(domain, problems, options)
    try:
        if kind == "all":
            candidates = all_pairs(domain, problems, options)
            _require_same_pairs(language, candidates)
            return candidates
        if len(listed) != count:  # made in Python: of files it is checked when they are read
            raise BadInput(
                f"the language records {count} tasks but lists {len(listed)}",
                remedy="Say --tasks all or --tasks FILE.",
            )
        return from_listed(domain, problems, listed, options, language.position, kind=kind)
    except BadInput as error:
        error.position = error.position or language.position
        raise


def _require_same_pairs(language: Language, candidates: Candidates) -> None:
    """Raise `BadInput` where other states are reachable than those of a language for all pairs."""
    count, states = (language.provenance.tasks.get(key) for key in ("count", "states_sha256"))
    what = None
    if candidates.count != count:
        first, *more = candidates.loaded.problems
        have = f"these {1 + len(more)} problems have" if more else f"{first.source.name} has"
        what = (
            f"the language records {count:,} tasks, but {have} {candidates.count:,} pairs of "
            "reachable states"
        )
    elif states not in (None, states_sha256(candidates)):
        what = (
            "the language serves all pairs of other states: as many are reachable here, but not "
            "the same ones"
        )
    if what is not None:
        raise BadInput(
            what,
            remedy="Give the problems that the language was built for, or say --tasks all to check "
            "these.",
        )


def with_recorded(language: Language, candidates: Candidates) -> Candidates:
    """Candidate tasks together with those that a language records.

    On another map, where problems have other objects or static facts, the recorded tasks do not
    count.  All pairs of states are with the recorded tasks, if these have one goal state each.

    Raises `BadInput` for a language for all pairs of states, where the candidate tasks are not, or
    lack some, and for tasks that are no such pairs where the candidate tasks are all pairs.
    """
    domain, problems = candidates.loaded.domain, list(candidates.loaded.problems)
    if not all(_is_of_world(language, domain, problem) for problem in problems):
        return candidates
    if language.provenance.tasks["kind"] == "all":
        _require_all_pairs(language, candidates)
        return candidates
    recorded = recorded_list(language)
    if candidates.kind == "all":
        _require_pairs(recorded, candidates, language.position)
        return candidates
    both = [*recorded, *candidates.listed]
    listed = [both[number] for number in first_of_equal(both)]
    if len(listed) == len(candidates.listed):
        return candidates
    are_own = {candidates.kind, language.provenance.tasks["kind"]} == {"problems"}
    kind: Kind = "problems" if are_own else "file"
    options, position = candidates.loaded.options, language.position
    together = from_listed(domain, problems, listed, options, position, kind=kind)
    return replace(together, skipped=candidates.skipped)


#: What to do about tasks that a language records, and that problems do not have.
_ALSO = "Also give the problem that it was built for."


def _require_pairs(recorded: list[ListedTask], candidates: Candidates, position: Position) -> None:
    """Raise `BadInput` for a recorded task that is no pair of reachable states."""
    loaded, model = candidates.loaded, candidates.model
    states, _ = unique_rows(model.codec.facts_part(candidates.rows))
    facts = model.codec.facts.texts
    reached = {frozenset(facts[n] for n in model.codec.true_facts(row)) for row in states}
    ends: dict[tuple[str, ...], int] = {}
    ground = ground_tasks(loaded.domain, loaded.problems[0], recorded, position)
    for task, (init, goal) in zip(recorded, ground, strict=True):
        start = frozenset(map(show, init))
        if task.goal not in ends:
            ends[task.goal] = int(model.holds(goal, states).sum())
        if start not in reached or not ends[task.goal]:
            raise position.fail(
                f"these problems do not reach both states of the recorded task "
                f"{' '.join(sorted(start))} -> {goal_text(model, goal)}",
                _ALSO,
            )
        if ends[task.goal] > 1:
            raise position.fail(
                f"the recorded goal {goal_text(model, goal)} is one of several states, and would "
                "not be served with all pairs of states",
                "Say --tasks FILE with the tasks that count, or leave out --start.",
            )


def _require_all_pairs(language: Language, candidates: Candidates) -> None:
    """Raise `BadInput` unless the candidate tasks are all pairs, with all that are recorded."""
    if candidates.kind != "all":
        raise language.position.fail(
            "this language serves all pairs of states, and others cannot be added to them",
            "Say --tasks all, with the problems whose states count.",
        )
    recorded, have = language.provenance.tasks["count"], f"have {candidates.count:,}"
    if candidates.count >= recorded:
        if language.states.keys() <= set(map(candidates.model.codec.key, candidates.rows)):
            return
        have = "do not reach all their states"
    raise language.position.fail(
        f"this language serves {recorded:,} pairs of states, but these problems {have}", _ALSO
    )
