# SPDX-License-Identifier: GPL-3.0-or-later
"""How robots agree on a sentence, by three messages: propose, answer, agreed.

Of the robots that have wishes the one with the least name proposes the sentence that it likes best;
if nobody has any, the one with the least name of all.  Every other one accepts, or answers with its
own wishes if the sentence does not grant them.  Then the proposer says what is agreed: what it
proposed if all accept, else the best sentence by its own wishes and, where these leave a choice,
by those of the others in the order of their names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from coordlang.execution.fleet_log import Answer, Message
from planners.system.errors import Refuted


class Agreement:
    """How far one robot has come in agreeing with the ``others`` on a sentence.

    ``sentence`` is what was agreed on, or given from outside; None before that.  ``best`` gives the
    best sentence by wishes in order of weight, ``grants`` says whether a sentence grants wishes.
    """

    def __init__(
        self,
        robot: str,
        others: Sequence[str],
        sentence: str | None,
        wishes: Sequence[str],
        best: Callable[[Sequence[str]], str],
        grants: Callable[[str, Sequence[str]], bool],
    ) -> None:
        self.robot, self.sentence, self._wishes = robot, sentence, tuple(wishes)
        self._best, self._grants = best, grants
        self._proposal: str | None = None
        self._answer: Answer | None = None
        self._heard: dict[str, Message | None] = dict.fromkeys(others)

    def hears(self, message: Message) -> None:
        """Take in what another robot says; `Refuted` if it follows another sentence."""
        if message.sentence is not None and self.sentence not in (None, message.sentence):
            what = f'{message.by} follows "{message.sentence}", {self.robot} "{self.sentence}"'
            raise Refuted(what, remedy="Give all robots one SENTENCE, or none.")
        self._heard[message.by] = message

    def advance(self) -> bool:
        """Propose, answer or agree, if it can be done now; whether anything was."""
        before = self.said()
        heard = [message for message in self._heard.values() if message is not None]
        agreed = [message.sentence for message in heard if message.sentence is not None]
        if self.sentence is None and agreed:
            self.sentence = agreed[0]
        elif self.sentence is None and len(heard) == len(self._heard):
            self._talk({message.by: message for message in heard})
        return self.said() != before

    def _talk(self, heard: dict[str, Message]) -> None:
        speakers = [name for name in heard if heard[name].speaks]
        speakers += [self.robot] * bool(self._wishes)
        proposer = min(speakers or [self.robot, *heard])
        if proposer != self.robot:
            proposed = heard[proposer].proposes
            if proposed is not None and (not self._answer or self._answer.sentence != proposed):
                is_granted = self._grants(proposed, self._wishes)
                self._answer = Answer(proposed, () if is_granted else self._wishes)
            return
        if self._proposal is None:
            self._proposal = self._best(self._wishes)
        answers = [heard[name].answer for name in sorted(heard)]
        if all(answer and answer.sentence == self._proposal for answer in answers):
            further = [wish for answer in answers if answer for wish in answer.wishes]
            self.sentence = self._best([*self._wishes, *further]) if further else self._proposal

    def said(self) -> dict[str, Any]:
        """What a message of this robot says of it."""
        return {
            "sentence": self.sentence,
            "speaks": bool(self._wishes),
            "proposes": self._proposal,
            "answer": self._answer,
        }
