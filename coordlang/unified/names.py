# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL names for the names of a unified-planning problem, which may be anything."""

from __future__ import annotations

import re
from collections.abc import Hashable

#: What PDDL or its readers take for something of their own.
_RESERVED = ("and", "or", "not", "imply", "forall", "exists", "when", "either", "object")


class PddlNames:
    """Names of one kind (types, predicates, actions or objects): each thing gets one of its own.

    What is a PDDL name already, in lower case, is kept unless it is taken.
    """

    def __init__(self) -> None:
        self._names: dict[Hashable, str] = {}
        self._taken = {*_RESERVED, "increase", "total-cost"}

    def of(self, thing: Hashable, text: str) -> str:
        """The PDDL name of a thing; ``text`` is what it is called."""
        if thing not in self._names:
            base = re.sub(r"[^a-z0-9_-]", "_", text.lower()).strip("-") or "x"
            name, number = base, 1
            while name in self._taken:
                number += 1
                name = f"{base}__{number}"
            self.keep(thing, name)
        return self._names[thing]

    def keep(self, thing: Hashable, name: str) -> None:
        """Give a thing exactly this name."""
        self._names[thing] = name
        self._taken.add(name)
