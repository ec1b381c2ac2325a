# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot's choices: exactly the subplans that it may follow, whatever the others choose.

The optimal plans with one sentence are RC-free, so a robot's subplans are its parts of those plans,
no more and no fewer.  Choices files have them as JSON (docs/formats.md), which
`coordlang.execution.monitor` reads with Python's standard library only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from operator import and_
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from coordlang.execution.automaton import Atoms, Automaton, Knowledge, determinise, walk_mixtures
from coordlang.execution.monitor import FORMAT, VERSION, EventMonitor, Monitor
from coordlang.execution.task_language import TaskLanguage
from coordlang.language.candidates import describe
from coordlang.language.provenance import tolerance_data
from coordlang.required.miscoordination import Miscoordination
from planners.joint.model import JointModel
from planners.joint.states import bits
from planners.joint.traces import Event, Traces
from planners.search.goals import FactsOf
from planners.search.plan_file import Count, json_count
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans
from planners.system.errors import OutOfMemory
from planners.system.files import FileFormat, doc

#: Combinations of the robots' moves beyond which exact knowledge is not tried by default.
MOST = 2_000_000


@dataclass(frozen=True, slots=True)
class SentenceChoices:
    """All robots' choices under one sentence of one task.

    ``fits`` are the plans with the sentence, ``mixtures`` every combination of the choices, as a
    plan space of one task; None if there are too many to walk, or if some combination is no optimal
    plan, and then ``witness`` shows one.  So many nodes were ``walked``, None: too many.
    """

    task_language: TaskLanguage
    words: tuple[int, ...]
    fits: PlanSpace
    robots: tuple[Automaton, ...]
    mixtures: PlanSpace | None
    witness: Miscoordination | None
    walked: int | None

    @property
    def guaranteed(self) -> bool:
        """Whether every combination is optimal, by a walk of all or by the language's guarantee."""
        return self.witness is None and (self.walked is not None or self.task_language.guaranteed)


def choices(task_language: TaskLanguage, words: Sequence[int], most: int = MOST) -> SentenceChoices:
    """The choices of every robot under a sentence, given by its word numbers.

    What is known in a state is exact (`coordlang.execution.automaton.determinise`) where all
    combinations of choices can be walked with at most ``most`` joint moves and all of them are
    optimal.  Elsewhere, and without a common step, only the atoms are known that the robot's own
    subactions alone change.  Raises `NoPlanFits`, and `OutOfMemory` if the automata do not fit into
    the memory.
    """
    fits, model = task_language.plans_with(words), task_language.model
    subplans = [determinise(fits, robot) for robot in range(len(model.robots))]
    mixtures, witness, walked = None, None, None
    with suppress(MemoryError):
        mixtures, witness, walked = walk_mixtures(task_language, fits, subplans, words, most)
    # Without a common step a node is no state in which a robot is when it has done its events.
    space = None if model.is_asynchronous else mixtures
    facts = [*map(model.codec.fact_bits, fits.rows)] if space else []
    truth = [facts[state] for state in space.state.tolist()] if space else []
    robots = []
    for robot in range(len(subplans)):
        exact = None
        with suppress(OutOfMemory):  # the combinations are checked all the same
            exact = space and determinise(space, robot, truth, most)
        robots.append(exact or knowing_own(fits, robot))
    found = mixtures, witness, walked
    return SentenceChoices(task_language, tuple(words), fits, tuple(robots), *found)


def knowing_own(fits: PlanSpace, robot: int) -> Automaton:
    """A robot's subplans; of what its own subactions alone change it knows the values."""
    model, start = fits.model, int(fits.starts[0])
    facts, changes = own_changes(model, robot)
    others = ((1 << len(model.codec.facts)) - 1) & ~facts
    numbers = range(len(model.labels[robot]))
    by_label = [changes.get(model.subaction_text(robot, label), (0, 0)) for label in numbers]
    true = [0] * len(fits)
    true[start] = facts & model.codec.fact_bits(fits.rows[fits.state[start]])
    edges = fits.sources, fits.robot_labels(robot), fits.targets()
    for node, label, after in np.column_stack(edges)[::-1].tolist():  # from the start down
        adds, deletes = by_label[label]
        true[after] = (true[node] & ~deletes) | adds  # the same on all ways to a node
    automaton = determinise(fits, robot, true)
    known = tuple(Knowledge(own.true, others) for own in automaton.known)
    return replace(automaton, known=known, atoms="own")


