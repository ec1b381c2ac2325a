# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a domain can be drawn: places, the things in them, and what each atom says about them.

It is found from the actions and the static atoms of the model alone, see `_locations`.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import permutations, product

from planners.grounding.actions import GroundAction
from planners.joint.model import JointModel, show
from planners.pddl.lifted import TRUE, Atom, Effect
from planners.pddl.robots import natural

#: What an atom says: ("at", thing, place), ("with", thing, thing), ("mark", place, text), or
#: ("other",).
Role = tuple[str, ...]

_OTHER: Role = ("other",)


@dataclass(frozen=True, slots=True)
class Link:
    """Two places that belong together; ``moves``: something moves from one to the other."""

    ends: tuple[str, str]
    moves: bool


@dataclass(frozen=True, slots=True)
class World:
    """The things (robots first), the places, and the role of every atom by its text.

    Links are what moves join, and what static atoms with two places relate.
    """

    things: tuple[str, ...]
    places: tuple[str, ...]
    links: tuple[Link, ...]
    roles: Mapping[str, Role]

    def role(self, text: str) -> Role:
        """Return the role of an atom; ``("other",)`` for what is no fact of the model."""
        return self.roles.get(text, _OTHER)

    def located(self, texts: Iterable[str], among: Iterable[str] | None = None) -> dict[str, str]:
        """Return the places of the things (or those ``among`` some) that atoms locate, in order."""
        found = {role[1]: role[2] for role in map(self.role, texts) if role[0] == "at"}
        things = self.things if among is None else among
        return {thing: found[thing] for thing in things if thing in found}

    def moves(self, model: JointModel, robot: int, label: int) -> tuple[tuple[str, str], ...]:
        """Return where a robot's subaction always brings things: pairs (thing, place)."""
        text = model.subaction_text(robot, label)
        own = [action for action in model.actions if text and action.part_of(robot) == text]
        brought = [self._brought(action, model.robots[robot]) for action in own]
        return tuple(sorted(set.intersection(*brought))) if brought else ()

    def _brought(self, action: GroundAction, robot: str) -> set[tuple[str, str]]:
        """Where a robot's action always brings things; of a joint action only the robot itself."""
        added = (show(e.atom) for e in action.effects if e.adds and e.condition == TRUE)
        at = (role[1:] for role in map(self.role, added) if role[0] == "at")
        return {(thing, place) for thing, place in at if thing == robot or not action.parts}


def find_world(model: JointModel, states: Sequence[Sequence[str]]) -> World:
    """Find what of a model can be drawn.

    ``states`` are known ones, as the texts of their true atoms: what puts a thing into two places
    in one of them does not say where it is.
    """
    locations, known = _locations(model)
    roles = _without_ambiguous(_location_roles(model, locations, known), states)
    things = {role[1] for role in roles.values()} | {*model.robots}
    places = frozenset(role[2] for role in roles.values())
    for atom in model.codec.facts.atoms:
        roles.setdefault(show(atom), _other_role(atom, places, things))
    carried = {thing for role in roles.values() if role[0] == "with" for thing in role[1:]}
    others = sorted((things | carried) - {*model.robots}, key=natural)
    return World(
        things=(*model.robots, *others),
        places=tuple(sorted(places, key=natural)),
        links=_links(model, locations, places),
        roles=roles,
    )


def _location_roles(
    model: JointModel, locations: Sequence[_Reading], places: Set[str]
) -> dict[str, tuple[Atom, Role]]:
    """The atoms that say where a thing is, by their texts, with their roles.

    The first location predicate that has an atom says it.
    """
    roles: dict[str, tuple[Atom, Role]] = {}
    for reading in locations:
        for atom, thing, place in reading.atoms:
            if place in places and thing not in places:
                role = "at", thing or _owner(reading, model), place
                roles.setdefault(show(atom), (atom, role))
    return roles


def _owner(reading: _Reading, model: JointModel) -> str:
    """Name what moves without a name: the only robot that moves it, else a thing of its own."""
    if len(reading.owners) == 1 and not model.is_joint_action:
        (team,) = reading.owners
        if len(team) == 1:
            return model.robots[team[0]]
    return reading.predicate.removesuffix("-at").removeprefix("at-")


def _without_ambiguous(
    roles: dict[str, tuple[Atom, Role]], states: Sequence[Sequence[str]]
) -> dict[str, Role]:
    """The roles without atoms of a thing and predicate that put the thing into two places at once.

    Of two predicates the one that locates more things is kept: ``(at plane1 city0)``, as said of
    passengers, tells where a plane is, and ``(fuel-level plane1 fl3)`` does not.
    """
    pairs = {(atom.predicate, role[1]) for atom, role in roles.values()}
    located = Counter(predicate for predicate, _ in pairs)
    ambiguous: set[tuple[str, str]] = set()
    for state in states:
        said = defaultdict[str, list[str]](list)
        for atom, role in map(roles.__getitem__, roles.keys() & state):
            said[role[1]].append(atom.predicate)
        for thing, predicates in said.items():
            first, *further = sorted(predicates, key=located.__getitem__, reverse=True)
            if further and located[first] == located[further[0]]:
                further.append(first)
            ambiguous.update(product([thing], further))
    return {
        text: role
        for text, (atom, role) in roles.items()
        if (role[1], atom.predicate) not in ambiguous
    }


