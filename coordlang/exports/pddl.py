# SPDX-License-Identifier: GPL-3.0-or-later
"""A task under a sentence as plain PDDL, so that any planner can take part.

The plain task of `planners.classical` gets one more fact per word of the sentence, and after each
joint step two actions without cost: the state is *named* by its word, and then the sentence *stays*
at this word or *goes on* to the next one.

Its optimal plans are exactly the plans with the sentence, one to one (docs/use.md has the proof).
With slack the sentence is followed at most as many times as joint steps are allowed.  Then every
plan, not only the optimal ones, is a plan within the slack that has the sentence, with all, some or
none of its rest at the end; with all of it where words see what robots did last.

States elsewhere never matter to optimal plans, so this needs no list of all states, and holds for
tasks that the language does not cover, too.  A plan of higher cost follows the sentence as far as
it stays in states that the language maps.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from os import PathLike, fspath
from typing import Any

from coordlang.execution.guided_search import plan_under_sentence
from coordlang.execution.task_language import InTask, TaskLanguage
from coordlang.explanation.variables import truth
from coordlang.exports.membership import Terms, exclusive_terms, refuse_seen_slack
from planners.classical import compile_classical
from planners.classical.task import (
    ClassicalAction,
    ClassicalTask,
    Condition,
    action_names,
    to_pddl,
    with_positive_literals,
)
from planners.joint.model import IDLE, JointModel, PlanningTask, show
from planners.pddl.lifted import Atom
from planners.search.plan_file import only_one_plan
from planners.search.plans import Plan, Plans, Texts, texts
from planners.system.errors import BadInput, Position, Refuted, UsageError
from planners.system.messages import echoed
from planners.system.writing import write_texts

#: Beyond this many joint actions robots choose one after another.
MAX_ACTIONS = 2000


class ExportedTask(InTask):
    """A task under a sentence as PDDL; its optimal plans are exactly those of the sentence.

    ``classical`` is the task as data, ``domain`` and ``problem`` the same as PDDL text, ``cost``
    the total cost of an optimal plan; ``classical.cost`` of it is that of the joint plan,
    (makespan, second component).  ``labels`` are for each action, by its name in the PDDL, the
    labels that robots take in it: all robots (explicit form), one, or none (bookkeeping).  So many
    ``terms`` tell which word a state belongs to.

    Up to `MAX_ACTIONS` plain actions every joint action is written as one; beyond, robots choose
    one after another (see `planners.classical.compile_classical`).  With ``strips_only`` there are
    neither negative conditions nor costs: then the plans with the fewest actions are those of the
    sentence.

    Raises `NoPlanFits`, and `UsageError` under ``strips_only`` where actions without costs do not
    count joint steps; with slack, for words that see it, and where more than joint steps counts.
    """

    shown = ("form", "actions", "cost")

    def __init__(
        self, used: TaskLanguage, words: Sequence[int], *, strips_only: bool = False
    ) -> None:
        self.used, self.model = used, (model := used.model)
        refuse_seen_slack(model, "--to pddl")
        if model.slack and model.cost != "makespan":
            raise UsageError(
                f"--to pddl counts the joint steps of plans within slack, and --cost {model.cost} "
                "counts more",
                remedy="Build the language with --cost makespan; `coordlang understand`, `plan` "
                "and `choices` give its plans.",
            )
        space = used.plans_with(words)
        self.plans = Plans.of(space)
        makespan, second = space.cost_of(0)
        start = space.starts[0]
        task = PlanningTask("task", space.rows[space.state[start]], space.goals[space.goal[start]])
        plain = compile_classical(model, task, MAX_ACTIONS, longest=max(1, makespan))
        tests = exclusive_terms(used)
        naming = _Naming(used, words, plain, tests, makespan if model.slack else None)
        named = naming.task()
        if model.slack and not naming.remembered:  # else a rest is seen, and is part of the plan
            makespan, second = plan_under_sentence(used, words).cost
        if strips_only:
            _require_steps_counted(plain, model)
        named = with_positive_literals(named, only_goal=not strips_only)
        self.domain, self.problem = to_pddl(named, costs=not strips_only)
        self.classical = named
        self.labels = {
            name: tuple(
                (robot, model.labels[robot].index(text or IDLE)) for robot, text in own.labels
            )
            for name, own in zip(action_names(named), named.actions, strict=True)
        }
        self.cost = plain.step_cost * makespan + second
        self.terms = sum(map(len, tests))

    @property
    def form(self) -> str:
        """How joint steps are written: ``explicit`` (one action each) or robot after robot."""
        return self.classical.form

    @property
    def actions(self) -> int:
        """The number of actions."""
        return len(self.classical.actions)

    def save(self, folder: str | PathLike[str]) -> None:
        """Write ``domain.pddl`` and ``problem.pddl`` into a folder, which is made if it is missing.

        Raises `UsageError` if it cannot be written to.
        """
        written = {"domain.pddl": self.domain, "problem.pddl": self.problem}
        write_texts(fspath(folder), written)

    def translate_plan(self, actions: Sequence[str]) -> tuple[Texts, ...]:
        """Translate a plan of the exported problem, the names of its actions, into joint steps.

        Raises `BadInput` as `joint_plan`, and `Refuted` if it is not optimal there.
        """
        plan = self.joint_plan(actions)
        numbers = self.plans.of_steps(plan)
        if numbers is None or self.plans.rank(numbers) is None:
            raise Refuted(
                f"this is no {self.model.kept_plan} of the exported problem",
                remedy="Ask the planner for an optimal plan: the one of least total-cost.",
            )
        return texts(self.model, plan)

    def translate_text(self, text: str, name: str) -> tuple[Texts, ...]:
        """Translate the text of a plan file; ``name`` is what messages call it."""
        position = Position(name)
        only_one_plan(text, position)
        try:
            return self.translate_plan(plan_names(text))
        except (BadInput, Refuted) as error:
            error.position = error.position or position
            raise

    def data(self) -> dict[str, Any]:
        """The PDDL, and what each action stands for, as ``--json`` has them."""
        labels, robots = self.model.labels, self.model.robots
        return {
            "domain": self.domain,
            "problem": self.problem,
            "form": self.form,
            "step_cost": self.classical.step_cost,
            "optimal_cost": self.cost,
            "robots": list(robots),
            "actions": {
                name: {robots[r]: labels[r][label] if label else None for r, label in chosen}
                for name, chosen in self.labels.items()
            },
        }

    def joint_plan(self, names: Sequence[str]) -> Plan:
        """The joint plan that a plan of the exported problem stands for, given by its actions.

        Raises `BadInput` for an action that the problem does not have, or a plan that ends within a
        step.
        """
        steps: list[dict[int, int]] = [{}]
        for number, name in enumerate(names, 1):
            chosen = self.labels.get(name.lower())
            if chosen is None:
                raise BadInput(
                    f"action {number} of the plan, {echoed(name)}, is none of the exported problem",
                    remedy="Give a plan of the problem that this command exports, with the same "
                    "arguments.",
                )
            if steps[-1].keys() & dict(chosen).keys():
                steps.append({})
            steps[-1].update(chosen)
        plan = [step for step in steps if step]
        for number, step in enumerate(plan, 1):
            if missing := {*range(len(self.model.robots))} - step.keys():
                name = self.model.robots[min(missing)]
                raise BadInput(
                    f"in step {number} of the plan {name} chooses nothing: the plan is cut off",
                    remedy="Give the whole plan that the planner wrote.",
                )
        return tuple(tuple(step[robot] for robot in sorted(step)) for step in plan)


def _require_steps_counted(plain: ClassicalTask, model: JointModel) -> None:
    """Raise `UsageError` where fewest actions are not least cost.

    In the explicit form each joint step takes as many actions as any other: itself, the naming of
    its state, and one that stays at the word or goes on.
    """
    if plain.form != "explicit":
        raise UsageError(
            "without costs every joint action must be one action, and there are too many",
            remedy="Leave out --for pyperplan.",
        )
    if model.cost != "makespan":
        raise UsageError(
            f"--for pyperplan writes no costs, and --cost {model.cost} needs them",
            remedy="Leave out --for pyperplan, or build the language with --cost makespan.",
        )


def plan_names(text: str) -> list[str]:
    """Read the actions of a plan file of another planner.

    One ``(name)`` a line, perhaps with a step before it.  Comments (``;``) are left out.  Raises
    `BadInput` for a line that is not an action.
    """
    names = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.split(";")[0].strip()
        match = re.fullmatch(
            r"(?:\d+(?:\.\d+)?\s*:\s*)?(?:\(\s*([^\s()]+)\s*\)|([^\s()]+?)(?:\(\))?)(?:\s*\[.*\])?",
            line,
        )
        if match:
            names.append(match[1] or match[2])
        elif line:
            raise BadInput(
                f"line {number} of the plan: expected '(action)', found {echoed(raw.strip())}",
                remedy="Give a plan file as planners write it: one action a line, "
                "comments behind ';'.",
            )
    return names


class _Naming:
    """The plain task in which states are named by their words and the sentence is followed.

    ``tests`` say which states belong to which word, ``steps`` is the most joint steps; None: any
    number.  Facts are numbers, as in `ClassicalTask`.
    """

    def __init__(
        self,
        task_language: TaskLanguage,
        words: Sequence[int],
        plain: ClassicalTask,
        tests: Terms,
        steps: int | None,
    ) -> None:
        self.model, self.words, self.plain, self.tests = task_language.model, words, plain, tests
        self.sentence, self.names = task_language.text(words), task_language.partition.words
        self.texts, self.init = list(plain.facts), {*plain.init}
        self.number: dict[Atom, int] = dict(self.model.codec.facts.index)
        self.remembered = _remembered(task_language, tests)
        for atom, true in self.remembered.items():
            self.number[atom] = self.add(show(atom))
            self.init |= {self.number[atom]} if true else set()
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

    def task(self) -> ClassicalTask:
        """The task: the actions of the plain one, then those that name and follow."""
        within = map(self.within, self.plain.actions)
        return replace(
            self.plain,
            name=f'under "{self.sentence}"',
            facts=tuple(self.texts),
            init=frozenset(self.init),
            actions=(*within, *self.naming_actions(), *self.following_actions()),
            goal=self.goal(),
        )

    def add(self, text: str) -> int:
        self.texts.append(text)
        return len(self.texts) - 1

    def within(self, action: ClassicalAction) -> ClassicalAction:
        """An action of the plain task that leads to naming at the end of a step, and remembers."""
        conditions, adds, deletes = {*action.preconditions}, {*action.adds}, {*action.deletes}
        if self.explicit:
            conditions.add((self.between, True))
            deletes.add(self.between)
            adds |= {self.naming} if action.labels else set()
        elif self.between in adds:
            adds = adds - {self.between} | {self.naming}
            if (self.between, True) in conditions:  # one robot: the step ends as it begins
                deletes.add(self.between)
        for robot, text in action.labels:
            last = Atom("last", (self.model.robots[robot], text or IDLE))
            for atom in self.remembered:
                if atom.args[0] == last.args[0]:
                    (adds if atom == last else deletes).add(self.number[atom])
        return replace(
            action,
            preconditions=tuple(sorted(conditions)),
            adds=tuple(sorted(adds)),
            deletes=tuple(sorted(deletes - adds)),
        )

    def naming_actions(self) -> list[ClassicalAction]:
        """Actions that name a state by its word, one for each term of the word."""
        return [
            _free(
                f"name {self.names[word]} {number}",
                (*((self.number[atom], v) for atom, v in term.items()), (self.naming, True)),
                (named,),
                (self.naming,),
            )
            for word, named in self.named.items()
            for number, term in enumerate(self.tests[word], 1)
        ]

    def following_actions(self) -> Iterator[ClassicalAction]:
        """Actions that stay at a word of the sentence or go on to the next one."""
        for number, (word, said) in enumerate(zip(self.words, self.said, strict=True)):
            named, place = self.named[word], f"word {number + 1} {self.names[word]}"
            if number:
                here = (named, self.said[number - 1])
                yield from self._counted(f"go on to {place}", here, (self.between, said), here)
            yield from self._counted(f"stay in {place}", (named, said), (self.between,), (named,))

    def _counted(
        self, name: str, true: Sequence[int], adds: Sequence[int], deletes: Sequence[int]
    ) -> Iterator[ClassicalAction]:
        """An action after a joint step, once for each number of steps where they are counted."""
        here = [(fact, True) for fact in true]
        if not self.taken:
            yield _free(name, here, adds, deletes)
        for number, (before, after) in enumerate(pairwise(self.taken), 1):
            conditions = (*here, (before, True))
            after_step = f"{name} after step {number}"
            yield _free(after_step, conditions, (*adds, after), (*deletes, before))

    def goal(self) -> tuple[Condition, ...]:
        """The whole sentence is passed, and the last state is named, by ``reach the goal``, too."""
        conditions = {*self.plain.goal, (self.said[-1], True)}
        old = {self.between, *range(len(self.model.codec.facts))}  # further ones: the compilation's
        if all(number in old for number, _ in self.plain.goal):
            conditions.add((self.between, True))
        if self.remembered:  # a rest may add words
            conditions |= {(step, True) for step in self.taken[-1:]}
        return tuple(sorted(conditions))


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
