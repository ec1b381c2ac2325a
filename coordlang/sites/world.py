# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a domain can be drawn: places, the things in them, and what each atom says about them.

It is found from the actions and the static atoms of the model alone, see `_locations`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import combinations, product

from planners.grounding import GroundAction
from planners.joint.model import JointModel, show
from planners.pddl.lifted import TRUE, Atom
from planners.pddl.robots import natural

#: What an atom says: ("at", thing, place), ("with", thing, thing), ("mark", place, text), ("about",
#: thing, text), ("other",).
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

    Links are what moves join, and what static atoms relate.
    """

    things: tuple[str, ...]
    places: tuple[str, ...]
    links: tuple[Link, ...]
    roles: Mapping[str, Role]

    def role(self, text: str) -> Role:
        """Return the role of an atom; ``("other",)`` for what is no fact of the model."""
        return self.roles.get(text, _OTHER)

    def located(self, texts: Iterable[str]) -> dict[str, str]:
        """Return the places of the things that some atoms locate, in the order of `things`."""
        found = {role[1]: role[2] for role in map(self.role, texts) if role[0] == "at"}
        return {thing: found[thing] for thing in self.things if thing in found}

    def moves(self, model: JointModel, robot: int, label: int) -> tuple[tuple[str, str], ...]:
        """Return where a robot's subaction always brings things: pairs (thing, place)."""
        text = model.label_text(robot, label)
        if text is None:
            return ()
        found = []
        for action in model.actions:
            if action.part_of(robot) != text:
                continue
            added = (e.atom for e in action.effects if e.adds and e.condition == TRUE)
            roles = (self.role(show(atom)) for atom in added)
            brought = {(role[1], role[2]) for role in roles if role[0] == "at"}
            if action.parts:  # a joint action also moves the other robots
                brought = {(t, place) for t, place in brought if t == model.robots[robot]}
            found.append(brought)
        return tuple(sorted(set.intersection(*found))) if found else ()


def find_world(model: JointModel, states: Sequence[Sequence[str]]) -> World:
    """Find what of a model can be drawn.

    ``states`` are known ones, as the texts of their true atoms: what puts a thing into two places
    in one of them does not say where it is.
    """
    predicates, known = _locations(model)
    roles = _without_ambiguous(_location_roles(model, predicates, known), states)
    located = {role[1] for _, role in roles.values()}
    places = frozenset(role[2] for _, role in roles.values())
    for atom in model.codec.facts.atoms:
        text = show(atom)
        if text not in roles:
            roles[text] = atom, _other_role(atom, places, located | {*model.robots})
    carried = {thing for _, role in roles.values() if role[0] == "with" for thing in role[1:]}
    others = sorted((located | carried) - {*model.robots}, key=natural)
    return World(
        things=(*model.robots, *others),
        places=tuple(sorted(places, key=natural)),
        links=tuple(_links(model, predicates, places)),
        roles={text: role for text, (_, role) in roles.items()},
    )


def _location_roles(
    model: JointModel, predicates: Sequence[_Location], places: Set[str]
) -> dict[str, tuple[Atom, Role]]:
    """The atoms that say where a thing is, by their texts, with their roles.

    The first predicate that reads an atom says it.
    """
    names = {p: _owner(p, model) for p in predicates if p.thing is None}
    roles: dict[str, tuple[Atom, Role]] = {}
    for atom in model.codec.facts.atoms:
        for predicate in predicates:
            thing, place = predicate.read(atom) or (None, "")
            if place in places and thing not in places:
                owner = names[predicate] if thing is None else thing
                roles[show(atom)] = atom, ("at", owner, place)
                break
    return roles


def _owner(predicate: _Location, model: JointModel) -> str:
    """Name what moves without a name: the only robot that moves it, else a thing of its own."""
    owners = {action.owners for action in model.actions if any(predicate.changes(action))}
    if len(owners) == 1 and not model.is_joint_action:
        (team,) = owners
        if len(team) == 1:
            return model.robots[team[0]]
    return predicate.predicate.removesuffix("-at").removeprefix("at-")


