# SPDX-License-Identifier: GPL-3.0-or-later
"""Location predicates: which atoms of a domain say where things are, found from what actions do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from planners.grounding import GroundAction
from planners.joint.model import JointModel
from planners.pddl.lifted import Atom


@dataclass(frozen=True, slots=True)
class LocationPredicate:
    """A predicate read as "a thing is in a place".

    Attributes
    ----------
    predicate, arity
        Its name and number of arguments.
    place
        The argument that is the place.
    thing
        The argument that is the thing; None if it has none, as ``(stops floor)``.
    """

    predicate: str
    arity: int
    place: int
    thing: int | None

    def read(self, atom: Atom) -> tuple[str | None, str] | None:
        """Return an atom's thing and place, None for another predicate."""
        if atom.predicate != self.predicate or len(atom.args) != self.arity:
            return None
        thing = None if self.thing is None else atom.args[self.thing]
        return thing, atom.args[self.place]

    def read_all(self, atoms: Iterable[Atom]) -> list[tuple[str | None, str]]:
        """Return the things and places of all atoms of this predicate."""
        return [found for found in map(self.read, atoms) if found is not None]

    def changes(self, action: GroundAction) -> Iterator[tuple[str, str]]:
        """Yield the pairs of places between which an action moves a thing."""
        left: list[tuple[str | None, str]] = []
        entered: list[tuple[str | None, str]] = []
        for effect in action.effects:
            found = self.read(effect.atom)
            if found is not None:
                (entered if effect.adds else left).append(found)
        for (thing, source), (other, target) in product(left, entered):
            if thing == other and source != target:
                yield source, target

    def moves_in(self, action: GroundAction) -> bool:
        """Say whether an action moves a thing from a place to another."""
        return any(True for _ in self.changes(action))


@dataclass(frozen=True, slots=True)
class Locations:
    """The location predicates of a model, and the places."""

    predicates: tuple[LocationPredicate, ...]
    places: frozenset[str]

    def thing_and_place(self, atom: Atom, names: dict[LocationPredicate, str]) -> tuple[str, str]:
        """Return what the first predicate that reads an atom says; ``("", "")`` if none does.

        ``names`` are the things of predicates that have none of their own.
        """
        for predicate in self.predicates:
            found = predicate.read(atom)
            if found is not None and found[1] in self.places and found[0] not in self.places:
                thing, place = found
                return names[predicate] if thing is None else thing, place
        return "", ""


def find_locations(model: JointModel) -> Locations:
    """Find location predicates: places are what some action moves a thing from and to.

    An action moves a thing if it makes ``(at r1 a)`` false and ``(at r1 b)`` true.  Predicates
    whose places are all known and that actions make true and false (``(lies box a)``, which is
    picked up here and dropped there) are location predicates, too.
    """
    atoms = model.codec.facts.atoms
    candidates = _candidates(atoms)
    moving = [p for p in candidates if any(map(p.moves_in, model.actions))]
    kept, places = _consistent(moving, atoms, model.robots)
    further = [
        p
        for p in candidates
        if p not in kept and _is_in_places(p, atoms, places) and _comes_and_goes(p, model.actions)
    ]
    return Locations((*kept, *further), frozenset(places))


def _candidates(atoms: Iterable[Atom]) -> list[LocationPredicate]:
    """Every reading of every predicate with one or two arguments."""
    found = set()
    for atom in atoms:
        if len(atom.args) == 1:
            found.add(LocationPredicate(atom.predicate, 1, 0, None))
        elif len(atom.args) == 2:
            found.add(LocationPredicate(atom.predicate, 2, 1, 0))
            found.add(LocationPredicate(atom.predicate, 2, 0, 1))
    return sorted(found, key=lambda p: (p.thing is None, p.predicate, -p.place))


def _consistent(
    moving: Sequence[LocationPredicate], atoms: Sequence[Atom], robots: Sequence[str]
) -> tuple[list[LocationPredicate], set[str]]:
    """Keep the predicates whose places are neither robots nor things, and collect their places.

    Parcels are handed over between robots, and blocks stand on blocks: these are no places.  What
    moves without a name (``(stops floor)``) moves among the places of others, if there are any.
    """
    places: set[str] = set()
    kept = []
    for predicate in moving:
        read = predicate.read_all(atoms)
        own = {place for _, place in read}
        things = {thing for thing, _ in read if thing}
        contradicts = bool(own & {*things, *robots} or things & places)
        elsewhere = predicate.thing is None and bool(places) and not own <= places
        if not contradicts and not elsewhere:
            kept.append(predicate)
            places |= own
    return kept, places


def _is_in_places(predicate: LocationPredicate, atoms: Iterable[Atom], places: set[str]) -> bool:
    """Say whether all its places are known places, and its things are none."""
    return predicate.thing is not None and all(
        place in places and thing not in places for thing, place in predicate.read_all(atoms)
    )


def _comes_and_goes(predicate: LocationPredicate, actions: Iterable[GroundAction]) -> bool:
    """Say whether actions make it true and false."""
    signs = {
        effect.adds
        for action in actions
        for effect in action.effects
        if predicate.read(effect.atom) is not None
    }
    return signs == {True, False}
