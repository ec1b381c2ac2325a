# SPDX-License-Identifier: GPL-3.0-or-later
"""unified-planning's own examples: refused, or as Fast Downward and its own validator say."""

from __future__ import annotations

from collections import Counter
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
import unified_planning.shortcuts as up
from unified_planning.engines import CompilationKind
from unified_planning.engines import PlanGenerationResultStatus as Status
from unified_planning.engines import ValidationResultStatus as Validity
from unified_planning.exceptions import UPUnsupportedProblemTypeError
from unified_planning.model.multi_agent import MultiAgentProblem
from unified_planning.model.problem_kind import FEATURES as GROUPS
from unified_planning.plans import ActionInstance, PlanKind, SequentialPlan
from unified_planning.test.examples import get_example_problems, multi_agent, tamp

from coordlang.unified import register
from coordlang.unified.engine import CoordlangEngine
from coordlang.unified.translation import FEATURES, translate
from tests.support import thorough

EXAMPLES: dict[str, Any] = {
    **get_example_problems(),
    **multi_agent.get_example_problems(),
    **tamp.get_example_problems(),
}


@pytest.fixture(autouse=True)
def _registered() -> None:
    register()
    up.get_environment().credits_stream = None


def answer(problem: Any) -> str:
    """What the engine should say of a problem: by its class, by a feature, or a plan."""
    others = problem.kind.features - FEATURES - {"MAKESPAN"}
    return "class" if others & {*GROUPS["PROBLEM_CLASS"]} else "feature" if others else "solved"


def without_metrics(problem: Any) -> Any:
    problem = problem.clone()
    if not isinstance(problem, MultiAgentProblem):
        problem.clear_quality_metrics()
    return problem


SUPPORTED = [n for n, e in EXAMPLES.items() if answer(without_metrics(e.problem)) == "solved"]
REFUSED = [n for n, e in EXAMPLES.items() if answer(e.problem) != "solved"]


def test_there_are_examples_of_every_kind() -> None:
    answers = Counter(answer(example.problem) for example in EXAMPLES.values())
    assert answers.keys() == {"class", "feature", "solved"}
    assert min(answers.values()) >= 7, answers
    features = frozenset().union(*(e.problem.kind.features for e in EXAMPLES.values()))
    for feature in ("TIMED_GOALS", "TIMED_EFFECTS", "PROCESSES", "EVENTS", "STATE_INVARIANTS"):
        assert feature in features
    assert {"HIERARCHICAL", "SCHEDULING", "TAMP"} <= features


@pytest.mark.filterwarnings("ignore:We cannot establish", "ignore:coordlang cannot validate")
@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_supported_is_refused_by_name(name: str) -> None:
    """With and without checks; a metric alone is ignored without checks, and nothing promised."""
    example, problem = EXAMPLES[name], EXAMPLES[name].problem
    for skip in (False, True):
        for mode in (up.OneshotPlanner, up.AnytimePlanner):
            with mode(name="coordlang", params=serial(without_metrics(problem))) as planner:
                planner.skip_checks = skip
                if mode is up.OneshotPlanner:
                    result = planner.solve(problem)
                else:
                    (result, *_) = planner.get_solutions(problem)
                promised = (Status.SOLVED_OPTIMALLY, Status.UNSOLVABLE_PROVEN)
                assert result.status not in promised
                if not skip or name not in SUPPORTED:
                    assert (result.status, result.plan) == (Status.UNSUPPORTED_PROBLEM, None)
                    assert "not supported" in str(result.log_messages) or name in SUPPORTED
                else:
                    assert "is ignored" in str(result.log_messages)
    with up.PlanValidator(name="coordlang", params=serial(without_metrics(problem))) as validator:
        if name in SUPPORTED:  # which plans are good is another question
            for plan in example.valid_plans:
                assert validator.validate(problem, plan).status == Validity.VALID
            return
        for plan in (*example.valid_plans, *example.invalid_plans, SequentialPlan([])):
            with pytest.raises(UPUnsupportedProblemTypeError, match="not supported"):
                validator.validate(problem, plan)


def serial(problem: Any) -> dict[str, Any]:
    """Parameters with which one action is done in each step, so that a makespan is a length."""
    if type(problem) is up.Problem:
        parts = {a.name: [a.name, *(f"?{p.name}" for p in a.parameters)] for a in problem.actions}
        return {"subactions": {name: {"robot": f"({' '.join(p)})"} for name, p in parts.items()}}
    if type(problem) is not MultiAgentProblem:
        return {}
    nobody = []
    for schema in translate(problem).domain.schemas:
        variables = [
            f"?o{n} - (either {' '.join(p.types)})" for n, p in enumerate(schema.parameters)
        ]
        atom = " ".join([schema.name, *(f"?o{n}" for n, _ in enumerate(variables))])
        nobody.append(f"(forall ({' '.join(variables)}) (not ({atom})))")
    names = {action.name for agent in problem.agents for action in agent.actions}
    return {"concurrency": {name: f"(and {' '.join(nobody)})" for name in names}}


