# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's choices at run time.

What may it do next, and are the detours that it wants still possible?

This file needs Python's standard library and nothing else, so that a robot can carry it: copy it
beside a choices file (docs/formats.md), which ``coordlang choices --format json`` writes.  Neither
PDDL nor a planner is needed then.
"""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, fields
from typing import Any

FORMAT = "coordlang/choices"
VERSION = 1
IDLE = "idle"

#: Where a monitor is: a state of the automaton, and which parts of the detour are made already
#: (bits).
Progress = tuple[int, int]

#: One text or several; None is idling.
Texts = str | Iterable[str | None] | None


class MonitorError(ValueError):
    """A choices file that is none, a robot or an atom that it does not have."""


class NotAllowed(MonitorError):
    """The robot did what it may not do.

    ``step`` counts from 0, ``allowed`` are what it could have done (None: idle).
    """

    def __init__(
        self, robot: str, did: str | None, step: int, allowed: Sequence[str | None]
    ) -> None:
        could = " or ".join(text or IDLE for text in allowed)
        may = f"it may do {could}" if allowed else "all its steps are done"
        super().__init__(f"step {step + 1}: {robot} may not do {did or IDLE}; {may}")
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
        try:
            _check_moves(entry["states"])
            self._load(data["sentence"], entry)
            _check_counts(
                entry["states"],
                [self._left.get((state, 0)) for state in range(len(entry["states"]))],
            )
        except (KeyError, TypeError, IndexError, AttributeError) as error:
            raise MonitorError(
                f"this is no choices file: {type(error).__name__}: {error}"
            ) from None

    def _load(self, sentence: str, entry: Mapping[str, Any]) -> None:
        self.robot: str = entry["robot"]
        self.sentence = sentence
        #: "exact": known over every combination of the robots' choices; "own": from own subactions
        #: alone.
        self.atoms: str = entry["atoms"]
        self._facts: dict[str, int] = {text: number for number, text in enumerate(entry["facts"])}
        self._others: frozenset[str] = frozenset(entry["others"])
        states = entry["states"]
        self._next: list[dict[str | None, int]] = [
            {
                None if text == IDLE else text: to
                for text, to in sorted(state["next"].items(), key=_idle_first)
            }
            for state in states
        ]
        self._true: list[frozenset[int]] = [frozenset(state["true"]) for state in states]
        self._unknown: list[frozenset[int]] = [frozenset(state["unknown"]) for state in states]
        self._history: tuple[str | None, ...] = ()
        self._promised = Detour()
        self._progress: Progress = (0, 0)
        self._left = self._counts(self._promised, self._progress)

    @classmethod
    def read(cls, path: str, robot: str | None = None) -> Monitor:
        """The monitor of a choices file (compressed or not)."""
        with open(path, "rb") as file:
            text = file.read()
        try:
            data = json.loads(gzip.decompress(text) if text[:2] == b"\x1f\x8b" else text)
        except (ValueError, OSError, EOFError) as error:
            raise MonitorError(f"{path}: this is no JSON, or it is cut off: {error}") from None
        return cls(data, robot)

    def copy(self) -> Monitor:
        """A monitor of its own in the same place, for trying things out."""
        return copy(self)

    @property
    def step(self) -> int:
        """How many steps are done."""
        return len(self._history)

    @property
    def history(self) -> tuple[str | None, ...]:
        """What the robot did, step by step; None is idling."""
        return self._history

    @property
    def finished(self) -> bool:
        """Whether the robot has done all its steps."""
        return not self._next[self._progress[0]]

    @property
    def remaining(self) -> int:
        """How many own subplans are left, of those that keep every promise."""
        return self._left[self._progress]

    @property
    def promised(self) -> Detour:
        """Everything that `commit` was called with."""
        return self._promised

    def allowed(self) -> tuple[str | None, ...]:
        """What the robot may do next (None: idle), sorted, idling first.

        Nothing when it has finished.
        """
        return tuple(text for text, _ in self._moves(self._promised, self._left, self._progress))

    def did(self, subaction: str | None) -> None:
        """Tell what the robot did in this step, as ``(move r1 a b)``; None or ``idle`` for idling.

        Raises `NotAllowed`, and is then as it was before.
        """
        text = _subaction(subaction)
        for own, after in self._moves(self._promised, self._left, self._progress):
            if own == text:
                self._progress = after
                self._history = (*self._history, text)
                return
        raise NotAllowed(self.robot, text, self.step, self.allowed())

    def known(self, atom: str) -> bool | None:
        """Whether an atom is true now, whatever the others did; None if that depends on them."""
        text = _plain(atom)
        fact = self._facts.get(text)
        if fact is None and text not in self._others:
            raise MonitorError(f"{text} is no atom that can change: {self._similar(text)}")
        state = self._progress[0]
        if fact is None or fact in self._unknown[state]:
            return None
        return fact in self._true[state]

    def can(self, detour: Detour | None = None, /, **wanted: Texts) -> Answer:
        """Whether all this can still be had at once, promises kept.

        ``can(visit="(at r1 c)", never="idle")``; see `Detour`.

        O(automaton * 2^(visits and dos)).
        """
        whole = self._promised & (detour or Detour()) & Detour.of(**wanted)
        self._check_atoms(whole)
        progress = self._enter(whole, *self._progress)
        left = self._counts(whole, progress) if progress else {}
        if progress is None or not left[progress]:
            return Answer(None, 0)
        start, subplan = progress, []
        while self._next[progress[0]]:
            text, progress = self._moves(whole, left, progress)[0]
            subplan.append(text)
        return Answer(tuple(subplan), left[start])

    def commit(self, detour: Detour | None = None, /, **wanted: Texts) -> None:
        """Promise it: from now on only what keeps the promise is allowed.

        Raises `NotPossible`, and is then as it was before.
        """
        if not self.can(detour, **wanted):
            kept = " together with what was promised before" if self._promised != Detour() else ""
            raise NotPossible(
                f"step {self.step + 1}: {self.robot} has no subplan left for this{kept}"
            )
        self._promised = self._promised & (detour or Detour()) & Detour.of(**wanted)
        progress = self._enter(self._promised, *self._progress)
        assert progress is not None
        self._progress = progress
        self._left = self._counts(self._promised, progress)

    def _enter(self, detour: Detour, state: int, kept: int) -> Progress | None:
        """The progress in a state; None if the detour avoids the state."""
        true, unknown = self._true[state], self._unknown[state]
        for atom in detour.avoid:
            fact = self._facts.get(atom)
            if fact is None or fact in true or fact in unknown:
                return None
        for bit, atom in enumerate(detour.visit):
            if self._facts.get(atom) in true:
                kept |= 1 << 2 * bit
        return state, kept

    def _after(self, detour: Detour, progress: Progress, text: str | None) -> Progress | None:
        """The progress after one subaction; None if the detour forbids it."""
        state, kept = progress
        if any(_matches(pattern, text) for pattern in detour.never):
            return None
        for bit, pattern in enumerate(detour.do):
            if _matches(pattern, text):
                kept |= 2 << 2 * bit
        return self._enter(detour, self._next[state][text], kept)

    def _counts(self, detour: Detour, start: Progress) -> dict[Progress, int]:
        """How many subplans make the detour, from ``start`` on and from all progress after it."""
        made = [1 << 2 * bit for bit in range(len(detour.visit))]
        made += [2 << 2 * bit for bit in range(len(detour.do))]
        whole = sum(made)
        after = self._all_after(detour, start)
        left: dict[Progress, int] = {}
        for progress in reversed(after):
            state, kept = progress
            if self._next[state]:
                left[progress] = sum(left[to] for to in after[progress])
            else:
                left[progress] = int(kept == whole)
        return left

    def _all_after(self, detour: Detour, start: Progress) -> dict[Progress, list[Progress]]:
        """Where subactions lead that the detour does not forbid, step by step from ``start`` on."""
        after: dict[Progress, list[Progress]] = {}
        layer = [start]
        while layer:
            for progress in layer:
                moves = (self._after(detour, progress, text) for text in self._next[progress[0]])
                after[progress] = [to for to in moves if to is not None]
            layer = list(dict.fromkeys(to for progress in layer for to in after[progress]))
        return after

    def _moves(
        self, detour: Detour, left: Mapping[Progress, int], progress: Progress
    ) -> list[tuple[str | None, Progress]]:
        """The subactions that still lead to the end, with the progress after each."""
        found = []
        for text in self._next[progress[0]]:
            after = self._after(detour, progress, text)
            if after is not None and left[after]:
                found.append((text, after))
        return found

    def _check_atoms(self, detour: Detour) -> None:
        for atom in (*detour.visit, *detour.avoid):
            if atom not in self._facts and atom not in self._others:
                raise MonitorError(f"{atom} is no atom that can change: {self._similar(atom)}")

    def _similar(self, atom: str) -> str:
        head = atom.strip("()").split(" ")[0]
        alike = [
            text
            for text in (*self._facts, *sorted(self._others))
            if text.strip("()").split(" ")[0] == head
        ]
        if not alike:
            return f"none is ({head} ..)"
        more = " .." if len(alike) > 8 else ""
        return f"there are {', '.join(alike[:8])}{more}"


def _entry(data: Any, robot: str | None) -> Any:
    """The choices of one robot in the data of a choices file."""
    if not isinstance(data, Mapping) or data.get("format") != FORMAT:
        raise MonitorError(f'expected a choices file: {{"format": "{FORMAT}", ..}}')
    if data.get("version") != VERSION or data.get("version") is True:
        raise MonitorError(
            f"choices file version {data.get('version')!r}; this program reads version {VERSION}"
        )
    try:
        entries = {entry["robot"]: entry for entry in data["choices"]}
        names = ", ".join(map(str, entries))
    except (KeyError, TypeError, AttributeError) as error:
        raise MonitorError(f"this is no choices file: {type(error).__name__}: {error}") from None
    if robot is not None:
        if robot not in entries:
            raise MonitorError(f"the file has no choices of {robot}; it has those of {names}")
        return entries[robot]
    if len(entries) != 1:
        raise MonitorError(f"whose choices? The file has those of {names}")
    return next(iter(entries.values()))


def _check_moves(states: Sequence[Mapping[str, Any]]) -> None:
    """Raise unless there are states and every one leads to states of the next step.

    From state 0 in step 0.
    """
    if not states or states[0]["step"] != 0:
        raise MonitorError("the automaton has no state 0 in step 0")
    for number, state in enumerate(states):
        for to in state["next"].values():
            if (
                isinstance(to, bool)
                or not number < to < len(states)
                or states[to]["step"] != state["step"] + 1
            ):
                raise MonitorError(
                    f"state {number} does not lead to a state of step {state['step'] + 1}"
                )


def _check_counts(states: Sequence[Mapping[str, Any]], left: Sequence[int | None]) -> None:
    """Raise if the states contradict the number of subplans that the file says are left."""
    steps = max(state["step"] for state in states)
    for number, (state, count) in enumerate(zip(states, left, strict=True)):
        if str(state["left"]) != str(count):
            raise MonitorError(
                f"state {number} says {state['left']} subplans are left, but there are {count or 0}"
            )
        if not state["next"] and state["step"] != steps:
            raise MonitorError(f"state {number} ends after {state['step']} of {steps} steps")


def _idle_first(move: tuple[str, int]) -> str:
    return "" if move[0] == IDLE else move[0]


def _texts(value: Texts) -> tuple[str, ...]:
    several = [value] if value is None or isinstance(value, str) else value
    return tuple(IDLE if text is None else _plain(text) for text in several)


def _plain(text: str) -> str:
    """PDDL text in lower case with single spaces; raises `MonitorError` for anything else."""
    plain = re.sub(r"\s*([()])\s*", r"\1", " ".join(text.lower().split()))
    if plain != IDLE and not re.fullmatch(r"\([^()]+\)", plain):
        raise MonitorError(f"{text!r} is no PDDL text such as (move r1 a b), and not 'idle'")
    return plain


def _subaction(text: str | None) -> str | None:
    plain = IDLE if text is None else _plain(text)
    return None if plain == IDLE else plain


def _matches(pattern: str, text: str | None) -> bool:
    if pattern == IDLE or text is None:
        return pattern == IDLE and text is None
    return re.fullmatch("[^()]*".join(map(re.escape, pattern.split("*"))), text) is not None
