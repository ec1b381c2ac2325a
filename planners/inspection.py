# SPDX-License-Identifier: GPL-3.0-or-later
"""What was understood of a domain and problem: robots, subactions, interference, fluents."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from planners.grounding.instantiate import idling_schemas
from planners.joint.interference import footprint
from planners.joint.model import JointModel, show
from planners.loading import PlanningInstance
from planners.pddl.formula_tree import formula_text
from planners.pddl.lifted import Domain, StepAtom
from planners.search.search_estimate import SearchEstimate, estimate
from planners.system.messages import some

#: States in which an example of interference is looked for.
_LOOK_AT = 2000


@dataclass(frozen=True, slots=True)
class Inspection:
    """Everything that a user needs to see whether the domain was read as it was meant.

    ``objects`` counts them by type, each in all its types; ``subactions[robot][schema]`` counts
    ground subactions, and ``impossible`` are the schemas that have none; ``idle[robot]`` says when
    the robot may idle, ``left_out`` are the schemas that are idling; ``formulas`` shows for each
    schema of ``step_formulas`` what one of its subactions asks of the others.  ``interfering``
    counts pairs of subactions of different robots that cannot share a step; the ``example`` is one
    that meets in a reachable state, None if no state near the start has one.  ``start`` counts the
    fluents that are true at first, ``never`` are the predicates that no state can make true.
    ``estimate`` says how large a search for plans will be.
    """

    domain: str
    problem: str
    style: str
    robots: tuple[str, ...]
    robots_by: str
    objects: dict[str, int]
    subactions: dict[str, dict[str, int]]
    impossible: tuple[str, ...]
    idle: dict[str, str]
    left_out: tuple[str, ...]
    shared: dict[str, int]
    unowned: str
    step_formulas: dict[str, int]
    formulas: tuple[str, ...]
    without_effects: tuple[str, ...]
    costs: str
    interfering: int
    example: str | None
    fluents: dict[str, int]
    start: dict[str, int]
    statics: dict[str, int]
    never: tuple[str, ...]
    facts: int
    goal: str
    estimate: SearchEstimate


def inspect(loaded: PlanningInstance) -> Inspection:
    """Inspect a loaded domain and its first problem.

    O(pairs of subactions) for the interference count; the work in states is bounded
    (`planners.search.search_estimate`).
    """
    model, domain = loaded.model, loaded.domain
    found, layers = estimate(model, loaded.tasks[0])
    start = model.codec.true_facts(loaded.tasks[0].init)
    idling = idling_schemas(domain)
    acting = {action.schema for action in model.actions}
    asking, formulas = _formulas(model)
    possible = {atom.predicate for atom in (*model.codec.facts, *model.statics)}
    idle = "where a joint action says so" if model.is_joint_action else "may idle in every step"
    rows = np.concatenate(layers)[:_LOOK_AT]
    return Inspection(
        domain=domain.name,
        problem=loaded.problems[0].name,
        style=_style(domain),
        robots=model.robots,
        robots_by=loaded.team.by,
        objects=_objects(loaded),
        subactions=_subactions(model),
        impossible=tuple(s.name for s in domain.schemas if s.name not in acting | idling),
        idle=dict.fromkeys(model.robots, idle),
        left_out=tuple(sorted(idling)),
        shared=_counted(a.schema for a in model.actions if len(a.owners) > 1 and not a.parts),
        unowned=loaded.options.unowned,
        step_formulas=asking,
        formulas=formulas,
        without_effects=tuple(sorted({a.schema for a in model.actions if not a.effects})),
        costs=_costs(domain, model.cost),
        interfering=model.stepper.interfering_pairs(),
        example=model.stepper.conflict_in(model.codec.facts_part(rows)),
        fluents=_counted(fact.predicate for fact in model.codec.facts),
        start=_counted(model.codec.facts.atoms[fact].predicate for fact in start),
        statics=_counted(a.predicate for a in model.statics),
        never=tuple(sorted(set(domain.predicates) - possible)),
        facts=len(model.codec.facts),
        goal=formula_text(loaded.problems[0].goal),
        estimate=found,
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


def _objects(loaded: PlanningInstance) -> dict[str, int]:
    """How many objects each type has; untyped ones count as ``object``."""
    domain = loaded.domain
    types = [
        frozenset().union(*(domain.supertypes(t) for t in own))
        - ({"object"} if own != ("object",) else set())
        for own in loaded.problems[0].objects.values()
    ]
    return _counted(t for own in types for t in own)


def _formulas(model: JointModel) -> tuple[dict[str, int], tuple[str, ...]]:
    """How many subactions of each schema ask something of the others, and what the first asks."""
    touched = [(action, footprint(action)) for action in model.actions]
    asking = [(action, own) for action, own in touched if own.partners or own.excluded]
    there = {StepAtom(action.schema, action.args) for action in model.actions}
    found: dict[tuple[str, str], str] = {}
    for action, own in asking:
        for kind, others in (("speaks of", own.partners), ("forbids", own.excluded)):
            if others and (action.schema, kind) not in found:
                # What no robot has is often a mistake in the domain.
                named = _some(others & there) or f"{_some(others)}, which no robot can ever do,"
                found[action.schema, kind] = f"{action.label} {kind} {named} in the same step"
    return _counted(action.schema for action, _ in asking), tuple(found.values())


def _some(atoms: frozenset[StepAtom]) -> str:
    return some(sorted(map(show, atoms)), 2)


def _costs(domain: Domain, cost: str) -> str:
    declared = sorted(s.name for s in domain.schemas if s.cost is not None)
    if not declared:
        return "none declared"
    if cost == "makespan+cost":
        return f"used as the second component ({', '.join(declared)})"
    return f"declared ({', '.join(declared)}) and ignored: --cost makespan+cost uses them"


def _counted(names: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(names).items()))
