# SPDX-License-Identifier: GPL-3.0-or-later
"""Robots' choices in Graphviz' language."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import and_

from coordlang.execution.choices import RobotChoices, SentenceChoices
from planners.joint.model import IDLE


def choices_dot(choices: SentenceChoices, robots: Sequence[int] | None = None) -> str:
    """All robots' automata, or of those with these numbers: a cluster each, a rank for each step.

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


def distinguishing(choices: SentenceChoices, own: RobotChoices, states: range) -> list[list[str]]:
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


def _cluster(choices: SentenceChoices, own: RobotChoices) -> list[str]:
    model, automaton = choices.task_language.model, own.automaton
    title = f"{model.robots[own.robot]}: {automaton.count:,} subplan{'s' * (automaton.count != 1)}"
    lines = [f"  subgraph cluster_{own.robot} {{", f"    label={_quoted(title)};"]
    for step, states in enumerate(automaton.layers):
        names = [f"r{own.robot}s{state}" for state in states]
        final = ", peripheries=2" if step == automaton.steps else ""
        known = distinguishing(choices, own, states)
        for state, name, atoms in zip(states, names, known, strict=True):
            text = "\n".join([f"{state}: {automaton.left[state]:,} left", *atoms])
            lines.append(f"    {name} [label={_quoted(text)}{final}];")
        lines.append("    {rank=same; " + " ".join(f"{name};" for name in names) + "}")
    for state, moves in enumerate(automaton.moves):
        for label, to in moves.items():
            text = model.label_text(own.robot, label) or IDLE
            lines.append(f"    r{own.robot}s{state} -> r{own.robot}s{to} [label={_quoted(text)}];")
    return [*lines, "  }"]


def _quoted(text: str) -> str:
    """A string of Graphviz' language, in which ``&`` begins a character reference."""
    for character, written in (("&", "&amp;"), ("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        text = text.replace(character, written)
    return f'"{text}"'
