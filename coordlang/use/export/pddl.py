"""A task under a sentence as plain PDDL, so that any planner can take part.

The plain task of `planners.classical` gets one more fact per word said so far, and after each joint
step two actions without cost: the state is *named* by its word, and then the sentence *stays* at
this word or *goes on* to the next one.

Why its optimal plans are exactly the plans that fit, one to one:

1. Without naming, its plans stand one to one for the joint plans of the task, at the same cost
   (`planners.classical`). Naming costs nothing and only forbids.  So no plan is cheaper than an
   optimal plan of the task.
2. In a state on an optimal plan of the task exactly one naming is possible, that of its word
   (`membership`), and after it at most one action: which one, the word decides.  So an optimal plan
   of the task has at most one counterpart, and has it exactly if its words are, one after another,
   those of the sentence.
3. Some plan fits (`fitting`), so the optimal cost is that of the task.  Then each plan of that cost
   is an optimal plan of the task, passes only through states on optimal plans of the task, and by 2
   it fits.

States elsewhere never matter to optimal plans, so this needs no list of all states, and holds for
tasks that the language does not cover, too.  A plan of higher cost says the sentence as far as it
stays in states that the language maps.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from coordlang.use.export.membership import Membership, Term, membership
from coordlang.use.sentence.task_language import TaskLanguage
from planners.classical import (
    ClassicalAction,
    ClassicalTask,
    action_names,
    compile_classical,
    to_pddl,
)
from planners.classical.task import Condition
from planners.errors import BadInput
from planners.joint.model import IDLE, JointModel, PlanningTask
from planners.search.plans import Plan

#: A robot's label in a joint step, by the numbers of both.
Choice = tuple[int, int]


@dataclass(frozen=True, slots=True)
class PddlExport:
    """A task under a sentence for other planners.

    ``domain`` and ``problem`` are PDDL text; ``plain`` is the same as data.  ``choices`` says for
    each action, by its name in the PDDL, which robots choose what in it: all of them (explicit
    form), one, or none (bookkeeping).  ``cost`` is the total cost of an optimal plan, ``terms`` the
    number of terms that tell which word a state belongs to.
    """

    model: JointModel
    plain: ClassicalTask
    domain: str
    problem: str
    choices: dict[str, tuple[Choice, ...]]
    cost: int
    terms: int

    def joint_plan(self, names: Sequence[str]) -> Plan:
        """The joint plan that a plan of the exported problem stands for; ``names`` are its actions.

        Raises `BadInput` for an action that the problem does not have, or a plan that ends within a
        step.
        """
        steps: list[dict[int, int]] = [{}]
        for place, name in enumerate(names, 1):
            choices = self.choices.get(name.lower())
            if choices is None:
                raise BadInput(
                    f"action {place} of the plan, {name!r}, is none of the exported problem",
                    remedy="Give a plan of the problem that this command exports, with the same arguments.",
                )
            if any(robot in steps[-1] for robot, _ in choices):
                steps.append({})
            steps[-1].update(choices)
        done = [step for step in steps if step]
        for number, step in enumerate(done, 1):
            if len(step) < len(self.model.robots):
                missing = [r for i, r in enumerate(self.model.robots) if i not in step]
                raise BadInput(
                    f"in step {number} of the plan {missing[0]} chooses nothing: the plan is cut off"
                )
        return tuple(tuple(step[robot] for robot in range(len(self.model.robots))) for step in done)


def export_pddl(task_language: TaskLanguage, words: Sequence[int], limit: int = 2000) -> PddlExport:
    """The task under the sentence ``words``: its optimal plans are exactly the plans that fit, one
    to one.

    The cost of a plan is that of the joint plan: ``plain.cost`` of the total cost is (makespan,
    second component).

    Parameters
    ----------
    limit
        Up to this many plain actions every joint action is written as one; beyond, robots choose
        one after another (see `planners.classical.compile_classical`).

    Raises `NoPlanFits` if there is nothing to plan.
    """
    space, model = task_language.plans_with(words), task_language.model
    makespan, second = space.cost_of(0)
    goal = space.goals[int(space.goal[space.starts[0]])]
    task = PlanningTask("task", space.rows[space.state[space.starts[0]]], goal)
    plain = compile_classical(model, task, limit, longest=max(1, makespan))
    choices = [_choices(model, plain, action) for action in plain.actions]
    tests = membership(task_language)
    out = _Naming(task_language, words, plain, tests)
    actions = [
        out.within(action, chosen) for action, chosen in zip(plain.actions, choices, strict=True)
    ]
    actions += out.actions()
    plain = replace(
        plain,
        name=f'under "{task_language.text(words)}"',
        facts=tuple(out.facts),
        init=plain.init | out.init,
        actions=tuple(actions),
        goal=out.goal,
    )
    choices += [()] * (len(actions) - len(choices))
    domain, problem = to_pddl(plain)
    named = dict(zip(action_names(plain), choices, strict=True))
    cost = plain.step_cost * makespan + second
    return PddlExport(model, plain, domain, problem, named, cost, tests.size)


def plan_names(text: str) -> list[str]:
    """The actions in a plan file of another planner.

    One ``(name)`` a line, perhaps with a step before it.

    Comments (``;``) are left out.  Raises `BadInput` for a line that is none.
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
            raise BadInput(f"line {number} of the plan: expected '(action)', found {raw.strip()!r}")
    return names


