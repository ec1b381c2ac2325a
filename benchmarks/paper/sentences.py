# SPDX-License-Identifier: GPL-3.0-or-later
"""The sentences of every candidate task, as `communication` and `flexibility` compare methods."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.paper.recipe import Record, Result, Settings, Unit
from benchmarks.paper.state_orders import RANDOM_ORDERS, greedy_partitions
from benchmarks.paper.suite import METHODS, OTHERS, QUICK_ROW, ROW, WORLDS, language_for
from coordlang.language.sentences import Flexibility

#: Tasks whose own numbers are kept in the results.
MOST_LISTED = 1000


def comparison_units(experiment: str, settings: Settings) -> list[Unit]:
    """Return a unit for each method and world, and one for the greedy method in other orders."""
    row = QUICK_ROW if settings.quick else ROW
    methods = METHODS if settings.quick else (*METHODS, "flexible")
    worlds = (row, *(world.name for world in OTHERS[: 1 if settings.quick else None]))
    found = [
        Unit(experiment, f"{name}/{method}", {"world": name, "method": method})
        for name in worlds
        for method in methods
    ]
    orders = {"world": row, "orders": 10 if settings.quick else RANDOM_ORDERS}
    return [*found, Unit(experiment, f"{row}/orders", orders)]


def compare(
    unit: Unit,
    settings: Settings,
    measures: Callable[[Flexibility], Result],
    of_order: Callable[[Flexibility], Sequence[float]],
) -> Result:
    """Measure one language; or, in the field ``orders``, the greedy method in many orders."""
    world, asked = WORLDS[unit.parameters["world"]], unit.parameters
    if "orders" not in asked:
        candidates, language = language_for(world, asked["method"], settings.seed)
        partition, spaces = language.partition(candidates.model), [*candidates.spaces]
        words = [partition.word_of(space.rows)[space.state] for space in spaces]
        return {"words": len(language.words), **measures(Flexibility(spaces, words))}
    candidates = world.candidates()
    spaces, found = [*candidates.spaces], {}
    for name, word in greedy_partitions(candidates, asked["orders"], unit.random(settings.seed)):
        found[name] = of_order(Flexibility(spaces, [word[space.state] for space in spaces]))
    return {"orders": found}


@dataclass(frozen=True, slots=True)
class Comparison:
    """The results of `comparison_units`.

    ``row``: the row of Table 1.  ``languages``: one for each method, on the row.  ``others``: the
    languages of other worlds.  ``orders``: what was measured of the greedy method in random and in
    systematic orders, by their names.
    """

    row: str
    languages: list[Record]
    others: list[Record]
    orders: dict[str, list[float]]

    @classmethod
    def of(cls, records: Sequence[Record]) -> Comparison:
        """Sort records, the first of which is one of the row."""
        row = records[0].parameters["world"]
        built = [record for record in records if "method" in record.parameters]
        orders = [record.result for record in records if "orders" in record.parameters]
        return cls(
            row,
            [record for record in built if record.parameters["world"] == row],
            [record for record in built if record.parameters["world"] != row],
            next(iter(orders[0].values())) if orders else {},
        )

    @property
    def of_paper(self) -> dict[str, Result]:
        """The results by method, if the row is the one that the paper reports of."""
        if self.row != ROW:
            return {}
        return {record.parameters["method"]: record.result for record in self.languages}
