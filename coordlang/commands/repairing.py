# SPDX-License-Identifier: GPL-3.0-or-later
"""A language and other candidate tasks -> a verified language that differs in few states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from coordlang.commands.layout import WIDTH, wrapped
from coordlang.commands.options import MethodOptions
from coordlang.commands.witness import witness_data, witness_text
from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition, keys_of, read_keys
from coordlang.language.words import Language
from coordlang.required.miscoordination import Miscoordination
from coordlang.vocabulary.job import Assignment
from coordlang.vocabulary.repair import Repair, repair
from planners.joint.model import NO_FACT
from planners.joint.tables import Ints, Rows, find_rows
from planners.system.notebook import counted

if TYPE_CHECKING:
    from coordlang.commands.building import Built, Making

#: What a language file names as the method of a repaired language.
METHOD = "repair"
#: Changed states that are shown to a person.
_SHOWN = 12


@dataclass(frozen=True, slots=True)
class ChangedState:
    """A state, by its key, with the word that it had and the one that it has."""

    state: str
    old: str
    new: str


@dataclass(frozen=True, slots=True)
class Repaired:
    """What became of a language.

    ``witness`` has plans of one sentence of the old language that miscoordinate; None: it still
    holds, and no word was changed.  Other words have the states ``changed``; every language for the
    tasks changes ``changes_bound`` states at least, and one that changes so few has at least
    ``new_words_bound`` of ``new_words``.  ``new_states`` on plans of the tasks are not listed in
    the old language, and ``gone`` of its states the problem cannot have any more.
    """

    witness: Miscoordination | None
    changed: tuple[ChangedState, ...] = ()
    changes_bound: int = 0
    new_words: tuple[str, ...] = ()
    new_words_bound: int = 0
    new_states: int = 0
    gone: int = 0

    @property
    def still_holds(self) -> bool:
        """Whether the old language serves the tasks as it is."""
        return self.witness is None

    def data(self) -> dict[str, Any]:
        """The same as JSON data."""
        return {
            "still_holds": self.still_holds,
            "miscoordination": witness_data(self.witness),
            "changed": [asdict(change) for change in self.changed],
            "changed_lower_bound": self.changes_bound,
            "new_words": list(self.new_words),
            "new_words_lower_bound": self.new_words_bound,
            "new_states": self.new_states,
            "states_gone": self.gone,
        }

    def text(self, width: int = WIDTH) -> str:
        """Why the language was changed, and which states have other words, as lines."""
        lines = []
        if self.gone:
            lines.append(f"{counted(self.gone, 'state')} of the old language: not on this map")
        if self.witness is None:
            return "\n".join(["the old language still holds: no word is changed", *lines])
        sentence = " ".join(self.witness.sentence or ())
        lines += [
            f'the old language fails: plans with the sentence "{sentence}" do not mix',
            witness_text(self.witness, width),
            self._how_many(),
        ]
        for change in self.changed[:_SHOWN]:
            text = f"{change.state or NO_FACT}: {change.old} -> {change.new}"
            lines += wrapped(text, width, "  ", "      ")
        if len(self.changed) > _SHOWN:
            lines.append(f"  .. and {len(self.changed) - _SHOWN:,} more; --json has all")
        return "\n".join(lines)

    def _how_many(self) -> str:
        """How much was changed, and what is proved of it."""
        number, bound = len(self.changed), self.changes_bound
        verb = "changes its word" if number == 1 else "change their word"
        text = f"{counted(number, 'state')} {verb}{_proof(number, bound)}"
        if self.new_states:
            text += f"; {counted(self.new_states, 'new state')}"
        if words := self.new_words:
            new = f"{counted(len(words), 'new word')} ({', '.join(words)})"
            text += f"; {new}{_proof(len(words), self.new_words_bound)}"
        return text


def _proof(number: int, bound: int) -> str:
    if not number:
        return ""
    if number == bound:
        return ", proved the fewest"
    return f", at least {bound} are needed" if bound else ", not proved the fewest"


def repair_language(making: Making, start: Language, options: MethodOptions) -> Built:
    """Change the words of as few states as makes a language serve candidate tasks.

    The result is verified by definition.  States that are on no plan of the candidate tasks keep
    their words.
    """
    job = making.job(MethodOptions(seed=options.seed))
    making.note("coordination")
    old = _Old.of(start, making.candidates)
    words = old.words_of(job.states)
    making.progress("verifying the old language")
    partition = old.partition
    verdict = making.verdict(partition)
    making.note("verify")
    repaired = Repaired(None, new_states=len(job.states) - len(words), gone=old.gone)
    more: dict[str, Any] = {"figures": {}}
    if not verdict.holds:
        making.partition_of = old.repaired
        result = repair(job, words, len(partition.words), partition.default)
        making.note("repair")
        witness = verdict.witness
        verified = making.known(result.partition)
        assert verified is not None, "what repairs checks what it returns"
        partition, verdict = verified
        repaired = replace(
            repaired,
            witness=witness,
            changed=old.changes(result, partition),
            changes_bound=result.changes_bound,
            new_words=tuple(w for w in partition.words if w not in old.partition.words),
            new_words_bound=result.new_words_bound,
        )
        more = {"figures": result.figures, "stopped": result.stopped}
    # What the old file claims of fewer words is not believed.
    return making.built(
        job, (partition, verdict), METHOD, job.lower_bound, repaired=repaired, **more
    )


@dataclass(frozen=True, slots=True)
class _Old:
    """The old words in the model of the candidate tasks.

    ``listed`` (states) is the place of each candidate state in ``partition``, -1 where it has none.
    ``gone`` of the language's states are none of this model.
    """

    candidates: Candidates
    partition: Partition
    listed: Ints
    gone: int

    @classmethod
    def of(cls, language: Language, candidates: Candidates) -> _Old:
        _, wrong = read_keys(candidates.model.codec, language.states)
        if len(wrong):
            gone = set(wrong.tolist())
            kept = [item for n, item in enumerate(language.states.items()) if n not in gone]
            language = replace(language, states=dict(kept))
        partition = language.partition(candidates.model)
        listed = find_rows(partition.rows, candidates.rows)
        return cls(candidates, partition, listed, len(wrong))

    def words_of(self, states: Sequence[int]) -> dict[int, int]:
        """The word numbers of those states that the language lists."""
        places = self.listed[list(states)].tolist()
        word = self.partition.word.tolist()
        return {s: word[p] for s, p in zip(states, places, strict=True) if p >= 0}

    def repaired(self, assignment: Assignment) -> Partition:
        """The partition with other words of some states; words without states are left out."""
        states = sorted(assignment)
        fresh = self.listed[states] < 0
        rows: Rows = np.concatenate((self.partition.rows, self.candidates.rows[states][fresh]))
        given = np.array([assignment[state] for state in states], np.int64)
        word = np.concatenate((self.partition.word, given[fresh]))
        word[self.listed[states][~fresh]] = given[~fresh]
        used, number = np.unique(word, return_inverse=True)
        kept, old, default = used.tolist(), self.partition.words, self.partition.default
        new = (name for name in (f"w{n}" for n in count()) if name not in old)
        names = tuple(old[word] if word < len(old) else next(new) for word in kept)
        most = int(np.bincount(number).argmax())
        default = kept.index(default) if default in kept else most
        return Partition.of_table(names, rows, number.reshape(-1), default)

    def changes(self, result: Repair, partition: Partition) -> tuple[ChangedState, ...]:
        """The changed states, sorted by their keys."""
        rows = self.candidates.rows[list(result.changed)]
        names = zip(
            keys_of(self.candidates.model.codec, rows),
            self.partition.word_of(rows).tolist(),
            partition.word_of(rows).tolist(),
            strict=True,
        )
        old, new = self.partition.words, partition.words
        return tuple(ChangedState(key, old[was], new[now]) for key, was, now in sorted(names))
