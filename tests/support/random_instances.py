# SPDX-License-Identifier: GPL-3.0-or-later
"""Random models of all kinds: STRIPS with two and three robots, MA-PDDL, plain and joint actions."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from planners.loading import PlanningInstance, build
from planners.pddl import parse_domain, parse_problem
from planners.pddl.model_options import Cost, ModelOptions
from planners.pddl.sexpr import Source
from planners.search.reachable import Space, explore
from planners.system.errors import BadInput
from tests.support.random_models import random_model
from tests.support.random_pddl import random_model as random_pddl


def random_instance(seed: int, cost: Cost | None = None) -> PlanningInstance | None:
    """The model of a seed, with ``cost`` in place of a random one; None where it is refused."""
    random = Random(seed)
    try:
        if seed % 2:
            domain, problem, options = random_model(seed, random.choice((2, 3)))
        else:
            text = random_pddl(seed, random.choice(["agent", "plain", "joint"]))
            domain = parse_domain(Source("domain", text.domain))
            problem = parse_problem(Source("problem", text.problem), domain)
            options = ModelOptions(unowned=text.unowned, remember_actions=random.random() < 0.3)
        return build(domain, [problem], replace(options, cost=cost or options.cost))
    except BadInput:
        return None


def explored(loaded: PlanningInstance) -> Space | None:
    """All reachable states; None where joint actions cannot be told apart."""
    try:
        return explore(loaded.model, loaded.tasks[0].init[None, :])
    except BadInput:  # joint actions that no robot can tell apart
        return None