class _Naming:
    """The facts and actions that name states and follow the sentence.

    Facts by number, as in `ClassicalTask`.
    """

    def __init__(
        self,
        task_language: TaskLanguage,
        words: Sequence[int],
        plain: ClassicalTask,
        tests: Membership,
    ) -> None:
        self.model, self.words, self.tests, self.table = (
            task_language.model,
            words,
            tests,
            task_language.partition.words,
        )
        self.facts, self.init = list(plain.facts), set[int]()
        self.known = {text: n for n, text in enumerate(self.model.codec.facts.texts)}
        self.remembered = sorted(
            {a for terms in tests.terms for t in terms for a in t if a.startswith("(last ")}
        )
        if self.model.remembers:
            key = self.model.codec.decode(
                task_language.space.rows[task_language.space.state[task_language.start]]
            )
            for atom in self.remembered:
                self.known[atom] = self.fact(atom)
            self.init |= {self.known[atom] for atom in key if atom in self.remembered}
        self.own = len(self.model.codec.facts)  # from here on, facts of the compilation
        between = [number for number in plain.init if number >= self.own]
        self.explicit = not between
        #: Between two joint steps: select-then-apply has a fact for this already.
        self.between = between[0] if between else self.fact("(time to act)")
        self.naming = self.fact("(time to name)")
        self.named = {word: self.fact(f"(named {self.table[word]})") for word in sorted(set(words))}
        self.said = [self.fact(f"(said {n})") for n in range(1, len(words) + 1)]
        self.init |= {self.between, self.said[0]}
        self.goal: tuple[Condition, ...] = self._goal(plain)

    def fact(self, text: str) -> int:
        self.facts.append(text)
        return len(self.facts) - 1

    def within(self, action: ClassicalAction, chosen: Sequence[Choice]) -> ClassicalAction:
        """An action of the plain task.

        What ends a step leads to naming, and what is remembered is noted.
        """
        conditions, adds, deletes = {*action.preconditions}, {*action.adds}, {*action.deletes}
        if self.explicit:
            conditions.add((self.between, True))
            deletes.add(self.between)
            adds |= {self.naming} if chosen else set()
        elif self.between in adds:
            adds = adds - {self.between} | {self.naming}
        for robot, label in chosen:
            prefix, text = f"(last {self.model.robots[robot]} ", self.model.labels[robot][label]
            for atom in self.remembered:
                if atom.startswith(prefix):
                    (adds if atom == f"{prefix}{text})" else deletes).add(self.known[atom])
        return replace(
            action,
            preconditions=tuple(sorted(conditions)),
            adds=tuple(sorted(adds)),
            deletes=tuple(sorted(deletes - adds)),
        )

    def actions(self) -> list[ClassicalAction]:
        """Naming by one term each, then staying or going on."""
        found = []
        for word, named in self.named.items():
            for number, term in enumerate(self.tests.terms[word], 1):
                conditions = (*self._conditions(term), (self.naming, True))
                found.append(
                    self._free(
                        f"name {self.table[word]} {number}", conditions, (named,), (self.naming,)
                    )
                )
        for place, (word, said) in enumerate(zip(self.words, self.said, strict=True)):
            here = ((self.named[word], True), (said, True))
            stay = f"stay in word {place + 1} {self.table[word]}"
            found.append(self._free(stay, here, (self.between,), (self.named[word],)))
            if place + 1 < len(self.words):
                after, text = self.words[place + 1], self.table[self.words[place + 1]]
                found.append(
                    self._free(
                        f"go on to word {place + 2} {text}",
                        ((self.named[after], True), (said, True)),
                        (self.between, self.said[place + 1]),
                        (self.named[after], said),
                    )
                )
        return found

    def _goal(self, plain: ClassicalTask) -> tuple[Condition, ...]:
        """The whole sentence is said, and the last state is named.

        ``reach the goal`` consumes the time to act.
        """
        conditions = {*plain.goal, (self.said[-1], True)}
        if all(number < self.own or number == self.between for number, _ in plain.goal):
            conditions.add((self.between, True))
        return tuple(sorted(conditions))

    def _conditions(self, term: Term) -> list[Condition]:
        return sorted((self.known[atom], value) for atom, value in term.items())

    def _free(
        self,
        name: str,
        conditions: Sequence[Condition],
        adds: Sequence[int],
        deletes: Sequence[int],
    ) -> ClassicalAction:
        return ClassicalAction(
            name, tuple(sorted(conditions)), tuple(sorted(adds)), tuple(sorted(deletes)), 0
        )


def _choices(
    model: JointModel, plain: ClassicalTask, action: ClassicalAction
) -> tuple[Choice, ...]:
    """Which robots choose what in a plain action, by its name."""
    if plain.form == "explicit":
        if action.name == "reach the goal":
            return ()
        texts = [None if t == IDLE else t for t in re.findall(rf"{IDLE}|\([^()]*\)", action.name)]
    elif not action.name.startswith("choose "):
        return ()
    else:
        chooser, label = action.name.removeprefix("choose ").split(" ", 1)
        if not model.is_joint_action:
            robot = model.robots.index(chooser)
            return ((robot, 0 if label == IDLE else model.labels[robot].index(label)),)
        texts = list(next(a.parts for a in model.actions if a.label == label))
    numbers = model.numbers(texts)
    assert numbers is not None, action.name
    return tuple(enumerate(numbers))
