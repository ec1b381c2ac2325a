# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's choices at run time.

What may it do next, and are the detours that it wants still possible?

This file needs Python's standard library and nothing else, so that a robot can carry it: copy it
beside a choices file (docs/formats.md), which ``coordlang choices --format json`` writes.  Neither
PDDL nor a planner is needed then.

All checks and all larger pieces of work are done when the file is read, and in `Monitor.can` and
`Monitor.commit`.  What a robot calls in every step (`Monitor.allowed`, `Monitor.did`,
`Monitor.known`, `Monitor.remaining`, `Monitor.step`, `Monitor.finished`, `Monitor.copy`) takes the
same time however many steps were done before.  It opens no file and imports nothing.
"""

from __future__ import annotations

import gzip
import json
import re
import zlib
from array import array
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from decimal import Decimal
from functools import cache, partial
from io import BytesIO
from typing import Any, TypeVar

FORMAT = "coordlang/choices"
VERSION = 1
IDLE = "idle"
#: The largest choices file that is read, in bytes before and after decompression.
MAX_BYTES = 1 << 28

#: The most nodes that `Monitor.can` explores: pairs of a state and the visits and dos made there.
#: In files with many states it is 16 for each, which is enough for four visits and dos.
MAX_NODES = 1 << 18
_NODES_OF_STATE = 16

_SHOWN = 8  # things that a message lists
_SHOWN_TEXT = 200  # characters of a text that a message shows
_AROUND_PARENTHESES = re.compile(r"\s*([()])\s*")
_PDDL_TEXT = re.compile(r"\([^()]+\)")
_KINDS = {str: "a text", int: "a whole number", list: "a list", dict: "an object"}
_KNOWN = ("true", "unknown")  # the keys of what is known in a state
_Kind = TypeVar("_Kind")

#: One text or several; None is idling.
Texts = str | Iterable[str | None] | None


class MonitorError(ValueError):
    """A choices file that is none, a robot or an atom that it lacks, a detour of too much work."""


class NotAllowed(MonitorError):
    """The robot did what it may not do.

    ``step`` counts from 0, ``allowed`` are what it could have done (None: idle).
    """

    def __init__(
        self, robot: str, did: str | None, step: int, allowed: Sequence[str | None]
    ) -> None:
        could = " or ".join(text or IDLE for text in allowed[:_SHOWN])
        more = " or .." if len(allowed) > _SHOWN else ""
        may = f"it may do {could}{more}" if allowed else "all its steps are done"
        super().__init__(f"step {step + 1}: {robot} may not do {_shown(did or IDLE)}; {may}")
        self.robot, self.did, self.step, self.allowed = robot, did, step, tuple(allowed)


class NotPossible(MonitorError):
    """A promise that can no longer be kept."""


@dataclass(frozen=True, slots=True)
class Detour:
    """What a robot wants of its remaining steps; all of it at once.

    ``visit``: atoms, each known to be true in the present or in some later state.  ``avoid``: atoms
    known to be false in the present and in every later state.  ``do``: patterns of own subactions,
    each done at least once from now on; ``never``: patterns that are not done any more.  In a
    pattern ``*`` stands for any text, ``(move r1 * c3)``; ``idle`` is idling.  *Known* means:
    whatever the others choose.
    """

    visit: tuple[str, ...] = ()
    avoid: tuple[str, ...] = ()
    do: tuple[str, ...] = ()
    never: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, _texts(getattr(self, field.name)))

    @classmethod
    def of(cls, **wanted: Texts) -> Detour:
        """Each field as one text or several; None stands for idling."""
        return cls(**{name: _texts(value) for name, value in wanted.items()})

    def __and__(self, other: Detour) -> Detour:
        return Detour(*((*getattr(self, f.name), *getattr(other, f.name)) for f in fields(self)))


@dataclass(frozen=True, slots=True)
class Answer:
    """Whether a detour is still possible.

    ``subplan`` is one way to do it (the first in order), ``subplans`` their number.

    True in a condition iff it is possible.
    """

    subplan: tuple[str | None, ...] | None
    subplans: int

    def __bool__(self) -> bool:
        return self.subplan is not None


@dataclass(frozen=True, slots=True)
class _Walk:
    """The subplans that are left, as an automaton: its nodes are numbered step by step, 0 first.

    The edges out of node n are ``first[n]`` to ``first[n + 1]``, sorted by their label; each has a
    label and a target.  ``state[n]`` is the state of the choices file in which n is, ``left[n]``
    the number of subplans from n on, at least 1.  Flat arrays, because the garbage collector does
    not look into them.
    """

    first: array[int]
    label: array[int]
    target: array[int]
    state: Sequence[int]
    left: Sequence[int]

    def edges(self, node: int) -> range:
        """The edges out of a node."""
        return range(self.first[node], self.first[node + 1])


class _Known:
    """What is known in each state, as sorted numbers in one flat array.

    The number of a fact in a state is ``2 * (state * facts + fact)``, and 1 more if the fact is
    unknown there; a fact that does not occur is false.
    """

    def __init__(self, states: Sequence[Any], facts: int) -> None:
        self._facts, self._numbers = facts, array("q")
        for state, record in enumerate(states):
            true, unknown = (_fact_numbers(record, key, facts, state) for key in _KNOWN)
            if both := true & unknown:
                raise MonitorError(f"state {state} says that fact {min(both)} is true and unknown")
            found = [2 * fact for fact in true] + [2 * fact + 1 for fact in unknown]
            self._numbers.extend(2 * state * facts + number for number in sorted(found))

    def value(self, state: int, fact: int | None) -> bool | None:
        """Whether a fact is true in a state; None where it is unknown.  None always is."""
        if fact is None:
            return None
        number = 2 * (state * self._facts + fact)
        at = bisect_left(self._numbers, number)
        found = self._numbers[at] - number if at < len(self._numbers) else 2
        return None if found == 1 else found == 0


def _fact_numbers(record: Any, key: str, facts: int, state: int) -> set[int]:
    numbers = _get(record, key, list, f"state {state}")
    for fact in numbers:
        if not _is_number(fact) or not 0 <= fact < facts:
            raise _broken(
                f"state {state}: '{key}' has {_shown(fact)}; facts are numbers below {facts}"
            )
    return set(numbers)


class _History:
    """The labels of the steps done, in blocks.

    Full blocks are never changed, so that copies share them: adding a step and copying take
    constant time.
    """

    __slots__ = ("_before", "_block", "_length")

    _SIZE = 256

    def __init__(self, labels: Iterable[int] = ()) -> None:
        self._before: tuple[Any, ...] = ()  # (the blocks before, a full block)
        self._block = array("I", bytes(array("I").itemsize * self._SIZE))
        self._length = 0
        for label in labels:
            self.add(label)

    def __len__(self) -> int:
        return self._length

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.labels(),)  # flat: many blocks would be nested too deeply

    def add(self, label: int) -> None:
        at = self._length % self._SIZE
        if at == 0 and self._length:
            self._before = (self._before, self._block)
            self._block = self._block[:]
        self._block[at] = label
        self._length += 1

    def copy(self) -> _History:
        other = _History()
        other._before, other._block = self._before, self._block[:]
        other._length = self._length
        return other

    def labels(self) -> list[int]:
        blocks, before = [self._block], self._before
        while before:
            before, block = before
            blocks.append(block)
        return [label for block in reversed(blocks) for label in block][: self._length]


class Monitor:
    """Follows one robot through its choices.

    >>> monitor = Monitor.read("choices.json", "r1")        # doctest: +SKIP
    >>> monitor.allowed()                                   # doctest: +SKIP
    (None, '(move r1 a b)')
    >>> monitor.did("(move r1 a b)")                        # doctest: +SKIP

    Parameters
    ----------
    data
        The data of a choices file.
    robot
        Whose choices; needed where the file has several.

    Raises `MonitorError` for data that is no choices file, or that contradicts itself.
    """

    def __init__(self, data: Mapping[str, Any], robot: str | None = None) -> None:
        entry = _entry(data, robot)
        self.robot = _text(entry, "robot", "a robot's choices")
        self.sentence = _text(data, "sentence", "the file")
        where = f"the choices of {self.robot}"
        #: "exact": known over every combination of the robots' choices; "own": from own subactions
        #: alone.
        self.atoms = _text(entry, "atoms", where)
        if self.atoms not in ("exact", "own"):
            raise _broken(f"{where}: 'atoms' is {_shown(self.atoms)}, not exact or own")
        facts, others = _atoms(entry, "facts", where), _atoms(entry, "others", where)
        if len({*facts, *others}) < len(facts) + len(others):
            raise _broken(f"{where}: an atom occurs twice in 'facts' and 'others'")
        #: The number of each atom; None for one of which nothing is ever known.
        self._facts: dict[str, int | None] = {text: n for n, text in enumerate(facts)}
        self._facts |= dict.fromkeys(sorted(others))
        states = _get(entry, "states", list, where)
        _check_moves(states)
        labels = _labels(states)
        #: The text of each label; sorted, idling (None) first.
        self._texts = tuple(None if text == IDLE else text for text in labels)
        self._numbers = {text: number for number, text in enumerate(self._texts)}
        self._walk = _read_walk(states, labels)
        _check_ends(entry, states, self._walk)
        self._known = _Known(states, len(facts))
        self._most = max(MAX_NODES, _NODES_OF_STATE * len(states))
        self._here = 0
        self._history = _History()
        self._promised = Detour()

    @classmethod
    def read(cls, path: str, robot: str | None = None, *, max_bytes: int = MAX_BYTES) -> Monitor:
        """The monitor of a choices file (compressed or not).

        A file that holds more than ``max_bytes`` bytes, or more when it is decompressed, is
        refused.

        Raises `MonitorError` for a file that is no choices file, whatever it is; `OSError` where it
        cannot be opened or read.
        """
        try:
            return cls(_parsed(path, max_bytes), robot)
        except MemoryError:
            pass  # raised below, where the memory of what was read is free again
        raise MonitorError(f"{path}: it does not fit into the memory")

    def copy(self) -> Monitor:
        """A monitor of its own in the same place, for trying things out.

        Constant time.  A copy of a monitor that has just been read does the whole mission again.
        """
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._history = self._history.copy()
        return other

    __copy__ = copy

    @property
    def step(self) -> int:
        """How many steps are done."""
        return len(self._history)

    @property
    def history(self) -> tuple[str | None, ...]:
        """What the robot did, step by step; None is idling.

        It is put together when it is asked for: O(steps done); `step` is their number.
        """
        return tuple(self._texts[label] for label in self._history.labels())

    @property
    def finished(self) -> bool:
        """Whether the robot has done all its steps."""
        return not self._walk.edges(self._here)

    @property
    def remaining(self) -> int:
        """How many own subplans are left, of those that keep every promise."""
        return self._walk.left[self._here]

    @property
    def promised(self) -> Detour:
        """Everything that `commit` was called with, each text once."""
        return self._promised

    def allowed(self) -> tuple[str | None, ...]:
        """What the robot may do next (None: idle), sorted, idling first.

        Nothing when it has finished.
        """
        walk = self._walk
        # Through a list: a tuple of known length costs the garbage collector nothing.
        return tuple([self._texts[walk.label[edge]] for edge in walk.edges(self._here)])

    def did(self, subaction: str | None) -> None:
        """Tell what the robot did in this step, as ``(move r1 a b)``; None or ``idle`` for idling.

        Constant time; O(log allowed).

        Raises `NotAllowed`, and is then as it was before.
        """
        is_known = isinstance(subaction, str) and subaction in self._numbers
        text = subaction if is_known else _subaction(subaction)
        label = self._numbers.get(text, -1)
        edges = self._walk.edges(self._here)
        edge = bisect_left(self._walk.label, label, edges.start, edges.stop)
        if edge == edges.stop or self._walk.label[edge] != label:
            raise NotAllowed(self.robot, text, self.step, self.allowed())
        self._history.add(label)
        self._here = self._walk.target[edge]

    def known(self, atom: str) -> bool | None:
        """Whether an atom is true now, whatever the others did; None if that depends on them."""
        text = atom if isinstance(atom, str) and atom in self._facts else _plain(atom)
        self._check_atom(text)
        return self._known.value(self._walk.state[self._here], self._facts[text])

    def can(self, detour: Detour | None = None, /, **wanted: Texts) -> Answer:
        """Whether all this can still be had at once, promises kept.

        ``can(visit="(at r1 c)", never="idle")``; see `Detour`.

        O(automaton * 2^(visits and dos)), of the automaton's steps that are still to be done; more
        than `MAX_NODES` nodes are not explored.  (With any number of visits the question is
        NP-complete.)

        Raises `MonitorError` beyond that: ask for fewer at once.
        """
        walk = self._making((detour or Detour()) & Detour.of(**wanted))
        if walk is None:
            return Answer(None, 0)
        node, subplan = 0, []
        while edges := walk.edges(node):
            subplan.append(self._texts[walk.label[edges.start]])
            node = walk.target[edges.start]
        return Answer(tuple(subplan), walk.left[0])

    def commit(self, detour: Detour | None = None, /, **wanted: Texts) -> None:
        """Promise it: from now on only what keeps the promise is allowed.

        As much work as `can`; the steps after it are as fast as those before.

        Raises `NotPossible`, and is then as it was before.
        """
        promise = (detour or Detour()) & Detour.of(**wanted)
        walk = self._making(promise)
        if walk is None:
            kept = " together with what was promised before" if self._promised != Detour() else ""
            raise NotPossible(
                f"step {self.step + 1}: {self.robot} has no subplan left for this{kept}"
            )
        both = self._promised & promise
        self._promised = Detour(
            *(tuple(dict.fromkeys(getattr(both, f.name))) for f in fields(both))
        )
        self._walk, self._here = walk, 0

    def _making(self, detour: Detour) -> _Walk | None:
        """The subplans from here on that make a detour and keep the promises; None if none do."""
        for atom in (*detour.visit, *detour.avoid):
            self._check_atom(atom)
        nodes, moves = self._explored(detour)
        whole = (1 << len(detour.visit) + len(detour.do)) - 1
        left = [0] * len(nodes)
        for number in reversed(range(len(nodes))):
            node, made = nodes[number]
            if self._walk.edges(node):
                left[number] = sum(left[to] for _, to in moves[number])
            else:
                left[number] = int(made == whole)
        if not any(left[:1]):
            return None
        return _walk_of(moves, [self._walk.state[node] for node, _ in nodes], left)

    def _explored(
        self, detour: Detour
    ) -> tuple[list[tuple[int, int]], list[list[tuple[int, int]]]]:
        """What can be reached from here by moves that a detour does not forbid, step by step.

        Nodes are pairs: one of the subplans that are left, and the parts of the detour that are
        made by then (bits: the visits, then the dos).  Moves are pairs of a label and a node.
        """
        walk = self._walk
        by_label = [_made_by(detour, text) for text in self._texts]
        made_in = cache(partial(self._made_in, detour))
        made = made_in(walk.state[self._here])
        nodes = [(self._here, made)] if made is not None else []
        numbers = {node: number for number, node in enumerate(nodes)}
        moves: list[list[tuple[int, int]]] = []
        for node, before in nodes:  # which grows meanwhile
            moves.append([])
            for edge in walk.edges(node):
                label, to = walk.label[edge], walk.target[edge]
                now, then = by_label[label], made_in(walk.state[to])
                if now is None or then is None:
                    continue
                after = (to, before | now | then)
                if after not in numbers:
                    if len(nodes) >= self._most:
                        raise MonitorError(
                            f"{len(detour.visit) + len(detour.do)} visits and dos at once are too "
                            f"many here: there are more than {self._most:,} ways to have made some "
                            "of them; ask for fewer"
                        )
                    numbers[after] = len(nodes)
                    nodes.append(after)
                moves[-1].append((label, numbers[after]))
        return nodes, moves

    def _made_in(self, detour: Detour, state: int) -> int | None:
        """The visits made in a state, as bits; None if the detour avoids it."""
        values = partial(self._known.value, state)
        if any(values(self._facts[atom]) is not False for atom in detour.avoid):
            return None
        visited = (values(self._facts[atom]) for atom in detour.visit)
        return sum(1 << bit for bit, made in enumerate(visited) if made)

    def _check_atom(self, atom: str) -> None:
        if atom in self._facts:
            return
        head = _head(atom)
        alike = [text for text in self._facts if _head(text) == head]
        if alike:
            more = " .." if len(alike) > _SHOWN else ""
            similar = f"there are {', '.join(alike[:_SHOWN])}{more}"
        else:
            similar = f"none is ({_shown(head)} ..)"
        raise MonitorError(f"{_shown(atom)} is no atom that can change: {similar}")


def _head(atom: str) -> str:
    return atom.strip("()").split(" ")[0]


def _walk_of(
    moves: Sequence[Sequence[tuple[int, int]]], state: Sequence[int], left: Sequence[int]
) -> _Walk:
    """The nodes from which a subplan is left; ``moves[n]`` are pairs (label, target), sorted."""
    kept = [node for node, count in enumerate(left) if count]
    number = dict(zip(kept, range(len(kept)), strict=True))
    first, label, target = array("q", [0]), array("q"), array("q")
    for node in kept:
        for own, to in moves[node]:
            if left[to]:
                label.append(own)
                target.append(number[to])
        first.append(len(label))
    counts: Sequence[int] = [left[node] for node in kept]
    if counts[0] < 1 << 63:  # there are nowhere more left than at the start
        counts = array("q", counts)
    return _Walk(first, label, target, array("q", [state[node] for node in kept]), counts)


def _made_by(detour: Detour, text: str | None) -> int | None:
    """The dos that a subaction makes, as bits beside those of the visits; None if it is never."""
    if any(_matches(pattern, text) for pattern in detour.never):
        return None
    bits = enumerate(detour.do, len(detour.visit))
    return sum(1 << bit for bit, pattern in bits if _matches(pattern, text))


def _parsed(path: str, max_bytes: int) -> Any:
    """The JSON data of a file, compressed or not."""
    with open(path, "rb") as file:
        content = file.read(max_bytes + 1)
    try:
        if content[:2] == b"\x1f\x8b" and len(content) <= max_bytes:
            with gzip.GzipFile(fileobj=BytesIO(content)) as unpacked:
                content = unpacked.read(max_bytes + 1)
        if len(content) > max_bytes:
            raise MonitorError(f"it holds more than {max_bytes:,} bytes (max_bytes allows more)")
        text = content.decode("utf-8-sig")
        del content
        return json.loads(text, object_pairs_hook=_object, parse_constant=_no_constant)
    except MonitorError as error:
        raise MonitorError(f"{path}: {error}") from None
    except UnicodeDecodeError as error:
        raise MonitorError(f"{path}: byte {error.start} is no UTF-8: {error.reason}") from None
    except RecursionError:
        raise MonitorError(f"{path}: this is no choices file: it is nested too deeply") from None
    except (ValueError, OSError, EOFError, zlib.error) as error:
        raise MonitorError(f"{path}: this is no JSON, or it is cut off: {error}") from None


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; raises `MonitorError` for a key that occurs twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise _broken(f"the key '{_shown(twice)}' occurs twice in an object")
    return found


def _no_constant(text: str) -> None:
    raise _broken(f"{text} is no number in JSON")


def _broken(what: str) -> MonitorError:
    return MonitorError(f"this is no choices file: {what}")


def _get(record: Any, key: str, kind: type[_Kind], where: str) -> _Kind:
    """The value of a key; raises `MonitorError` if it is missing or of another type."""
    if not isinstance(record, Mapping):
        raise _broken(f"{where} is {_shown(record)}, not an object")
    if key not in record:
        raise _broken(f"{where}: '{key}' is missing")
    value = record[key]
    if not isinstance(value, kind) or isinstance(value, bool):
        raise _broken(f"{where}: '{key}' is {_shown(value)}, not {_KINDS[kind]}")
    return value


def _is_number(value: object) -> bool:
    """Whether a value is a whole number; to Python true and false are, too."""
    return isinstance(value, int) and not isinstance(value, bool)


def _text(record: Any, key: str, where: str) -> str:
    text = _get(record, key, str, where)
    if not text.isprintable():
        raise _broken(f"{where}: '{key}' holds control characters: {_shown(text)}")
    return text


def _atoms(entry: Mapping[str, Any], key: str, where: str) -> list[str]:
    atoms = _get(entry, key, list, where)
    for atom in atoms:
        _check_plain(atom, f"{where}: '{key}'")
    return atoms


def _check_plain(text: Any, where: str) -> None:
    """Raise unless it is an atom or subaction as `_plain` makes them."""
    if not isinstance(text, str) or not text.isprintable() or _plain_or_none(text) != text:
        raise _broken(f"{where} has {_shown(text)} in place of text such as (move r1 a b)")


def _entry(data: Any, robot: str | None) -> Mapping[str, Any]:
    """The choices of one robot in the data of a choices file."""
    if not isinstance(data, Mapping) or data.get("format") != FORMAT:
        raise MonitorError(f'expected a choices file: {{"format": "{FORMAT}", ..}}')
    version = data.get("version")
    if not _is_number(version) or version != VERSION:
        raise MonitorError(
            f"choices file version {_shown(version)}; this program reads version {VERSION}"
        )
    entries: dict[str, Mapping[str, Any]] = {}
    for entry in _get(data, "choices", list, "the file"):
        name = _text(entry, "robot", "a robot's choices")
        if name in entries:
            raise _broken(f"it has the choices of {_shown(name)} twice")
        entries[name] = entry
    names = ", ".join(_shown(name) for name in list(entries)[:_SHOWN])
    names += " .." if len(entries) > _SHOWN else ""
    if robot is not None:
        if robot not in entries:
            raise MonitorError(
                f"the file has no choices of {_shown(robot)}; it has those of {names or 'no robot'}"
            )
        return entries[robot]
    if len(entries) != 1:
        raise MonitorError(f"whose choices? The file has those of {names or 'no robot'}")
    return next(iter(entries.values()))


def _check_moves(states: Sequence[Any]) -> None:
    """Raise unless there are states and every one leads to states of the next step.

    From state 0 in step 0, from which every state can be reached.  So there are no cycles.
    """
    steps = [_get(state, "step", int, f"state {number}") for number, state in enumerate(states)]
    if not states or steps[0] != 0:
        raise MonitorError("the automaton has no state 0 in step 0")
    reached = bytearray(len(states))
    reached[0] = True
    for number, state in enumerate(states):
        if not reached[number]:
            raise MonitorError(f"state {number} cannot be reached from state 0")
        for to in _get(state, "next", dict, f"state {number}").values():
            is_state = _is_number(to) and number < to < len(states)
            if not is_state or steps[to] != steps[number] + 1:
                raise MonitorError(
                    f"state {number} does not lead to a state of step {steps[number] + 1}"
                )
            reached[to] = True


def _labels(states: Sequence[Mapping[str, Any]]) -> list[str]:
    """The texts of all subactions, sorted, idling first."""
    texts: dict[Any, int] = {}
    for number, state in enumerate(states):
        for text in state["next"]:
            if text not in texts:
                texts[text] = number
                if text != IDLE:
                    _check_plain(text, f"state {number}: 'next'")
    return sorted(texts, key=lambda text: "" if text == IDLE else text)


def _read_walk(states: Sequence[Mapping[str, Any]], labels: Sequence[str]) -> _Walk:
    """The subplans of the states.

    Raises `MonitorError` where a state contradicts the number of subplans that are left.  States
    are looked at backwards: the counts never take much more memory than those in the file.
    """
    numbers = {text: number for number, text in enumerate(labels)}
    moves = [sorted((numbers[text], to) for text, to in state["next"].items()) for state in states]
    left = [1] * len(states)
    for number in reversed(range(len(states))):
        if moves[number]:
            left[number] = sum(left[to] for _, to in moves[number])
        _check_count(states[number], "left", left[number], f"state {number}")
    return _walk_of(moves, range(len(states)), left)


def _check_ends(entry: Mapping[str, Any], states: Sequence[Mapping[str, Any]], walk: _Walk) -> None:
    """Raise unless all subplans have one length, and `steps` and `subplans` (where given) agree."""
    steps = max(state["step"] for state in states)
    for number, state in enumerate(states):
        if not state["next"] and state["step"] != steps:
            raise MonitorError(f"state {number} ends after {state['step']} of {steps} steps")
    if "steps" in entry and _get(entry, "steps", int, "a robot's choices") != steps:
        raise MonitorError(f"'steps' is {_shown(entry['steps'])}, but the states have {steps}")
    if "subplans" in entry:
        _check_count(entry, "subplans", walk.left[0], "a robot's choices")


def _check_count(record: Mapping[str, Any], key: str, count: int, where: str) -> None:
    """Raise unless a count in the file, a number or above 2^53 its digits, is this one."""
    if key not in record:
        raise _broken(f"{where}: '{key}' is missing")
    said = record[key]
    if isinstance(said, str) and said.isascii() and said.isdigit() and said[0] != "0":
        said = Decimal(said)  # exact, and unlike `int` not limited to some digits
    if not (_is_number(said) or isinstance(said, Decimal)) or said != count:
        number = str(count) if count.bit_length() < 256 else f"about 2^{count.bit_length()}"
        shown = _shown(record[key])
        raise MonitorError(f"{where} says {shown} subplans are left, but there are {number}")


def _texts(value: Texts) -> tuple[str, ...]:
    several = [value] if value is None or isinstance(value, str) else value
    return tuple(IDLE if text is None else _plain(text) for text in several)


def _plain(text: str) -> str:
    """PDDL text in lower case with single spaces; raises `MonitorError` for anything else."""
    plain = _plain_or_none(text) if isinstance(text, str) else None
    if plain is None:
        raise MonitorError(
            f"'{_shown(text)}' is no PDDL text such as (move r1 a b), and not 'idle'"
        )
    return plain


def _plain_or_none(text: str) -> str | None:
    plain = _AROUND_PARENTHESES.sub(r"\1", " ".join(text.lower().split()))
    return plain if plain == IDLE or _PDDL_TEXT.fullmatch(plain) else None


def _subaction(text: str | None) -> str | None:
    plain = IDLE if text is None else _plain(text)
    return None if plain == IDLE else plain


def _matches(pattern: str, text: str | None) -> bool:
    """Whether a text is the pattern, in which every * stands for any text."""
    if pattern == IDLE or text is None:
        return pattern == IDLE and text is None
    head, *pieces = pattern.split("*")
    if not pieces:
        return text == head
    *between, tail = pieces
    if len(text) < len(head) + len(tail) or not (text.startswith(head) and text.endswith(tail)):
        return False
    at, end = len(head), len(text) - len(tail)
    for piece in between:
        at = text.find(piece, at, end)
        if at < 0:
            return False
        at += len(piece)
    return True


def _shown(value: object) -> str:
    """A value in a message: cut, and without control characters."""
    if isinstance(value, str):
        cut = value[:_SHOWN_TEXT]
        clean = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in cut)
        return clean if len(value) <= _SHOWN_TEXT else f"{clean}.. ({len(value):,} characters)"
    if isinstance(value, int) and value.bit_length() > 64:
        return "a huge number"
    if value is None or isinstance(value, int | float):
        return str(value)
    return f"a {type(value).__name__}"
