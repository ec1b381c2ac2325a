# SPDX-License-Identifier: GPL-3.0-or-later
"""A classical task as PDDL text."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Sequence

from planners.classical.task import ClassicalTask, Condition


def to_pddl(classical: ClassicalTask, *, costs: bool = True) -> tuple[str, str]:
    """Domain and problem text: STRIPS with negative preconditions and, if asked for, action costs.

    Facts become predicates without arguments; a comment keeps what each predicate and action stands
    for.
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
        changes = [f"({facts[n]})" for n in action.adds] + [
            f"(not ({facts[n]}))" for n in action.deletes
        ]
        paid = [f"(increase (total-cost) {action.cost})"] if costs else []
        domain += [
            f"  ; {action.name}",
            f"  (:action {safe}",
            "    :parameters ()",
            f"    :precondition {_all_of(facts, action.preconditions)}",
            f"    :effect (and {' '.join((*changes, *paid))}))",
        ]
    problem = [
        "(define (problem plain-task)",
        "  (:domain plain)",
        "  (:init",
        *(["    (= (total-cost) 0)"] if costs else []),
        *(f"    ({facts[n]})" for n in sorted(classical.init)),
        "  )",
        f"  (:goal {_all_of(facts, classical.goal)}){'' if costs else ')'}",
        *(["  (:metric minimize (total-cost)))"] if costs else []),
    ]
    return "\n".join((*domain, ")", "")), "\n".join((*problem, ""))


def _requirements(classical: ClassicalTask, costs: bool) -> str:
    conditions = (c for action in classical.actions for c in action.preconditions)
    negative = any(not positive for _, positive in (*classical.goal, *conditions))
    names = [":strips"]
    names += [":negative-preconditions"] if negative or costs else []
    return " ".join(names + ([":action-costs"] if costs else []))


def action_names(classical: ClassicalTask) -> list[str]:
    """The names of the actions in `to_pddl`, in the order of ``classical.actions``."""
    return _safe_names(action.name for action in classical.actions)


def _all_of(names: Sequence[str], conditions: Iterable[Condition]) -> str:
    parts = [f"({names[n]})" if positive else f"(not ({names[n]}))" for n, positive in conditions]
    return f"(and{''.join(f' {part}' for part in parts)})"


def _safe_names(texts: Iterable[str]) -> list[str]:
    """For each text a PDDL name of its own.

    Letters, digits, ``-`` and ``_``, beginning with a letter.
    """
    taken: dict[str, int] = defaultdict(int)
    used: set[str] = set()
    names = []
    for text in texts:
        base = re.sub(r"[^a-z0-9-]+", "_", text.lower()).strip("_-")
        base = base if base[:1].isalpha() else f"x_{base}"
        name = base
        while name in used or name in _RESERVED:
            taken[base] += 1
            name = f"{base}__{taken[base]}"
        used.add(name)
        names.append(name)
    return names


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
