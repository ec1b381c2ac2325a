# SPDX-License-Identifier: GPL-3.0-or-later
"""The classical task: what every planner reads, also without negative conditions, and as PDDL."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import Literal

from planners.pddl.lifted import Atom

Form = Literal["explicit", "select-then-apply"]
#: A condition on a classical state: the number of a fact, and whether it is to be true.
Condition = tuple[int, bool]
Known = Mapping[Atom, bool]

#: The makespan up to which `ClassicalTask.cost` is sure to be lexicographic by default.
LONGEST = 100
#: Names that are words of PDDL itself, of any version: readers know them wherever they stand.
_RESERVED = frozenset(
    [
        *("and", "or", "not", "imply", "forall", "exists", "when", "either", "object", "number"),
        *("define", "domain", "problem", "total-cost", "total-time", "increase", "decrease"),
        *("assign", "scale-up", "scale-down", "minimize", "maximize", "preference", "is-violated"),
        *("always", "sometime", "within", "at-most-once", "sometime-after", "sometime-before"),
        *("always-within", "hold-during", "hold-after", "at", "over", "start", "end", "all"),
    ]
)


#: Robots, with what they do in a joint step as text, None where they idle.
Labels = tuple[tuple[int, str | None], ...]


@dataclass(frozen=True, slots=True)
class ClassicalAction:
    """A ground STRIPS action with negative preconditions; disjoint ``adds`` and ``deletes``.

    ``labels`` are those that robots take in it: all robots, one, or none.
    """

    name: str
    preconditions: tuple[Condition, ...]
    adds: tuple[int, ...]
    deletes: tuple[int, ...]
    cost: int
    labels: Labels = ()


@dataclass(frozen=True, slots=True)
class ClassicalTask:
    """A ground planning task.

    ``facts`` are texts; facts of the model are its PDDL atoms.  A plan of total cost ``step_cost *
    m + s`` stands for a joint plan of makespan ``m`` and second cost ``s``; ``highest_cost`` is the
    most that one joint step adds to ``s``.  ``between`` is the fact that is true between two joint
    steps and false within one; None where every action is a whole joint step.
    """

    name: str
    form: Form
    facts: tuple[str, ...]
    init: frozenset[int]
    actions: tuple[ClassicalAction, ...]
    goal: tuple[Condition, ...]
    step_cost: int
    highest_cost: int
    between: int | None = None

    def cost(self, total: int) -> tuple[int, int] | None:
        """An optimal total as (makespan, second cost); None if ``step_cost`` is too small for it.

        A plan of ``k`` steps costs from ``step_cost * k`` to ``(step_cost + highest_cost) * k``,
        which is less than ``step_cost * m`` for every ``k < m`` when ``step_cost > highest_cost *
        m``: then no plan has fewer than ``m`` steps.
        """
        makespan, second = divmod(total, self.step_cost)
        return (makespan, second) if self.step_cost > self.highest_cost * makespan else None

    def cost_of_plan(self, plan: Sequence[int]) -> int | None:
        """The total cost of the actions of these numbers in turn, None if they are no plan."""
        state = set(self.init)
        for number in plan:
            if not 0 <= number < len(self.actions) or not _holds(
                self.actions[number].preconditions, state
            ):
                return None
            state.difference_update(self.actions[number].deletes)
            state.update(self.actions[number].adds)
        if not _holds(self.goal, state):
            return None
        return sum(self.actions[number].cost for number in plan)


def _holds(conditions: Sequence[Condition], state: Set[int]) -> bool:
    return all((fact in state) == wanted for fact, wanted in conditions)


def with_positive_literals(task: ClassicalTask, *, only_goal: bool) -> ClassicalTask:
    """The task with positive literals only, in the goal and, unless ``only_goal``, everywhere.

    Each fact that is wanted false has a partner, which is true exactly where the fact is false.
    Every action keeps the two apart, so plans stay the same, one for one.
    """
    read = () if only_goal else (action.preconditions for action in task.actions)
    wanted = sorted({fact for own in (task.goal, *read) for fact, positive in own if not positive})
    partner = {fact: len(task.facts) + number for number, fact in enumerate(wanted)}

    def with_partners(action: ClassicalAction) -> ClassicalAction:
        conditions = action.preconditions
        return replace(
            action,
            preconditions=conditions if only_goal else _positive(conditions, partner),
            adds=(*action.adds, *_partners(action.deletes, partner)),
            deletes=(*action.deletes, *_partners(action.adds, partner)),
        )

    return replace(
        task,
        facts=(*task.facts, *(f"(not {task.facts[fact]})" for fact in wanted)),
        init=task.init.union(_partners(partner.keys() - task.init, partner)),
        actions=tuple(map(with_partners, task.actions)),
        goal=_positive(task.goal, partner),
    )


def _positive(conditions: Iterable[Condition], partner: Mapping[int, int]) -> tuple[Condition, ...]:
    return tuple((fact if value else partner[fact], True) for fact, value in conditions)


def _partners(facts: Iterable[int], partner: Mapping[int, int]) -> list[int]:
    return [partner[fact] for fact in facts if fact in partner]


def to_pddl(classical: ClassicalTask, *, costs: bool = True) -> tuple[str, str]:
    """Domain and problem text: STRIPS with negative preconditions and, if asked for, action costs.

    Facts become predicates without arguments; comments keep what they and the actions stand for.
    """
    facts = _safe_names(classical.facts)
    actions = action_names(classical)
    domain = [
        f"; {classical.name}: {classical.form} form; one joint step costs {classical.step_cost}",
        "(define (domain plain)",
        f"  (:requirements {_requirements(classical, costs)})",
        "  (:predicates",
        *(f"    ({safe}) ; {text}" for safe, text in zip(facts, classical.facts, strict=True)),
        "  )",
        *(["  (:functions (total-cost) - number)"] if costs else []),
    ]
    for safe, action in zip(actions, classical.actions, strict=True):
        changes = [*((n, True) for n in action.adds), *((n, False) for n in action.deletes)]
        paid = [f"(increase (total-cost) {action.cost})"] if costs else []
        domain += [
            f"  ; {action.name}",
            f"  (:action {safe}",
            "    :parameters ()",
            f"    :precondition {_all_of(facts, action.preconditions)}",
            f"    :effect {_all_of(facts, changes, paid)})",
        ]
    problem = [
        "(define (problem plain-task)",
        "  (:domain plain)",
        "  (:init",
        *(["    (= (total-cost) 0)"] if costs else []),
        *(f"    ({facts[n]})" for n in sorted(classical.init)),
        "  )",
        f"  (:goal {_all_of(facts, classical.goal)})",
        *(["  (:metric minimize (total-cost))"] if costs else []),
    ]
    return "\n".join((*domain, ")", "")), "\n".join(problem) + ")\n"


def _requirements(classical: ClassicalTask, costs: bool) -> str:
    conditions = (classical.goal, *(action.preconditions for action in classical.actions))
    negative = costs or any(not positive for own in conditions for _, positive in own)
    names = [":strips", *([":negative-preconditions"] if negative else [])]
    return " ".join(names + ([":action-costs"] if costs else []))


def action_names(classical: ClassicalTask) -> list[str]:
    """The names of the actions in `to_pddl`, in the order of ``classical.actions``."""
    return _safe_names(action.name for action in classical.actions)


def _all_of(names: Sequence[str], conditions: Iterable[Condition], more: Sequence[str] = ()) -> str:
    parts = [f"({names[n]})" if positive else f"(not ({names[n]}))" for n, positive in conditions]
    return f"(and{''.join(f' {part}' for part in (*parts, *more))})"


def _safe_names(texts: Iterable[str]) -> list[str]:
    """For each text a PDDL name of its own: letters, digits, ``-`` and ``_``, a letter first."""
    taken: dict[str, int] = defaultdict(int)
    names: dict[str, None] = {}
    for text in texts:
        base = re.sub(r"[^a-z0-9-]+", "_", text.lower()).strip("_-")
        base = base if base[:1].isalpha() else f"x_{base}"
        name = base
        while name in names or name in _RESERVED:
            taken[base] += 1
            name = f"{base}__{taken[base]}"
        names[name] = None
    return list(names)
