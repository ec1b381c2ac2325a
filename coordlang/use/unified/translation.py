# SPDX-License-Identifier: GPL-3.0-or-later
"""A unified-planning problem as PDDL, with the way back.

The text is written here, not by unified-planning's own writers: those for several agents write one
file per agent and lose goals of agents, and this way one writer does for both classes of problems.
It is then read like any other PDDL.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from coordlang.use.unified.names import Names
from planners.errors import Unsupported, UsageError
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.sexpr import Source

#: Action -> robot -> its part, as in joint-action PDDL: ``{"swap": {"r1": "(move ?a ?b)", "r2":
#: "(move ?b ?a)"}}``.
Subactions = Mapping[str, Mapping[str, str | None]]

#: Action schema -> the actions that it stands for, by agent (None where there are no agents).
Schemas = dict[str, dict[str | None, Any]]

_AGENT = "?agent"
_COMPILE = (
    "coordlang reads InstantaneousAction: states of true and false facts, steps without time."
)
_BOOLEAN = "coordlang reads Boolean fluents: True or False, no numbers and no objects as values."
#: Kinds of unified-planning's expressions -> their PDDL operators.
_QUANTIFIERS = {"exists": "exists", "forall": "forall"}
_CONNECTIVES = {"and": "and", "or": "or", "not": "not", "implies": "imply"}


@dataclass(frozen=True, slots=True)
class Translated:
    """A unified-planning problem as PDDL.

    ``schemas`` maps each action schema to the actions it stands for, by agent (None where there are
    no agents); ``objects`` and ``agents`` map PDDL names to objects and agents, ``types`` type
    names to PDDL names.
    """

    domain: Domain
    problem: Problem
    schemas: Schemas
    objects: dict[str, Any]
    agents: dict[str, Any]
    types: dict[str, str]

    @property
    def texts(self) -> tuple[str, str]:
        """Domain and problem as PDDL text."""
        return self.domain.source.text, self.problem.source.text


def translate(problem: Any, subactions: Subactions | None = None) -> Translated:
    """PDDL for a `unified_planning.model.Problem` or a `MultiAgentProblem`.

    Boolean fluents over objects, instantaneous actions.  An agent becomes an object, its own
    fluents get it as their first argument, and its actions ``:agent``; goals of agents are goals.
    With ``subactions`` an action is a whole joint step.

    Raises `Unsupported` for anything else, `BadInput` for a problem without a robot.
    """
    _check_subactions(problem, subactions or {})
    writer = _Writer(problem)
    domain_text, problem_text, schemas = writer.write(subactions or {})
    name = problem.name or "unnamed"
    domain = parse_domain(Source(f"unified-planning problem {name!r} (domain)", domain_text))
    return Translated(
        domain=domain,
        problem=parse_problem(Source(f"unified-planning problem {name!r}", problem_text), domain),
        schemas=schemas,
        objects={writer.objects.of(o.name, o.name): o for o in problem.all_objects},
        agents={writer.objects.of(("agent", a.name), a.name): a for a in writer.agents},
        types={t.name: writer.type_name(t) for t in problem.user_types},
    )


def _check_subactions(problem: Any, subactions: Subactions) -> None:
    """Raise `UsageError` for subactions that no action of the problem can have."""
    agents = getattr(problem, "agents", None)
    if subactions and agents:
        raise UsageError(
            "subactions are given for a problem with agents: its actions are the agents' own",
            remedy="Leave out subactions.",
        )
    names = {action.name for action in getattr(problem, "actions", ())}
    for name in subactions:
        if name not in names:
            raise UsageError(
                f"subactions: the problem has no action {name!r}",
                remedy=f"Its actions are {', '.join(sorted(names))}.",
            )


class _Writer:
    def __init__(self, problem: Any) -> None:
        self.problem = problem
        self.agents: tuple[Any, ...] = tuple(getattr(problem, "agents", ()))
        self.types, self.predicates, self.actions, self.objects = Names(), Names(), Names(), Names()
        self.variable_names = Names()
        self.variable_names.keep(None, _AGENT[1:])
        above = {t.name.lower() == "object" or _has_father(t, "object") for t in problem.user_types}
        if above == {True}:  # as unified-planning's PDDL reader makes it
            for t in problem.user_types:
                if t.name.lower() == "object":
                    self.types.keep(t.name, "object")
        # Names of the problem come first, so that they are kept where possible.
        for t in problem.user_types:
            self.type_name(t)
        for o in problem.all_objects:
            self.objects.of(o.name, o.name)
        for agent in self.agents:
            self.objects.of(("agent", agent.name), agent.name)
        self.declared: dict[str, str] = {}
        self.apart = False

    def write(self, subactions: Subactions) -> tuple[str, str, Schemas]:
        """Domain, problem, and what the schemas stand for."""
        for fluent in self.problem.ma_environment.fluents if self.agents else self.problem.fluents:
            self.predicate(fluent, None)
        if self.agents:
            actions, schemas = self.agent_actions()
        else:
            actions, schemas = self.plain_actions(subactions)
        facts, goals = self.facts(), self.goals()  # they may declare further predicates
        # Objects are constants, because actions may name them.
        domain = [
            "(define (domain up)",
            "(:types",
            *self.type_lines(),
            ")",
            "(:constants",
            *self.object_lines(),
            ")",
            "(:predicates",
            *(f"  {line}" for line in self.declared.values()),
            ")",
            *actions,
            ")",
            "",
        ]
        problem = [
            "(define (problem up-task) (:domain up)",
            "(:init",
            *(f"  {fact}" for fact in facts),
            ")",
            "(:goal (and",
            *(f"  {goal}" for goal in goals),
            ")))",
            "",
        ]
        return "\n".join(domain), "\n".join(problem), schemas

    def goals(self) -> list[str]:
        """The goals of the problem and of its agents."""
        goals = [self.text(goal, None) for goal in self.problem.goals]
        for agent in self.agents:
            goals += [self.text(g, agent) for g in (*agent.public_goals, *agent.private_goals)]
        return goals

    def object_lines(self) -> list[str]:
        """The objects and agents with their types."""
        objects = [
            f"  {self.objects.of(o.name, o.name)} - {self.type_name(o.type)}"
            for o in self.problem.all_objects
        ]
        return [*objects, *(f"  {self.agent_name(a)} - {self.own_type(a)}" for a in self.agents)]

    def plain_actions(self, subactions: Subactions) -> tuple[list[str], Schemas]:
        """The actions of a problem without agents."""
        actions: list[str] = []
        schemas: Schemas = {}
        for action in self.problem.actions:
            name = self.actions.of(action.name, action.name)
            parts = subactions.get(action.name, {})
            comments = [f"  ; subaction {robot} {text or 'idle'}" for robot, text in parts.items()]
            actions.append("\n".join([f"(:action {name}", *comments, *self.body(action, None)]))
            schemas[name] = {None: action}
        return actions, schemas

    def agent_actions(self) -> tuple[list[str], Schemas]:
        """Equal actions of several agents become one schema."""
        groups: dict[tuple[str, ...], dict[str | None, Any]] = {}
        for agent in self.agents:
            for action in agent.actions:
                key = (action.name, *self.body(action, agent))
                groups.setdefault(key, {})[self.agent_name(agent)] = action
        actions: list[str] = []
        schemas: Schemas = {}
        by_name = {self.agent_name(agent): agent for agent in self.agents}
        self.apart = any(len(members) < len(self.agents) for members in groups.values())
        for key, members in groups.items():
            name = self.actions.of(key, key[0])
            types = list(dict.fromkeys(self.own_type(by_name[str(member)]) for member in members))
            whose = f"(either {' '.join(types)})" if len(types) > 1 else types[0]
            actions.append(
                "\n".join([f"(:action {name}", f"  :agent {_AGENT} - {whose}", *key[1:]])
            )
            schemas[name] = members
        return actions, schemas

    def body(self, action: Any, agent: Any) -> list[str]:
        """Parameters, precondition and effect."""
        if type(action).__name__ != "InstantaneousAction":
            raise Unsupported(
                f"{type(action).__name__} {action.name!r}: only instantaneous actions "
                f"are supported",
                remedy=_COMPILE,
            )
        if action.simulated_effect is not None:
            raise Unsupported(
                f"action {action.name!r} has simulated effects",
                remedy="Write its effects as add_effect.",
            )
        parameters = " ".join(
            f"{self.parameter(p)} - {self.type_name(p.type)}" for p in action.parameters
        )
        conditions = [self.text(c, agent, inside=True) for c in action.preconditions]
        effects = [text for effect in action.effects for text in self.effect(effect, agent)]
        return [
            f"  :parameters ({parameters})",
            f"  :precondition (and {' '.join(conditions)})",
            f"  :effect (and {' '.join(effects)}))",
        ]

    def effect(self, effect: Any, agent: Any) -> Iterable[str]:
        """An assignment; of a value that is not constant both cases."""
        if not effect.is_assignment():
            raise Unsupported(
                f"the effect {effect}: only assignments of truth values are supported",
                remedy=_BOOLEAN,
            )
        atom = self.text(effect.fluent, agent, inside=True)
        value, condition = effect.value, effect.condition
        cases = [(value, atom), (None, f"(not {atom})")]
        if value.is_bool_constant():
            cases = [(True, atom if value.is_true() else f"(not {atom})")]
        for case, literal in cases:
            conditions = [] if condition.is_true() else [self.text(condition, agent, inside=True)]
            if case is not True:
                holds = self.text(value, agent, inside=True)
                conditions.append(holds if case is not None else f"(not {holds})")
            text = f"(when (and {' '.join(conditions)}) {literal})" if conditions else literal
            yield f"(forall ({self.variables(effect.forall)}) {text})" if effect.forall else text

    def facts(self) -> list[str]:
        """The atoms that are true at the start."""
        found = []
        for fluent, value in self.problem.initial_values.items():
            if not value.is_bool_constant():
                raise Unsupported(
                    f"the initial value {fluent} := {value}: only truth values are supported",
                    remedy=_BOOLEAN,
                )
            if value.is_true():
                found.append(self.text(fluent, None))
        return sorted(found)

    def text(self, node: Any, agent: Any, *, inside: bool = False) -> str:
        """An expression as PDDL.

        Own fluents are those of ``agent``, which is a variable ``inside`` its actions.
        """
        if node.is_bool_constant():
            return "(and)" if node.is_true() else "(or)"
        if node.is_fluent_exp():
            return self.atom(node, agent, inside=inside)
        if node.is_dot():
            return self.text(node.arg(0), self.problem.agent(node.agent()))
        if node.is_equals():
            return f"(= {self.term(node.arg(0))} {self.term(node.arg(1))})"
        parts = [self.text(arg, agent, inside=inside) for arg in node.args]
        if node.is_iff():
            return f"(and (imply {parts[0]} {parts[1]}) (imply {parts[1]} {parts[0]}))"
        for kind, operator in _QUANTIFIERS.items():
            if getattr(node, f"is_{kind}")():
                return f"({operator} ({self.variables(node.variables())}) {parts[0]})"
        for kind, operator in _CONNECTIVES.items():
            if getattr(node, f"is_{kind}")():
                return f"({' '.join((operator, *parts))})"
        raise Unsupported(
            f"the expression {node}",
            remedy="coordlang reads Boolean fluents with and, or, not, implies, "
            "equality and quantifiers.",
        )

    def atom(self, node: Any, agent: Any, *, inside: bool) -> str:
        """A fluent with its arguments."""
        fluent = node.fluent()
        own = agent if agent is not None and fluent in agent.fluents else None
        args = [self.term(arg) for arg in node.args]
        if own is not None:
            args.insert(0, _AGENT if inside else self.agent_name(own))
        return f"({' '.join((self.predicate(fluent, own), *args))})"

    def term(self, node: Any) -> str:
        if node.is_object_exp():
            return self.objects.of(node.object().name, node.object().name)
        if node.is_parameter_exp():
            return self.parameter(node.parameter())
        if node.is_variable_exp():
            return self.variable(node.variable())
        raise Unsupported(
            f"the term {node}",
            remedy="Object fluents can be compiled away: USERTYPE_FLUENTS_REMOVING.",
        )

    def variables(self, variables: Sequence[Any]) -> str:
        return " ".join(f"{self.variable(v)} - {self.type_name(v.type)}" for v in variables)

    def parameter(self, parameter: Any) -> str:
        return f"?{self.variable_names.of(parameter.name, parameter.name)}"

    def variable(self, variable: Any) -> str:
        return f"?{self.variable_names.of((variable.name,), f'any-{variable.name}')}"

    def predicate(self, fluent: Any, owner: Any) -> str:
        """The predicate of a fluent; own fluents of agents with one signature share one."""
        if not fluent.type.is_bool_type():
            raise Unsupported(
                f"fluent {fluent.name!r} of type {fluent.type}: only Boolean fluents are supported",
                remedy="Object fluents can be compiled away: USERTYPE_FLUENTS_REMOVING.",
            )
        types = tuple(self.type_name(p.type) for p in fluent.signature)
        key = (fluent.name, types, owner is not None)
        name = self.predicates.of(key, fluent.name)
        if name not in self.declared:
            whose = [f"?a - {self.agent_type()}"] if owner is not None else []
            self.declared[name] = (
                f"({' '.join((name, *whose, *(f'?x{n} - {t}' for n, t in enumerate(types))))})"
            )
        return name

    def type_name(self, kind: Any) -> str:
        if not kind.is_user_type():
            raise Unsupported(
                f"parameters of type {kind}: only user types are supported",
                remedy="Use objects of a user type.",
            )
        return self.types.of(kind.name, kind.name)

    def agent_type(self) -> str:
        return self.types.of(("agents",), "agent")

    def own_type(self, agent: Any) -> str:
        """A type for one agent alone, if some action is not for all of them."""
        return (
            self.agent_type()
            if not self.apart
            else self.types.of(("agent", agent.name), f"agent-{agent.name}")
        )

    def agent_name(self, agent: Any) -> str:
        return self.objects.of(("agent", agent.name), agent.name)

    def type_lines(self) -> list[str]:
        kinds = [
            (self.type_name(t), self.type_name(t.father) if t.father else "object")
            for t in self.problem.user_types
        ]
        kinds += [(self.own_type(agent), self.agent_type()) for agent in self.agents if self.apart]
        if self.agents:
            kinds.append((self.agent_type(), "object"))
        return [f"  {name} - {father}" for name, father in kinds if name != "object"]


def _has_father(kind: Any, name: str) -> bool:
    return any(t.name.lower() == name for t in kind.ancestors)
