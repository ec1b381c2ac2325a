# SPDX-License-Identifier: GPL-3.0-or-later
"""Two robots modelled in unified-planning: their plans, a language, planning under a sentence.

Run it as a script, or cell by cell (``# %%``) in an editor or as a notebook.
"""

# %% Two robots, three cells in a row and a passing place beside the middle.
from unified_planning.plans import PlanKind
from unified_planning.shortcuts import (
    AnytimePlanner,
    BoolType,
    Fluent,
    InstantaneousAction,
    MinimizeMakespan,
    OneshotPlanner,
    PlanValidator,
    Problem,
    UserType,
    get_environment,
)

import coordlang
from coordlang.unified import register
from coordlang.unified.translation import translate

register()
get_environment().credits_stream = None

cell, robot = UserType("cell"), UserType("robot")
at = Fluent("at", BoolType(), r=robot, c=cell)
near = Fluent("near", BoolType(), a=cell, b=cell)
free = Fluent("free", BoolType(), c=cell)

move = InstantaneousAction("move", r=robot, a=cell, b=cell)
for condition in (at(move.r, move.a), near(move.a, move.b), free(move.b)):
    move.add_precondition(condition)
for fluent, value in (
    (at(move.r, move.a), False),
    (at(move.r, move.b), True),
    (free(move.b), False),
    (free(move.a), True),
):
    move.add_effect(fluent, value)

problem = Problem("crossing")
for fluent in (at, near, free):
    problem.add_fluent(fluent, default_initial_value=False)
problem.add_action(move)
left, middle, right, aside = (
    problem.add_object(name, cell) for name in ("left", "middle", "right", "aside")
)
r1, r2 = (problem.add_object(name, robot) for name in ("r1", "r2"))
for place in (left, right, aside):
    problem.set_initial_value(near(place, middle), True)
    problem.set_initial_value(near(middle, place), True)
for place in (middle, aside):
    problem.set_initial_value(free(place), True)
problem.set_initial_value(at(r1, left), True)
problem.set_initial_value(at(r2, right), True)
problem.add_goal(at(r1, right))
problem.add_goal(at(r2, left))
problem.add_quality_metric(MinimizeMakespan())

# %% Every optimal plan, one after another.
with AnytimePlanner(name="coordlang") as planner:
    for result in planner.get_solutions(problem):
        steps = [
            str(action)
            for action in result.plan.convert_to(PlanKind.SEQUENTIAL_PLAN, problem).actions
        ]
        print(result.status.name, steps)

# %% A language, so that both robots know which plans the other one may follow.
found = translate(problem)
files = found.domain, found.problem
language = coordlang.build(*files, method="minimal").language
print(language.words, language.sizes())

# %% The sentences of the task, and the plan under each.
for sentence in coordlang.explain(language, *files).sentences:
    text = " ".join(sentence.words)
    params = {"language": language, "sentence": text}
    with OneshotPlanner(name="coordlang", params=params) as planner:
        result = planner.solve(problem)
    with PlanValidator(name="coordlang", params=params) as validator:
        verdict = validator.validate(problem, result.plan)
    plans = result.metrics["plans"]
    print(repr(text), "leaves", plans, "open;", result.status.name, verdict.status.name)
