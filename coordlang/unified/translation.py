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

from coordlang.unified.names import Names
from planners.errors import Unsupported, UsageError
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.sexpr import Source

#: Action -> robot -> its part, as in joint-action PDDL: ``{"swap": {"r1": "(move ?a ?b)", "r2":
#: "(move ?b ?a)"}}``.
Subactions = Mapping[str, Mapping[str, str | None]]

#: Action -> a formula about the same joint step, as PDDL text: ``{"lift": "(exists (?o - agent)
#: (and (not (= ?o ?agent)) (lift ?o)))"}``; the acting agent is ``?agent``.
Concurrency = Mapping[str, str]

#: Action schema -> the actions that it stands for, by agent (None where there are no agents).
Schemas = dict[str, dict[str | None, Any]]

_AGENT = "?agent"
_COMPILE = (
    "coordlang reads InstantaneousAction: states of true and false facts, steps without time."
)
_BOOLEAN = "coordlang reads Boolean and object fluents, no numbers."
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


def translate(
    problem: Any,
    subactions: Subactions | None = None,
    concurrency: Concurrency | None = None,
) -> Translated:
    """PDDL for a `unified_planning.model.Problem` or a `MultiAgentProblem`.

    Boolean and object fluents over objects, instantaneous actions.  An agent becomes an object, its
    own fluents get it as their first argument, and its actions ``:agent``; goals of agents are
    goals.  An object fluent becomes a predicate with its value as the last argument.  With
    ``subactions`` an action is a whole joint step; the formulas of ``concurrency`` are further
    preconditions.

    Raises `Unsupported` for anything else, `BadInput` for a problem without a robot.
    """
    _check_subactions(problem, subactions or {})
    _check_concurrency(problem, concurrency or {})
    writer = _Writer(problem, concurrency or {})
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


def _check_concurrency(problem: Any, concurrency: Concurrency) -> None:
    """Raise `UsageError` for a formula of an action that no agent has, or that is no text."""
    agents = getattr(problem, "agents", None)
    if concurrency and not agents:
        raise UsageError(
            "concurrency is given for a problem without agents",
            remedy="Write a MultiAgentProblem: its actions can speak of other agents' actions.",
        )
    names = {action.name for agent in agents or () for action in agent.actions}
    for name, formula in concurrency.items():
        if name not in names:
            raise UsageError(
                f"concurrency: no agent has an action {name!r}",
                remedy=f"The actions are {', '.join(sorted(names))}.",
            )
        if not isinstance(formula, str):
            raise UsageError(
                f"concurrency: the formula of {name!r} is no text",
                remedy='Write it as PDDL, as in "(forall (?o - agent) (not (take ?o)))".',
            )


@dataclass(frozen=True, slots=True)
class _Bound:
    """A variable that stands for the value of an object fluent: its declaration, and the atom."""

    declared: str
    atom: str


