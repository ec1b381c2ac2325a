# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's choices at run time: what it may do next, and which detours are still possible.

This file needs Python's standard library and nothing else, neither PDDL nor a planner: copy it
beside a choices file (docs/formats.md), which ``coordlang choices --format json`` writes.

A `Monitor` is where the robot is in what is open under the sentence.  All checks and larger pieces
of work are done when the file is read, and in `Monitor.can` and `Monitor.commit`.  What a robot
calls in every step or event takes the same time and memory however many were done before, opens no
file and imports nothing.
"""

from __future__ import annotations

import gzip
import json
import re
import zlib
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fnmatch import fnmatchcase
from functools import cache, partial
from io import BytesIO
from itertools import accumulate
from random import Random
from typing import Any, ClassVar, Literal, Self

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
_PDDL = "text such as (move r1 a b)"
# What a choices file holds: the shape of each key's value (`_check`).
_FILE = {"choices": list, "sentence": str}
_CHOICES = {"atoms": str, "facts": [_PDDL], "others": [_PDDL], "states": list}
_STATE = {"step": int, "left": object, "next": dict, "true": list, "unknown": list}
_EVENT = {"subaction": _PDDL, "after": {str: int}, "with": {str: _PDDL}}
_PASSINGS = {
    "others": {str: [{_PDDL: int}]},
    "events": dict,
    "interferes": {str: {str: [_PDDL]}},
}

#: In place of what is made of a detour: something that it excludes.
_EXCLUDED = 1

#: One text or several; None is idling.
Texts = str | Iterable[str | None] | None


class MonitorError(ValueError):
    """A choices file that is none, a robot or an atom that it lacks, a detour of too much work."""


class NotAllowed(MonitorError):
    """The robot did what it may not do.

    ``step`` counts from 0, ``allowed`` are what it could have done (None: idle).
    """

    def __init__(self, monitor: Monitor, did: str | None) -> None:
        robot, step, unit = monitor.robot, monitor.step, monitor.unit
        allowed = monitor.allowed()
        could = " or ".join(text or IDLE for text in allowed[:_SHOWN])
        more = " or .." if len(allowed) > _SHOWN else ""
        may = f"it may do {could}{more}" if allowed else f"all its {unit}s are done"
        super().__init__(f"{unit} {step + 1}: {robot} may not do {_shown(did or IDLE)}; {may}")
        self.robot, self.did, self.step, self.allowed = robot, did, step, allowed


class NotPossible(MonitorError):
    """A promise that can no longer be kept, or a report of what cannot have happened."""


@dataclass(frozen=True, slots=True)
class Answer:
    """Whether a detour is still possible; true in a condition iff it is.

    ``subplan`` is one way to do it (the first in order), ``subplans`` their number.
    """

    subplan: tuple[str | None, ...] | None
    subplans: int

    def __bool__(self) -> bool:
        return self.subplan is not None


@dataclass(eq=False, repr=False, slots=True)
class _State:
    """A state of the automaton of the own subplans that are open; it has no cycles.

    ``step`` steps or events are done there; ``known`` are the facts that are true (True) or may be
    true (None).  ``moves`` lead on by what is done (None: idle; sorted, idling first), to states by
    their numbers; ``left`` is the number of subplans from here on.
    """

    step: int
    known: Mapping[str, bool | None]
    moves: dict[str | None, int] = field(default_factory=dict)
    left: int = 1


class Monitor:
    """Follows one robot through its choices.

    >>> monitor = Monitor.read("choices.json", "r1")        # doctest: +SKIP
    >>> monitor.allowed()                                   # doctest: +SKIP
    (None, '(move r1 a b)')
    >>> monitor.did("(move r1 a b)")                        # doctest: +SKIP

    ``data`` is that of a choices file, ``robot`` whose choices, needed where the file has several.
    Raises `MonitorError` for data that is no choices file, or that contradicts itself.
    """

    #: What the robot's subplans are made of.
    unit: ClassVar[Literal["step", "event"]] = "step"

    def __init__(self, data: Mapping[str, Any], robot: str | None = None) -> None:
        if not isinstance(data, Mapping) or data.get("format") != FORMAT:
            raise MonitorError(f'expected a choices file: {{"format": "{FORMAT}", ..}}')
        version = data.get("version")
        if not _is_number(version) or version != VERSION:
            raise MonitorError(
                f"choices file version {_shown(version)}; this program reads version {VERSION}"
            )
        _check(data, _FILE, "the file")
        entry = _entry(data["choices"], robot)
        if ("passings" in entry) != isinstance(self, EventMonitor):
            kind = "an EventMonitor" if "passings" in entry else "a Monitor"
            raise MonitorError(f"the choices in this file are for {kind}")
        self.robot, self.sentence = entry["robot"], data["sentence"]
        where = f"the choices of {self.robot}"
        _check(entry, _CHOICES, where)
        #: "exact": known over every combination of the robots' choices; "own": from own subactions
        #: alone.
        self.atoms = entry["atoms"]
        if self.atoms not in ("exact", "own"):
            raise _broken(f"{where}: 'atoms' is {_shown(self.atoms)}, not exact or own")
        facts, others = entry["facts"], entry["others"]
        #: Every atom, and what is known of it in a state that does not mention it.
        self._atoms = {**dict.fromkeys(facts, False), **dict.fromkeys(sorted(others))}
        if len(self._atoms) < len(facts) + len(others):
            raise _broken(f"{where}: an atom occurs twice in 'facts' and 'others'")
        for number, state in enumerate(entry["states"]):
            _check(state, _STATE, f"state {number}")
        #: What the file says that the robot may do, as it is written there -> the subaction.
        self._written = {IDLE: IDLE, **self._read_events(entry, where)}
        self._states = _read_states(entry, self._written)
        self._most = max(MAX_NODES, _NODES_OF_STATE * len(self._states))
        self._here = self._states[0]
        self._has_promised = False

    def _read_events(self, entry: Mapping[str, Any], where: str) -> dict[str, str]:
        """Read what events are, where there are no steps: their subactions."""
        return {}

    @classmethod
    def read(cls, path: str, robot: str | None = None, *, max_bytes: int = MAX_BYTES) -> Self:
        """The monitor of a choices file, compressed or not, of at most ``max_bytes`` bytes.

        Raises `MonitorError` for a larger one and for a file that is no choices file, whatever it
        is; `OSError` where it cannot be opened or read.
        """
        try:
            return cls(_parsed(path, max_bytes), robot)
        except MemoryError:
            pass  # raised below, where the memory of what was read is free again
        raise MonitorError(f"{path}: it does not fit into the memory")

    def copy(self) -> Self:
        """A monitor of its own in the same place, for trying things out; constant time."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        return other

    def after(self, subaction: str | None) -> Self:
        """A monitor of its own that has done this, whatever it would have to wait for."""
        other = self.copy()
        Monitor.did(other, subaction)
        return other

    @property
    def step(self) -> int:
        """How many steps are done; or events, and when it has finished all steps of the plans."""
        return self._here.step

    @property
    def finished(self) -> bool:
        """Whether the robot has done all its steps."""
        return not self._here.moves

    @property
    def remaining(self) -> int:
        """How many own subplans are left, of those that keep every promise."""
        return self._here.left

    def allowed(self) -> tuple[str | None, ...]:
        """What the robot may do next, sorted, idling (None) first; nothing when it has finished."""
        return tuple(self._here.moves)

    def did(self, subaction: str | None) -> None:
        """Tell what the robot did in this step, as ``(move r1 a b)``; None or ``idle`` for idling.

        Raises `NotAllowed`, and is then as it was before.
        """
        text = self._own(subaction)
        if text not in self._here.moves:
            raise NotAllowed(self, text)
        self._here = self._states[self._here.moves[text]]

    def _own(self, subaction: str | None) -> str | None:
        """What the robot does as it is written in the file; None for idling."""
        is_written = isinstance(subaction, str) and subaction in self._written
        plain = subaction if is_written else _plain(subaction)
        return None if plain == IDLE else plain

    def known(self, atom: str) -> bool | None:
        """Whether an atom is true now, whatever the others did; None if that depends on them."""
        text = _plain(atom)
        self._check_atom(text)
        return self._value(self._here, text)

    def can(
        self, *, visit: Texts = (), avoid: Texts = (), do: Texts = (), never: Texts = ()
    ) -> Answer:
        """Whether a detour can still be had, all of it, promises kept: ``can(visit="(at r1 c)")``.

        ``visit``: atoms, each known to be true in the present or in some later state.  ``avoid``:
        atoms known to be false in the present and in every later state.  ``do``: patterns of own
        subactions, each done at least once from now on; ``never``: patterns that are not done any
        more.  In a pattern ``*`` stands for any text, ``(move r1 * c3)``; ``idle`` is idling.
        *Known* means: whatever the others choose.

        O(automaton * 2^(visits and dos)), of the steps still to be done.  (With any number of
        visits the question is NP-complete.)  Raises `MonitorError` beyond `MAX_NODES` nodes.
        """
        found = self._making(visit, avoid, do, never)
        if not found:
            return Answer(None, 0)
        at, subplan = found[0], []
        while at.moves:
            text, to = next(iter(at.moves.items()))
            at = found[to]
            subplan.append(text)
        return Answer(tuple(subplan), found[0].left)

    def commit(
        self, *, visit: Texts = (), avoid: Texts = (), do: Texts = (), never: Texts = ()
    ) -> None:
        """Promise a detour: from now on only what keeps the promise is allowed.

        As much work as `can`.  Raises `NotPossible`, and is then as it was before.
        """
        found = self._making(visit, avoid, do, never)
        if not found:
            kept = " together with what was promised before" if self._has_promised else ""
            raise NotPossible(
                f"{self.unit} {self.step + 1}: {self.robot} has no subplan left for this{kept}"
            )
        self._has_promised = True
        self._states, self._here = found, found[0]

    def _making(self, *detour: Texts) -> list[_State]:
        """The subplans from here on that make a detour and keep the promises; nothing if none do.

        Its states are pairs: one that was open, and the parts of the detour that are made by then
        (bits: `_EXCLUDED`, the visits, then the dos).  The present comes first.
        """
        visit, avoid, do, never = map(_texts, detour)
        for atom in (*visit, *avoid):
            self._check_atom(atom)
        made_in = cache(partial(self._made_in, visit, avoid))
        made_by = cache(partial(_made_by, do, never, 1 + len(visit)))
        whole = (1 << 1 + len(visit) + len(do)) - 1 - _EXCLUDED
        pairs, found = [(self._here, made_in(self._here))], list[_State]()
        number = {pairs[0]: 0}
        for state, before in pairs:  # which grow meanwhile
            is_way = not state.moves and before == whole
            found.append(_State(state.step, state.known, left=int(is_way)))
            for text, to in state.moves.items():
                there = self._states[to]
                made = before | made_by(self._written[text or IDLE]) | made_in(there)
                if made & _EXCLUDED:
                    continue
                if (there, made) not in number:
                    number[there, made] = len(pairs)
                    pairs.append((there, made))
                found[-1].moves[text] = number[there, made]
            if len(pairs) > self._most:
                raise MonitorError(
                    f"{len(visit) + len(do)} visits and dos at once are too many here: there are "
                    f"more than {self._most:,} ways to have made some of them; ask for fewer"
                )
        _keep_ways(found)
        return found if found[0].left else []

    def _made_in(self, visit: Sequence[str], avoid: Sequence[str], state: _State) -> int:
        """The visits made in a state, as bits from 1 on; `_EXCLUDED` if it is to be avoided."""
        if any(self._value(state, atom) is not False for atom in avoid):
            return _EXCLUDED
        return sum(1 << bit for bit, atom in enumerate(visit, 1) if self._value(state, atom))

    def _value(self, state: _State, atom: str) -> bool | None:
        return state.known.get(atom, self._atoms[atom])

    def _check_atom(self, atom: str) -> None:
        if atom in self._atoms:
            return
        head = _head(atom)
        alike = [text for text in self._atoms if _head(text) == head]
        if alike:
            more = " .." if len(alike) > _SHOWN else ""
            similar = f"there are {', '.join(alike[:_SHOWN])}{more}"
        else:
            similar = f"none is ({_shown(head)} ..)"
        raise MonitorError(f"{_shown(atom)} is no atom that can change: {similar}")


