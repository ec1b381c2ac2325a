# SPDX-License-Identifier: GPL-3.0-or-later
"""Choices by definition: plans listed, projected, mixed; knowledge is read off all mixtures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from typing import NamedTuple

from coordlang.execution.task_language import TaskLanguage
from planners.search.plans import Plan, Plans
from tests.support import naive


class Detour(NamedTuple):
    """What `Monitor.can` is asked for."""

    visit: tuple[str, ...] = ()
    avoid: tuple[str, ...] = ()
    do: tuple[str, ...] = ()
    never: tuple[str, ...] = ()


#: One robot's labels, step by step.
Own = tuple[int, ...]
#: Facts (numbers) certainly true, and certainly false.
Known = tuple[frozenset[str], frozenset[str]]


@dataclass
class Listed:
    """The plans of one sentence, and all plans of the task."""

    task_language: TaskLanguage
    plans: list[Plan]
    optimal: set[Plan]

    @cached_property
    def own(self) -> list[set[Own]]:
        """For each robot its own parts of the plans."""
        robots = len(self.task_language.model.robots)
        return [
            {tuple(step[robot] for step in plan) for plan in self.plans} for robot in range(robots)
        ]

    @property
    def combinations(self) -> int:
        return prod(len(own) for own in self.own)

    @cached_property
    def mixed(self) -> dict[tuple[Own, ...], Plan]:
        """Every combination of own parts, one for each robot, as a sequence of joint steps."""
        return {
            chosen: tuple(zip(*chosen, strict=True)) for chosen in product(*map(sorted, self.own))
        }

    @property
    def mixes(self) -> bool:
        """Is every combination an optimal plan?"""
        return all(plan in self.optimal for plan in self.mixed.values())

    @cached_property
    def facts(self) -> dict[tuple[Own, ...], list[frozenset[str]]]:
        """The true facts along every combination."""
        space, codec = self.task_language.space, self.task_language.model.codec
        plans = Plans(space, self.task_language.start, [])
        return {
            chosen: [
                frozenset(codec.decode(space.rows[s])) & set(codec.facts.texts)
                for s in plans.states(plan)
            ]
            for chosen, plan in self.mixed.items()
        }

    def knows(self, robot: int) -> dict[Own, Known]:
        """Own beginning -> what has one value after it, whatever the others chose."""
        everything = frozenset(self.task_language.model.codec.facts.texts)
        found: dict[Own, Known] = {}
        for chosen, along in self.facts.items():
            for step, here in enumerate(along):
                history = chosen[robot][:step]
                true, false = found.get(history, (everything, everything))
                found[history] = true & here, false - here
        return found

    def histories(self, robot: int) -> set[Own]:
        return {own[:step] for own in self.own[robot] for step in range(len(own) + 1)}

    def least(self, robot: int, known: dict[Own, Known] | None = None) -> int:
        """The size of the least automaton: histories by their futures (Myhill and Nerode)."""
        return len({self._future(robot, history, known) for history in self.histories(robot)})

    def _future(
        self, robot: int, history: Own, known: dict[Own, Known] | None
    ) -> frozenset[object]:
        here = len(history)
        return frozenset(
            (
                own[here:],
                tuple(known[own[:step]] for step in range(here, len(own) + 1)) if known else (),
            )
            for own in self.own[robot]
            if own[:here] == history
        )

    def fulfilling(
        self, robot: int, history: Own, detour: Detour, known: dict[Own, Known]
    ) -> set[Own]:
        """The own parts that begin with ``history`` and make a detour from then on."""
        return {
            own
            for own in self.own[robot]
            if own[: len(history)] == history
            and self._makes(robot, own, len(history), detour, known)
        }

    def _makes(
        self, robot: int, own: Own, here: int, detour: Detour, known: dict[Own, Known]
    ) -> bool:
        ahead = [known[own[:step]] for step in range(here, len(own) + 1)]
        texts = [
            self.task_language.model.labels[robot][label] if label else "idle"
            for label in own[here:]
        ]
        return (
            all(any(atom in true for true, _ in ahead) for atom in detour.visit)
            and all(all(atom in false for _, false in ahead) for atom in detour.avoid)
            and all(any(like(pattern, text) for text in texts) for pattern in detour.do)
            and not any(like(pattern, text) for text in texts for pattern in detour.never)
        )


def like(pattern: str, text: str) -> bool:
    return re.fullmatch(re.escape(pattern).replace(r"\*", ".*"), text) is not None


def listed(
    task_language: TaskLanguage, most_plans: int, most_combinations: int
) -> Iterator[tuple[tuple[int, ...], Listed]]:
    """Every sentence of a task with what it leaves open; raises `naive.TooLarge`."""
    groups = naive.numbered_sentences(task_language, most_plans)
    optimal = {plan for group in groups.values() for plan in group}
    for words, plans in groups.items():
        found = Listed(task_language, plans, optimal)
        if found.combinations > most_combinations:
            raise naive.TooLarge
        yield words, found


def accepted(moves: Sequence[dict[int, int]], state: int = 0) -> set[Own]:
    """All label sequences that an automaton accepts."""
    if not moves[state]:
        return {()}
    return {(label, *rest) for label, to in moves[state].items() for rest in accepted(moves, to)}