class _Writer:
    def __init__(self, problem: Any, concurrency: Concurrency) -> None:
        self.problem, self.concurrency = problem, concurrency
        self.values = 0
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
        self.values = 0  # agents' equal actions are equal texts
        parameters = " ".join(
            f"{self.parameter(p)} - {self.type_name(p.type)}" for p in action.parameters
        )
        conditions = [self.text(c, agent, inside=True) for c in action.preconditions]
        conditions += [self.concurrency[action.name]] if action.name in self.concurrency else []
        effects = [text for effect in action.effects for text in self.effect(effect, agent)]
        return [
            f"  :parameters ({parameters})",
            f"  :precondition (and {' '.join(conditions)})",
            f"  :effect (and {' '.join(effects)}))",
        ]

    def effect(self, effect: Any, agent: Any) -> Iterable[str]:
        """An assignment; of a truth value that is not constant both cases."""
        if not effect.is_assignment():
            raise Unsupported(
                f"the effect {effect}: only assignments of truth values and objects are supported",
                remedy=_BOOLEAN,
            )
        condition = effect.condition
        conditions = [] if condition.is_true() else [self.text(condition, agent, inside=True)]
        bound: list[_Bound] = []
        parts = self.parts(effect.fluent, agent, bound, inside=True)
        fluent, value = effect.fluent.fluent(), effect.value
        if fluent.type.is_user_type():
            yield from self.object_effect(effect, parts, conditions, bound, agent)
            return
        atom = f"({' '.join(parts)})"
        cases = [(value, atom), (None, f"(not {atom})")]
        if value.is_bool_constant():
            cases = [(True, atom if value.is_true() else f"(not {atom})")]
        for case, literal in cases:
            own = list(conditions)
            if case is not True:
                holds = self.text(value, agent, inside=True)
                own.append(holds if case is not None else f"(not {holds})")
            yield self.effect_text(literal, own, bound, effect.forall)

    def object_effect(
        self,
        effect: Any,
        parts: Sequence[str],
        conditions: Sequence[str],
        bound: list[_Bound],
        agent: Any,
    ) -> Iterable[str]:
        """The new value of an object fluent becomes true, every other one false."""
        value = self.term(effect.value, agent, bound, inside=True)
        atom, old = f"({' '.join((*parts, value))})", self.fresh()
        yield self.effect_text(atom, conditions, bound, effect.forall)
        former = f"({' '.join((*parts, old))})"
        kind = self.type_name(effect.fluent.fluent().type)
        others = [*bound, _Bound(f"{old} - {kind}", former)]
        other = [*conditions, f"(not (= {old} {value}))"]
        yield self.effect_text(f"(not {former})", other, others, effect.forall)

    def effect_text(
        self,
        literal: str,
        conditions: Sequence[str],
        bound: Sequence[_Bound],
        variables: Sequence[Any],
    ) -> str:
        """An effect under conditions, for all values of the variables."""
        when = [*(b.atom for b in bound), *conditions]
        text = f"(when (and {' '.join(when)}) {literal})" if when else literal
        declared = " ".join(filter(None, [self.variables(variables), *(b.declared for b in bound)]))
        return f"(forall ({declared}) {text})" if declared else text

    def facts(self) -> list[str]:
        """The atoms that are true at the start."""
        found = []
        for fluent, value in self.problem.initial_values.items():
            if value.is_object_exp():
                found.append(self.initial(fluent, value))
            elif not value.is_bool_constant():
                raise Unsupported(
                    f"the initial value {fluent} := {value}: only truth values and objects are "
                    "supported",
                    remedy=_BOOLEAN,
                )
            elif value.is_true():
                found.append(self.text(fluent, None))
        return sorted(found)

    def initial(self, fluent: Any, value: Any) -> str:
        """The atom of an object fluent's value at the start."""
        agent = self.problem.agent(fluent.agent()) if fluent.is_dot() else None
        node = fluent.arg(0) if fluent.is_dot() else fluent
        bound: list[_Bound] = []
        parts = self.parts(node, agent, bound, inside=False)
        return f"({' '.join((*parts, self.objects.of(value.object().name, value.object().name)))})"

    def text(self, node: Any, agent: Any, *, inside: bool = False) -> str:
        """An expression as PDDL.

        Own fluents are those of ``agent``, which is a variable ``inside`` its actions.
        """
        if node.is_bool_constant():
            return "(and)" if node.is_true() else "(or)"
        if node.is_fluent_exp():
            bound: list[_Bound] = []
            parts = self.parts(node, agent, bound, inside=inside)
            return _with(f"({' '.join(parts)})", bound)
        if node.is_dot():
            return self.text(node.arg(0), self.problem.agent(node.agent()))
        if node.is_equals():
            bound = []
            sides = [self.term(arg, agent, bound, inside=inside) for arg in node.args]
            return _with(f"(= {' '.join(sides)})", bound)
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

    def parts(self, node: Any, agent: Any, bound: list[_Bound], *, inside: bool) -> list[str]:
        """The predicate of a fluent and its arguments, without the value of an object fluent.

        What arguments are values of object fluents is added to ``bound``.
        """
        fluent = node.fluent()
        own = agent if agent is not None and fluent in agent.fluents else None
        args = [self.term(arg, agent, bound, inside=inside) for arg in node.args]
        if own is not None:
            args.insert(0, _AGENT if inside else self.agent_name(own))
        return [self.predicate(fluent, own), *args]

    def term(self, node: Any, agent: Any, bound: list[_Bound], *, inside: bool) -> str:
        """An object or a variable; for an object fluent a new variable, added to ``bound``."""
        if node.is_object_exp():
            return self.objects.of(node.object().name, node.object().name)
        if node.is_parameter_exp():
            return self.parameter(node.parameter())
        if node.is_variable_exp():
            return self.variable(node.variable())
        if node.is_dot():
            return self.term(node.arg(0), self.problem.agent(node.agent()), bound, inside=False)
        if node.is_fluent_exp() and node.fluent().type.is_user_type():
            parts = self.parts(node, agent, bound, inside=inside)
            value = self.fresh()
            kind = self.type_name(node.fluent().type)
            bound.append(_Bound(f"{value} - {kind}", f"({' '.join((*parts, value))})"))
            return value
        raise Unsupported(
            f"the term {node}",
            remedy="Arguments are objects, parameters, variables, and object fluents.",
        )

    def fresh(self) -> str:
        """A variable of its own."""
        self.values += 1
        return f"?{self.variable_names.of(self.values, f'value-{self.values}')}"

    def variables(self, variables: Sequence[Any]) -> str:
        return " ".join(f"{self.variable(v)} - {self.type_name(v.type)}" for v in variables)

    def parameter(self, parameter: Any) -> str:
        return f"?{self.variable_names.of(parameter.name, parameter.name)}"

    def variable(self, variable: Any) -> str:
        return f"?{self.variable_names.of((variable.name,), f'any-{variable.name}')}"

    def predicate(self, fluent: Any, owner: Any) -> str:
        """The predicate of a fluent; own fluents of agents with one signature share one."""
        if not fluent.type.is_bool_type() and not fluent.type.is_user_type():
            raise Unsupported(
                f"fluent {fluent.name!r} of type {fluent.type}: only Boolean and object fluents "
                "are supported",
                remedy=_BOOLEAN,
            )
        types = tuple(self.type_name(p.type) for p in fluent.signature)
        if fluent.type.is_user_type():
            types = (*types, self.type_name(fluent.type))
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


def _with(text: str, bound: Sequence[_Bound]) -> str:
    """A formula about values of object fluents: each fluent has exactly one."""
    if not bound:
        return text
    declared = " ".join(value.declared for value in bound)
    return f"(exists ({declared}) (and {' '.join(value.atom for value in bound)} {text}))"


def _has_father(kind: Any, name: str) -> bool:
    return any(t.name.lower() == name for t in kind.ancestors)