class EventMonitor(Monitor):
    """Follows a robot that keeps no common step with the others.

    What it may do are events, subactions with what they wait for: ``(move r1 a b) (after-1 r2)``.
    The robot chooses one of those that are `allowed` (None: no more), says `start` when nothing is
    `missing`, and `did` when it has ended; until then no other one is allowed, and what it changes
    is not known.  It says what it observes of the others: what has `ended`, and who is `ready` for
    a meeting.

    Parameters and errors are those of `Monitor`.
    """

    unit = "event"

    def __init__(self, data: Mapping[str, Any], robot: str | None = None) -> None:
        super().__init__(data, robot)
        # Replaced and not changed, so that copies stay as they are: how many events were observed
        # of each robot, how often what has ended ("": of the own robot), and who waits for its
        # partners in what.
        self._observed: dict[str, int] = dict.fromkeys(self._others, 0)
        self._ended: dict[tuple[str, str], int] = {}
        #: Of each robot that is ready for a meeting what it will do, and as which of its events.
        self._ready: dict[str, tuple[str, int]] = {}
        self._underway: str | None = None

    def _read_events(self, entry: Mapping[str, Any], where: str) -> dict[str, str]:
        _check(entry, {"passings": dict}, where)
        record = entry["passings"]
        _check(record, _PASSINGS, where)
        #: Own subaction -> other robot -> its subactions that interfere with it.
        self._interferes: dict[str, dict[str, list[str]]] = record["interferes"]
        #: For each other robot what its events may be, and how many own ones they wait for.
        self._others: dict[str, list[dict[str, int]]] = record["others"]
        #: What an event does, how many of each robot it waits for, and whom it meets in what.
        self._events: dict[str, dict[str, Any]] = record["events"]
        for text, event in self._events.items():
            _check(event, _EVENT, f"event {_shown(text)}")
            if lost := (event["after"].keys() | event["with"].keys()) - self._others.keys():
                raise _broken(f"event {_shown(text)} waits for {_shown(min(lost))}: no such robot")
        for number, state in enumerate(entry["states"]):
            for text in state["next"]:
                if text != IDLE and text not in self._events:
                    raise _broken(f"state {number}: 'events' lacks {_shown(text)}")
        return {text: own["subaction"] for text, own in self._events.items() if text != IDLE}

    @property
    def finished(self) -> bool:
        """Whether there is no event that the robot may do."""
        return not any(self._here.moves)

    def subaction(self, event: str) -> str:
        """What is done in an event."""
        return str(self._event(event)["subaction"])

    def partners(self, event: str) -> tuple[str, ...]:
        """The robots that an event meets."""
        return tuple(self._event(event)["with"])

    def concerns(self, event: str) -> tuple[str, ...]:
        """The robots that may wait for an own event, and so should be told when it has ended."""
        waiting = self._interferes.get(self.subaction(event), {})
        return tuple(sorted(robot for robot, texts in waiting.items() if texts))

    def missing(self, event: str | None) -> dict[str, int | str]:
        """What an allowed event still waits for; nothing: it may start.

        By robot the number of its events that must end, or the subaction that it must be ready to
        start together with this one.
        """
        event = self._own(event)
        if event not in self.allowed():
            raise NotAllowed(self, event)
        if event is None or event == self._underway:
            return {}
        own = self._events[event]
        found: dict[str, int | str] = {
            robot: its
            for robot, its in own["with"].items()
            if self._ready.get(robot, ("", 0))[0] != its
        }
        for robot, number in own["after"].items():
            texts = {*self._interferes.get(own["subaction"], {}).get(robot, ())}
            if (left := number - sum(self._ended.get((robot, text), 0) for text in texts)) > 0:
                found[robot] = left
        return found

    def free(self) -> tuple[str | None, ...]:
        """The allowed events that wait for no event of another robot, but perhaps for partners."""
        return tuple(
            event
            for event in self.allowed()
            if all(isinstance(its, str) for its in self.missing(event).values())
        )

    def may_start(self) -> tuple[str | None, ...]:
        """The allowed events that may start now; None: the robot may do no more."""
        return tuple(event for event in self.allowed() if not self.missing(event))

    def late(self) -> tuple[str, ...]:
        """The robots that every allowed event waits for."""
        waits = [{*self.missing(event)} for event in self.allowed()]
        return tuple(sorted(set.intersection(*waits))) if waits else ()

    def start(self, event: str) -> None:
        """Tell that an own event starts.  Raises `NotAllowed`, and `NotPossible` while it waits."""
        if missing := self.missing(event):
            waits = " and ".join(
                f"{its} of {robot}" if isinstance(its, str) else f"{its} more of {robot}"
                for robot, its in missing.items()
            )
            raise NotPossible(f"{self.robot} cannot start {event}: it waits for {waits}")
        text = self._own(event)
        if text is None or text == self._underway:
            return
        here, to = self._here, self._states[self._here.moves[text]]
        # Until it has ended nothing else may be promised, and what it changes may be either.
        values = {atom: self._value(here, atom) for atom in here.known.keys() | to.known.keys()}
        known = {a: v if v is self._value(to, a) else None for a, v in values.items()}
        self._here = _State(here.step, known, {text: here.moves[text]}, to.left)
        self._underway = text
        self._forget_ready(self._events[text]["with"])  # not for the next meeting

    def did(self, subaction: str | None) -> None:
        """Tell that the event under way has ended; None: the robot does no more.

        Raises `NotAllowed`, and `NotPossible` for an event that was not started.
        """
        event = self._own(subaction)
        if event and event in self.allowed() and event != self._underway:
            raise NotPossible(f"{self.robot} cannot have done {event}: it has not started it")
        super().did(event)
        while self.finished and self._here.moves:
            super().did(None)
        if self._underway:
            self._count("", self._events[self._underway]["subaction"])
        self._underway = None

    def ended(self, robot: str, subaction: str, number: int) -> None:
        """Tell that an event of another robot was observed to end: its ``number``, from 1.

        Events that interfere with none of the robot's own need not be told.  Raises `MonitorError`
        for a robot that there is not, and `NotPossible` for what cannot have happened: an event
        that was told before or has another number, or waits for own events.
        """
        may_be = self._events_of(robot)
        text = _plain(subaction)
        if not _is_number(number):
            raise MonitorError(f"events are numbered from 1: {_shown(number)} is no such number")
        what = f"{robot} cannot have done {text} as its event {_shown(number)}"
        if not self._observed[robot] < number <= len(may_be):
            told = f"{self._observed[robot]} of {len(may_be)} were told before"
            raise NotPossible(f"{what}: {told}")
        if text not in may_be[number - 1]:
            could = " or ".join([*may_be[number - 1]][:_SHOWN]) or "nothing"
            raise NotPossible(f"{what}: that is {could}")
        waits_for = (own for own, its in self._interferes.items() if text in its.get(robot, ()))
        if may_be[number - 1][text] > sum(self._ended.get(("", own), 0) for own in waits_for):
            raise NotPossible(f"{what}: it waits for {self.robot}")
        self._observed = {**self._observed, robot: number}
        if self._ready.get(robot, ("", 0))[1] <= number:
            self._forget_ready([robot])
        self._count(robot, text)

    def ready(self, robot: str, subaction: str, number: int = 0) -> None:
        """Tell that another robot is ready to start this together with an own event.

        It is so until its event ``number``, from 1, is told to have ended; 0: until any is.
        """
        self._events_of(robot)
        self._ready = {**self._ready, robot: (_plain(subaction), number)}

    def _forget_ready(self, robots: Iterable[str]) -> None:
        self._ready = {name: its for name, its in self._ready.items() if name not in robots}

    def _event(self, event: str) -> dict[str, Any]:
        if event not in self._events:
            raise MonitorError(f"{_shown(event)} is no event of {self.robot}")
        return self._events[event]

    def _events_of(self, robot: str) -> Sequence[Mapping[str, int]]:
        if robot not in self._others:
            names = ", ".join(self._others) or "none"
            raise MonitorError(f"there is no robot {_shown(robot)} beside {self.robot}: {names}")
        return self._others[robot]

    def _count(self, robot: str, ended: str) -> None:
        self._ended = self._ended | {(robot, ended): self._ended.get((robot, ended), 0) + 1}


