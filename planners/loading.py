# SPDX-License-Identifier: GPL-3.0-or-later
"""Domain and problems -> joint model and tasks: the steps of the front end in their order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike

from planners.grounding.actions import GroundAction, apply_network, impossible_actions
from planners.grounding.instantiate import FEWER, goal_grounder, ground_actions, idling_costs
from planners.joint.composition import ComposingStepper, JointActionStepper
from planners.joint.conditions import Evaluator
from planners.joint.model import IDLE, SLACK_LEFT, JointModel, PlanningTask, Stepper, show
from planners.joint.states import FactTable, StateCodec
from planners.pddl import read_domain, read_problem
from planners.pddl.lifted import Atom, Domain, Problem, StepAtom
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import Team, find_team, fluent_predicates, natural, static_atoms
from planners.system.errors import Position, UsageError
from planners.system.limits import reaching
from planners.system.messages import Presented, echoed


@dataclass(frozen=True, slots=True, repr=False)
class PlanningInstance(Presented):
    """A joint model with the files and options it was made from and one task per problem."""

    domain: Domain
    problems: tuple[Problem, ...]
    model: JointModel
    tasks: tuple[PlanningTask, ...]
    options: ModelOptions
    team: Team

    def summary(self) -> Mapping[str, object]:
        """Whose model it is."""
        problems = tuple(problem.name for problem in self.problems)
        return {"domain": self.domain.name, "problems": problems, "robots": self.team.robots}


def load(
    domain: str | PathLike[str],
    problems: Sequence[str | PathLike[str]],
    options: ModelOptions | None = None,
) -> PlanningInstance:
    """Read PDDL files; raises `BadInput`, `Unsupported` or `UsageError` with the position."""
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
    starts = frozenset().union(*(problem.init for problem in problems), *inits)
    with_costs = options.cost == "makespan+cost"
    actions = ground_actions(domain, first, team, starts, costs=with_costs)
    with reaching(
        lambda: f"comparing {len(actions):,} ground actions of {len(team.robots)} robots", FEWER
    ):
        actions = apply_network(domain, first, actions)
        team = team.without_idle_environment(i for action in actions for i in action.owners)
        model = _joint_model(domain, first, team, actions, starts, options)
    tasks = tuple(task_of(model, domain, problem) for problem in problems)
    return PlanningInstance(domain, tuple(problems), model, tasks, options, team)


def _joint_model(
    domain: Domain,
    problem: Problem,
    team: Team,
    actions: tuple[GroundAction, ...],
    starts: frozenset[Atom],
    options: ModelOptions,
) -> JointModel:
    """The joint model of a team's ground actions: its facts, labels and stepper.

    ``starts`` are the true atoms of all initial states: what can ever be true depends on them.
    """
    robots = team.robots
    subactions = [[a for a in actions if robot in a.owners] for robot in range(len(robots))]
    labels = _labels(subactions, is_joint_action=domain.is_joint_action)
    possible = starts | {e.atom for action in actions for e in action.effects if e.adds}
    # What says how many steps of the slack are left, where words see that.
    left = range(options.slack + 1) if options.words_see_slack else ()
    slack = [Atom(SLACK_LEFT, (str(steps),)) for steps in left]
    fluents = fluent_predicates(domain)
    facts = FactTable.of([*(atom for atom in possible if atom.predicate in fluents), *slack])
    codec = StateCodec(facts, robots, labels if options.remember_actions else None)
    evaluator = Evaluator(codec, _step_atoms(subactions))
    idling = idling_costs(domain, problem, team, costs=options.cost == "makespan+cost")
    stepper: Stepper
    if domain.is_joint_action:
        positions = {s.name: s.position for s in domain.schemas}
        stepper = JointActionStepper(evaluator, robots, labels, actions, options.cost, positions)
    else:
        stepper = ComposingStepper(evaluator, robots, subactions, options.cost, idling)
    return JointModel(
        robots=robots,
        labels=labels,
        actions=actions,
        codec=codec,
        stepper=stepper,
        evaluator=evaluator,
        cost=options.cost,
        idling_costs=idling,
        statics=static_atoms(domain, problem),
        is_joint_action=domain.is_joint_action,
        slack=options.slack,
        slack_facts=tuple(map(facts.index.__getitem__, slack)),
        is_asynchronous=options.asynchronous,
        impossible=impossible_actions(domain, problem, team, actions, possible),
    )


def _labels(
    subactions: Sequence[Sequence[GroundAction]], *, is_joint_action: bool
) -> tuple[tuple[str, ...], ...]:
    """What the robots' parts are called; those of joint-action PDDL in natural order."""
    named = [
        [*filter(None, dict.fromkeys(action.part_of(robot) for action in own))]
        for robot, own in enumerate(subactions)
    ]

    def by_names(text: str) -> list[object]:
        return [natural(name) for name in text.strip("()").split()]

    if is_joint_action:
        named = [sorted(own, key=by_names) for own in named]
    return tuple((IDLE, *own) for own in named)


def _step_atoms(subactions: Sequence[Sequence[GroundAction]]) -> dict[StepAtom, tuple[int, int]]:
    """The robot and label that a step atom speaks of: a shared subaction's first owner."""
    return {
        action.name: (robot, number + 1)
        for robot, own in reversed([*enumerate(subactions)])
        for number, action in enumerate(own)
    }


def task_of(model: JointModel, domain: Domain, problem: Problem) -> PlanningTask:
    """The planning task of a problem."""
    goal = goal_grounder(domain, problem)(problem.goal)
    position = Position(problem.source.name)
    return PlanningTask(problem.name, model.state(problem.init), goal, position)


def _check_same_world(domain: Domain, first: Problem, other: Problem) -> None:
    """Raise `BadInput` for problems that differ in more than the start and the goal."""
    objects = {*first.objects.items()} ^ {*other.objects.items()}
    values = {*first.values.items()} ^ {*other.values.items()}
    statics = static_atoms(domain, first) ^ static_atoms(domain, other)
    for section, odd in (
        (":objects", [f"object {echoed(name)}" for name, _ in objects]),
        (":init", [f"static fact {show(atom)}" for atom in statics]),
        (":init", [f"function value {show(atom)}" for atom, _ in values]),
    ):
        if odd:
            raise other.source.section(section).fail(
                f"{min(odd)} is not the same in all problems",
                f"Compared with {first.source.name}: the problems of one model have the "
                "same objects and statics.",
            )
