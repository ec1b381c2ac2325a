# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots' choices drawn in Graphviz' language.

One cluster for each automaton, one rank for each step.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import and_

from coordlang.execution.choices import Choices, RobotChoices
from coordlang.execution.drawing import quoted
from planners.joint.model import IDLE


def to_dot(choices: Choices, robots: Sequence[int] | None = None) -> str:
    """A digraph of all robots' automata, or of those with these numbers.

    In a state stand its number, how many own subplans are left, and the atoms known to be true that
    tell it from the other states of its step.
    """
    lines = [
        "digraph choices {",
        "  rankdir=LR; node [shape=box, style=rounded, fontsize=10]; edge [fontsize=10];",
    ]
    for own in choices.of(robots):
        lines += _cluster(choices, own)
    return "\n".join([*lines, "}"]) + "\n"


def distinguishing(choices: Choices, own: RobotChoices, states: range) -> list[list[str]]:
    """For each state of one step the atoms known to be true there.

    Without those known to be true in all of them.
    """
    known = own.automaton.known[states.start : states.stop]
    everywhere = reduce(and_, (knowledge.true for knowledge in known))
    facts = choices.task_language.model.codec.facts.texts
    return [
        [text for bit, text in enumerate(facts) if (knowledge.true & ~everywhere) >> bit & 1]
        for knowledge in known
    ]


def _cluster(choices: Choices, own: RobotChoices) -> list[str]:
    model, automaton = choices.task_language.model, own.automaton
    name = model.robots[own.robot]
    title = f"{name}: {automaton.count:,} subplan{'s' * (automaton.count != 1)}"
    lines = [f"  subgraph cluster_{own.robot} {{", f"    label={quoted(title)};"]
    for step, states in enumerate(automaton.layers):
        for state, atoms in zip(states, distinguishing(choices, own, states), strict=True):
            text = "\n".join([f"{state}: {automaton.left[state]:,} left", *atoms])
            final = ", peripheries=2" if step == automaton.steps else ""
            lines.append(f"    r{own.robot}s{state} [label={quoted(text)}{final}];")
        lines.append(
            "    {rank=same; " + " ".join(f"r{own.robot}s{state};" for state in states) + "}"
        )
    for state in range(len(automaton)):
        for label, to in automaton.moves(state):
            text = model.label_text(own.robot, label) or IDLE
            lines.append(f"    r{own.robot}s{state} -> r{own.robot}s{to} [label={quoted(text)}];")
    return [*lines, "  }"]