def drawn(monitor: Monitor, random: Random, allowed: Sequence[str | None]) -> str | None:
    """Draw what to do next: each own subplan that is left has the same probability."""
    left = [monitor.after(subaction).remaining for subaction in allowed]
    return allowed[bisect_right([*accumulate(left)], random.randrange(sum(left)))]


def _made_by(do: Sequence[str], never: Sequence[str], first: int, text: str) -> int:
    """The dos that a subaction makes, as bits from ``first`` on; `_EXCLUDED` if it is forbidden."""
    if any(_matches(pattern, text) for pattern in never):
        return _EXCLUDED
    return sum(1 << bit for bit, pattern in enumerate(do, first) if _matches(pattern, text))


def _keep_ways(states: Sequence[_State]) -> None:
    """Leave out the moves that lead to no end, and count the subplans; ends have one each."""
    for state in reversed(states):
        state.moves = {text: to for text, to in state.moves.items() if states[to].left}
        state.left += sum(states[to].left for to in state.moves.values())


def _head(atom: str) -> str:
    return atom.strip("()").split(" ")[0]


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


def _is_number(value: object) -> bool:
    """Whether a value is a whole number; to Python true and false are, too."""
    return isinstance(value, int) and not isinstance(value, bool)


def _check(record: object, shapes: Mapping[str, Any], where: str) -> None:
    """Raise `MonitorError` unless a record has these keys, with values of these shapes."""
    if not isinstance(record, Mapping):
        raise _broken(f"{where} is {_shown(record)}, not an object")
    for key, shape in shapes.items():
        if key not in record:
            raise _broken(f"{where}: '{key}' is missing")
        _check_shape(record[key], shape, where, key)


