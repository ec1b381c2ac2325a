# SPDX-License-Identifier: GPL-3.0-or-later
"""Domain and problems -> joint model and tasks: the steps of the front end in their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from planners.grounding import (
    FEWER,
    ground_actions,
    ground_goal,
    idling_costs,
    impossible_actions,
)
from planners.grounding.networks import apply_network
from planners.joint.assembly import SLACK_LEFT, assemble
from planners.joint.model import JointModel, PlanningTask, show
from planners.pddl import read_domain, read_problem
from planners.pddl.lifted import Atom, Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import (
    Team,
    find_team,
    static_atoms,
    without_idle_environment,
)
from planners.system.errors import BadInput, Position, UsageError
from planners.system.limits import reaching
from planners.system.messages import echoed


@dataclass(frozen=True, slots=True)
class PlanningInstance:
    """A joint model with the files and options it was made from and one task per problem."""

    domain: Domain
    problems: tuple[Problem, ...]
    model: JointModel
    tasks: tuple[PlanningTask, ...]
    options: ModelOptions
    team: Team


def load(
    domain: str | Path, problems: Sequence[str | Path], options: ModelOptions | None = None
) -> PlanningInstance:
    """Read PDDL files and build their joint model.

    Raises `BadInput`, `Unsupported` or `UsageError` with position and remedy.
    """
    lifted = read_domain(domain)
    return build(lifted, [read_problem(p, lifted) for p in problems], options)


def build(
    domain: Domain,
    problems: Sequence[Problem],
    options: ModelOptions | None = None,
    inits: Sequence[frozenset[Atom]] = (),
) -> PlanningInstance:
    """The joint model of problems over the same objects and statics.

    ``inits`` are the fluents of further initial states (of a task file): what can be true
    depends on where tasks start.
    """
    options = options or ModelOptions()
    for is_used, option, name, args in (
        (options.remember_actions, "--remember-actions", "last", "ROBOT ACTION"),
        (options.words_see_slack, "--words-see-slack", SLACK_LEFT, "N"),
    ):
        if is_used and name in domain.predicates:
            raise UsageError(
                f"{option} writes facts ({name} {args}), but this domain has a predicate {name!r}",
                remedy="Rename the predicate.",
            )
    first = problems[0]
    for other in problems[1:]:
        _check_same_world(domain, first, other)
    team = find_team(domain, first, options)
    starts = [*(problem.init for problem in problems), *inits]
    extra = {atom for start in starts for atom in start}
    with_costs = options.cost == "makespan+cost"
    actions = ground_actions(domain, first, team, also=extra, costs=with_costs)
    with reaching(
        lambda: f"comparing {len(actions):,} ground actions of {len(team.robots)} robots", FEWER
    ):
        actions = apply_network(domain, first, actions)
        team = without_idle_environment(team, (i for action in actions for i in action.owners))
        model = assemble(
            domain,
            problems[0],
            team,
            actions,
            starts,
            cost=options.cost,
            remember_actions=options.remember_actions,
            idling_costs=idling_costs(domain, first, team, costs=with_costs),
            slack=options.slack,
            words_see_slack=options.words_see_slack,
        )
        never = impossible_actions(domain, first, team, actions, extra)
        model = replace(model, impossible=never)
    tasks = tuple(task_of(model, domain, problem) for problem in problems)
    return PlanningInstance(domain, tuple(problems), model, tasks, options, team)


def task_of(model: JointModel, domain: Domain, problem: Problem) -> PlanningTask:
    """The planning task of a problem."""
    goal = ground_goal(domain, problem, problem.goal)
    return PlanningTask(
        problem.name, model.state(problem.init), goal, Position(problem.source.name)
    )


def _check_same_world(domain: Domain, first: Problem, other: Problem) -> None:
    remedy = (
        f"Compared with {first.source.name}: the problems of one model have the same objects "
        "and statics."
    )
    objects, init = other.source.section(":objects"), other.source.section(":init")
    if first.objects != other.objects:
        odd = sorted({*first.objects.items()} ^ {*other.objects.items()})[0][0]
        raise BadInput(
            f"object {echoed(odd)} is not the same in all problems", position=objects, remedy=remedy
        )
    changed = static_atoms(domain, first) ^ static_atoms(domain, other)
    if changed:
        odd = min(show(atom) for atom in changed)
        raise BadInput(
            f"static fact {odd} is not the same in all problems", position=init, remedy=remedy
        )
    if first.values != other.values:
        raise BadInput("function values differ between the problems", position=init, remedy=remedy)


__all__ = ["ModelOptions", "PlanningInstance", "build", "load", "task_of"]
