# SPDX-License-Identifier: GPL-3.0-or-later
"""A sentence as a formula of linear temporal logic over finite traces.

LTLf: De Giacomo and Vardi (IJCAI 2013).  The text is that of the Python packages flloat and
ltlf2dfa, which most others read as well: ``!``, ``&``, ``|``, ``U`` (until), ``G`` (always), and
symbols of lower-case letters, digits and ``_``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from coordlang.execution.task_language import InTask, TaskLanguage
from coordlang.explanation.words import Conjunction
from coordlang.exports.membership import refuse_seen_slack, short_terms
from coordlang.language.provenance import tolerance_data
from planners.joint.model import show
from planners.pddl.lifted import Atom

#: What must not begin a symbol: readers take it for a word of their own.
_TAKEN = re.compile(r"[^a-z]|true|false|last|end|tt|ff")


@dataclass(frozen=True, slots=True, repr=False)
class ExportedFormula(InTask):
    """A sentence as an LTLf formula over the states of a plan, the initial state first.

    ``formula`` is satisfied by the states of a plan exactly if the plan has the sentence, as long
    as it passes through states that the language maps, or that lie on optimal plans of the task.
    ``over_words`` is the same with the words as symbols, ``words`` has each word's formula,
    ``symbols``: symbol -> PDDL atom.
    """

    used: TaskLanguage = field(compare=False)
    formula: str
    over_words: str
    words: dict[str, str]
    symbols: dict[str, str]
    shown = ("over_words",)

    def __str__(self) -> str:
        return self.formula

    def data(self) -> dict[str, Any]:
        """The formulas, as ``--json`` has them."""
        names = ("formula", "over_words", "words", "symbols")
        own = {name: getattr(self, name) for name in names}
        return {**own, **tolerance_data(self.tolerance)}


def export_ltlf(task_language: TaskLanguage, words: Sequence[int]) -> ExportedFormula:
    """The sentence ``words`` as a formula over the states of a plan, the initial state first.

    A plan has the sentence w0 w1 .. wk exactly if it is in w0 for a while, then in w1, and so on,
    and in wk to the end: ``w0 & (w0 U (w1 & (w1 U .. G(wk))))``.  Raises `NoPlanFits` if no optimal
    plan does, and `UsageError` for words that see slack.
    """
    refuse_seen_slack(task_language.model, "--to ltlf")
    task_language.plans_with(words)  # raises where no plan has the sentence
    terms = short_terms(task_language)
    used = sorted(set(words))
    atoms = sorted({atom for word in used for term in terms[word] for atom in term}, key=show)
    symbol = dict(zip(atoms, symbols_of(map(show, atoms)), strict=True))
    names = symbols_of(task_language.partition.words[word] for word in used)
    name_of = dict(zip(used, names, strict=True))
    meaning = {word: disjunction(terms[word], symbol) for word in used}
    return ExportedFormula(
        task_language,
        formula=_in_turn([meaning[word] for word in words]),
        over_words=_in_turn([name_of[word] for word in words]),
        words={name_of[word]: meaning[word] for word in used},
        symbols={symbol[atom]: show(atom) for atom in atoms},
    )


def disjunction(terms: Iterable[Conjunction], symbol: Mapping[Atom, str]) -> str:
    """Terms as text, in brackets unless it is one symbol."""
    parts = []
    for term in terms:
        literals = [symbol[atom] if value else f"!{symbol[atom]}" for atom, value in term.items()]
        if not literals:
            return "true"
        parts.append(f"({' & '.join(literals)})" if len(literals) > 1 else literals[0])
    return parts[0] if len(parts) == 1 else f"({' | '.join(parts)})"


def symbols_of(texts: Iterable[str]) -> list[str]:
    """For each text a symbol of its own: ``(at r1 c0-1)`` becomes ``at_r1_c0_1``."""
    found: dict[str, None] = {}
    for text in texts:
        base = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
        base = f"p_{base}" if not base or _TAKEN.match(base) else base
        name, number = base, 1
        while name in found:
            number += 1
            name = f"{base}__{number}"
        found[name] = None
    return list(found)


def _in_turn(parts: Sequence[str]) -> str:
    """One after another, each for one state or more, the last to the end."""
    formula = f"G({parts[-1]})"
    for part in reversed(parts[:-1]):
        formula = f"({part} & ({part} U {formula}))"
    return formula
