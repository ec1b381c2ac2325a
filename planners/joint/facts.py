# SPDX-License-Identifier: GPL-3.0-or-later
"""The fluent atoms of a joint model, numbered: the table that turns atoms into text and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from planners.pddl.formula_tree import label
from planners.pddl.lifted import Atom


@dataclass(frozen=True, slots=True)
class FactTable:
    """The atoms that can be true in some state and false in another: the *facts* of a model.

    ``atoms`` are in the order of their ``texts`` (PDDL, lower case, sorted as strings), which is
    the order in which a state's key names them.  A fact's *number* is its position.
    """

    atoms: tuple[Atom, ...]
    texts: tuple[str, ...] = field(init=False, compare=False)
    index: dict[Atom, int] = field(init=False, compare=False, repr=False)
    _number: dict[str, int] = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Number the atoms by their texts."""
        by_text = {label(atom.predicate, atom.args): atom for atom in self.atoms}
        texts = tuple(sorted(by_text))
        object.__setattr__(self, "atoms", tuple(by_text[text] for text in texts))
        object.__setattr__(self, "texts", texts)
        object.__setattr__(self, "index", {by_text[text]: n for n, text in enumerate(texts)})
        object.__setattr__(self, "_number", {text: n for n, text in enumerate(texts)})

    @classmethod
    def of(cls, atoms: Iterable[Atom]) -> FactTable:
        """The table of some atoms, in any order."""
        return cls(tuple(atoms))

    def __len__(self) -> int:
        """Count the facts."""
        return len(self.atoms)

    def __iter__(self) -> Iterator[Atom]:
        """Go through the atoms by their numbers."""
        return iter(self.atoms)

    def __contains__(self, atom: Atom) -> bool:
        """Say whether an atom is a fact of the model."""
        return atom in self.index

    def number_of(self, text: str) -> int | None:
        """The number of the fact with this text, None if there is none."""
        return self._number.get(text)
