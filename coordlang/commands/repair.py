# SPDX-License-Identifier: GPL-3.0-or-later
"""What became of a language that was repaired, as text and as JSON."""

from __future__ import annotations

from typing import Any

from coordlang.commands.layout import WIDTH, wrapped
from coordlang.commands.repairing import Repaired
from coordlang.commands.witness import witness_data, witness_text
from planners.joint.model import NO_FACT
from planners.system.notebook import counted

#: Changed states that are shown to a person.
_SHOWN = 12


def repair_data(repaired: Repaired) -> dict[str, Any]:
    """Return what became of a language as JSON data."""
    return {
        "still_holds": repaired.still_holds,
        "miscoordination": witness_data(repaired.witness),
        "changed": [
            {"state": change.state, "old": change.old, "new": change.new}
            for change in repaired.changed
        ],
        "changed_lower_bound": repaired.changes_bound,
        "new_words": list(repaired.new_words),
        "new_words_lower_bound": repaired.new_words_bound,
        "new_states": repaired.new_states,
        "states_gone": repaired.gone,
    }


def repair_text(repaired: Repaired, width: int = WIDTH) -> str:
    """Return why a language was changed, and which states have other words, as lines."""
    lines = []
    if repaired.gone:
        lines.append(f"{counted(repaired.gone, 'state')} of the old language: not on this map")
    if repaired.witness is None:
        return "\n".join(["the old language still holds: no word is changed", *lines])
    sentence = " ".join(repaired.witness.sentence or ())
    lines += [
        f'the old language fails: plans with the sentence "{sentence}" do not mix',
        witness_text(repaired.witness, width),
        _how_many(repaired),
    ]
    for change in repaired.changed[:_SHOWN]:
        text = f"{change.state or NO_FACT}: {change.old} -> {change.new}"
        lines += wrapped(text, width, "  ", "      ")
    if len(repaired.changed) > _SHOWN:
        lines.append(f"  .. and {len(repaired.changed) - _SHOWN:,} more; --json has all")
    return "\n".join(lines)


def _how_many(repaired: Repaired) -> str:
    """How much was changed, and what is proved of it."""
    number, bound = len(repaired.changed), repaired.changes_bound
    verb = "changes its word" if number == 1 else "change their word"
    text = f"{counted(number, 'state')} {verb}{_proof(number, bound)}"
    if repaired.new_states:
        text += f"; {counted(repaired.new_states, 'new state')}"
    if words := repaired.new_words:
        new = f"{counted(len(words), 'new word')} ({', '.join(words)})"
        text += f"; {new}{_proof(len(words), repaired.new_words_bound)}"
    return text


def _proof(number: int, bound: int) -> str:
    if not number:
        return ""
    if number == bound:
        return ", proved the fewest"
    return f", at least {bound} are needed" if bound else ", not proved the fewest"