def own_changes(model: JointModel, robot: int) -> tuple[int, dict[str | None, tuple[int, int]]]:
    """The facts of which every change is certain from the robot's own label, as bits.

    And by own subaction those of them that it adds, and that it deletes.  Found from the ground
    actions, without regard to what is reachable: no action without this robot changes the fact, no
    conditional effect does, and two (joint) actions with the same own part change it in the same
    way.
    """
    unsure = {*model.slack_facts}  # they change by themselves
    of_part: dict[str | None, FactsOf] = {}
    for action in model.actions:
        facts = FactsOf.of(model, action)
        unsure |= {fact for _, fact, _ in facts.conditional}
        if robot in action.owners:
            first = of_part.setdefault(action.part_of(robot), facts)
            unsure |= (first.adds ^ facts.adds) | (first.deletes ^ facts.deletes)
        else:
            unsure |= facts.adds | facts.deletes
    if model.is_asynchronous and None in of_part:
        idling = of_part.pop(None)  # that others do something meanwhile is no event of it
        unsure |= idling.adds | idling.deletes

    def sure(facts: Iterable[int]) -> int:
        return sum(1 << fact for fact in {*facts} - unsure)

    changes = {part: (sure(facts.adds), sure(facts.deletes)) for part, facts in of_part.items()}
    return sure(range(len(model.codec.facts))), changes


# ---- the file

_Facts = list[Annotated[int, Meta(ge=0)]]


class StateRecord(msgspec.Struct, frozen=True):
    """A state of a robot's automaton; state 0 is the start."""

    step: Annotated[int, doc("The number of steps or events done.", ge=0)]
    left: Annotated[Count, doc("The number of own subplans that lead on from it.")]
    next: Annotated[dict[str, int], doc("What the robot may do now -> the state after that.")]
    true: Annotated[_Facts, doc("Numbers of facts that are certainly true.")]
    unknown: Annotated[_Facts, doc("Numbers of facts that depend on the other robots.")]


class OwnEvent(msgspec.Struct, frozen=True, rename={"meets": "with"}):
    """An event of a robot that keeps no common step with the others."""

    subaction: Annotated[str, doc("What is done.")]
    after: Annotated[
        dict[str, int],
        doc("Robot -> how many of its events that interfere must have ended before."),
    ]
    meets: Annotated[dict[str, str], doc("Robot that starts together with it -> its subaction.")]


class Passings(msgspec.Struct, frozen=True):
    """What a robot waits for that keeps no common step with the others."""

    events: Annotated[dict[str, OwnEvent], doc("What the keys of 'next' mean, but for 'idle'.")]
    interferes: Annotated[
        dict[str, dict[str, list[str]]],
        doc("Own subaction -> other robot -> its subactions that interfere with it."),
    ]
    others: Annotated[
        dict[str, list[dict[str, int]]],
        doc(
            "Other robot -> for its first event, its second one and so on what it may "
            "be -> how many own events that interfere with it must have ended before."
        ),
    ]


class RobotRecord(msgspec.Struct, frozen=True):
    """The choices of one robot."""

    robot: Annotated[str, doc("The robot.")]
    steps: Annotated[int, doc("The number of steps of each plan.")]
    subplans: Annotated[Count, doc("The number of its own subplans.")]
    atoms: Annotated[
        Atoms,
        doc(
            "How 'true' and 'unknown' were found: over all combinations of the robots' "
            "choices, or from the robot's own subactions alone."
        ),
    ]
    facts: Annotated[list[str], doc("The atoms of which something is known in some state.")]
    others: Annotated[list[str], doc("The other atoms that can change.")]
    states: Annotated[list[StateRecord], doc("The states of the automaton.")]
    passings: Annotated[
        Passings | UnsetType, doc("What it waits for; missing where robots step together.")
    ] = UNSET


class ChoicesFile(msgspec.Struct, frozen=True):
    """A choices file, version 1.  Keys that are not listed here are ignored by readers."""

    format: Annotated[str, doc("What kind of file this is.")]
    version: Annotated[int, doc("Readers refuse a version that they do not know.")]
    domain: Annotated[dict[str, Any], doc("The language's domain, as in a language file.")]
    robots: Annotated[list[str], doc("All robots, in the order of joint actions.")]
    task: Annotated[str, doc("The task; for information.")]
    sentence: Annotated[str, doc("The sentence; for information.")]
    plans: Annotated[Count, doc("The number of plans with the sentence.")]
    covered: Annotated[bool, doc("Whether it is a candidate task of the language.")]
    guaranteed: Annotated[bool, doc("Whether every combination of choices is an optimal plan.")]
    combinations_walked: Annotated[
        int | None, doc("Nodes that were walked to prove it; null if there were too many.")
    ]
    choices: Annotated[list[RobotRecord], doc("The choices of each robot that was asked for.")]
    tolerance: Annotated[
        dict[str, float] | UnsetType,
        doc("What the language tolerates, as in its file; missing: nothing."),
    ] = UNSET


CHOICES = FileFormat("choices", "choices file", ChoicesFile, FORMAT, VERSION)


