# SPDX-License-Identifier: GPL-3.0-or-later
"""Each robot's choices under a sentence as a behaviour tree, in the XML of BehaviorTree.CPP 4.

A robot runs the tree with its name: a sequence of the joint steps.  In each of them it waits for
the step to begin (``AwaitStep``), chooses one of the subactions that its automaton allows
(``Chooses``), checks that what it knows and the subaction needs does hold (``Holds``), and does it.
The automaton's state is an entry of the tree's blackboard, so that the tree is as large as the
automaton and no larger, although a behaviour tree has no way back.

Robots that keep no common step await no steps: having chosen an event, a robot waits until the
events of others that it waits for have ended (``AwaitEnded``), and those that start together with
it are ready (``AwaitPartner``).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, product
from typing import NamedTuple
from xml.etree import ElementTree as ET

from coordlang.execution.automaton import Automaton
from coordlang.execution.choices import SentenceChoices
from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel
from planners.joint.states import bits
from planners.search.goals import goal_facts
from planners.system.errors import UsageError
from planners.system.messages import echoed


class _Leaf(NamedTuple):
    """A leaf that a robot has to bring besides its actions."""

    kind: str
    ports: tuple[str, ...]
    does: str


_LEAVES = {
    "AwaitStep": _Leaf(
        "Action", ("step",), "is running until this joint step begins; steps count from 0"
    ),
    "AwaitEnded": _Leaf(
        "Action",
        ("robot", "count", "subaction"),
        "is running until so many events of the robot have ended that interfere with the subaction",
    ),
    "AwaitPartner": _Leaf(
        "Action",
        ("robot", "does", "subaction"),
        "says that the own robot is ready for the subaction, and is running until the other one is "
        "for what it does",
    ),
    "Chooses": _Leaf("Condition", ("subaction",), "succeeds if the robot wants to do this now"),
    "Holds": _Leaf("Condition", ("fact",), "succeeds if this fact is true now"),
}

#: What BehaviorTree.CPP refuses in an ID.
_FORBIDDEN = re.compile(r"""[<>&"'/\\:*?|.]""")


def behaviour_trees(choices: SentenceChoices) -> str:
    """All robots' choices as one XML document.

    Each robot's tree can do exactly the robot's subplans: for every one of them there is one way to
    answer the ``Chooses`` with which the tree does it.  Linear in the automata.  Raises
    `UsageError` for a name that BehaviorTree.CPP takes for something else.
    """
    model = choices.task_language.model
    root = ET.Element("root", BTCPP_format="4")
    root.append(ET.Comment(_comment(choices)))
    root.extend(_tree(model, own) for own in choices.robots)
    root.append(_models(root, _leaves(model)))
    _set_ids(root, model)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _comment(choices: SentenceChoices) -> str:
    used = choices.task_language
    if choices.guaranteed:
        article, kind = "a" if used.model.slack else "an", used.model.kept_plan
        promise = f"Whatever each robot chooses, all of them together follow {article} {kind}."
    elif used.covered:
        promise = "This is no coordination language: choices of different robots need not mix."
    else:
        promise = "The language does not cover this task: choices of different robots need not mix."
    leaves = "".join(
        f"\n    {name} ({leaf.kind}, {', '.join(leaf.ports)}): {leaf.does}."
        for name, leaf in _leaves(used.model).items()
    )
    sentence = used.text(choices.words)
    text = f' Sentence "{sentence}". {promise}\n  Leaves besides the actions:{leaves}\n  '
    return re.sub("-(?=-)", "- ", text)  # two hyphens end a comment


def _leaves(model: JointModel) -> Mapping[str, _Leaf]:
    left_out = ("AwaitStep",) if model.is_asynchronous else ("AwaitEnded", "AwaitPartner")
    return {name: leaf for name, leaf in _LEAVES.items() if name not in left_out}


def _tree(model: JointModel, own: Automaton) -> ET.Element:
    name = model.robots[own.robot]
    tree = ET.Element("BehaviorTree", ID=name)
    steps = ET.SubElement(tree, "Sequence", name=name)
    ET.SubElement(steps, "Script", code="state := 0")
    actions = {
        action.label: action
        for action in model.in_step.actions
        if own.robot in action.owners and not action.parts
    }
    for step, states in enumerate(own.layers[:-1]):
        here = ET.SubElement(steps, "Sequence", name=f"{model.unit} {step}")
        if not model.is_asynchronous:
            here.append(_leaf("AwaitStep", step=str(step)))
        here.extend(_branches(model, own, states, actions))
    return tree