def _check_shape(value: Any, shape: Any, where: str, *keys: str) -> None:
    """Check a value behind keys, of which the first and the last one are named.

    Its shape is a type; `_PDDL`, for a text as `_plain` makes it; [that of each]; or {that of each
    key: that of each value}.
    """
    if shape is _PDDL:
        _check_plain(value, f"{where}: '{keys[0]}'")
        return
    kind: Any = shape if isinstance(shape, type) else type(shape)
    if not isinstance(value, kind) or isinstance(value, bool):
        at = ": ".join(map("'{}'".format, map(_shown, keys)))
        raise _broken(f"{where}: {at} is {_shown(value)}, not {_KINDS.get(kind, 'a count')}")
    if kind is str and not value.isprintable():
        raise _broken(f"{where}: '{keys[0]}' holds control characters: {_shown(value)}")
    if kind is not shape:
        (of_each,) = shape
        for inner in value:
            _check_shape(inner, of_each, where, *keys)
            if kind is dict:
                _check_shape(value[inner], shape[of_each], where, keys[0], inner)


def _check_plain(text: Any, where: str) -> None:
    if not isinstance(text, str) or not text.isprintable() or plain_text(text) != text:
        raise _broken(f"{where} has {_shown(text)} in place of {_PDDL}")


def _entry(choices: Iterable[Any], robot: str | None) -> Mapping[str, Any]:
    entries: dict[str, Mapping[str, Any]] = {}
    for entry in choices:
        _check(entry, {"robot": str}, "a robot's choices")
        name = entry["robot"]
        if name in entries:
            raise _broken(f"it has the choices of {_shown(name)} twice")
        entries[name] = entry
    chosen = list(entries) if robot is None else [robot]
    if len(chosen) == 1 and chosen[0] in entries:
        return entries[chosen[0]]
    names = ", ".join(map(_shown, list(entries)[:_SHOWN])) or "no robot"
    names += " .." if len(entries) > _SHOWN else ""
    if robot is None:
        raise MonitorError(f"whose choices? The file has those of {names}")
    raise MonitorError(f"the file has no choices of {_shown(robot)}; it has those of {names}")


