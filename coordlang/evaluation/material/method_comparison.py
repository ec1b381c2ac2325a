# SPDX-License-Identifier: GPL-3.0-or-later
"""What the experiments that compare methods on one row of Table 1 share: units and records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from coordlang.evaluation.lab.recipe import Record, Result, Settings, Unit, done
from coordlang.evaluation.material.languages import COMPARED
from coordlang.evaluation.material.state_orders import RANDOM_ORDERS
from coordlang.evaluation.material.suite import OTHERS, QUICK_ROW, ROW, WORLDS


def comparison_units(
    experiment: str, settings: Settings, effort: float, flexible: float
) -> list[Unit]:
    """Return a unit for each method and world, and one for the greedy method in other orders.

    Parameters
    ----------
    effort, flexible
        Estimated seconds for a language, and for the most flexible one.
    """
    row = QUICK_ROW if settings.quick else ROW
    found = []
    for name in (row, *(world.name for world in OTHERS[: 1 if settings.quick else None])):
        for method in COMPARED[:3] if settings.quick else COMPARED:
            parameters = {"world": name, "method": method}
            cost = flexible if method == "flexible" else effort
            found.append(Unit(experiment, f"{name}/{method}", parameters, WORLDS[name].files, cost))
    orders = {"world": row, "orders": 10 if settings.quick else RANDOM_ORDERS}
    return [*found, Unit(experiment, f"{row}/orders", orders, WORLDS[row].files, 3.0)]


@dataclass(frozen=True, slots=True)
class Comparison:
    """The records of the units that ended without meeting a limit.

    Attributes
    ----------
    row
        The row of Table 1.
    languages
        One for each method, on the row.
    orders
        That of the greedy method in other orders, if it is there.
    others
        The languages of other worlds.
    """

    row: str
    languages: list[Record]
    orders: list[Record]
    others: list[Record]

    @classmethod
    def of(cls, records: Sequence[Record]) -> Comparison:
        """Sort the records of `comparison_units`, the last of which is one of the row."""
        row = records[-1].parameters["world"]
        ended = done(records)
        on_row = [record for record in ended if record.parameters["world"] == row]
        return cls(
            row,
            [record for record in on_row if "method" in record.parameters],
            [record for record in on_row if "orders" in record.parameters],
            [record for record in ended if record.parameters["world"] != row],
        )

    def greedy_and_minimal(self) -> tuple[Result, Result] | None:
        """Return the results to be put beside the paper's.

        None if it is not the paper's row, or one of them is missing.
        """
        of = {record.parameters["method"]: record.result for record in self.languages}
        if self.row != ROW or not {"greedy", "minimal"} <= of.keys():
            return None
        return of["greedy"], of["minimal"]