def _branches(
    model: JointModel, own: Automaton, states: range, actions: Mapping[str, GroundAction]
) -> tuple[ET.Element, ET.Element]:
    """What chooses a move of the present state, and what does it.

    The first one that is wanted, else the last.  Where it is chosen nothing is done, so that an
    action that fails is never followed by another choice.  Of what does moves only its own branch
    can succeed.
    """
    choose, act = ET.Element("Fallback", name="choose"), ET.Element("Fallback", name="act")
    moves = [(state, *move) for state in states for move in own.moves[state].items()]
    last = {state: label for state, label, _ in moves}
    for number, (state, label, target) in enumerate(moves):
        branch = ET.SubElement(choose, "Sequence")
        ET.SubElement(branch, "ScriptCondition", code=f"state == {state}")
        if last[state] != label:
            wanted = model.labels[own.robot][label]
            ET.SubElement(branch, "Condition", ID="Chooses", subaction=wanted)
        ET.SubElement(branch, "Script", code=f"move := {number}")
        branch = ET.SubElement(act, "Sequence")
        ET.SubElement(branch, "ScriptCondition", code=f"move == {number}")
        text = model.subaction_text(own.robot, label)
        if text is not None:
            branch.extend(_awaiting(model, own.robot, label, text))
            known = {*bits(own.known[state].true)}
            needed = goal_facts(model, actions[text].precondition) if text in actions else ()
            for fact in sorted(known.intersection(needed)):
                ET.SubElement(branch, "Condition", ID="Holds", fact=model.codec.facts.texts[fact])
            branch.append(_action(text))
        ET.SubElement(branch, "Script", code=f"state := {target}")
    return choose, act


def _awaiting(model: JointModel, robot: int, label: int, text: str) -> Iterator[ET.Element]:
    """What an event waits for."""
    event = model.events[robot][label] if model.events else None
    if event is None:
        return
    for name, count in zip(model.robots, event.waits, strict=True):
        if count:
            yield _leaf("AwaitEnded", robot=name, count=str(count), subaction=text)
    for other, its in event.meets:
        does = model.in_step.labels[other][its]
        yield _leaf("AwaitPartner", robot=model.robots[other], does=does, subaction=text)


def _leaf(name: str, **ports: str) -> ET.Element:
    return ET.Element("Action", {"ID": name, **ports})


def _action(text: str) -> ET.Element:
    """``(move r1 a b)`` as a leaf ``move`` with the ports ``arg0`` (r1), ``arg1`` and ``arg2``."""
    name, *arguments = text.strip("()").split()
    ports = {f"arg{number}": argument for number, argument in enumerate(arguments)}
    return _leaf(name, subaction=text, **ports)


def _models(trees: ET.Element, leaves: Mapping[str, _Leaf]) -> ET.Element:
    """The ports of all leaves, which editors of trees ask for; actions have their own names yet."""
    found = ET.Element("TreeNodesModel")
    found.extend(_leaf_model(one.kind, name, one.ports) for name, one in leaves.items())
    ports: dict[str, list[str]] = {}
    for action in trees.iter("Action"):
        (_, name), *given = action.items()
        ports[name] = max(ports.get(name, []), [port for port, _ in given], key=len)
    for name in sorted(ports.keys() - leaves.keys()):
        found.append(_leaf_model("Action", name, ports[name]))
    return found


def _leaf_model(kind: str, name: str, ports: Sequence[str]) -> ET.Element:
    found = ET.Element(kind, ID=name)
    for port in ports:
        ET.SubElement(found, "input_port", name=port)
    return found


def _set_ids(root: ET.Element, model: JointModel) -> None:
    """Give each tree and action an ID of its own that BehaviorTree.CPP takes: mostly its name."""
    texts = chain.from_iterable(own[1:] for own in model.in_step.labels)
    named = {("Action", text.strip("()").split()[0]) for text in texts}
    named.update(product(["BehaviorTree"], model.robots))
    ids: dict[tuple[str, str], str] = {}
    for kind, name in sorted(named, key=lambda own: (bool(_FORBIDDEN.search(own[1])), own)):
        ids[kind, name] = _FORBIDDEN.sub("_", name)
        while [*ids.values(), "root"].count(ids[kind, name]) > 1:
            ids[kind, name] += "_"
    root.set("main_tree_to_execute", ids["BehaviorTree", model.robots[0]])
    for node in root.iter():
        if own_id := ids.get((node.tag, node.get("ID", ""))):
            node.set("ID", own_id)
        for port, value in node.items():
            if port not in ("ID", "name") and re.fullmatch(r"\{.+\}", value):
                raise UsageError(
                    f"--to bt: in a behaviour tree {echoed(value)} is an entry of a blackboard",
                    remedy="Rename the object.",
                )
