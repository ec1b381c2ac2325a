# SPDX-License-Identifier: GPL-3.0-or-later
"""Small random domains and problems as PDDL text, for comparing the fast model with its naive twin.

Every seed gives one model with two or three robots and at most `_FLUENTS` ground fluents, hence at
most ``2 ** _FLUENTS`` states.  Three kinds: MA-PDDL with ``:agent``, plain typed PDDL with actions
shared by two robots (and now and then actions of nobody), and joint-action PDDL.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from math import prod
from random import Random
from typing import Literal

from planners.pddl.model_options import Unowned

Kind = Literal["agent", "plain", "joint"]
KINDS: tuple[Kind, ...] = ("agent", "plain", "joint")
_FLUENTS = 7
Signature = tuple[str, ...]
_SIGNATURES: tuple[Signature, ...] = (
    *((), ("robot",), ("place",), ("robot", "place"), ("place", "place"), ("robot", "robot")),
)
#: Types that a variable may have, and how often.
_TYPES = ("robot", "robot", "place", "place", "place", "hub", "object", "(either robot hub)")
_FORMULAS = ("literal", "equal", "step", "and", "or", "not", "imply", "forall", "exists")
#: Variables and their types.
Scope = dict[str, str]


@dataclass(frozen=True)
class RandomModel:
    """Text of a domain and a problem, and who does what belongs to nobody."""

    domain: str
    problem: str
    unowned: Unowned = "error"


def random_model(seed: int, kind: Kind) -> RandomModel:
    """The model of a seed; the same seed writes the same text."""
    return _Writer(Random(f"{kind} {seed}"), kind).model()


def _listed(scope: Scope) -> str:
    return " ".join(f"{name} - {kind}" for name, kind in scope.items())


@dataclass
class _Writer:
    random: Random
    kind: Kind
    robots: list[str] = field(default_factory=list)
    places: list[str] = field(default_factory=list)
    fluents: dict[str, Signature] = field(default_factory=dict)
    statics: dict[str, Signature] = field(default_factory=dict)
    actions: dict[str, Scope] = field(default_factory=dict)
    unowned: Unowned = "error"

    def model(self) -> RandomModel:
        self._choose_names()
        # What no effect mentions would be static.
        bodies = [self._schema(scope) for scope in self.actions.values()]
        missing = [p for p in self.fluents if not any(f"({p}" in effect for _, effect in bodies)]
        first = self.actions["a0"]
        more = "".join(f" ({name}{self._terms(self.fluents[name], first)})" for name in missing)
        bodies[0] = bodies[0][0], bodies[0][1] + more
        texts = [
            self._action(name, scope, precondition, f"(and{effect})" if effect else "()")
            for (name, scope), (precondition, effect) in zip(
                self.actions.items(), bodies, strict=True
            )
        ]
        predicates = " ".join(
            f"({name}{''.join(f' ?{i}' for i in range(len(types)))})"
            for name, types in (*self.fluents.items(), *self.statics.items())
        )
        domain = (
            "(define (domain random) (:requirements :adl :multi-agent)\n"
            "  (:types robot place - object hub - place)\n"
            f"  (:constants {' '.join(self.robots)} - robot {self.places[0]} - hub)\n"
            f"  (:predicates {predicates})\n" + "\n".join(texts) + ")\n"
        )
        return RandomModel(domain, self._problem(), self.unowned)

    # -- what there is

    def _choose_names(self) -> None:
        pick = self.random
        self.robots = [f"r{i + 1}" for i in range(pick.choice((2, 2, 2, 3)))]
        self.places = [f"p{i + 1}" for i in range(pick.choice((1, 2, 2, 3, 3)))]
        sizes = {"robot": len(self.robots), "place": len(self.places)}
        atoms = {s: prod(sizes[kind] for kind in s) for s in _SIGNATURES}
        left = _FLUENTS
        for number in range(pick.randint(1, 3)):
            fitting = [s for s in _SIGNATURES if atoms[s] <= left and (s or number)]
            if fitting:
                self.fluents[f"f{number}"] = signature = pick.choice(fitting)
                left -= atoms[signature]
        if not self.fluents:
            self.fluents["f0"] = ("robot",)
        for number in range(pick.randint(0, 2)):
            self.statics[f"s{number}"] = pick.choice(_SIGNATURES)
        if self.kind == "plain" and pick.random() < 0.2:
            self.unowned = pick.choice(("environment", "shared"))
        for number in range(pick.choice((1, 2, 2, 3, 3, 4))):
            self.actions[f"a{number}"] = self._parameters()

    def _parameters(self) -> Scope:
        pick, types = self.random, ("place", "place", "hub", "robot")
        if self.kind == "joint":
            number = pick.choice((0, 1, 2, 2, 3, 4))
            return {f"?x{i}": pick.choice(types) for i in range(number)}
        scope = {"?r": "robot"}
        if self.kind == "plain":
            if self.unowned != "error" and pick.random() < 0.4:
                del scope["?r"]
            elif pick.random() < 0.4:
                scope["?q"] = "robot"
        extra = pick.choice((0, 1, 2, 2)) if len(scope) < 2 else pick.choice((0, 0, 1))
        for number in range(extra):
            # Another robot as argument would make a plain action a shared one.
            plain = self.kind == "plain"
            scope[f"?x{number}"] = pick.choice(("place", "hub") if plain else types)
        return scope

    # -- schemas

    def _schema(self, scope: Scope) -> tuple[str, str]:
        """Precondition and effects (not yet joined) of an action; one in six has no effect."""
        pick = self.random
        if pick.random() < 0.12 and self.kind != "joint":
            return self._wait(scope)
        if pick.random() < 0.4 and (moving := self._move(scope)):
            return moving
        parts = [self._literal(scope) for _ in range(pick.choice((0, 0, 1, 1, 2)))]
        if pick.random() < 0.35:
            parts.append(self._formula(scope, pick.randint(1, 3)))
        if self.kind != "joint" and pick.random() < 0.3:
            parts.append(self._about_the_step(scope))
        precondition = f"(and {' '.join(parts)})" if len(parts) != 1 else parts[0]
        if not parts and pick.random() < 0.5:
            precondition = "()"
        if pick.random() < 1 / 6:
            return precondition, ""
        effects = [self._effect(scope, 2) for _ in range(pick.randint(1, 3))]
        return precondition, "".join(f" {effect}" for effect in effects)

    def _wait(self, scope: Scope) -> tuple[str, str]:
        """An action that does nothing: always possible, or wherever one fact holds."""
        name, types = self.random.choice(list(self.fluents.items()))
        return self.random.choice(("()", f"({name}{self._terms(types, scope)})")), ""

    def _move(self, scope: Scope) -> tuple[str, str] | None:
        """``(f .. ?x)`` becomes ``(f .. ?y)``: chains of such steps make plans of some length."""
        pick = self.random
        changing = [(f, types) for f, types in self.fluents.items() if types]
        if not changing:
            return None
        name, types = pick.choice(changing)
        last = [v for v, t in scope.items() if t == types[-1] or (types[-1], t) == ("place", "hub")]
        if len(last) < 2:
            return None
        before, after = pick.sample(last, 2)
        first = self._terms(types[:-1], scope)
        here, there = f"({name}{first} {before})", f"({name}{first} {after})"
        more = [self._about_the_step(scope)] if self.kind != "joint" and pick.random() < 0.4 else []
        more += [f"(not {there})"] if pick.random() < 0.4 else []
        more += [self._literal(scope)] if pick.random() < 0.2 else []
        effect = f" {self._effect(scope, 2)}" if pick.random() < 0.3 else ""
        return f"(and {' '.join((here, *more))})", f" (not {here}) {there}{effect}"

    def _action(self, name: str, scope: Scope, precondition: str, effect: str) -> str:
        lines, parameters = [f"  (:action {name}"], {**scope}
        if self.kind == "agent" and self.random.random() < 0.7:
            lines.append(f"    :agent ?r - {parameters.pop('?r')}")
        elif self.kind == "agent":
            lines.append("    :agent ?r")
        lines.append(f"    :parameters ({_listed(parameters)})")
        if self.kind == "joint":
            lines += self._comments(scope)
        return "\n".join([*lines, f"    :precondition {precondition}", f"    :effect {effect})"])

    def _comments(self, scope: Scope) -> list[str]:
        """The robots' parts; most name all parameters, so that they determine the action."""
        pick = self.random
        lines = []
        for robot in self.robots:
            terms = [v for v in scope if pick.random() < 0.8]
            if pick.random() < 0.1:
                terms.append(self.places[0])
            idle = pick.random() < 0.25
            part = "idle" if idle else f"({' '.join((pick.choice(('go', 'do')), *terms))})"
            lines.append(f"    ; subaction {robot} {part}")
        # A missing line means idle; the first robot is always named.
        return [
            line
            for n, line in enumerate(lines)
            if n == 0 or not line.endswith("idle") or pick.random() < 0.5
        ]

    # -- formulas

    def _term(self, kind: str, scope: Scope) -> str:
        """Mostly a variable of the type, sometimes a constant or a variable of any type."""
        pick = self.random
        fitting = [v for v, t in scope.items() if t == kind or (kind == "place" and t == "hub")]
        if fitting and pick.random() < 0.85:
            return pick.choice(fitting)
        if scope and pick.random() < 0.2:
            return pick.choice(list(scope))
        return pick.choice(self.robots) if kind == "robot" else self.places[0]

    def _terms(self, types: Signature, scope: Scope) -> str:
        return "".join(f" {self._term(t, scope)}" for t in types)

    def _literal(self, scope: Scope) -> str:
        pick = self.random
        known = {**self.fluents, **(self.statics if pick.random() < 0.4 else {})}
        name = pick.choice(list(known))
        atom = f"({name}{self._terms(known[name], scope)})"
        return atom if pick.random() < 0.65 else f"(not {atom})"

    def _variables(self) -> Scope:
        """Names that may hide the parameters."""
        names = self.random.sample(("?o", "?x0", "?r", "?y"), self.random.choice((1, 1, 2)))
        return {name: self.random.choice(_TYPES) for name in names}

    def _formula(self, scope: Scope, depth: int, *, step: bool = True) -> str:
        pick = self.random
        kind = pick.choice(_FORMULAS)
        if depth == 0:
            kind = pick.choice(("literal", "literal", "literal", "equal", "step"))
        if kind == "step" and (self.kind == "joint" or not step):
            kind = "literal"

        def inner(scope: Scope = scope) -> str:
            return self._formula(scope, depth - 1, step=step)

        match kind:
            case "equal":
                terms = [*scope, *self.robots, self.places[0]]
                return f"(= {pick.choice(terms)} {pick.choice(terms)})"
            case "step":
                name = pick.choice(list(self.actions))
                return f"({name}{self._terms(tuple(self.actions[name].values()), scope)})"
            case "and" | "or":
                parts = [inner() for _ in range(pick.choice((1, 2, 2, 3)))]
                return f"({kind} {' '.join(parts)})"
            case "not":
                return f"(not {inner()})"
            case "imply":
                return f"(imply {inner()} {inner()})"
            case "forall" | "exists":
                own = self._variables()
                return f"({kind} ({_listed(own)}) {inner({**scope, **own})})"
        return self._literal(scope)

    def _about_the_step(self, scope: Scope) -> str:
        """As domains write: nobody does .., somebody else does .., nobody does .. unless .."""
        pick = self.random
        inner = {**scope, "?o": "robot"}
        name = pick.choice(list(self.actions))
        args = [
            "?o" if t == "robot" and pick.random() < 0.8 else self._term(t, inner)
            for t in self.actions[name].values()
        ]
        atom = f"({' '.join((name, *args))})"
        form = pick.random()
        if form < 0.4:
            return f"(forall (?o - robot) (not {atom}))"
        if form < 0.6:
            return f"(forall (?o - robot) (or (not {atom}) {self._literal(inner)}))"
        other = pick.choice(("(not (= ?o ?r)) ", "")) if "?r" in scope else ""
        return f"(exists (?o - robot) (and {other}{atom}))"

    def _effect(self, scope: Scope, depth: int) -> str:
        pick, kind = self.random, "literal"
        if depth:
            kind = pick.choice(("literal", "literal", "literal", "when", "forall"))
        if kind == "when":
            if self.kind != "joint" and pick.random() < 0.3:
                condition = self._about_the_step(scope)
            else:
                condition = self._formula(scope, pick.choice((0, 0, 1, 2)))
            return f"(when {condition} {self._effect(scope, depth - 1)})"
        if kind == "forall":
            own = self._variables()
            return f"(forall ({_listed(own)}) {self._effect({**scope, **own}, depth - 1)})"
        name = pick.choice(list(self.fluents))
        atom = f"({name}{self._terms(self.fluents[name], scope)})"
        literal = atom if pick.random() < 0.55 else f"(not {atom})"
        return literal if pick.random() < 0.85 else f"(and {literal} {self._effect(scope, 0)})"

    # -- the problem

    def _problem(self) -> str:
        pick = self.random
        things = {"robot": self.robots, "place": self.places}
        true = [
            f"({' '.join((name, *args))})"
            for name, types in (*self.fluents.items(), *self.statics.items())
            for args in product(*(things[t] for t in types))
            if pick.random() < 0.5
        ]
        goals = []
        for _ in range(pick.choice((1, 2, 2, 3))):
            name = pick.choice(list(self.fluents))
            args = [pick.choice(things[t]) for t in self.fluents[name]]
            atom = f"({' '.join((name, *args))})"
            # What already holds makes no goal: mostly ask for a change.
            wanted = (atom in true) != (pick.random() < 0.8)
            goals.append(atom if wanted else f"(not {atom})")
        if pick.random() < 0.2:
            goals.append(self._formula(dict.fromkeys(self.robots, "robot"), 2, step=False))
        rest = " ".join(self.places[1:])
        objects = f"{rest} - {pick.choice(('place', 'place', 'hub'))}" if rest else ""
        return (
            f"(define (problem random-1) (:domain random)\n  (:objects {objects})\n"
            f"  (:init {' '.join(true)})\n  (:goal (and {' '.join(goals)})))\n"
        )
