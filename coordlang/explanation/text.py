# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas, and what sentences ask, as text; formulas as PDDL conditions; all of it as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, takewhile
from math import prod
from typing import Any

from coordlang.explanation.demands import RobotPart, SentenceDemands, WordChange
from coordlang.explanation.words import Cover, Literal, MappedStates, Term, WordDescriptions
from planners.joint.model import show
from planners.system.messages import counted, named

#: Terms of one formula, and alternatives of one choice, that are written out.
_TERMS = 12
#: The most columns to which terms are aligned.
_WIDTH = 70
_ALTERNATIVES = 4


def literal_text(literal: Literal) -> str:
    """The text of one limit on a variable.

    ``at(r2) = c``, ``at(r2) != c``, ``at(r2) in {a, b}``, ``at(r2) not in {a, b}``, ``free(r1)``,
    ``not free(r1)``.
    """
    variable, negative = literal.variable, literal.is_negative
    if variable.is_fact:
        return variable.name if literal.values == variable.values[:1] else f"not {variable.name}"
    texts_of = dict(zip(variable.values, variable.texts, strict=True))
    values: dict[str, list[str]] = {}
    for value in literal.others if negative else literal.values:
        subject, text = texts_of[value]
        values.setdefault(subject, []).append(text)
    parts = [_compared(subject, texts, negative) for subject, texts in values.items()]
    joined = (" and " if negative else " or ").join(parts)
    return f"({joined})" if len(parts) > 1 and not negative else joined


def _compared(subject: str, values: list[str], negative: bool) -> str:
    if values == [""]:
        return f"not {subject}" if negative else subject
    if len(values) == 1:
        return f"{subject} {'!=' if negative else '='} {values[0]}"
    return f"{subject} {'not in' if negative else 'in'} {{{', '.join(values)}}}"


def term_text(term: Term) -> str:
    """A conjunction; the empty one is ``true``."""
    return " and ".join(literal_text(literal) for literal in term) or "true"


def shown(cover: Cover) -> str:
    """A formula on one line; the empty one is ``false``."""
    return " or ".join(term_text(term) for term in cover.terms) or "false"


def pddl_condition(cover: Cover) -> str:
    """A formula as PDDL, with ``and``, ``or`` and ``not``."""
    literals = (
        [show(atom) if value else f"(not {show(atom)})" for atom, value in conjunction.items()]
        for conjunction in cover.conjunctions()
    )
    return _joined("or", [_joined("and", own) for own in literals])