def _without_ambiguous(
    roles: dict[str, tuple[Atom, Role]], states: Sequence[Sequence[str]]
) -> dict[str, tuple[Atom, Role]]:
    """Drop the atoms of a thing and predicate that put the thing into two places at once.

    Of two predicates the one that locates more things is kept: ``(at plane1 city0)``, as said of
    passengers, tells where a plane is, and ``(fuel-level plane1 fl3)`` does not.
    """
    located: dict[str, set[str]] = {}
    for atom, (_, thing, _) in roles.values():
        located.setdefault(atom.predicate, set()).add(thing)
    ambiguous: set[tuple[str, str]] = set()
    for state in states:
        said: dict[str, list[str]] = {}
        for text in state:
            if text in roles:
                atom, (_, thing, _) = roles[text]
                said.setdefault(thing, []).append(atom.predicate)
        for thing, predicates in said.items():
            number = {predicate: len(located[predicate]) for predicate in predicates}
            best = [one for one in predicates if number[one] == max(number.values())]
            ambiguous |= {(thing, one) for one in predicates if len(best) > 1 or one != best[0]}
    return {
        text: (atom, role)
        for text, (atom, role) in roles.items()
        if (role[1], atom.predicate) not in ambiguous
    }


def _other_role(atom: Atom, places: frozenset[str], things: set[str]) -> Role:
    """The role of an atom that does not say where a thing is."""
    match atom.args:
        case (one,):
            return "mark" if one in places else "about", one, atom.predicate
        case (one, two) if not places & {one, two} and things & {one, two}:
            return "with", one, two
        case (one, two) if one in things and two in places:
            return "about", one, f"{atom.predicate} {two}"
    return _OTHER


def _links(
    model: JointModel, predicates: Sequence[_Location], places: frozenset[str]
) -> Iterator[Link]:
    """What moves join, and what static atoms relate."""
    moved = {
        tuple(sorted(pair))
        for predicate in predicates
        for action in model.actions
        for pair in predicate.changes(action)
        if places.issuperset(pair)
    }
    related = {
        tuple(sorted(pair))
        for atom in model.statics
        for pair in combinations([arg for arg in atom.args if arg in places], 2)
        if pair[0] != pair[1]
    }
    for first, second in sorted(moved | related):
        yield Link((first, second), (first, second) in moved)


@dataclass(frozen=True, slots=True)
class _Location:
    """A predicate read as "a thing is in a place".

    ``place`` is the argument that is the place, ``thing`` the one that is the thing; None if it has
    none, as ``(stops floor)``.
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


def _locations(model: JointModel) -> tuple[list[_Location], set[str]]:
    """The location predicates of a model, and the places.

    Places are what some action moves a thing from and to: it makes ``(at r1 a)`` false and
    ``(at r1 b)`` true.  Predicates whose places are all known and that actions make true and false
    (``(lies box a)``, which is picked up here and dropped there) are location predicates, too.
    """
    atoms = model.codec.facts.atoms
    candidates = _candidates(atoms)
    moving = [p for p in candidates if any(any(p.changes(action)) for action in model.actions)]
    kept, places = _consistent(moving, atoms, model.robots)
    further = [
        p
        for p in candidates
        if p not in kept
        and p.thing is not None
        and all(place in places and thing not in places for thing, place in p.read_all(atoms))
        and _comes_and_goes(p, model.actions)
    ]
    return [*kept, *further], places


def _candidates(atoms: Iterable[Atom]) -> list[_Location]:
    """Every reading of every predicate with one or two arguments."""
    found = set()
    for atom in atoms:
        if len(atom.args) == 1:
            found.add(_Location(atom.predicate, 1, 0, None))
        elif len(atom.args) == 2:
            found.add(_Location(atom.predicate, 2, 1, 0))
            found.add(_Location(atom.predicate, 2, 0, 1))
    return sorted(found, key=lambda p: (p.thing is None, p.predicate, -p.place))


def _consistent(
    moving: Sequence[_Location], atoms: Sequence[Atom], robots: Sequence[str]
) -> tuple[list[_Location], set[str]]:
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


def _comes_and_goes(predicate: _Location, actions: Iterable[GroundAction]) -> bool:
    """Say whether actions make it true and false."""
    signs = {
        effect.adds
        for action in actions
        for effect in action.effects
        if predicate.read(effect.atom) is not None
    }
    return signs == {True, False}