def _other_role(atom: Atom, places: frozenset[str], things: set[str]) -> Role:
    """The role of an atom that does not say where a thing is."""
    match atom.args:
        case (one,) if one in places:
            return "mark", one, atom.predicate
        case (one, two) if not places & {one, two} and things & {one, two}:
            return "with", one, two
    return _OTHER


def _links(
    model: JointModel, locations: Sequence[_Reading], places: frozenset[str]
) -> tuple[Link, ...]:
    """What moves join, and what static atoms with two places relate."""
    moves = {frozenset(pair) for reading in locations for pair in reading.moves}
    moved = {ends for ends in moves if ends <= places}
    related = {places.intersection(atom.args) for atom in model.statics}
    pairs = sorted((min(e), max(e), e in moved) for e in moved | related if len(e) == 2)
    return tuple(Link((first, second), moves) for first, second, moves in pairs)


class _Reading:
    """A predicate read as "a thing is in a place", and what atoms and actions say then.

    ``place`` is the argument that is the place, ``thing`` the one that is the thing; None if it has
    none, as ``(stops floor)``: its name is empty then.  ``atoms`` come with their ``things`` and
    ``places``, ``moves`` are the pairs of places between which actions of ``owners`` move a thing,
    ``signs`` say whether actions make it true, and false.
    """

    def __init__(
        self, model: JointModel, kind: tuple[str, int], thing: int | None, place: int
    ) -> None:
        self.predicate, self.thing, self.place = kind[0], thing, place
        atoms = [atom for atom in model.codec.facts.atoms if _kind(atom) == kind]
        self.atoms = [(atom, *self._read(atom)) for atom in atoms]
        self.things = {named for _, named, _ in self.atoms}
        self.places = {where for _, _, where in self.atoms}
        self.moves, self.owners = set[tuple[str, str]](), set[tuple[int, ...]]()
        self.signs = set[bool]()
        for action in model.actions:
            own = [effect for effect in action.effects if _kind(effect.atom) == kind]
            self.signs |= {effect.adds for effect in own}
            self._take_in_moves(own, action.owners)

    def _take_in_moves(self, effects: Sequence[Effect], owners: tuple[int, ...]) -> None:
        for left, entered in permutations(effects, 2):
            (thing, source), (other, target) = self._read(left.atom), self._read(entered.atom)
            if entered.adds and not left.adds and thing == other and source != target:
                self.moves.add((source, target))
                self.owners.add(owners)

    def _read(self, atom: Atom) -> tuple[str, str]:
        """The thing and the place of an atom of the predicate."""
        return "" if self.thing is None else atom.args[self.thing], atom.args[self.place]

    def is_among(self, places: Set[str]) -> bool:
        """Whether actions put things into known places, and take them from there."""
        is_known = self.places <= places and self.things.isdisjoint(places)
        return is_known and self.thing is not None and self.signs == {True, False}


def _kind(atom: Atom) -> tuple[str, int]:
    return atom.predicate, len(atom.args)


def _readings(model: JointModel) -> list[_Reading]:
    """Every reading of every predicate with two arguments, and then of those with one."""
    kinds = sorted({_kind(atom) for atom in model.codec.facts.atoms})
    two = [_Reading(model, own, *ends) for own in kinds if own[1] == 2 for ends in ((0, 1), (1, 0))]
    return [*two, *(_Reading(model, own, None, 0) for own in kinds if own[1] == 1)]


def _locations(model: JointModel) -> tuple[list[_Reading], set[str]]:
    """The location predicates of a model, and the places.

    Places are what some action moves a thing from and to: it makes ``(at r1 a)`` false and
    ``(at r1 b)`` true.  They are neither robots nor things: parcels are handed over between robots,
    and blocks stand on blocks.  What moves without a name (``(stops floor)``) moves among the
    places of others, if there are any.  Predicates whose places are all known and that actions make
    true and false (``(lies box a)``, which is picked up here and dropped there) are location
    predicates, too.
    """
    readings, kept, places = _readings(model), list[_Reading](), set[str]()
    for reading in readings:
        things = reading.things
        contradicts = (reading.places & {*things, *model.robots}) | (things & places)
        elsewhere = reading.thing is None and places and not reading.places <= places
        if reading.moves and not contradicts and not elsewhere:
            kept.append(reading)
            places |= reading.places
    further = [each for each in readings if each not in kept and each.is_among(places)]
    return [*kept, *further], places