def _read_states(entry: Mapping[str, Any], written: dict[str, str]) -> list[_State]:
    """The states of a file, read backwards; 0 is the start.

    ``written`` has texts that are known to be well written, and gets all others.  Raises
    `MonitorError` unless every state can be reached from state 0 in step 0 and leads to later
    states of the next step, so that there are no cycles, all subplans have one length, and the
    counts of subplans agree: these never take much more memory than those in the file.
    """
    records, states = entry["states"], dict[int, _State]()
    if not records or records[0]["step"] != 0:
        raise MonitorError("the automaton has no state 0 in step 0")
    reached, last = {0}, max(record["step"] for record in records)
    for number in reversed(range(len(records))):
        record, step = records[number], records[number]["step"]
        moves = _moves(record, number, step + 1, states, written)
        reached.update(moves.values())
        if bool(moves) != (step < last):
            raise MonitorError(f"state {number} ends after {step} of {last} steps")
        left = sum(states[to].left for to in moves.values()) or 1
        _check_count(record["left"], left, f"state {number}")
        states[number] = _State(step, _known(record, entry["facts"], number), moves, left)
    if lost := states.keys() - reached:
        raise MonitorError(f"state {min(lost)} cannot be reached from state 0")
    whole = {"steps": last, "subplans": states[0].left, **entry}
    _check(whole, {"steps": int}, "a robot's choices")
    if whole["steps"] != last:
        raise MonitorError(f"'steps' is {_shown(whole['steps'])}, but the states have {last}")
    _check_count(whole["subplans"], states[0].left, "a robot's choices")
    return [*reversed(states.values())]


