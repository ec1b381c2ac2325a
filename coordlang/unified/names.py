# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL names and declarations for what a unified-planning problem names, in whatever words."""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from typing import Any

from planners.system.errors import Unsupported

#: What PDDL or its readers take for something of their own.
_RESERVED = ("and", "or", "not", "imply", "forall", "exists", "when", "either", "object")

#: The variable that stands for the acting agent.
AGENT = "?agent"


class PddlNames:
    """Names of one kind (types, predicates, actions or objects): each thing gets one of its own.

    What is a PDDL name already, in lower case, is kept unless it is taken.
    """

    def __init__(self) -> None:
        self._names: dict[Hashable, str] = {}
        self._taken = {*_RESERVED, "increase", "total-cost"}

    def of(self, thing: Hashable, text: str) -> str:
        """The PDDL name of a thing; ``text`` is what it is called."""
        if thing not in self._names:
            base = re.sub(r"[^a-z0-9_-]", "_", text.lower()).strip("-") or "x"
            name, number = base, 1
            while name in self._taken:
                number += 1
                name = f"{base}__{number}"
            self.keep(thing, name)
        return self._names[thing]

    def keep(self, thing: Hashable, name: str) -> None:
        """Give a thing exactly this name."""
        self._names[thing] = name
        self._taken.add(name)


class ProblemNames:
    """The PDDL names of a problem's types, fluents, actions, objects, agents and variables.

    Those of types, objects and agents come first, so that they are kept where possible.
    ``declared`` are the predicates named so far; ``apart``: some action is not for all agents.
    """

    def __init__(self, problem: Any) -> None:
        self.problem = problem
        self.values = 0
        self.agents: tuple[Any, ...] = tuple(getattr(problem, "agents", ()))
        self.types, self.predicates, self.actions = PddlNames(), PddlNames(), PddlNames()
        self.objects, self.variable_names = PddlNames(), PddlNames()
        self.variable_names.keep(None, AGENT[1:])
        roots = {[*t.ancestors][-1].name for t in problem.user_types}
        if len(roots) == 1 and min(roots).lower() == "object":  # as its PDDL reader makes it
            self.types.keep(min(roots), "object")
        for t in problem.user_types:
            self.type_name(t)
        #: The type of all agents.
        self.agent_type = self.types.of(("agents",), "agent") if self.agents else ""
        for o in problem.all_objects:
            self.object_name(o)
        for agent in self.agents:
            self.agent_name(agent)
        self.declared: dict[str, str] = {}
        self.apart = False

    def fresh(self) -> str:
        """A variable of its own."""
        self.values += 1
        return f"?{self.variable_names.of(self.values, f'value-{self.values}')}"

    def variables(self, variables: Sequence[Any]) -> str:
        """The declarations of variables."""
        return " ".join(f"{self.variable(v)} - {self.type_name(v.type)}" for v in variables)

    def parameter(self, parameter: Any) -> str:
        """The variable of an action's parameter."""
        return f"?{self.variable_names.of(parameter.name, parameter.name)}"

    def variable(self, variable: Any) -> str:
        """A quantifier's variable."""
        return f"?{self.variable_names.of((variable.name,), f'any-{variable.name}')}"

    def predicate(self, fluent: Any, owner: Any) -> str:
        """The predicate of a fluent; own fluents of agents with one signature share one."""
        if not is_read(fluent):
            raise refused(f"fluent {fluent.name!r} of type {fluent.type}")
        types = tuple(self.type_name(p.type) for p in fluent.signature)
        if fluent.type.is_user_type():
            types = (*types, self.type_name(fluent.type))
        key = (fluent.name, types, owner is not None)
        name = self.predicates.of(key, fluent.name)
        if name not in self.declared:
            whose = [f"?a - {self.agent_type}"] if owner is not None else []
            args = [f"?x{n} - {t}" for n, t in enumerate(types)]
            self.declared[name] = listed(name, *whose, *args)
        return name

    def type_name(self, kind: Any) -> str:
        """The name of a type of objects."""
        if not kind.is_user_type():
            raise refused(f"parameters of type {kind}")
        return self.types.of(kind.name, kind.name)

    def own_type(self, agent: Any) -> str:
        """A type for one agent alone, if some action is not for all of them."""
        if not self.apart:
            return self.agent_type
        return self.types.of(("agent", agent.name), f"agent-{agent.name}")

    def object_name(self, thing: Any) -> str:
        """The name of an object."""
        return self.objects.of(thing.name, thing.name)

    def agent_name(self, agent: Any) -> str:
        """The name of the object that stands for an agent."""
        return self.objects.of(("agent", agent.name), agent.name)

    def type_lines(self) -> list[str]:
        """The declarations of types."""
        kinds = [
            (self.type_name(t), self.type_name(t.father) if t.father else "object")
            for t in self.problem.user_types
        ]
        kinds += [(self.own_type(agent), self.agent_type) for agent in self.agents if self.apart]
        if self.agents:
            kinds.append((self.agent_type, "object"))
        return [f"{name} - {father}" for name, father in kinds if name != "object"]


def refused(what: str) -> Unsupported:
    """The error for what is not read."""
    return Unsupported(
        what,
        remedy="coordlang reads Boolean and object fluents over objects, and instantaneous "
        "actions; docs/unified-planning.md has the list.",
    )


def is_read(fluent: Any) -> bool:
    """Whether a fluent has a truth value or an object; another one must not be used."""
    return bool(fluent.type.is_bool_type() or fluent.type.is_user_type())


def listed(*words: str) -> str:
    """Words in brackets."""
    return f"({' '.join(words)})"
