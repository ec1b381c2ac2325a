"""What the experiments that compare languages on one row of Table 1 share.

Their units, and their records by kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from coordlang.evaluation.lab.recipe import Record, Result, Settings, Unit, done
from coordlang.evaluation.material.languages import COMPARED
from coordlang.evaluation.material.state_orders import ORDERS
from coordlang.evaluation.material.suite import OTHERS, QUICK_ROW, ROW, WORLDS


def compared_units(
    experiment: str, settings: Settings, effort: float, flexible: float
) -> list[Unit]:
    """A unit for each language of the row and of the other worlds, and one for the orders.

    The other worlds are those that are no grids; the orders are those of the row.

    ``effort`` of a language, ``flexible`` of the most flexible one.
    """
    row = QUICK_ROW if settings.quick else ROW
    found = []
    for name in (row, *(world.name for world in OTHERS[: 1 if settings.quick else None])):
        for method in COMPARED[:3] if settings.quick else COMPARED:
            parameters = {"world": name, "method": method}
            cost = flexible if method == "flexible" else effort
            found.append(Unit(experiment, f"{name}/{method}", parameters, WORLDS[name].files, cost))
    orders = {"world": row, "orders": 10 if settings.quick else ORDERS}
    return [*found, Unit(experiment, f"{row}/orders", orders, WORLDS[row].files, 3.0)]


@dataclass(frozen=True, slots=True)
class Compared:
    """The records that came to their end.

    Of the languages of ``row``, of its orders, of other worlds.
    """

    row: str
    languages: list[Record]
    orders: list[Record]
    others: list[Record]

    @classmethod
    def of(cls, records: Sequence[Record]) -> Compared:
        """By kind; the last record is one of the row."""
        row = records[-1].unit.parameters["world"]
        ended = done(records)
        return cls(
            row,
            [
                r
                for r in ended
                if r.unit.parameters["world"] == row and "method" in r.unit.parameters
            ],
            [r for r in ended if "orders" in r.unit.parameters],
            [r for r in ended if r.unit.parameters["world"] != row],
        )

    def greedy_and_minimal(self) -> tuple[Result, Result] | None:
        """Results to be put beside the paper's.

        None if it is not the paper's row, or one of them is missing.
        """
        of = {record.unit.parameters["method"]: record.result for record in self.languages}
        return (
            (of["greedy"], of["minimal"])
            if self.row == ROW and {"greedy", "minimal"} <= of.keys()
            else None
        )
