# SPDX-License-Identifier: GPL-3.0-or-later
"""A unified-planning problem as PDDL, with the way back.

The text is written here, not by unified-planning's own writers: those for several agents write one
file per agent and lose goals of agents, and this way one writer does for both classes of problems.
It is then read like any other PDDL.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations_with_replacement, count
from typing import Any, NamedTuple

from unified_planning.model import InstantaneousAction, OperatorKind, Problem, Variable
from unified_planning.model.multi_agent import MultiAgentProblem
from unified_planning.model.problem_kind import FEATURES as ALL_FEATURES

from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import Domain
from planners.pddl.lifted import Problem as PddlProblem
from planners.pddl.sexpr import Source
from planners.system.errors import BadInput, Unsupported, UsageError
from planners.system.messages import echoed

#: Action -> robot -> its part, as in joint-action PDDL: ``{"swap": {"r1": "(move ?a ?b)", "r2":
#: "(move ?b ?a)"}}``.
Subactions = Mapping[str, Mapping[str, str | None]]

#: Action -> a formula about the same joint step, as PDDL text: ``{"lift": "(exists (?o - agent)
#: (and (not (= ?o ?agent)) (lift ?o)))"}``; the acting agent is ``?agent``.
Concurrency = Mapping[str, str]

#: Action schema -> the actions that it stands for, by agent (None where there are no agents).
Schemas = dict[str, dict[str | None, Any]]

#: The features of problems that are understood, in unified-planning's words.  What has any other
#: is refused, and what is no `Problem` or `MultiAgentProblem` itself.
FEATURES = frozenset(
    """
    ACTION_BASED ACTION_BASED_MULTI_AGENT AGENT_SPECIFIC_PRIVATE_GOAL AGENT_SPECIFIC_PUBLIC_GOAL
    FLAT_TYPING HIERARCHICAL_TYPING OBJECT_FLUENTS
    NEGATIVE_CONDITIONS DISJUNCTIVE_CONDITIONS EQUALITIES EXISTENTIAL_CONDITIONS
    UNIVERSAL_CONDITIONS CONDITIONAL_EFFECTS FORALL_EFFECTS
    STATIC_FLUENTS_IN_BOOLEAN_ASSIGNMENTS FLUENTS_IN_BOOLEAN_ASSIGNMENTS
    STATIC_FLUENTS_IN_OBJECT_ASSIGNMENTS FLUENTS_IN_OBJECT_ASSIGNMENTS
    """.split()  # noqa: SIM905
)
#: A metric says which plans are good, not what is a plan.
_METRIC_GROUPS = ("QUALITY_METRICS", "ACTIONS_COST_KIND", "OVERSUBSCRIPTION_KIND")
_METRICS = {feature for group in _METRIC_GROUPS for feature in ALL_FEATURES[group]}

#: The variable that stands for the acting agent.
AGENT = "?agent"
#: What PDDL or its readers take for something of their own.
_RESERVED = ("and", "or", "not", "imply", "forall", "exists", "when", "either", "object")
#: Kinds of unified-planning's expressions -> their PDDL operators.
_OPERATORS = {
    OperatorKind.AND: "and",
    OperatorKind.OR: "or",
    OperatorKind.NOT: "not",
    OperatorKind.IMPLIES: "imply",
    OperatorKind.EXISTS: "exists",
    OperatorKind.FORALL: "forall",
}
#: What an action is given, by the parameter, and an example.
_EXAMPLES: dict[str, tuple[Any, str]] = {
    "subactions": (Mapping, '{"r1": "(move ?a ?b)"}'),
    "concurrency": (str, '"(forall (?o - agent) (not (take ?o)))"'),
}
#: Kinds of expressions about values, which other ones combine.
_ATOMIC = (OperatorKind.FLUENT_EXP, OperatorKind.DOT, OperatorKind.EQUALS)


@dataclass(frozen=True, slots=True)
class Translated:
    """A unified-planning problem as PDDL.

    ``schemas`` maps each action schema to the actions it stands for, by agent (None where there are
    no agents); ``objects`` and ``agents`` map PDDL names to objects and agents, ``types`` type
    names to PDDL names.
    """

    domain: Domain
    problem: PddlProblem
    schemas: Schemas
    objects: dict[str, Any]
    agents: dict[str, Any]
    types: dict[str, str]


def translate(
    problem: Any, subactions: Subactions | None = None, concurrency: Concurrency | None = None
) -> Translated:
    """PDDL for a `unified_planning.model.Problem` or a `MultiAgentProblem`.

    An agent becomes an object, its own fluents get it as their first argument, and its actions
    ``:agent``; goals of agents are goals.  An object fluent becomes a predicate with its value as
    the last argument.  With ``subactions`` an action is a whole joint step; the formulas of
    ``concurrency`` are further preconditions.

    Raises `Unsupported` for what is not read, `UsageError` for subactions or formulas that belong
    to no action, `BadInput` for a problem without a robot.
    """
    subactions, concurrency = subactions or {}, concurrency or {}
    if type(problem) not in (Problem, MultiAgentProblem):
        raise refused(f"a {type(problem).__name__} is not supported")
    if type(problem) is MultiAgentProblem and not problem.agents:
        raise BadInput("the problem has no agent", remedy="Add one: problem.add_agent(..).")
    if others := problem.kind.features - FEATURES - _METRICS:
        raise refused(f"not supported: {', '.join(sorted(others))}")
    _check_parameters(problem, subactions, concurrency)
    writer = _Writer(problem, concurrency)
    domain_text, problem_text, schemas = writer.write(subactions)
    name = problem.name or "unnamed"
    domain = parse_domain(Source(f"unified-planning problem {name!r} (domain)", domain_text))
    return Translated(
        domain=domain,
        problem=parse_problem(Source(f"unified-planning problem {name!r}", problem_text), domain),
        schemas=schemas,
        objects=writer.objects,
        agents=writer.named_agents,
        types={t.name: writer.type_name(t) for t in problem.user_types},
    )


def _check_parameters(problem: Any, subactions: Subactions, concurrency: Concurrency) -> None:
    """Raise `UsageError` for subactions and formulas that no action of the problem can have."""
    agents = getattr(problem, "agents", ())
    own, other = ("concurrency", "subactions") if agents else ("subactions", "concurrency")
    given: dict[str, Mapping[str, Any]] = {"subactions": subactions, "concurrency": concurrency}
    if given[other]:
        raise UsageError(
            f"a problem is given {other}, {'with' if agents else 'without'} agents",
            remedy="Give concurrency where actions are agents' own, and subactions elsewhere.",
        )
    names = sorted({action.name for owner in agents or (problem,) for action in owner.actions})
    kind, example = _EXAMPLES[own]
    for name, value in given[own].items():
        if name not in names:
            what, remedy = f"there is no action {name!r}", f"The actions are {', '.join(names)}."
        elif not isinstance(value, kind):
            what, remedy = f"{value!r} for {name!r}", f"Write {example}."
        else:
            continue
        raise UsageError(f"{own}: {what}", remedy=remedy)


class _Bound(NamedTuple):
    """A variable that stands for the value of an object fluent, its declaration, and the atom."""

    variable: str
    declared: str
    atom: str


class PddlNames:
    """PDDL names for what a problem names, in whatever words.

    Each thing of a kind (types, predicates, actions, objects, variables) gets one of its own.  What
    is a PDDL name already, in lower case, is kept unless it is taken.
    """

    def __init__(self) -> None:
        self._names: dict[tuple[str, Hashable], str] = {}
        self._taken: dict[str, set[str]] = {}

    def of(self, kind: str, thing: Hashable, text: str) -> str:
        """The PDDL name of a thing; ``text`` is what it is called."""
        if (kind, thing) not in self._names:
            taken = self._taken.setdefault(kind, {*_RESERVED, "increase", "total-cost"})
            base = self.plain(text)
            names = chain([base], (f"{base}__{number}" for number in count(2)))
            name = self._names[kind, thing] = next(name for name in names if name not in taken)
            taken.add(name)
        return self._names[kind, thing]

    def plain(self, text: str) -> str:
        """What a thing is called in PDDL as long as nothing else is."""
        return re.sub(r"[^a-z0-9_-]", "_", text.lower()).strip("-") or "x"


class _Writer:
    """The text, with the names of everything in it.

    ``objects`` and ``named_agents`` are by their names, ``declared`` the predicates named so far;
    ``apart``: some action is not for all agents.
    """

    def __init__(self, problem: Any, concurrency: Concurrency) -> None:
        self.problem, self.concurrency, self.names = problem, concurrency, PddlNames()
        self.values, self.apart = 0, False
        self.declared: dict[str, str] = {}
        #: The types by their names; the problem does not list those of quantifiers alone.
        self.types: dict[str, Any] = {}
        self.agents: tuple[Any, ...] = tuple(getattr(problem, "agents", ()))
        self.names.of("variable", None, AGENT[1:])
        shared = problem.ma_environment if self.agents else problem
        #: The fluents that are nobody's own.
        self.shared: tuple[Any, ...] = tuple(shared.fluents)
        roots = {[*t.ancestors][-1].name for t in problem.user_types}
        is_root = not self.agents and [root.lower() for root in roots] == ["object"]
        #: The type that PDDL calls object, as unified-planning's PDDL reader makes it; no agents
        #: are of it.
        self.root = min(roots) if is_root else None
        #: The type of all agents, by which formulas of the user name it.
        self.agent_type = self.names.of("type", None, "agent") if self.agents else ""
        # Types, objects and agents are named first, so that their names are kept where possible.
        for t in self.problem.user_types:
            self.type_name(t)
        if self.concurrency:  # its formulas name actions, not fluents that are called so
            for action in (a.name for agent in self.agents for a in agent.actions):
                self.names.of("predicate", ("action", action), action)
        self.objects = {self.object_name(o): o for o in self.problem.all_objects}
        self.named_agents = {self.agent_name(agent): agent for agent in self.agents}

    def type_name(self, kind: Any) -> str:
        if not kind.is_user_type():
            raise refused(f"parameters of type {kind}")
        for each in kind.ancestors:
            self.types.setdefault(each.name, each)
        return "object" if kind.name == self.root else self.names.of("type", kind.name, kind.name)

    def own_type(self, agent: Any) -> str:
        """A type for one agent alone, if some action is not for all of them."""
        if not self.apart:
            return self.agent_type
        return self.names.of("type", ("agent", agent.name), f"agent-{agent.name}")

    def object_name(self, thing: Any) -> str:
        return self.names.of("object", thing.name, thing.name)

    def agent_name(self, agent: Any) -> str:
        """The name of the object that stands for an agent."""
        return self.names.of("object", ("agent", agent.name), agent.name)

    def variable(self, thing: Any) -> str:
        """The variable of an action's parameter, or of a quantifier."""
        text = f"any-{thing.name}" if isinstance(thing, Variable) else thing.name
        return f"?{self.names.of('variable', (type(thing), thing.name), text)}"

    def declarations(self, things: Iterable[Any]) -> str:
        """The declarations of parameters, or of a quantifier's variables."""
        return " ".join(f"{self.variable(v)} - {self.type_name(v.type)}" for v in things)

    def predicate(self, fluent: Any, owner: Any) -> str:
        """The predicate of a fluent; own fluents of agents with one signature share one."""
        if not _is_read(fluent):
            raise refused(f"fluent {fluent.name!r} of type {fluent.type}")
        types = tuple(self.type_name(p.type) for p in fluent.signature)
        if fluent.type.is_user_type():
            types = (*types, self.type_name(fluent.type))
        name = self.names.of("predicate", (fluent.name, types, owner is not None), fluent.name)
        if name not in self.declared:
            whose = [f"?a - {self.agent_type}"] if owner is not None else []
            args = [f"?x{n} - {t}" for n, t in enumerate(types)]
            self.declared[name] = _listed(name, *whose, *args)
        return name

    def write(self, subactions: Subactions) -> tuple[str, str, Schemas]:
        """Domain, problem, and what the schemas stand for."""
        for fluent in filter(_is_read, self.shared):
            self.predicate(fluent, None)
        actions, schemas = self.actions(subactions)
        facts, goals = self.facts(), self.goals()  # they may declare further predicates
        objects = [f"{name} - {self.type_name(o.type)}" for name, o in self.objects.items()]
        objects += [f"{name} - {self.own_type(a)}" for name, a in self.named_agents.items()]
        sections = [
            _section("(:types", self.type_lines()),
            _section("(:constants", objects),  # constants, as actions may name them
            _section("(:predicates", self.declared.values()),
        ]
        domain = "\n".join(["(define (domain up)", *sections, *actions, ")\n"])
        sections = [_section("(:init", facts), _section("(:goal (and", goals)]
        problem = "\n".join(["(define (problem up-task) (:domain up)", *sections])
        return domain, f"{problem}))\n", schemas

    def goals(self) -> list[str]:
        goals = [self.text(goal, None) for goal in self.problem.goals]
        for agent in self.agents:
            goals += [self.text(g, agent) for g in (*agent.public_goals, *agent.private_goals)]
        return goals

    def type_lines(self) -> list[str]:
        kinds = [
            (self.type_name(t), self.type_name(t.father) if t.father else "object")
            for t in [*self.types.values()]
        ]
        kinds += [(self.own_type(agent), self.agent_type) for agent in self.agents if self.apart]
        if self.agents:
            kinds.append((self.agent_type, "object"))
        return [f"{name} - {father}" for name, father in kinds if name != "object"]

    def actions(self, subactions: Subactions) -> tuple[list[str], Schemas]:
        """The schemas and what they stand for: equal actions of several agents become one."""
        groups = self.groups(subactions)
        self.apart = any(len(members) < len(self.agents) for members in groups.values())
        self.require_one_form(key[0] for key in groups)
        own_types = {name: self.own_type(agent) for name, agent in self.named_agents.items()}
        actions: list[str] = []
        schemas: Schemas = {}
        for key, members in groups.items():
            name = self.names.of("action", key, key[0])
            types = dict.fromkeys(own_types[member] for member in members if member)
            whose = f"(either {' '.join(types)})" if len(types) > 1 else "".join(types)
            agents = [f"  :agent {AGENT} - {whose}"] if whose else []
            actions.append("\n".join([f"(:action {name}", *agents, *key[1:]]))
            schemas[name] = members
        return actions, schemas

    def groups(self, subactions: Subactions) -> dict[tuple[str, ...], dict[str | None, Any]]:
        """Actions by their names and lines of PDDL, those of one name and text by agent."""
        groups: dict[tuple[str, ...], dict[str | None, Any]] = defaultdict(dict)
        for agent in self.agents or (None,):
            owner = agent and self.agent_name(agent)
            for action in (agent or self.problem).actions:
                parts = subactions.get(action.name, {}).items()
                comments = [f"  ; subaction {robot} {text or 'idle'}" for robot, text in parts]
                groups[action.name, *comments, *self.body(action, agent)][owner] = action
        return groups

    def require_one_form(self, actions: Iterable[str]) -> None:
        """Raise `UsageError` for a formula about an action that became several schemas.

        ``actions`` has the name of each schema's action: a formula would speak of the first alone.
        """
        forms = Counter(map(self.names.plain, actions))
        formulas = " ".join(self.concurrency.values()).lower()
        for name in re.findall(r"\(\s*([^\s()]+)", formulas):
            if forms[name] > 1:
                raise UsageError(
                    f"concurrency names action {echoed(name)}, which agents have in different "
                    "forms",
                    remedy="Give these actions names of their own, or equal conditions and "
                    "effects.",
                )

    def body(self, action: Any, agent: Any) -> list[str]:
        if type(action) is not InstantaneousAction or action.simulated_effect is not None:
            raise refused(
                f"{type(action).__name__} {action.name!r} is not instantaneous, or its effects are "
                "simulated"
            )
        self.values = 0  # agents' equal actions are equal texts
        conditions = [self.text(c, agent, True) for c in (*action.preconditions, *_clashes(action))]
        conditions += [self.concurrency[action.name]] if action.name in self.concurrency else []
        effects = [text for effect in action.effects for text in self.effect(effect, agent)]
        return [
            f"  :parameters ({self.declarations(action.parameters)})",
            f"  :precondition (and {' '.join(conditions)})",
            f"  :effect (and {' '.join(effects)}))",
        ]

    def effect(self, effect: Any, agent: Any) -> Iterator[str]:
        """An assignment: what it makes true and what false, each under its condition."""
        when = [] if effect.condition.is_true() else [self.text(effect.condition, agent, True)]
        for literal, own, variables in self.cases(effect, agent):
            conditions = [*(b.atom for b in variables), *when, *own]
            text = f"(when (and {' '.join(conditions)}) {literal})" if conditions else literal
            declared = [self.declarations(effect.forall), *(b.declared for b in variables)]
            quantified = " ".join(filter(None, declared))
            yield f"(forall ({quantified}) {text})" if quantified else text

    def cases(self, effect: Any, agent: Any) -> list[tuple[str, list[str], list[_Bound]]]:
        """The literals that an assignment makes true, with conditions of their own, and values."""
        fluent, value, bound = effect.fluent.fluent(), effect.value, list[_Bound]()
        parts = self.parts(effect.fluent, agent, bound, True)
        if fluent.type.is_user_type():
            new, old = self.term(value, agent, bound, True), self.value(fluent, parts)
            differs = f"(not (= {old.variable} {new}))"
            return [
                (_listed(*parts, new), [], bound),
                (f"(not {old.atom})", [differs], [*bound, old]),
            ]
        atom = _listed(*parts)
        if value.is_bool_constant():
            return [(atom if value.is_true() else f"(not {atom})", [], bound)]
        holds = self.text(value, agent, True)
        return [(atom, [holds], bound), (f"(not {atom})", [f"(not {holds})"], bound)]

    def facts(self) -> list[str]:
        """The atoms that are true at the start."""
        found = []
        for node, value in self.problem.initial_values.items():
            if value.is_true():
                found.append(self.text(node, None))
            elif value.is_object_exp():
                parts = self.parts(node, None, [], False)
                found.append(_listed(*parts, self.object_name(value.object())))
        return sorted(found)

    def text(self, node: Any, agent: Any, inside: bool = False) -> str:
        """An expression as PDDL.

        Own fluents are those of ``agent``, which is a variable ``inside`` its actions.
        """
        if node.is_bool_constant():
            return "(and)" if node.is_true() else "(or)"
        if node.node_type in _ATOMIC:
            return self.atomic(node, agent, inside)
        parts = [self.text(arg, agent, inside) for arg in node.args]
        if node.is_iff():
            return f"(and (imply {parts[0]} {parts[1]}) (imply {parts[1]} {parts[0]}))"
        operator = _OPERATORS.get(node.node_type)
        if operator is None:
            raise refused(f"the expression {node}")
        if node.is_exists() or node.is_forall():
            parts = [f"({self.declarations(node.variables())})", *parts]
        return _listed(operator, *parts)

    def atomic(self, node: Any, agent: Any, inside: bool) -> str:
        """An atom, or an equation, about the values of the object fluents in it."""
        bound: list[_Bound] = []
        if node.is_equals():
            words = ["=", *(self.term(arg, agent, bound, inside) for arg in node.args)]
        else:
            words = self.parts(node, agent, bound, inside)
        if not bound:
            return _listed(*words)
        declared = " ".join(value.declared for value in bound)
        atoms = " ".join(value.atom for value in bound)  # each fluent has exactly one value
        return f"(exists ({declared}) (and {atoms} {_listed(*words)}))"

    def parts(self, node: Any, agent: Any, bound: list[_Bound], inside: bool) -> list[str]:
        """The predicate of a fluent and its arguments, without the value of an object fluent.

        What arguments are values of object fluents is added to ``bound``.  Of ``Dot(other, ..)``
        the fluent is the other agent's, and its arguments are read as they are without.
        """
        owner, is_variable = agent, inside
        if node.is_dot():
            owner, is_variable, node = self.problem.agent(node.agent()), False, node.arg(0)
        fluent = node.fluent()
        own = owner if owner is not None and fluent in owner.fluents else None
        if own is None and fluent not in self.shared:
            raise refused(f"fluent {fluent.name!r}, another agent's own, without Dot")
        args = [self.term(arg, agent, bound, inside) for arg in node.args]
        if own is not None:
            args.insert(0, AGENT if is_variable else self.agent_name(own))
        return [self.predicate(fluent, own), *args]

    def value(self, fluent: Any, parts: Sequence[str]) -> _Bound:
        """A new variable for the value of an object fluent, of which ``parts`` are the atom's."""
        self.values += 1
        name = f"?{self.names.of('variable', self.values, f'value-{self.values}')}"
        return _Bound(name, f"{name} - {self.type_name(fluent.type)}", _listed(*parts, name))

    def term(self, node: Any, agent: Any, bound: list[_Bound], inside: bool) -> str:
        """An object or a variable; for an object fluent a new variable, added to ``bound``."""
        if node.is_object_exp():
            return self.object_name(node.object())
        if node.is_parameter_exp() or node.is_variable_exp():
            return self.variable(node.parameter() if node.is_parameter_exp() else node.variable())
        inner = node.arg(0) if node.is_dot() else node
        if inner.is_fluent_exp() and inner.fluent().type.is_user_type():
            parts = self.parts(node, agent, bound, inside)
            bound.append(self.value(inner.fluent(), parts))
            return bound[-1].variable
        raise refused(f"the term {node}")


