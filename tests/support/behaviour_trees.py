# SPDX-License-Identifier: GPL-3.0-or-later
"""Behaviour trees in the XML of BehaviorTree.CPP 4, run by py_trees.

Only the nodes that exports use, read as the documentation of BehaviorTree.CPP describes them: a
``Sequence`` and a ``Fallback`` go on with the child that was running.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from xml.etree import ElementTree as ET

import py_trees
from py_trees.common import Status

#: What a leaf does: its ports by name -> its status.
Leaf = Callable[[Mapping[str, str]], Status]


class Node(py_trees.behaviour.Behaviour):
    """A leaf that asks a function for its status."""

    def __init__(self, name: str, ask: Callable[[], Status]) -> None:
        super().__init__(name)
        self.ask = ask

    def update(self) -> Status:
        return self.ask()


def read_tree(xml: str, robot: str, leaves: Mapping[str, Leaf]) -> py_trees.trees.BehaviourTree:
    """The tree of this name, with ``leaves`` in place of the robot's own nodes, by their ID."""
    root = ET.fromstring(xml)
    assert root.tag == "root"
    assert root.get("BTCPP_format") == "4"
    names = [tree.get("ID") for tree in root.iter("BehaviorTree")]
    assert root.get("main_tree_to_execute") in names
    assert len(set(names)) == len(names)
    modelled = {
        leaf.get("ID"): {p.get("name") for p in leaf} for leaf in root.find("TreeNodesModel") or ()
    }
    (tree,) = [tree for tree in root.iter("BehaviorTree") if tree.get("ID") == robot]
    (child,) = tree
    blackboard: dict[str, int] = {}
    return py_trees.trees.BehaviourTree(_node(child, leaves, modelled, blackboard))


def _node(
    element: ET.Element,
    leaves: Mapping[str, Leaf],
    modelled: Mapping[str | None, set[str | None]],
    blackboard: dict[str, int],
) -> py_trees.behaviour.Behaviour:
    if element.tag in ("Sequence", "Fallback"):
        kind = {"Sequence": py_trees.composites.Sequence, "Fallback": py_trees.composites.Selector}
        found = kind[element.tag](element.get("name", ""), memory=True)
        found.add_children([_node(child, leaves, modelled, blackboard) for child in element])
        return found
    ports = dict(element.attrib)
    if element.tag == "Script":
        name, value = ports["code"].split(" := ")

        def assign() -> Status:
            blackboard[name] = int(value)
            return Status.SUCCESS

        return Node("Script", assign)
    if element.tag == "ScriptCondition":
        name, value = ports["code"].split(" == ")
        return Node("ScriptCondition", lambda: _status(blackboard[name] == int(value)))
    assert element.tag in ("Action", "Condition")
    own = ports.pop("ID")
    assert set(ports) <= modelled[own], "the model of each leaf has its ports"
    return Node(own, lambda: leaves[own](ports))


def _status(holds: bool) -> Status:
    return Status.SUCCESS if holds else Status.FAILURE
