"""What of a domain can be drawn: places, the things in them, and what each atom says about them.

Nothing is asked of the user.  *Places* are what some action moves a thing from and to: it makes
``(at r1 a)`` false and ``(at r1 b)`` true.  Links are what moves join, and what static atoms
relate.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

from planners.grounding import GroundAction
from planners.joint.model import JointModel, show
from planners.pddl.lifted import TRUE, Atom
from planners.pddl.robots import natural

#: What an atom says: ("at", thing, place), ("with", thing, thing), ("mark", place, text), ("about",
#: thing, text), ("other",).
Role = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Link:
    """Two places that belong together; ``moves``: something moves from one to the other."""

    ends: tuple[str, str]
    moves: bool


@dataclass(frozen=True, slots=True)
class World:
    """The things (robots first), the places and their links, and the role of every atom.

    Atoms are given by their text.
    """

    things: tuple[str, ...]
    places: tuple[str, ...]
    links: tuple[Link, ...]
    roles: Mapping[str, Role]

    def moves(self, model: JointModel, robot: int, label: int) -> tuple[tuple[str, str], ...]:
        """Where a robot's subaction brings things: pairs (thing, place)."""
        text = model.labels[robot][label]
        found: list[set[tuple[str, str]]] = []
        for action in model.actions:
            mine = (
                action.parts[robot] == text
                if action.parts
                else robot in action.owners and action.label == text
            )
            if not mine:
                continue
            brought = {
                role[1:3]
                for role in (
                    self.roles.get(show(e.atom), ("",))
                    for e in action.effects
                    if e.adds and e.condition == TRUE
                )
                if role[0] == "at"
            }
            found.append(
                {(t, p) for t, p in brought if not action.parts or t == model.robots[robot]}
            )
        return tuple(sorted(set.intersection(*found))) if found else ()


@dataclass(frozen=True, slots=True)
class _Shape:
    """Atoms of one predicate seen as "thing in place".

    The argument that is the place, and the thing's (None: no thing).
    """

    predicate: str
    arity: int
    place: int
    thing: int | None

    def read(self, atom: Atom) -> tuple[str | None, str] | None:
        if atom.predicate != self.predicate or len(atom.args) != self.arity:
            return None
        return (None if self.thing is None else atom.args[self.thing]), atom.args[self.place]


def find_world(model: JointModel, states: Sequence[Sequence[str]]) -> World:
    """The world of a model.

    ``states`` are known states as lists of true atoms: no thing may be in two places in one.
    """
    atoms = {show(atom): atom for atom in _fluents(model)}
    shapes = [shape for shape in _shapes(atoms.values()) if _moves(shape, model.actions)]
    places = _places(shapes, atoms.values(), model.robots)
    shapes += [
        shape
        for shape in _shapes(atoms.values())
        if shape not in shapes
        and _is_about(shape, atoms.values(), places)
        and _comes_and_goes(shape, model.actions)
    ]
    owner = {shape: _owner(shape, model) for shape in shapes if shape.thing is None}
    roles: dict[str, Role] = {}
    for text, atom in atoms.items():
        for shape in shapes:
            at = shape.read(atom)
            if at is not None and at[1] in places and at[0] not in places:
                thing = at[0] if shape.thing is not None else owner[shape]
                if thing is not None:
                    roles[text] = ("at", thing, at[1])
                    break
    _drop_ambiguous(roles, states)
    placed = {role[1] for role in roles.values()}
    for text, atom in atoms.items():
        if text not in roles:
            roles[text] = _other_role(atom, places, placed | {*model.robots})
    things = {r[1] for r in roles.values() if r[0] == "at"} | {
        t for r in roles.values() if r[0] == "with" for t in r[1:]
    }
    others = sorted(things - {*model.robots}, key=natural)
    named = sorted(places, key=natural)
    return World((*model.robots, *others), tuple(named), tuple(_links(model, shapes, named)), roles)


def _fluents(model: JointModel) -> Iterator[Atom]:
    """All atoms that a state can have, with those of remembered actions left out."""
    for text in model.codec.facts.texts:
        predicate, *args = text.strip("()").split()
        yield Atom(predicate, tuple(args))


def _shapes(atoms: Iterable[Atom]) -> list[_Shape]:
    found = set()
    for atom in atoms:
        if len(atom.args) == 1:
            found.add(_Shape(atom.predicate, 1, 0, None))
        if len(atom.args) == 2:
            found |= {_Shape(atom.predicate, 2, 1, 0), _Shape(atom.predicate, 2, 0, 1)}
    return sorted(found, key=lambda s: (s.thing is None, s.predicate, -s.place))


