"""What was understood of a domain and problem: robots, subactions, constraints, interference, fluents."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from planners.grounding import GroundAction
from planners.interference import conflict, footprint
from planners.joint import JointModel
from planners.model import Loaded
from planners.pddl.lifted import Domain


@dataclass(frozen=True, slots=True)
class Inspection:
    """Everything that a user needs to see whether the domain was read as it was meant.

    ``subactions[robot][schema]`` counts ground subactions; ``idle[robot]`` says how the robot may do nothing;
    ``interfering`` counts pairs of subactions of different robots that cannot share a step, with one example.
    """

    domain: str
    problem: str
    style: str
    robots: tuple[str, ...]
    robots_by: str
    subactions: dict[str, dict[str, int]]
    idle: dict[str, str]
    shared: dict[str, int]
    unowned: str
    step_formulas: dict[str, int]
    without_effects: tuple[str, ...]
    costs: str
    interfering: int
    example: str | None
    fluents: dict[str, int]
    statics: dict[str, int]
    facts: int
    goal: str


def inspect(loaded: Loaded) -> Inspection:
    """Inspect a loaded domain and its first problem.

    O(pairs of subactions) for the interference count.
    """
    model, domain = loaded.model, loaded.domain
    pairs, example = _interference(model)
    return Inspection(
        domain=domain.name,
        problem=loaded.problems[0].name,
        style=_style(domain),
        robots=model.robots,
        robots_by=loaded.team.by,
        subactions=_subactions(model),
        idle=_idle(model),
        shared=_counted(a.schema for a in model.actions if len(a.owners) > 1 and not a.parts),
        unowned=loaded.options.robots.unowned,
        step_formulas=_counted(a.schema for a in model.actions if _speaks_of_others(a)),
        without_effects=tuple(sorted({a.schema for a in model.actions if not a.effects})),
        costs=_costs(domain, model.cost),
        interfering=pairs,
        example=example,
        fluents=_counted(fact[1:-1].split(" ")[0] for fact in model.codec.facts),
        statics=_counted(a.predicate for a in model.statics),
        facts=len(model.codec.facts),
        goal=_source_of_goal(loaded),
    )


def _style(domain: Domain) -> str:
    if domain.is_joint_action:
        return "joint-action PDDL (subaction comments)"
    if any(schema.agent is not None for schema in domain.schemas):
        return "MA-PDDL (:agent)"
    return "plain PDDL with robots as objects"


def _subactions(model: JointModel) -> dict[str, dict[str, int]]:
    if model.is_joint_action:
        return {
            robot: _counted(label[1:-1].split(" ")[0] for label in own[1:])
            for robot, own in zip(model.robots, model.labels, strict=True)
        }
    return {
        robot: _counted(a.schema for a in model.actions if number in a.owners)
        for number, robot in enumerate(model.robots)
    }


def _idle(model: JointModel) -> dict[str, str]:
    if model.is_joint_action:
        return dict.fromkeys(model.robots, "where a joint action says so")
    nothing = sorted({a.schema for a in model.actions if a.does_nothing})
    return {
        robot: "may idle in every step" if keeps else f"does nothing by its own action ({', '.join(nothing)})"
        for robot, keeps in zip(model.robots, model.keeps_idle, strict=True)
    }


def _speaks_of_others(action: GroundAction) -> bool:
    touched = footprint(action)
    return bool(touched.partners or touched.excluded)


def _interference(model: JointModel) -> tuple[int, str | None]:
    """Pairs of subactions of different robots that may not share a step, and why, for the first."""
    if model.is_joint_action:
        return 0, None
    count = 0
    example: str | None = None
    own = [[a for a in model.actions if a.owners == (i,)] for i in range(len(model.robots))]
    tables = getattr(model.stepper, "tables", {})
    for i, j in combinations(range(len(model.robots)), 2):
        table = tables[i, j]
        count += int(np.count_nonzero(~table[1:, 1:]))
        if example is None:
            example = next((c for a in own[i] for b in own[j] if (c := conflict(a, b))), None)
    return count, example


def _costs(domain: Domain, cost: str) -> str:
    declared = sorted(s.name for s in domain.schemas if s.cost is not None)
    if not declared:
        return "none declared"
    if cost == "makespan+cost":
        return f"used as the second component ({', '.join(declared)})"
    return f"declared ({', '.join(declared)}) and ignored: --cost makespan+cost uses them"


def _source_of_goal(loaded: Loaded) -> str:
    text = loaded.problems[0].source.text
    start = text.lower().find("(:goal")
    depth = 0
    for position in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[position], 0)
        if depth == 0:
            return " ".join(text[start : position + 1].split())
    return ""


def _counted(names: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(names).items()))

