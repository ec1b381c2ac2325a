# SPDX-License-Identifier: GPL-3.0-or-later
"""Domain and problems -> joint model and tasks: the steps of the front end in their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import get_args

from planners.errors import BadInput, Position, UsageError
from planners.grounding import (
    FEWER,
    ground_actions,
    ground_goal,
    idling_costs,
    impossible_actions,
)
from planners.grounding.networks import apply_network
from planners.joint.assembly import SLACK_LEFT, assemble
from planners.joint.model import Cost, JointModel, PlanningTask, show
from planners.limits import reaching
from planners.messages import echoed
from planners.pddl import read_domain, read_problem
from planners.pddl.lifted import Atom, Domain, Problem
from planners.pddl.robots import (
    RobotSelection,
    Team,
    Unowned,
    find_team,
    static_atoms,
    without_idle_environment,
)

#: The most slack that is taken: plans of so many joint steps fill any memory.
MOST_SLACK = 1_000_000


@dataclass(frozen=True, slots=True)
class ModelOptions:
    """How the files are to be understood; all of it is recorded in a language file.

    Attributes
    ----------
    robots
        Which objects are robots, and who owns actions that name none.
    cost
        What optimal means.
    remember_actions
        Whether a state also holds each robot's last subaction.
    slack
        Joint steps that plans may take more than the least makespan.
    sees_slack
        Whether states on plans say how many of these are left.

    Raises
    ------
    UsageError
        For a value that there is not.
    """

    robots: RobotSelection = field(default_factory=RobotSelection)
    cost: Cost = "makespan"
    remember_actions: bool = False
    slack: int = 0
    sees_slack: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.slack, bool) or not isinstance(self.slack, int) or self.slack < 0:
            raise UsageError(
                f"--slack {echoed(str(self.slack))}: expected a number of joint steps, 0 or more",
                remedy="Say --slack 1.",
            )
        if self.slack > MOST_SLACK:
            raise UsageError(
                f"--slack {echoed(str(self.slack))}: more than {MOST_SLACK:,} joint steps",
                remedy="Say --slack 1.",
            )
        if self.sees_slack and not self.slack:
            raise UsageError(
                "--words-see-slack belongs to --slack, and there is none",
                remedy="Add --slack 1, or leave out --words-see-slack.",
            )
        _require_one_of("cost", self.cost, get_args(Cost))
        _require_one_of("unowned", self.robots.unowned, get_args(Unowned))


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
    if options.remember_actions and "last" in domain.predicates:
        raise UsageError(
            "--remember-actions writes facts (last ROBOT ACTION), but this domain has a predicate "
            "'last'",
            remedy="Rename the predicate.",
        )
    if options.sees_slack and SLACK_LEFT in domain.predicates:
        raise UsageError(
            f"--words-see-slack writes facts ({SLACK_LEFT} N), but this domain has a predicate "
            f"{SLACK_LEFT!r}",
            remedy="Rename the predicate.",
        )
    first = problems[0]
    for other in problems[1:]:
        _check_same_world(domain, first, other)
    team = find_team(domain, first, options.robots)
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
            sees_slack=options.sees_slack,
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


def _require_one_of(option: str, value: str, values: Sequence[str]) -> None:
    if value not in values:
        raise UsageError(
            f"{echoed(value)} is no value of the option {option}",
            remedy=f"It is {' or '.join(values)}.",
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