def to_record(choices: SentenceChoices, robots: Sequence[int] | None = None) -> ChoicesFile:
    """The content of a choices file, of all robots or of those with these numbers."""
    task_language = choices.task_language
    chosen = range(len(choices.robots)) if robots is None else robots
    return ChoicesFile(
        format=FORMAT,
        version=VERSION,
        domain=dict(task_language.language.provenance.domain),
        robots=list(task_language.model.robots),
        task=describe(task_language.space, task_language.task),
        sentence=task_language.text(choices.words),
        plans=json_count(Plans.of(choices.fits).count),
        covered=task_language.covered,
        guaranteed=choices.guaranteed,
        tolerance=tolerance_data(task_language.language.tolerance).get("tolerance", UNSET),
        combinations_walked=choices.walked,
        choices=[_robot(choices.fits, choices.robots[robot]) for robot in chosen],
    )


def to_bytes(choices: SentenceChoices, robots: Sequence[int] | None = None) -> bytes:
    """The text of a choices file: the same choices give the same bytes."""
    return msgspec.json.encode(to_record(choices, robots)) + b"\n"


def monitor(fits: PlanSpace, own: Automaton, sentence: str) -> Monitor:
    """A run-time monitor of a robot's subplans in some plans, those with a sentence."""
    entry = msgspec.to_builtins(_robot(fits, own))
    data = {"format": FORMAT, "version": VERSION, "sentence": sentence, "choices": [entry]}
    return EventMonitor(data) if fits.model.is_asynchronous else Monitor(data)


def _robot(fits: PlanSpace, own: Automaton) -> RobotRecord:
    model, texts = fits.model, fits.model.codec.facts.texts
    others = [*bits(reduce(and_, (known.unknown for known in own.known)))]
    facts = sorted({*range(len(texts))} - {*others})
    return RobotRecord(
        robot=model.robots[own.robot],
        steps=own.steps,
        subplans=json_count(own.count),
        atoms=own.atoms,
        facts=[texts[fact] for fact in facts],
        others=[texts[fact] for fact in others],
        states=_states(own, model.labels[own.robot], facts),
        passings=_passings(fits, own) if model.is_asynchronous else UNSET,
    )


def _states(automaton: Automaton, labels: Sequence[str], facts: Sequence[int]) -> list[StateRecord]:
    def numbers(known: int) -> list[int]:
        return [number for number, fact in enumerate(facts) if known >> fact & 1]

    return [
        StateRecord(
            step=step,
            left=json_count(automaton.left[state]),
            next={labels[label]: to for label, to in automaton.moves[state].items()},
            true=numbers(automaton.known[state].true),
            unknown=numbers(automaton.known[state].unknown),
        )
        for step, states in enumerate(automaton.layers)
        for state in states
    ]


def _passings(fits: PlanSpace, own: Automaton) -> Passings:
    """What a robot waits for in its subplans, and what it may hear of the others."""
    model, robot = fits.model, own.robot
    may_be = {
        name: _events_of(fits, other, robot)
        for other, name in enumerate(model.robots)
        if other != robot
    }
    events = {
        model.labels[robot][label]: event
        for label in sorted(own.labels)
        if (event := model.events[robot][label])
    }
    labels = sorted({event.label for event in events.values()})
    return Passings(
        events={text: _own_event(model, robot, event) for text, event in events.items()},
        interferes=_interferes(model.in_step, robot, labels, may_be),
        others=may_be,
    )


def _own_event(model: JointModel, robot: int, event: Event) -> OwnEvent:
    robots, texts = model.robots, model.in_step.labels
    return OwnEvent(
        texts[robot][event.label],
        {name: number for name, number in zip(robots, event.waits, strict=True) if number},
        {robots[other]: texts[other][its] for other, its in event.meets},
    )


def _interferes(
    model: JointModel, robot: int, labels: Iterable[int], may_be: Mapping[str, list[dict[str, int]]]
) -> dict[str, dict[str, list[str]]]:
    """For each own subaction those that others may do and that interfere with it."""
    interfering, texts = Traces(model).interfering, model.labels
    heard = {model.robots.index(name): set().union(*its) for name, its in may_be.items()}
    return {
        texts[robot][label]: {
            model.robots[other]: [
                text
                for its, text in enumerate(texts[other])
                if text in its_texts and interfering[robot, other][label, its]
            ]
            for other, its_texts in heard.items()
        }
        for label in labels
    }


def _events_of(fits: PlanSpace, robot: int, waiting_for: int) -> list[dict[str, int]]:
    """What a robot's events may be, one by one -> how many of another robot's they wait for."""
    texts = fits.model.in_step.labels[robot]
    found: list[dict[str, int]] = []
    for numbers in fits.labels_by_step(robot):
        waits: dict[int, int] = {}
        for event in filter(None, (fits.model.events[robot][number] for number in numbers)):
            least = waits.get(event.label, event.waits[waiting_for])
            waits[event.label] = min(least, event.waits[waiting_for])
        found.append({texts[label]: least for label, least in sorted(waits.items())})
    return found
