# SPDX-License-Identifier: GPL-3.0-or-later
"""Random models of all kinds: STRIPS with two and three robots, MA-PDDL, plain and joint actions."""

from __future__ import annotations

from dataclasses import replace
from random import Random
from typing import get_args

from planners.loading import PlanningInstance, build
from planners.pddl.model_options import Cost, ModelOptions
from planners.search.reachable import Space, explore
from planners.system.errors import BadInput
from tests.support.random_models import random_model
from tests.support.random_pddl import random_model as random_pddl
from tests.support.texts import parsed


def random_instance(seed: int, cost: Cost | None = None) -> PlanningInstance | None:
    """The model of a seed, under ``cost`` or a random one; None where it is refused."""
    random = Random(seed)
    try:
        if seed % 2:
            domain, problem, options = random_model(seed, random.choice((2, 3)))
        else:
            text = random_pddl(seed, random.choice(["agent", "plain", "joint"]))
            domain, problem = parsed(text.domain, text.problem)
            options = ModelOptions(unowned=text.unowned, remember_actions=random.random() < 0.3)
        chosen = random.choice(get_args(Cost)) if cost is None else cost
        return build(domain, [problem], replace(options, cost=chosen))
    except BadInput:
        return None


def explored(loaded: PlanningInstance) -> Space | None:
    """All reachable states; None where joint actions cannot be told apart."""
    try:
        return explore(loaded.model, loaded.tasks[0].init[None, :])
    except BadInput:  # joint actions that no robot can tell apart
        return None