class Central:
    """A problem for one agent in place of several, written with unified-planning alone."""

    def __init__(self, problem: Any) -> None:
        self.old, self.problem = problem, up.Problem(problem.name)
        self.fluents = {(None, f): f for f in problem.ma_environment.fluents}
        for agent in problem.agents:
            for f in agent.fluents:
                own = {p.name: p.type for p in f.signature}
                self.fluents[agent, f] = up.Fluent(f"{agent.name} {f.name}", f.type, **own)
        self.problem.add_fluents(self.fluents.values())
        self.problem.add_objects(problem.all_objects)
        for node, value in problem.initial_values.items():
            self.problem.set_initial_value(self.of(node), value)
        self.actions = {}
        for agent in problem.agents:
            for action in agent.actions:
                own = {p.name: p.type for p in action.parameters}
                new = up.InstantaneousAction(f"{agent.name} {action.name}", **own)
                for condition in action.preconditions:
                    new.add_precondition(self.of(condition, agent, new))
                for e in action.effects:
                    parts = (self.of(x, agent, new) for x in (e.fluent, e.value, e.condition))
                    new.add_effect(*parts)
                self.actions[agent.name, action.name] = new
                self.problem.add_action(new)
            for goal in (*agent.public_goals, *agent.private_goals):
                self.problem.add_goal(self.of(goal, agent))
        for goal in problem.goals:
            self.problem.add_goal(self.of(goal))

    def of(self, node: Any, agent: Any = None, action: Any = None) -> Any:
        if node.is_dot():
            return self.of(node.arg(0), self.old.agent(node.agent()), action)
        if node.is_parameter_exp():
            return action.parameter(node.parameter().name)
        args = [self.of(arg, agent, action) for arg in node.args]
        if node.is_fluent_exp():
            own = self.fluents.get((agent, node.fluent()))
            return (own or self.fluents[None, node.fluent()])(*args)
        if node.is_and():
            return up.And(*args)
        return up.Not(*args) if node.is_not() else node

    def plan(self, plan: Any) -> SequentialPlan:
        instances = (
            ActionInstance(self.actions[a.agent.name, a.action.name], a.actual_parameters)
            for a in plan.actions
        )
        return SequentialPlan(list(instances))


#: What Fast Downward's optimal configuration does not read, and unified-planning's own compilers.
#: They keep the length of plans.
REMOVED = {
    "OBJECT_FLUENTS": CompilationKind.USERTYPE_FLUENTS_REMOVING,
    "UNIVERSAL_CONDITIONS": CompilationKind.QUANTIFIERS_REMOVING,
    "CONDITIONAL_EFFECTS": CompilationKind.CONDITIONAL_EFFECTS_REMOVING,
    "DISJUNCTIVE_CONDITIONS": CompilationKind.DISJUNCTIVE_CONDITIONS_REMOVING,
}


def shortest(problem: Any) -> int:
    """The length of a shortest plan, by Fast Downward."""
    back: list[Any] = []
    for feature, kind in REMOVED.items():
        if feature in problem.kind.features:
            with up.Compiler(problem_kind=problem.kind, compilation_kind=kind) as compiler:
                compiled = compiler.compile(problem, kind)
            problem, back = compiled.problem, [compiled.map_back_action_instance, *back]
    problem = problem.clone()
    problem.add_quality_metric(up.MinimizeSequentialPlanLength())
    with up.OneshotPlanner(name="fast-downward-opt") as planner:
        result = planner.solve(problem)
    assert result.status == Status.SOLVED_OPTIMALLY
    plan = result.plan
    for function in back:
        plan = plan.replace_action_instances(function)
    return len(plan.actions)


#: One of them takes as long as all others together; of those for one agent every second is enough.
NIGHTLY = ["ma_buttons", *[n for n in SUPPORTED if not n.startswith("ma")][1::2]]


@pytest.mark.parametrize("name", [*sorted({*SUPPORTED} - {*NIGHTLY}), *thorough(*NIGHTLY)])
def test_what_is_solved_is_what_others_say(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # Fast Downward's output.sas is in the working directory
    example = EXAMPLES[name]
    problem = without_metrics(example.problem)
    central = Central(problem) if isinstance(problem, MultiAgentProblem) else None
    other = central.problem if central else problem
    params = serial(problem)
    with up.OneshotPlanner(name="coordlang", params=params) as planner:
        result = planner.solve(problem)
    assert result.status == Status.SOLVED_OPTIMALLY
    plan = result.plan.convert_to(PlanKind.SEQUENTIAL_PLAN, problem)
    theirs = up.PlanValidator(name="sequential_plan_validator")
    ours = up.PlanValidator(name="coordlang", params=params)
    for found in (plan, *example.valid_plans, *example.invalid_plans):
        verdict = theirs.validate(other, central.plan(found) if central else found)
        assert ours.validate(problem, found).status == verdict.status
        assert found is not plan or verdict.status == Validity.VALID
    assert int(result.metrics["makespan"]) == len(plan.actions) == shortest(other)


@pytest.mark.parametrize("name", ["ma-loader", *thorough("ma_buttons")])
def test_agents_that_act_together(name: str) -> None:
    """Every order of the actions of a step is a plan, by unified-planning's own validator."""
    problem = EXAMPLES[name].problem
    central = Central(problem)
    with up.AnytimePlanner(name="coordlang") as planner:
        results = list(islice(planner.get_solutions(problem), 3))
    with up.PlanValidator(name="sequential_plan_validator") as validator:
        for result in results:
            for order in islice(result.plan.all_sequential_plans(), 3):
                verdict = validator.validate(central.problem, central.plan(order))
                assert verdict.status == Validity.VALID


def test_the_list_of_features_is_unified_plannings() -> None:
    assert {feature for group in GROUPS.values() for feature in group} >= FEATURES
    assert CoordlangEngine.supported_kind().features == FEATURES | {"MAKESPAN"}
