# SPDX-License-Identifier: GPL-3.0-or-later
"""How results show themselves: one line at the prompt, a table in a notebook."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

from planners.system.notebook import html_table


class Presented(ABC):
    """A result that shows itself: `facts` are what its ``repr`` and its table in a notebook say."""

    __slots__ = ()

    @abstractmethod
    def facts(self) -> Mapping[str, object]:
        """Return name -> value, in the order in which they are shown."""

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value!r}" for name, value in self.facts().items())
        return f"{type(self).__name__}({shown})"

    def _repr_html_(self) -> str:
        return html_table((), [(name, _plain(value)) for name, value in self.facts().items()])


def _plain(value: object) -> str:
    if isinstance(value, tuple | list):
        return ", ".join(map(str, value))
    return str(value)
