# SPDX-License-Identifier: GPL-3.0-or-later
"""All experiments, by the name that ``coordlang evaluate`` takes."""

from __future__ import annotations

from collections.abc import Mapping

from coordlang.evaluation.experiments import (
    communication,
    delays,
    flexibility,
    game,
    navigation,
    planning_cost,
    scenario,
    silence,
    simulation,
    table1,
)
from coordlang.evaluation.lab.recipe import Recipe

RECIPES: Mapping[str, Recipe] = {
    recipe.name: recipe
    for recipe in (
        table1.RECIPE,
        communication.RECIPE,
        flexibility.RECIPE,
        planning_cost.RECIPE,
        navigation.RECIPE,
        game.RECIPE,
        delays.RECIPE,
        scenario.RECIPE,
        silence.RECIPE,
        simulation.RECIPE,
    )
}
