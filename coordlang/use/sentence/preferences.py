"""What a sentence can be wished to be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import BadInput, UsageError
from planners.joint.model import JointModel
from planners.joint.states import split_atoms

#: What a wish remembers of a plan's beginning.
Memory = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class PlanPreference:
    """A wish about single plans, as a small automaton.

    It reads a plan and gives it a grade, the lower the better.

    ``start`` gives the memory in the initial state, ``step`` the memory after a joint step into a
    state, ``grade`` the grade of a plan by the memory at its end.  A state is given by its number
    in the plan space's table.
    """

    text: str
    start: Callable[[int], Memory]
    step: Callable[[Memory, tuple[int, ...], int], Memory]
    grade: Callable[[Memory], int]
    grades: tuple[str, ...]


#: ``"shortest"`` and ``"most-plans"`` are wishes about whole sentences.
Preference = str | PlanPreference


def read_preference(task_language: TaskLanguage, text: str) -> Preference:
    """``shortest``, ``most-plans``, ``first:ROBOT`` or ``avoid:ATOMS``.  Raises `UsageError` for
    anything else.
    """
    kind, _, argument = text.strip().partition(":")
    if text.strip() in ("shortest", "most-plans"):
        return text.strip()
    if kind == "first":
        return first(task_language.model, argument.strip().lower())
    if kind == "avoid":
        return avoid(task_language, argument)
    raise UsageError(
        f"--wish {text!r}: there is no such wish",
        remedy='Say shortest, most-plans, first:ROBOT or avoid:"(ATOM) ..".',
    )


def first(model: JointModel, robot: str) -> PlanPreference:
    """The robot goes first.

    A robot *acts* in a step if it neither idles nor does a subaction that is as good as idling.
    Robot r goes before robot q in a plan if, in the first step in which one of the two acts and the
    other one does not, it is r that acts. Grades: 0 if r goes before every other robot, 2 if some
    other robot goes before r, else 1.
    """
    if robot not in model.robots:
        raise UsageError(
            f"--wish first:{robot}: there is no such robot",
            remedy=f"The robots are {', '.join(model.robots)}.",
        )
    place = model.robots.index(robot)
    nothing = {action.label for action in model.actions if action.does_nothing and not action.parts}
    acts = [
        [label > 0 and text not in nothing for label, text in enumerate(own)]
        for own in model.labels
    ]
    late = (-1,)
    others = tuple(other for other in range(len(model.robots)) if other != place)

    def step(memory: Memory, labels: tuple[int, ...], _: int) -> Memory:
        # The robots that nothing is decided about yet; `late` once somebody went before.
        if memory == late:
            return memory
        mine = acts[place][labels[place]]
        if not mine and any(acts[other][labels[other]] for other in memory):
            return late
        return tuple(other for other in memory if acts[other][labels[other]] == mine)

    def grade(memory: Memory) -> int:
        return 2 if memory == late else 1 if memory else 0

    grades = (
        f"{robot} goes first",
        f"nobody goes before {robot}",
        f"another robot goes before {robot}",
    )
    return PlanPreference(f"first:{robot}", lambda _: others, step, grade, grades)


def avoid(task_language: TaskLanguage, atoms: str) -> PlanPreference:
    """No state of the plan, the first and last included, has all of these atoms.  Grades: 0 if so,
    else 1.
    """
    codec = task_language.model.codec
    try:
        wanted = split_atoms(" ".join(atoms.lower().split()).replace("( ", "(").replace(" )", ")"))
        row = codec.encode(wanted)
    except BadInput as error:
        raise UsageError(f"--wish avoid:{atoms}: {error.what}", remedy=error.remedy) from None
    if not wanted:
        raise UsageError('--wish avoid: expected atoms, as in avoid:"(at r1 c1-1)"')
    mask = row[: codec.fact_blocks]
    hit: list[int] = (
        ((task_language.space.rows[:, : codec.fact_blocks] & mask) == mask)
        .all(axis=1)
        .astype(int)
        .tolist()
    )
    text = " ".join(wanted)
    grades = (f"it keeps away from {text}", f"it passes through {text}")
    return PlanPreference(
        f"avoid:{text}",
        lambda state: (hit[state],),
        lambda memory, _, state: (memory[0] or hit[state],),
        lambda memory: memory[0],
        grades,
    )
