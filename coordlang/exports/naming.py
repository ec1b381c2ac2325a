# SPDX-License-Identifier: GPL-3.0-or-later
"""Facts and actions that let a plain task follow a sentence.

The plain task of `planners.classical` gets one more fact per word of the sentence, and after each
joint step two actions without cost: the state is *named* by its word, and then the sentence *stays*
at this word or *goes on* to the next one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from coordlang.execution.task_language import TaskLanguage
from coordlang.explanation.variables import truth
from coordlang.explanation.words import Conjunction
from coordlang.exports.membership import Terms
from planners.classical import ClassicalAction, ClassicalTask, Condition
from planners.joint.model import show
from planners.pddl.lifted import Atom

#: A robot's label in a joint step, by the numbers of both.
RobotLabel = tuple[int, int]


def named_by_words(
    task_language: TaskLanguage,
    words: Sequence[int],
    plain: ClassicalTask,
    labels: Sequence[Sequence[RobotLabel]],
    tests: Terms,
    steps: int | None = None,
) -> ClassicalTask:
    """The plain task in which states are named by their words and the sentence is followed.

    The actions of ``plain`` in their order, then those that name and follow.  ``labels`` are for
    each action of ``plain`` those that robots take in it, ``tests`` say which states belong to
    which word, and ``steps`` is the most joint steps; None: any number.
    """
    facts = _NamingFacts(task_language, words, plain, tests, steps)
    within = [
        facts.within(action, chosen) for action, chosen in zip(plain.actions, labels, strict=True)
    ]
    return replace(
        plain,
        name=f'under "{task_language.text(words)}"',
        facts=tuple(facts.texts),
        init=plain.init | facts.init,
        actions=(*within, *facts.naming_actions(tests), *facts.following_actions()),
        goal=facts.goal(plain),
    )


class _NamingFacts:
    """The new facts (by number, as in `ClassicalTask`), and what they do to actions and goal."""

    def __init__(
        self,
        task_language: TaskLanguage,
        words: Sequence[int],
        plain: ClassicalTask,
        tests: Terms,
        steps: int | None,
    ) -> None:
        self.model, self.words = task_language.model, words
        self.names = task_language.partition.words
        self.texts, self.init = list(plain.facts), set[int]()
        self.number: dict[Atom, int] = dict(self.model.codec.facts.index)
        self.remembered = _remembered(task_language, tests)
        for atom, true in self.remembered.items():
            self.number[atom] = self.add(show(atom))
            if true:
                self.init.add(self.number[atom])
        self.first_new = len(self.model.codec.facts)  # from here on, facts of the compilation
        self.explicit = plain.between is None
        #: Between two joint steps: select-then-apply has a fact for this already.
        self.between = self.add("(time to act)") if plain.between is None else plain.between
        self.naming = self.add("(time to name)")
        self.named = {word: self.add(f"(named {self.names[word]})") for word in sorted(set(words))}
        self.said = [self.add(f"(said {n})") for n in range(1, len(words) + 1)]
        self.init |= {self.between, self.said[0]}
        #: The joint steps that were taken, where they are counted.
        self.taken = [self.add(f"(taken {n})") for n in range(steps + 1)] if steps else []
        self.init |= {*self.taken[:1]}

    def add(self, text: str) -> int:
        """Add a fact."""
        self.texts.append(text)
        return len(self.texts) - 1

    def within(self, action: ClassicalAction, labels: Sequence[RobotLabel]) -> ClassicalAction:
        """An action of the plain task with the new facts.

        What ends a step leads to naming, and what is remembered is noted.
        """
        conditions, adds, deletes = {*action.preconditions}, {*action.adds}, {*action.deletes}
        if self.explicit:
            conditions.add((self.between, True))
            deletes.add(self.between)
            adds |= {self.naming} if labels else set()
        elif self.between in adds:
            adds = adds - {self.between} | {self.naming}
            if (self.between, True) in conditions:  # one robot: the step ends as it begins
                deletes.add(self.between)
        for robot, label in labels:
            last = Atom("last", (self.model.robots[robot], self.model.labels[robot][label]))
            for atom in self.remembered:
                if atom.args[0] == last.args[0]:
                    (adds if atom == last else deletes).add(self.number[atom])
        return replace(
            action,
            preconditions=tuple(sorted(conditions)),
            adds=tuple(sorted(adds)),
            deletes=tuple(sorted(deletes - adds)),
        )

    def naming_actions(self, tests: Terms) -> list[ClassicalAction]:
        """Actions that name a state by its word, one for each term of the word."""
        return [
            _free(
                f"name {self.names[word]} {number}",
                (*self._conditions(term), (self.naming, True)),
                (named,),
                (self.naming,),
            )
            for word, named in self.named.items()
            for number, term in enumerate(tests[word], 1)
        ]

    def following_actions(self) -> list[ClassicalAction]:
        """Actions that stay at a word of the sentence or go on to the next one."""
        found = []
        for number, (word, said) in enumerate(zip(self.words, self.said, strict=True), 1):
            here = ((self.named[word], True), (said, True))
            stay = f"stay in word {number} {self.names[word]}"
            found.append(_free(stay, here, (self.between,), (self.named[word],)))
            if number < len(self.words):
                after = self.words[number]
                found.append(
                    _free(
                        f"go on to word {number + 1} {self.names[after]}",
                        ((self.named[after], True), (said, True)),
                        (self.between, self.said[number]),
                        (self.named[after], said),
                    )
                )
        return [counted for action in found for counted in self._counted(action)]

    def _counted(self, action: ClassicalAction) -> list[ClassicalAction]:
        """An action after a joint step, once for each number of steps where they are counted."""
        if not self.taken:
            return [action]
        return [
            _free(
                f"{action.name} after step {number}",
                (*action.preconditions, (before, True)),
                (*action.adds, after),
                (*action.deletes, before),
            )
            for number, (before, after) in enumerate(pairwise(self.taken), 1)
        ]

    def goal(self, plain: ClassicalTask) -> tuple[Condition, ...]:
        """The whole sentence is passed, and the last state is named.

        ``reach the goal`` consumes the time to act.
        """
        conditions = {*plain.goal, (self.said[-1], True)}
        old = (number < self.first_new or number == self.between for number, _ in plain.goal)
        if all(old):
            conditions.add((self.between, True))
        return tuple(sorted(conditions))

    def _conditions(self, term: Conjunction) -> list[Condition]:
        return sorted((self.number[atom], value) for atom, value in term.items())


def _remembered(task_language: TaskLanguage, tests: Terms) -> dict[Atom, bool]:
    """The atoms of remembered subactions that terms mention, and whether they are true at first."""
    facts = task_language.model.codec.facts
    mentioned = {atom for terms in tests for term in terms for atom in term}
    space = task_language.space
    init = space.rows[space.state[[task_language.start]]]
    atoms, [values] = truth(task_language.model, init)
    true = dict(zip(atoms, values.tolist(), strict=True))
    return {atom: true[atom] for atom in sorted(mentioned - facts.index.keys(), key=show)}


def _free(
    name: str, conditions: Sequence[Condition], adds: Sequence[int], deletes: Sequence[int]
) -> ClassicalAction:
    """An action without cost."""
    return ClassicalAction(
        name, tuple(sorted(conditions)), tuple(sorted(adds)), tuple(sorted(deletes)), 0
    )