def _joined(operator: str, parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"({' '.join((operator, *parts))})"


def cover_data(cover: Cover) -> dict[str, Any]:
    """A formula for JSON."""
    return {
        "text": shown(cover),
        "pddl": pddl_condition(cover),
        "states": cover.states,
        "fewest_terms_proved": cover.fewest,
        "terms": [
            {
                "text": term_text(term),
                "states": count,
                "literals": [
                    {
                        "variable": one.variable.name,
                        "values": [None if value is None else show(value) for value in one.values],
                    }
                    for one in term
                ],
            }
            for term, count in zip(cover.terms, cover.counts, strict=True)
        ],
    }


def descriptions_text(descriptions: WordDescriptions, mapped: MappedStates) -> str:
    """The words and their formulas, a term a line where there are several."""
    lines = []
    states = mapped.states
    for word, formula in descriptions.rules:
        head = f"  {word} ({counted(states[word], 'state')}):"
        if formula is None:
            lines.append(f"{head} every other state")
        elif not formula.states:
            lines.append(f"{head} no state")
        elif len(formula.terms) < 2:
            lines.append(f"{head} {shown(formula)}")
        else:
            lines += [head, *_term_lines(formula)]
    return "\n".join(lines)


def _term_lines(formula: Cover) -> list[str]:
    """The terms of a formula, each with its number of states."""
    texts = [term_text(term) for term in formula.terms[:_TERMS]]
    width = min(max(map(len, texts)), _WIDTH)
    lines = []
    for number, (text, count) in enumerate(zip(texts, formula.counts, strict=False)):
        lines.append(f"      {'or ' if number else '   '}{text:{width}}  [{count}]")
    rest = len(formula.terms) - _TERMS
    return [*lines, f"      .. and {counted(rest, 'more term')}"] if rest > 0 else lines


def meaning_text(
    sentences: Sequence[str], meant: tuple[str, Sequence[Sequence[str]]] | None
) -> str:
    """What the sentences of a task mean (`meaning`), in one line."""
    if meant is None:
        return (
            "No one thing was found that the sentences say, such as who first uses an object: "
            "see the words."
        )
    name, first = meant
    said = [
        f'{named(who) if who else "nobody"} in "{words}"'
        for words, who in zip(sentences, first, strict=True)
    ]
    return f"The sentences say who is the first to use {name}: {', '.join(said)}."


def demands_text(demands: SentenceDemands) -> str:
    """What a sentence demands, in plain sentences."""
    lines = [f'"{" ".join(demands.sentence)}" leaves {counted(demands.plans, "plan")} open.']
    for part in demands.parts:
        lines += _part_lines(part, demands.unit)
    for change in demands.changes:
        when = f"in step {change.earliest}"
        if change.earliest < change.latest:
            when = f"in steps {change.earliest} to {change.latest}"
        lines.append(f"  {change.before} -> {change.after} {when}: {_cause(change)}.")
    return "\n".join(lines)


def _part_lines(part: RobotPart, unit: str) -> list[str]:
    """What one robot may do."""
    if part.subplans == 1:
        only = _sequence([own[0] for own in part.by_step], unit)
        return [f"  {part.robot}: {only}." if only else f"  {part.robot} has nothing to do."]
    if part.listed:
        by_step = zip(*part.listed, strict=True)
        first = len(list(takewhile(lambda own: len(set(own)) == 1, by_step)))
        begin = _sequence(part.listed[0][:first], unit)
        head = f": {begin}, then one of" if first else " may choose:"
        return [
            f"  {part.robot}{head}",
            *(f"    {_sequence(own[first:], unit) or 'nothing more'}" for own in part.listed),
        ]
    # The table of steps shows combinations of which some may be no subplans.
    ways = "ways, not every combination of these (choices lists them)"
    if part.subplans == prod(map(len, part.by_step)):
        ways = "ways, any combination of"
    return [f"  {part.robot} has {part.subplans:,} {ways}:", *_step_lines(part, unit)]


def _step_lines(part: RobotPart, unit: str) -> list[str]:
    """What a robot may do in each step, equal steps together."""
    idling = "wait" if unit == "step" else "nothing more"
    lines = []
    last = 0
    for subactions, run in groupby(part.by_step):
        first, last = last + 1, last + len(list(run))
        name = f"{unit} {first}" if first == last else f"{unit}s {first} to {last}"
        ways = [idling if own is None else _told(own) for own in subactions]
        lines.append(f"    {name}: {_alternatives(ways)}")
    return lines


def _sequence(subplan: Sequence[str | None], unit: str) -> str:
    """``wait 2 steps, move a b, move b c``."""
    parts = []
    for own, run in groupby(subplan):
        number = len(list(run))
        if own is None and unit == "event":
            continue  # there are no more
        if own is None:
            parts.append("wait" if number == 1 else f"wait {number} steps")
        else:
            parts += [_told(own)] * number
    return ", ".join(parts)


def _told(own: str) -> str:
    """A subaction as it stands beside ``wait``, which is idling."""
    return f"({own})" if own == "wait" else own


def _alternatives(texts: Sequence[str], between: str = " or ") -> str:
    rest = len(texts) - _ALTERNATIVES
    if rest <= 1:  # "one of 1 others" would be as long as its name
        return between.join(texts)
    return between.join([*texts[:_ALTERNATIVES], f"one of {rest} others"])


def _cause(change: WordChange) -> str:
    """Who brings the change about."""
    if not change.robots:
        return "whatever the robots do"
    if len(change.robots) == 1:
        only = [way.subactions[0] for way in change.ways]
        ways = ["waiting" if own is None else _told(own) for own in only]
        return f"{change.robots[0]} decides it by {_alternatives(ways)}"
    ways = [
        " and ".join(
            f"{name} {'wait' if own is None else _told(own)}"
            for name, own in zip(change.robots, way.subactions, strict=True)
        )
        for way in change.ways
    ]
    return f"{named(change.robots)} decide it together: {_alternatives(ways, '; or ')}"
