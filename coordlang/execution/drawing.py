# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open, and robots' choices, in Graphviz' language."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import reduce
from itertools import groupby
from operator import and_

from coordlang.execution.choices import RobotChoices, SentenceChoices
from coordlang.execution.open_plans import DagEdge, DagNode, PlanDag
from planners.joint.model import IDLE, NO_FACT, own_text
from planners.joint.states import split_atoms

#: Colours that people of every colour vision tell apart (Okabe and Ito 2008).  Words carry their
#: names as well: in white on the dark colours.
_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999")
_DARK = ("#0072b2", "#009e73", "#d55e00")

_ATOMS_SHOWN = 6
_ACTIONS_SHOWN = 3
_LONGEST = 40


def plans_dot(dag: PlanDag) -> str:
    """A DAG of plans, layers from left to right.  The same DAG gives the same text."""
    looks, note = _looks(dag), cut_note(dag)
    headline = f'"{" ".join(dag.sentence)}" leaves {_plans_text(dag.count)} open'
    title = "\n".join([headline, dag.task, *([note] if note else [])])
    out = [
        "digraph plans {",
        "  rankdir=LR;",
        '  node [shape=box, style="filled,rounded", fontname="monospace", fontsize=10];',
        '  edge [fontname="monospace", fontsize=9];',
        f"  labelloc=t; label={_quoted(title)};",
    ]
    states = [set(split_atoms(node.key)) for node in dag.nodes if not node.merged]
    always = set.intersection(*states) if len(states) > 1 else set()
    for step, layer in groupby(enumerate(dag.nodes), lambda numbered: numbered[1].step):
        out.append(f"  subgraph step{step} {{ rank=same;")
        out += [f"    n{n} [{_node(node, always, looks)}];" for n, node in layer]
        out.append("  }")
    for edge in dag.edges:
        merged = dag.nodes[edge.source].merged or dag.nodes[edge.target].merged
        look = "style=dashed" if merged else f"label={_quoted(_edge_text(dag, edge))}"
        out.append(f"  n{edge.source} -> n{edge.target} [{look}];")
    return "\n".join([*out, "}"]) + "\n"


def _looks(dag: PlanDag) -> dict[str, str]:
    """The attributes of each word's nodes: a colour, with a second border when all are in use.

    In the order in which plans come to the words.
    """
    result = {}
    for number, word in enumerate(dict.fromkeys(dag.sentence)):
        fill = _COLOURS[number % len(_COLOURS)]
        text = "#ffffff" if fill in _DARK else "#000000"
        again = ", peripheries=2" if number >= len(_COLOURS) else ""
        result[word] = f'fillcolor="{fill}", fontcolor="{text}"{again}'
    return result


def cut_note(dag: PlanDag) -> str | None:
    """What a cut DAG does not show."""
    if not dag.cut:
        return None
    steps = sum(1 for node in dag.nodes if node.merged)
    return (
        f"cut: {dag.cut:,} nodes of {steps} steps are drawn as {steps} dashed boxes; "
        "the nodes that most plans pass through are kept"
    )


def _node(node: DagNode, always: Collection[str], looks: dict[str, str]) -> str:
    """A node's attributes: its word, its atoms without those of all nodes, its plans."""
    plans = _plans_text(node.plans)
    if node.merged:
        text = f"{node.merged:,} more states\n{plans}"
        return f'label={_quoted(text)}, style="dashed,rounded"'
    atoms = split_atoms(node.key)
    lines = [_clipped(atom[1:-1]) for atom in atoms if atom not in always]
    if len(lines) > _ATOMS_SHOWN:
        rest = len(lines) - _ATOMS_SHOWN + 1
        lines = [*lines[: _ATOMS_SHOWN - 1], f"and {rest} more atoms"]
    text = "\n".join([node.word, *(lines if atoms else [NO_FACT]), plans])
    return f"label={_quoted(text)}, tooltip={_quoted(node.key)}, {looks[node.word]}"


def _edge_text(dag: PlanDag, edge: DagEdge) -> str:
    """One line for each robot, for each of the first joint actions."""
    actions = [
        [
            _clipped(f"{robot} {own_text(text or '(idles)', robot)}")
            for robot, text in zip(dag.robots, action, strict=True)
        ]
        for action in edge.actions[:_ACTIONS_SHOWN]
    ]
    rest = len(edge.actions) - _ACTIONS_SHOWN
    more = f"\nor {rest:,} more" if rest > 0 else ""
    return "\nor\n".join("\n".join(lines) for lines in actions) + more


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


def _plans_text(number: int) -> str:
    """``12 plans``."""
    return f"{number:,} plan{'s' * (number != 1)}" if number < 10**12 else f"{number:.2e} plans"


def _quoted(text: str) -> str:
    """A string of Graphviz' language, in which ``&`` begins a character reference."""
    for character, written in (("&", "&amp;"), ("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        text = text.replace(character, written)
    return f'"{text}"'


def _clipped(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 2] + ".."
