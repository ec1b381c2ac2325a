# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground actions of a team -> the joint model: its facts, labels and stepper."""

from __future__ import annotations

from collections.abc import Sequence

from planners.grounding import GroundAction
from planners.joint.composition import ComposingStepper
from planners.joint.conditions import Evaluator
from planners.joint.joint_actions import JointActionStepper
from planners.joint.model import IDLE, JointModel, Stepper
from planners.joint.states import FactTable, StateCodec
from planners.pddl.lifted import Atom, Domain, Problem, StepAtom
from planners.pddl.model_options import Cost
from planners.pddl.robots import Team, fluent_predicates, natural, static_atoms

#: The predicate of the facts that say how many joint steps of the slack are left.
SLACK_LEFT = "slack-left"

#: The texts of a robot's labels, idling first.
Labels = tuple[str, ...]


def assemble(
    domain: Domain,
    problem: Problem,
    team: Team,
    actions: tuple[GroundAction, ...],
    starts: Sequence[frozenset[Atom]],
    *,
    cost: Cost,
    remember_actions: bool,
    idling_costs: Sequence[int],
    slack: int = 0,
    words_see_slack: bool = False,
) -> JointModel:
    """The joint model of a team's ground actions.

    Parameters
    ----------
    problem
        Where the static atoms are from.
    starts
        The true atoms of all initial states: what can ever be true depends on them.
    idling_costs
        For each robot what idling adds to the second cost.
    slack
        Joint steps that plans may take more than the least makespan.
    words_see_slack
        Whether states on plans say how many of these are left.
    """
    robots = team.robots
    subactions = [[a for a in actions if robot in a.owners] for robot in range(len(robots))]
    labels = _labels_of_parts(actions, robots) if domain.is_joint_action else _labels(subactions)
    left = [Atom(SLACK_LEFT, (str(k),)) for k in range(slack + 1)] if words_see_slack else []
    facts = FactTable.of({*_facts(domain, actions, starts), *left})
    codec = StateCodec(facts, robots, labels if remember_actions else None)
    evaluator = Evaluator(codec.facts, {} if domain.is_joint_action else _step_atoms(subactions))
    stepper: Stepper
    if domain.is_joint_action:
        positions = {s.name: domain.source.position(s.offset) for s in domain.schemas}
        stepper = JointActionStepper(codec, evaluator, robots, labels, actions, cost, positions)
    else:
        stepper = ComposingStepper(codec, evaluator, robots, subactions, cost, idling_costs)
    return JointModel(
        name=domain.name,
        robots=robots,
        labels=labels,
        actions=actions,
        codec=codec,
        stepper=stepper,
        evaluator=evaluator,
        cost=cost,
        idling_costs=tuple(idling_costs),
        statics=static_atoms(domain, problem),
        is_joint_action=domain.is_joint_action,
        slack=slack,
        slack_facts=tuple(facts.index[atom] for atom in left),
    )


def _facts(
    domain: Domain, actions: Sequence[GroundAction], starts: Sequence[frozenset[Atom]]
) -> set[Atom]:
    """The fluent atoms that some initial state has or some action adds."""
    fluents = fluent_predicates(domain)
    possible = {atom for start in starts for atom in start if atom.predicate in fluents}
    return possible | {e.atom for a in actions for e in a.effects if e.adds}


def _labels(subactions: Sequence[Sequence[GroundAction]]) -> tuple[Labels, ...]:
    return tuple((IDLE, *(action.label for action in own)) for own in subactions)


def _labels_of_parts(actions: Sequence[GroundAction], robots: Sequence[str]) -> tuple[Labels, ...]:
    """The labels of joint-action PDDL: what the robots' parts are called, in natural order."""
    parts = [{action.parts[robot] for action in actions} for robot in range(len(robots))]
    return tuple((IDLE, *sorted((p for p in own if p), key=_natural_label)) for own in parts)


def _natural_label(text: str) -> tuple[object, ...]:
    return tuple(natural(name) for name in text.strip("()").split())


def _step_atoms(subactions: Sequence[Sequence[GroundAction]]) -> dict[StepAtom, tuple[int, int]]:
    """The robot and label that a step atom speaks of: a shared subaction's first owner."""
    return {
        StepAtom(action.schema, action.args): (robot, number + 1)
        for robot, own in reversed([*enumerate(subactions)])
        for number, action in enumerate(own)
    }
