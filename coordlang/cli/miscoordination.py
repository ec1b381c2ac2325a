"""A miscoordination shown, as text and as JSON: what several commands answer with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from planners.joint.model import NO_FACT

if TYPE_CHECKING:
    from coordlang.required.miscoordination import Miscoordination


def witness_data(witness: Miscoordination) -> dict[str, Any]:
    """A miscoordination as JSON."""
    data: dict[str, Any] = {
        "task": witness.task,
        "robots": list(witness.robots),
        "plans": [[list(step) for step in plan] for plan in witness.plans],
        "states": [list(states) for states in witness.states],
        "mixture": [list(step) for step in witness.mixture],
        "mixed_states": list(witness.mixed_states),
        "step": witness.step,
        "reason": witness.reason,
    }
    if witness.sentence is not None:
        data["sentence"] = list(witness.sentence)
    return data


def show(witness: Miscoordination) -> str:
    """A miscoordination as a person wants to see it.

    Who follows which plan, step by step, and where it breaks.
    """
    width = max(len(text or "idle") for plan in witness.plans for step in plan for text in step) + 2
    lines = [f"  task: {witness.task}"]
    for robot, plan, states in zip(witness.robots, witness.plans, witness.states, strict=True):
        lines.append(f"  {robot} follows this optimal plan:")
        lines += _table(witness.robots, plan, states, width)
    lines.append("  together they do:")
    for number, (step, state) in enumerate(zip(witness.mixture, witness.mixed_states, strict=True)):
        mark = "  <-- breaks here" if number == witness.step else ""
        lines.append(f"    {state or NO_FACT}")
        lines.append(
            f"    {number + 1:>3}  "
            + "".join(
                f"{_does(r, t):<{width + 6}}" for r, t in zip(witness.robots, step, strict=True)
            ).rstrip()
            + mark
        )
    lines.append(f"  step {witness.step + 1} breaks: {witness.reason}")
    return "\n".join(lines)


def _table(
    robots: tuple[str, ...],
    plan: tuple[tuple[str | None, ...], ...],
    states: tuple[str, ...],
    width: int,
) -> list[str]:
    lines = []
    for number, step in enumerate(plan, 1):
        texts = "".join(
            f"{_does(r, t):<{width + 6}}" for r, t in zip(robots, step, strict=True)
        ).rstrip()
        lines.append(f"    {number:>3}  {texts}")
    lines.append(f"         reaches {states[-1] or NO_FACT}")
    return lines


def _does(robot: str, text: str | None) -> str:
    return f"{robot}: {text or 'idle'}"
