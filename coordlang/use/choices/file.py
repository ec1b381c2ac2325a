"""Choices files: robots' choices as JSON (docs/formats.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from coordlang.tasks.candidates import describe
from coordlang.use.choices.automaton import Automaton
from coordlang.use.choices.choices import Choices, RobotChoices
from coordlang.use.choices.monitor import FORMAT, IDLE, VERSION, Monitor
from coordlang.use.choices.record import ChoicesFile, RobotRecord, StateRecord
from planners.search.plan_file import json_count
from planners.search.plans import Plans


def to_record(choices: Choices, robots: Sequence[int] | None = None) -> ChoicesFile:
    """The content of a choices file, of all robots or of those with these numbers."""
    task_language = choices.task_language
    chosen = choices.robots if robots is None else [choices.robots[robot] for robot in robots]
    return ChoicesFile(
        format=FORMAT,
        version=VERSION,
        domain=dict(task_language.language.provenance.domain) if task_language.language else {},
        robots=list(task_language.model.robots),
        task=describe(task_language.space, task_language.task),
        sentence=task_language.text(choices.words),
        plans=json_count(Plans.of(choices.fits).count),
        covered=task_language.covered,
        guaranteed=choices.guaranteed,
        combinations_walked=choices.mixtures.nodes if choices.mixtures is not None else None,
        choices=[_robot(choices, own) for own in chosen],
    )


def to_data(choices: Choices, robots: Sequence[int] | None = None) -> dict[str, Any]:
    """The data of a choices file, of all robots or of those with these numbers."""
    data: dict[str, Any] = msgspec.to_builtins(to_record(choices, robots))
    return data


def to_bytes(choices: Choices, robots: Sequence[int] | None = None) -> bytes:
    """The text of a choices file: the same choices give the same bytes."""
    return msgspec.json.encode(to_record(choices, robots)) + b"\n"


def monitor(choices: Choices, robot: str) -> Monitor:
    """A run-time monitor of one robot's choices.

    Raises `coordlang.use.choices.monitor.MonitorError` for an unknown robot.
    """
    names = choices.task_language.model.robots
    return Monitor(to_data(choices, [names.index(robot)] if robot in names else None), robot)


def _robot(choices: Choices, own: RobotChoices) -> RobotRecord:
    model, automaton = choices.task_language.model, own.automaton
    ever = 0
    for true, possible in automaton.known:
        ever |= true | ~possible
    texts = model.codec.facts.texts
    facts = [bit for bit in range(len(texts)) if ever >> bit & 1]
    number = {bit: n for n, bit in enumerate(facts)}
    steps = [step for step, states in enumerate(automaton.layers) for _ in states]
    return RobotRecord(
        robot=model.robots[own.robot],
        steps=len(automaton.layers) - 1,
        subplans=json_count(automaton.count),
        atoms=own.atoms,
        facts=[texts[bit] for bit in facts],
        others=[text for bit, text in enumerate(texts) if bit not in number],
        states=[
            _state(automaton, state, step, model.labels[own.robot], number)
            for state, step in enumerate(steps)
        ],
    )


def _state(
    automaton: Automaton, state: int, step: int, labels: Sequence[str], number: Mapping[int, int]
) -> StateRecord:
    """One state; ``number`` are the numbers of facts in the file, by their number in the model."""
    true, possible = automaton.known[state]
    return StateRecord(
        step=step,
        left=json_count(automaton.left[state]),
        next={labels[label] if label else IDLE: to for label, to in automaton.moves(state)},
        true=[n for bit, n in number.items() if true >> bit & 1],
        unknown=[n for bit, n in number.items() if possible >> bit & ~true >> bit & 1],
    )