def _moves(
    record: Any, number: int, step: int, states: Mapping[int, _State], written: dict[str, str]
) -> dict[str | None, int]:
    """What the robot may do in a state, idling first."""
    moves: dict[str | None, int] = {}
    for text, to in record["next"].items():
        if text not in written:
            _check_plain(text, f"state {number}: 'next'")
            written[text] = text
        if not _is_number(to) or to not in states or states[to].step != step:
            raise MonitorError(f"state {number} does not lead to a state of step {step}")
        moves[None if text == IDLE else text] = to
    return dict(sorted(moves.items(), key=lambda move: move[0] or ""))


def _known(record: Mapping[str, Any], facts: Sequence[str], number: int) -> dict[str, bool | None]:
    """The facts that are true, or may be true, in a state of a file."""
    found: dict[str, bool | None] = {}
    for key, value in (("true", True), ("unknown", None)):
        for fact in record[key]:
            if not _is_number(fact) or not 0 <= fact < len(facts):
                raise _broken(
                    f"state {number}: '{key}' has {_shown(fact)}; "
                    f"facts are numbers below {len(facts)}"
                )
            if found.setdefault(facts[fact], value) is not value:
                raise MonitorError(f"state {number} says that fact {fact} is true and unknown")
    return found


def _check_count(said: Any, count: int, where: str) -> None:
    """Raise unless a count in the file, a number or above 2^53 its digits, is this one."""
    is_digits = isinstance(said, str) and re.fullmatch("[1-9][0-9]*", said)
    # A `Decimal` is exact, and unlike `int` not limited to some digits.
    if not (is_digits or _is_number(said)) or Decimal(said) != count:
        number = str(count) if count.bit_length() < 256 else f"about 2^{count.bit_length()}"
        raise MonitorError(f"{where} says {_shown(said)} subplans are left, but there are {number}")


def _texts(value: Texts) -> tuple[str, ...]:
    several = [value] if value is None or isinstance(value, str) else value
    return tuple(map(_plain, several))


def _plain(text: str | None) -> str:
    """PDDL text in lower case with single spaces; raises `MonitorError` for anything else."""
    if text is None:
        return IDLE
    plain = plain_text(text) if isinstance(text, str) else None
    if plain is None:
        raise MonitorError(
            f"'{_shown(text)}' is no PDDL text such as (move r1 a b), and not 'idle'"
        )
    return plain


def plain_text(text: str) -> str | None:
    """PDDL text in lower case with single spaces, or ``idle``; None for anything else."""
    plain = _AROUND_PARENTHESES.sub(r"\1", " ".join(text.lower().split()))
    return plain if plain == IDLE or _PDDL_TEXT.fullmatch(plain) else None


def _matches(pattern: str, text: str) -> bool:
    """Whether a text is the pattern, in which every * stands for any text."""
    return fnmatchcase(text, re.sub(r"[?[]", r"[\g<0>]", pattern))


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
