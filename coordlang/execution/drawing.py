# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open in Graphviz' language: texts and colours."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from coordlang.execution.plan_dag import DagEdge, DagNode, PlanDag
from planners.joint.model import NO_FACT, own_text
from planners.joint.states import split_atoms

#: Colours that people of every colour vision tell apart (Okabe and Ito 2008).  Words carry their
#: names as well.
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442", "#999999")

_ATOMS_SHOWN = 6
_ACTIONS_SHOWN = 3
_LONGEST = 40


@dataclass(frozen=True, slots=True)
class Ink:
    """The colour of a word, and the colour of text on it.

    ``again``: every colour is in use already.
    """

    fill: str
    text: str
    again: bool


def inks(dag: PlanDag) -> dict[str, Ink]:
    """A colour for each word, in the order in which plans come to them."""
    result = {}
    for number, word in enumerate(dag.words):
        fill = COLOURS[number % len(COLOURS)]
        red, green, blue = (int(fill[k : k + 2], 16) / 255 for k in (1, 3, 5))
        dark = 0.299 * red + 0.587 * green + 0.114 * blue < 0.5
        result[word] = Ink(fill, "#ffffff" if dark else "#000000", number >= len(COLOURS))
    return result


def node_lines(dag: PlanDag) -> list[list[str]]:
    """What is written in each node: its atoms, without those that are true in all nodes."""
    atoms = [split_atoms(node.key) for node in dag.nodes]
    states = [set(a) for a, node in zip(atoms, dag.nodes, strict=True) if not node.merged]
    always = set.intersection(*states) if len(states) > 1 else set()
    return [_state_lines(node, own, always) for node, own in zip(dag.nodes, atoms, strict=True)]


def _state_lines(node: DagNode, atoms: Sequence[str], always: Collection[str]) -> list[str]:
    if node.merged:
        return [f"{node.merged:,} more states"]
    if not atoms:
        return [NO_FACT]
    lines = [_without_parentheses(atom) for atom in atoms if atom not in always]
    return _shortened(lines, _ATOMS_SHOWN, "atoms")


def edge_lines(dag: PlanDag, edge: DagEdge) -> list[str]:
    """What is written at an edge: one line for each robot, for each of its first joint actions."""
    lines: list[str] = []
    for action in edge.actions[:_ACTIONS_SHOWN]:
        if lines:
            lines.append("or")
        for robot, text in zip(dag.robots, action, strict=True):
            lines.append(_clipped(f"{robot} {own_text(text or '(idles)', robot)}"))
    rest = len(edge.actions) - _ACTIONS_SHOWN
    return [*lines, f"or {rest:,} more"] if rest > 0 else lines


def cut_note(dag: PlanDag) -> str | None:
    """What a cut DAG does not show."""
    if not dag.cut:
        return None
    steps = sum(1 for node in dag.nodes if node.merged)
    return (
        f"cut: {dag.cut:,} nodes of {steps} steps are drawn as {steps} dashed boxes; "
        "the nodes that most plans pass through are kept"
    )


def _plans_text(number: int) -> str:
    """``12 plans``."""
    return f"{number:,} plan{'s' * (number != 1)}" if number < 10**12 else f"{number:.2e} plans"


def to_dot(dag: PlanDag) -> str:
    """Graphviz text, layers from left to right.  The same DAG gives the same text."""
    ink, lines = inks(dag), node_lines(dag)
    note = cut_note(dag)
    headline = f'"{" ".join(dag.sentence)}" leaves {_plans_text(dag.count)} open'
    title = "\n".join([headline, dag.task, *([note] if note else [])])
    out = [
        "digraph plans {",
        "  rankdir=LR;",
        '  node [shape=box, style="filled,rounded", fontname="monospace", fontsize=10];',
        '  edge [fontname="monospace", fontsize=9];',
        f"  labelloc=t; label={quoted(title)};",
    ]
    for layer in dag.layers:
        out.append(f"  subgraph step{dag.nodes[layer.start].step} {{ rank=same;")
        out += [f"    n{n} [{_dot_node(dag.nodes[n], lines[n], ink)}];" for n in layer]
        out.append("  }")
    for edge in dag.edges:
        merged = dag.nodes[edge.source].merged or dag.nodes[edge.target].merged
        look = "style=dashed" if merged else f"label={quoted(chr(10).join(edge_lines(dag, edge)))}"
        out.append(f"  n{edge.source} -> n{edge.target} [{look}];")
    return "\n".join([*out, "}"]) + "\n"


def _dot_node(node: DagNode, lines: list[str], ink: dict[str, Ink]) -> str:
    text = "\n".join([*([] if node.merged else [node.word]), *lines, _plans_text(node.plans)])
    if node.merged:
        return f'label={quoted(text)}, style="dashed,rounded"'
    own = ink[node.word]
    look = f'fillcolor="{own.fill}", fontcolor="{own.text}"' + (
        ", peripheries=2" if own.again else ""
    )
    return f"label={quoted(text)}, tooltip={quoted(node.key)}, {look}"


def quoted(text: str) -> str:
    """A string of Graphviz' language, in which ``&`` begins a character reference."""
    for character, written in (("&", "&amp;"), ("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n")):
        text = text.replace(character, written)
    return f'"{text}"'


def _without_parentheses(atom: str) -> str:
    """An atom without its outer parentheses; a remembered action keeps its own ones."""
    return atom[1:-1]


def _shortened(lines: list[str], most: int, noun: str) -> list[str]:
    lines = [_clipped(line) for line in lines]
    if len(lines) <= most:
        return lines
    return [*lines[: most - 1], f"and {len(lines) - most + 1} more {noun}"]


def _clipped(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 2] + ".."