def _section(begin: str, lines: Iterable[str]) -> str:
    return "\n".join([begin, *(f"  {line}" for line in lines), ")"])


def _clashes(action: Any) -> Iterator[Any]:
    """Conditions without which an object fluent gets two values at once.

    To unified-planning such an action is not applicable.  (A truth value that is made true and
    false at once becomes true, as in PDDL.)
    """
    new = action.environment.expression_manager
    objects = [e for e in action.effects if e.fluent.fluent().type.is_user_type()]
    for one, two in combinations_with_replacement(objects, 2):
        if one.fluent.fluent() != two.fluent.fluent():
            continue
        others = [Variable(f"{v.name}'", v.type, v.environment) for v in two.forall]
        given, fresh = map(new.VariableExp, two.forall), map(new.VariableExp, others)
        renamed = dict(zip(given, fresh, strict=True))
        parts = (two.fluent, two.value, two.condition)
        target, value, when = (part.substitute(renamed) for part in parts)
        same = [new.Equals(a, b) for a, b in zip(one.fluent.args, target.args, strict=True)]
        values = new.And(*same, new.Not(new.Equals(one.value, value)))
        if not values.simplify().is_false():
            clash = new.And(one.condition, when, values)
            variables = (*one.forall, *others)
            yield new.Not(new.Exists(clash, *variables) if variables else clash)


def refused(what: str) -> Unsupported:
    """The error for what is not read."""
    return Unsupported(
        what,
        remedy="coordlang reads Boolean and object fluents over objects, and instantaneous "
        "actions; docs/unified-planning.md has the list.",
    )


def _is_read(fluent: Any) -> bool:
    """Whether a fluent has a truth value or an object; another one must not be used."""
    return bool(fluent.type.is_bool_type() or fluent.type.is_user_type())


def _listed(*words: str) -> str:
    return f"({' '.join(words)})"
