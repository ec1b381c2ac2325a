# SPDX-License-Identifier: GPL-3.0-or-later
"""What the sentence for a task should be like: preferences by which the best one is chosen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from coordlang.execution.task_language import TaskLanguage
from planners.joint.model import JointModel
from planners.joint.states import split_atoms
from planners.pddl.lifted import Atom
from planners.system.errors import BadInput, UsageError
from planners.system.messages import echoed

#: What a preference remembers of a plan's beginning.
Memory = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class PlanPreference:
    """A preference about single plans: an automaton that reads a plan and gives it a grade.

    ``start`` gives the memory in the initial state, ``step`` that after a joint step (labels) into
    a state, both by its number in the plan space's table; ``grade`` gives the grade by the memory
    at the end, the lower the better.  ``text`` is the preference as it is written on the command
    line, ``grades`` says in words what each grade means.
    """

    text: str
    start: Callable[[int], Memory]
    step: Callable[[Memory, tuple[int, ...], int], Memory]
    grade: Callable[[Memory], int]
    grades: tuple[str, ...]


#: ``"shortest"`` and ``"most-plans"`` are preferences about whole sentences.
Preference = str | PlanPreference


def read_preference(task_language: TaskLanguage, text: str) -> Preference:
    """Read ``shortest``, ``most-plans``, ``first:ROBOT`` or ``avoid:ATOMS``.

    Raises `UsageError` for anything else.
    """
    kind, _, argument = text.strip().partition(":")
    if text.strip() in ("shortest", "most-plans"):
        return text.strip()
    if kind == "first":
        return goes_first(task_language.model, argument.strip().lower())
    if kind == "avoid":
        return avoids(task_language, argument)
    raise UsageError(
        f"--prefer {echoed(text)}: there is no such preference",
        remedy='Use shortest, most-plans, first:ROBOT or avoid:"(ATOM) ..".',
    )


def goes_first(model: JointModel, robot: str) -> PlanPreference:
    """The preference that a robot goes first.

    Robot r goes before robot q if, in the first step in which one of the two *acts* (does not idle)
    and the other one does not, it is r that acts.  Grades: 0 if r goes before every other robot, 2
    if some other robot goes before r, else 1.  Raises `UsageError` for a robot that the model does
    not have.
    """
    if robot not in model.robots:
        raise UsageError(
            f"--prefer first:{robot}: there is no such robot",
            remedy=f"The robots are {', '.join(model.robots)}.",
        )
    own = model.robots.index(robot)
    others = tuple(other for other in range(len(model.robots)) if other != own)
    grades = (
        f"{robot} goes first",
        f"no robot goes before {robot}",
        f"another robot goes before {robot}",
    )
    late = (-1,)  # in place of the robots of which it is open: one has acted before this one

    def step(memory: Memory, labels: tuple[int, ...], _state: int) -> Memory:
        acts = labels[own] != 0
        if memory == late or (not acts and any(labels[other] for other in memory)):
            return late
        return tuple(other for other in memory if (labels[other] != 0) == acts)

    def grade(memory: Memory) -> int:
        return 2 if memory == late else int(bool(memory))

    return PlanPreference(f"first:{robot}", lambda _: others, step, grade, grades)


def avoids(task_language: TaskLanguage, atoms: str) -> PlanPreference:
    """The preference that no state of the plan, the first and last included, has all these atoms.

    Grades: 0 if so, else 1; always 0 where one of the atoms can never be true.  Raises `UsageError`
    for text that is not a list of atoms of the problem.
    """
    try:
        wanted = split_atoms(" ".join(atoms.lower().split()).replace("( ", "(").replace(" )", ")"))
    except BadInput as error:
        raise UsageError(f"--prefer avoid:{atoms}: {error.what}", remedy=error.remedy) from None
    if not wanted:
        raise UsageError(
            "--prefer avoid: expected atoms", remedy='As in --prefer avoid:"(at r1 c1-1)".'
        )
    model = task_language.model
    facts, never, codec = [], [], model.codec
    for text in wanted:  # what is always true is left out
        predicate, *args = text[1:-1].split(" ")
        number = codec.facts.number_of(text)
        if number is not None:
            facts.append(number)
        elif not _is_declared(task_language, predicate, args):
            raise UsageError(
                f"--prefer avoid:{text}: this is no atom of the problem",
                remedy="Write a predicate of the domain with objects of the problem, as in "
                f"{next(iter(codec.facts.texts), '(at r1 c1-1)')}.",
            )
        elif Atom(predicate, tuple(args)) not in model.statics:
            never.append(text)
    states = codec.facts_part(task_language.space.rows)
    mask = codec.mask(facts)
    hit: list[int] = ((states & mask) == mask).all(axis=1).astype(int).tolist()
    if never:
        hit = [0] * len(states)
    text = " ".join(wanted)
    why = f": {never[0]} can never be true" if never else ""
    grades = (f"it keeps away from {text}{why}", f"it passes through {text}")
    return PlanPreference(
        f"avoid:{text}",
        lambda state: (hit[state],),
        lambda memory, _, state: (memory[0] or hit[state],),
        lambda memory: memory[0],
        grades,
    )


def _is_declared(task_language: TaskLanguage, predicate: str, args: Sequence[str]) -> bool:
    """Whether this is an atom over declared names, be it possible or not."""
    if task_language.declared is None:
        return False
    domain, problem = task_language.declared
    return len(args) in domain.predicates.get(predicate, ()) and problem.objects.keys() >= {*args}
