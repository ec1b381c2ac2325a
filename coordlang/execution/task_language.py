# SPDX-License-Identifier: GPL-3.0-or-later
"""A language and one task in which it is used, and the plans of the task that have a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from coordlang.language.listed import ListedTask, model_of_listed
from coordlang.language.provenance import Tolerance
from coordlang.language.recorded import check_source, options_of, recorded_list
from coordlang.language.words import Language, Partition
from coordlang.verification.by_definition import Verdict, verify
from planners.joint.model import FullState, Goal, JointModel, PlanningTask
from planners.joint.tables import Ints, find_rows, unique_rows
from planners.pddl.formula_tree import conjuncts
from planners.pddl.lifted import Domain, Problem
from planners.pddl.model_options import ModelOptions
from planners.search.asynchronous import as_executed
from planners.search.kept_plans import search
from planners.search.plan_space import PlanSpace
from planners.system.errors import BadInput, OutOfMemory, Refuted, UsageError, note
from planners.system.messages import Presented, echoed


class NoPlanFits(Refuted):
    """No optimal plan of the task has this sentence.

    ``fitting`` are the word numbers of the longest prefix of the sentence with which some plan's
    sentence begins; ``next_words`` those that can follow it, None where a plan may end.
    """

    def __init__(
        self,
        task_language: TaskLanguage,
        sentence: Sequence[int],
        length: int,
        next_words: Sequence[int | None],
    ) -> None:
        names, kept_plan = task_language.partition.words, task_language.model.kept_plan
        following = [f"say {echoed(names[w])}" if w is not None else "end" for w in next_words]
        where = f'after "{task_language.text(sentence[:length])}"' if length else "at the beginning"
        wrong = f"says {echoed(names[sentence[length]])}" if length < len(sentence) else "ends"
        text = task_language.text(sentence)
        super().__init__(
            f'no {kept_plan} has the sentence "{text}": {where} no plan {wrong}',
            remedy=f"There plans {' or '.join(following)}.",
        )
        self.fitting = tuple(sentence[:length])
        self.next_words = tuple(next_words)


@dataclass(frozen=True, slots=True, repr=False)
class TaskLanguage:
    """A language with the optimal plans of one task.

    ``partition`` is the language over the model's states, ``word`` the word number of every node of
    ``space``, which holds the plans of ``task`` (a number) and perhaps of further ones.
    ``covered``: it is one of the language's candidate tasks, and nothing worse happens in it than
    the language says; for any other task nothing is guaranteed.  ``guaranteed``: the plans of each
    sentence mix freely in the task, as ``verdict`` (None: there was none, or it did not fit into
    the memory) said here. ``declared`` are domain and problem.
    """

    language: Language
    partition: Partition
    space: PlanSpace
    task: int
    word: Ints
    covered: bool
    declared: tuple[Domain, Problem]
    guaranteed: bool = True
    verdict: Verdict | None = None

    @property
    def start(self) -> int:
        """The plan-space node of the task's initial state."""
        return int(self.space.starts[self.task])

    @property
    def model(self) -> JointModel:
        """The joint model of the task."""
        return self.space.model

    @property
    def is_mapped(self) -> bool:
        """Whether the language lists every state on the plans of the space."""
        rows = self.space.rows[np.unique(self.space.state)]
        return bool((find_rows(self.partition.rows, rows) >= 0).all())

    def robot_number(self, name: str, option: str = "--robot ") -> int:
        """The number of a robot that an option names; `UsageError` if there is none of it."""
        robots = self.model.robots
        if name not in robots:
            raise UsageError(
                f"{option}{echoed(name)}: there is no such robot",
                remedy=f"The robots are {', '.join(robots)}.",
            )
        return robots.index(name)

    def words_of(self, text: str | Iterable[str]) -> tuple[int, ...]:
        """Word numbers of a sentence, ``"w2 w0"`` or ``("w2", "w0")``.

        Raises `BadInput` for an empty sentence, a word that the language does not have, or equal
        neighbours, which no sentence has.
        """
        words = text.split() if isinstance(text, str) else list(text)
        if not words:
            raise BadInput(
                "the sentence is empty", remedy="It begins with the word of the initial state."
            )
        number = {word: n for n, word in enumerate(self.partition.words)}
        for index, word in enumerate(words, 1):
            if word not in number:
                raise BadInput(
                    f"word {index} of the sentence, {echoed(word)}, is no word of this language",
                    remedy=f"Its words are {', '.join(self.partition.words)}.",
                )
        for index, (before, word) in enumerate(pairwise(words), 1):
            if before == word:
                raise BadInput(
                    f"the sentence says {echoed(word)} twice in a row "
                    f"(words {index} and {index + 1})",
                    remedy="Write a word once, however long the plan stays in it.",
                )
        return tuple(number[word] for word in words)

    def plans_with(self, words: Sequence[int]) -> PlanSpace:
        """The optimal plans of the task that have a sentence, as a plan space of one task.

        Its nodes are pairs (node of `space`, number of words passed), each on some plan with the
        sentence, so that `planners.search.plans.Plans.of` counts, ranks and samples exactly these
        plans.  The table of states and the goals are those of `space`.  O(nodes * words of the
        sentence), layer by layer.

        Raises `NoPlanFits` if no optimal plan of the task has the sentence.
        """
        space, word, length = self.space, self.word, len(words)
        if not length or word[self.start] != words[0]:
            raise NoPlanFits(self, words, 0, [int(word[self.start])])
        next_word = np.array([*words[1:], -1, -1])
        #: For each layer the node of ``space`` and the index in the sentence of its word.
        layers: list[tuple[Ints, Ints]] = [(np.array([self.start]), np.array([0]))]
        steps: list[tuple[Ints, Ints, Ints]] = []
        for _ in range(space.cost_of(self.task)[0]):
            node, index = layers[-1]
            source, edge = space.edges_from(node)
            target, before = space.targets(edge), index[source]
            changes = word[target] != word[node[source]]
            fits = ~changes | (next_word[before] == word[target])
            code = target * length + before + changes
            reached, number = np.unique(code[fits], return_inverse=True)
            layers.append((reached // length, reached % length))
            steps.append((source[fits], edge[fits], number.reshape(-1)))
        ends = layers[-1][1] == length - 1
        if not ends.any():
            furthest = max(int(index.max()) for _, index in layers if len(index))
            nodes = np.concatenate([node[index == furthest] for node, index in layers])
            raise NoPlanFits(self, words, furthest + 1, self._next_words(nodes))
        return space.unfolded([node for node, _ in layers], steps, self.task, ends)

    def _next_words(self, nodes: Ints) -> list[int | None]:
        """The words to which plans go on from some nodes of one word, None where they may end."""
        after = self.space.targets(self.space.edges_from(nodes)[1])
        following = {*self.word[after].tolist()} - {int(self.word[nodes[0]])}
        may_end = (self.space.layer[nodes] == 0).any()
        return [*sorted(following), None] if may_end else sorted(following)

    def text(self, words: Sequence[int]) -> str:
        """A sentence as it is written."""
        return " ".join(self.partition.words[word] for word in words)


def language_in_task(
    language: Language, domain: Domain, problem: Problem, options: ModelOptions | None = None
) -> TaskLanguage:
    """A language in the task of a PDDL problem.

    Raises `BadInput` when domain or problem are not the language's, `ProvedImpossible` for an
    unsolvable task.
    """
    check_source(language, domain, [problem])
    listed, position = recorded_list(language), language.position
    options = options or options_of(language)
    loaded, recorded = model_of_listed(domain, [problem], listed, options, position)
    atoms = set(" ".join(filter(None, language.states)).replace(") (", ")\0(").split("\0"))
    codec = loaded.model.codec
    atoms -= {"", *codec.facts.texts}
    unknown = {a for a in atoms if codec.memory is None or not a.startswith("(last ")}
    if unknown:
        # What can be true depends on where tasks start: the states in the language file must
        # be possible here.
        all_true = ListedTask(tuple(sorted(unknown)), ())
        loaded, (*recorded, _) = model_of_listed(
            domain, [problem], [*listed, all_true], options, position
        )
    space = as_executed(search(loaded.model, loaded.tasks[0]))
    partition = language.partition(loaded.model)
    covered = _covers(language, space, recorded)
    verdict = _verdict(partition, space) if covered else None
    guaranteed = verdict is not None and verdict.holds
    covered &= guaranteed or language.may_fail
    word = partition.word_of(space.rows)[space.state]
    read = domain, problem
    return TaskLanguage(language, partition, space, 0, word, covered, read, guaranteed, verdict)


def _verdict(partition: Partition, space: PlanSpace) -> Verdict | None:
    """Whether words are a coordination language in a plan space, by definition.

    None, with a note, where the verification does not fit into the memory.
    """
    try:
        return verify(partition, [space])
    except OutOfMemory as error:
        note(f"what the language promises is not verified here: {error.what}")
        return None


def _covers(language: Language, space: PlanSpace, recorded: Sequence[PlanningTask]) -> bool:
    """Whether the (one) task of a plan space is a candidate task of the language.

    The guarantee is about a task's optimal plans, so a task with the same optimal plans as a
    candidate is one too: under ``--tasks all``, a task whose optimal plans all end in one state,
    whatever was done last, and how much slack is left.  Within slack it is not the state in which
    they begin.
    """
    model = space.model
    row = space.rows[space.state[space.starts[0]]]
    if language.provenance.tasks["kind"] == "all":
        ends = space.rows[np.unique(space.state[space.layer == 0])]
        begin, *facts = model.codec.facts_part(model.forgetting_slack(np.stack((row, *ends))))
        if len(unique_rows(np.stack(facts))[0]) > 1 or (model.slack and (facts == begin).all()):
            return False
        return all(model.codec.key(state) in language.states for state in (row, *ends))
    init = model.forgetting_slack(row)
    return any(
        _literals(task.goal) == _literals(space.goals[0]) and (task.init == init).all()
        for task in recorded
    )


def _literals(goal: Goal) -> frozenset[object]:
    return frozenset((goal,) if isinstance(goal, FullState) else conjuncts(goal))


class InTask(Presented):
    """A result about one task under a language.  ``used`` is the language in the task."""

    __slots__ = ()
    used: TaskLanguage

    @property
    def covered(self) -> bool:
        """Whether the task is one that the language guarantees."""
        return self.used.covered

    @property
    def tolerance(self) -> Tolerance | None:
        """What may go wrong, or be longer, under the language; None: nothing."""
        return self.used.language.tolerance
