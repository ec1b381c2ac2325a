# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground formulas, each kept once: equal formulas are one object, compared by identity."""

from __future__ import annotations

from collections.abc import Iterable

from planners.pddl.formula_tree import GroundLeaf
from planners.pddl.lifted import FALSE, TRUE, And, Atom, Formula, Not, Or, Term, Truth


class Interned:
    """A table of ground formulas in negation normal form.

    Formulas made by one table are equal if and only if they are the same object, so that thousands
    of actions share what their preconditions have in common, and no formula is ever hashed.
    """

    def __init__(self) -> None:
        self._leaves: dict[tuple[type[GroundLeaf], str, tuple[Term, ...]], GroundLeaf] = {}
        # By identity of the parts; the formulas, and with them the parts, stay alive here.
        self._negations: dict[int, Not] = {}
        self._compounds: dict[tuple[type[And] | type[Or], tuple[int, ...]], And | Or] = {}

    def atom(self, predicate: str, args: tuple[Term, ...]) -> Atom:
        """The atom over states."""
        found = self._leaf(Atom, predicate, args)
        assert isinstance(found, Atom)
        return found

    def literal(
        self, kind: type[GroundLeaf], name: str, args: tuple[Term, ...], positive: bool
    ) -> Formula:
        """The literal about an atom or a subaction of the step."""
        leaf = self._leaf(kind, name, args)
        if positive:
            return leaf
        found = self._negations.get(id(leaf))
        if found is None:
            found = self._negations[id(leaf)] = Not(leaf)
        return found

    def joined(self, kind: type[And] | type[Or], parts: Iterable[Formula]) -> Formula:
        """A flat conjunction or disjunction of formulas of this table.

        As by `planners.pddl.formula_tree.joined`, and a part that stands in it before is left out.
        """
        neutral = kind is And
        kept: dict[int, Formula] = {}
        for part in parts:
            if isinstance(part, Truth):
                if part.value != neutral:
                    return FALSE if neutral else TRUE
            elif isinstance(part, And | Or) and isinstance(part, kind):
                for inner in part.parts:
                    kept.setdefault(id(inner), inner)
            else:
                kept.setdefault(id(part), part)
        if not kept:
            return TRUE if neutral else FALSE
        if len(kept) == 1:
            return next(iter(kept.values()))
        key = kind, tuple(kept)
        found = self._compounds.get(key)
        if found is None:
            found = self._compounds[key] = kind(tuple(kept.values()))
        return found

    def _leaf(self, kind: type[GroundLeaf], name: str, args: tuple[Term, ...]) -> GroundLeaf:
        key = kind, name, args
        found = self._leaves.get(key)
        if found is None:
            found = self._leaves[key] = kind(name, args)
        return found