def _changes(shape: _Shape, action: GroundAction) -> Iterator[tuple[str, str]]:
    """Pairs of places between which an action moves a thing."""
    gone: list[tuple[str | None, str]] = []
    come: list[tuple[str | None, str]] = []
    for effect in action.effects:
        at = shape.read(effect.atom)
        if at is not None:
            (come if effect.adds else gone).append(at)
    yield from ((a, b) for (x, a), (y, b) in product(gone, come) if x == y and a != b)


def _moves(shape: _Shape, actions: Iterable[GroundAction]) -> bool:
    return any(True for action in actions for _ in _changes(shape, action))


def _places(shapes: list[_Shape], atoms: Iterable[Atom], robots: Sequence[str]) -> set[str]:
    """What the moving shapes have in their place argument; other shapes are dropped.

    No places are robots (between which parcels are handed over) and things (blocks on blocks).
    What moves without a name (``(stops floor)``) moves among the places of others, if there are
    any.
    """
    places: set[str] = set()
    kept = []
    for shape in shapes:
        read = [at for at in (shape.read(atom) for atom in atoms) if at]
        mine, things = {p for _, p in read}, {t for t, _ in read if t}
        if (
            mine & {*things, *robots}
            or (shape.thing is None and places and not mine <= places)
            or things & places
        ):
            continue
        kept.append(shape)
        places |= mine
    shapes[:] = kept
    return places


def _is_about(shape: _Shape, atoms: Iterable[Atom], places: set[str]) -> bool:
    read = [at for at in (shape.read(atom) for atom in atoms) if at]
    return shape.thing is not None and all(p in places and t not in places for t, p in read)


def _comes_and_goes(shape: _Shape, actions: Iterable[GroundAction]) -> bool:
    signs = {e.adds for action in actions for e in action.effects if shape.read(e.atom) is not None}
    return signs == {True, False}


def _owner(shape: _Shape, model: JointModel) -> str | None:
    """Whose place it is that moves without a name.

    The one robot's that moves it, else it is a thing of its own.
    """
    owners = {
        action.owners for action in model.actions if any(True for _ in _changes(shape, action))
    }
    if model.is_joint_action or len(owners) != 1:
        return shape.predicate.removesuffix("-at").removeprefix("at-")
    (only,) = owners
    return (
        model.robots[only[0]]
        if len(only) == 1
        else shape.predicate.removesuffix("-at").removeprefix("at-")
    )


def _drop_ambiguous(roles: dict[str, Role], states: Sequence[Sequence[str]]) -> None:
    """A thing in two places at once is not *in* a place.

    Atoms of such a predicate say something else.
    """
    bad: set[tuple[str, str]] = set()
    for state in states:
        seen: dict[str, str] = {}
        for text in state:
            role = roles.get(text)
            if role is None:
                continue
            if role[1] in seen:
                bad |= {(role[1], _predicate(text)), (role[1], _predicate(seen[role[1]]))}
            seen[role[1]] = text
    for text in [t for t, role in roles.items() if (role[1], _predicate(t)) in bad]:
        del roles[text]


def _predicate(text: str) -> str:
    return text.strip("()").split()[0]


def _other_role(atom: Atom, places: set[str], things: set[str]) -> Role:
    match atom.args:
        case (one,) if one in places:
            return "mark", one, atom.predicate
        case (one,):
            return "about", one, atom.predicate
        case (one, two) if (
            one not in places and two not in places and (one in things or two in things)
        ):
            return "with", one, two
        case (one, two) if one in things and two in places:
            return "about", one, f"{atom.predicate} {two}"
    return ("other",)


def _links(model: JointModel, shapes: Iterable[_Shape], places: Sequence[str]) -> Iterator[Link]:
    known = set(places)
    moved = {
        tuple(sorted(pair))
        for shape in shapes
        for action in model.actions
        for pair in _changes(shape, action)
        if known.issuperset(pair)
    }
    related = {
        tuple(sorted(pair))
        for atom in model.statics
        for pair in combinations([a for a in atom.args if a in known], 2)
        if pair[0] != pair[1]
    }
    for a, b in sorted(moved | related):
        yield Link((a, b), (a, b) in moved)
