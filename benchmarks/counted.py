# SPDX-License-Identifier: GPL-3.0-or-later
"""The number of optimal plans once more: models of a formula, counted by Ganak.

    python benchmarks/counted.py [--limit SECONDS] [--kept FILE] [--cost COST] [--first N]
                                 [--searched FILE] [--python PYTHON] [ROW ..]

Rows are those of coverage.py that its search solves.  The formula is written from the ground
actions and the definition of a joint step alone: no bound, no mutex, no table of interference and
no other part of the search has to do with it.  Its models stand one to one for the plans of a task
that have as many joint steps and, under makespan+actions, as many actions as the search says.
Shared with the search are the PDDL reader, the grounder and the rule of who may idle.

Columns: the cost and the number of plans by the search; what CaDiCaL says of fewer joint steps, and
of as many with fewer actions (``none``: refuted); Ganak's number of models; where it has none, how
many models CaDiCaL finds one by one until no other is left; seconds and memory.  A question that is
not answered within ``--limit`` CPU seconds (60) and 8 GB is left open (``?``); a number that
differs ends the run with an error.  ``--searched`` is a file that coverage.py kept: its rows are
not searched again.  ``--python`` is a Python that has the counter (``pip install '.[oracles]'``).
Actions with conditional effects, disjunctions, quantifiers or conditions about the joint step are
not written down here, nor those of several robots.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import coverage
from kept_rows import KeptRows, asked_for
from printed_table import PrintedTable
from processes import run_python

if TYPE_CHECKING:
    from planners.grounding import GroundAction
    from planners.loading import PlanningInstance
    from planners.pddl.lifted import Atom, Formula

COLUMNS = (
    ("row", -38),
    ("makespan", 8),
    ("second", 6),
    ("shorter", 7),
    ("cheaper", 7),
    ("plans", 24),
    ("models", 24),
    ("listed", 7),
    ("s", 7),
    ("MB", 5),
)
QUESTIONS = ("shorter", "cheaper", "models")
#: Plans beyond which models are not found one by one.
_LISTED = 400_000
#: Reads a formula and the variables whose values are counted; prints the number as JSON.
COUNT = """
import json, resource, sys
from pyganak import Counter
path, seconds, memory = sys.argv[1], *map(int, sys.argv[2:])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
counter = Counter()
with open(path) as file:
    counter.new_vars(int(file.readline().split()[2]))
    counter.set_sampling_set([int(text) for text in file.readline().split()[3:-1]])
    for line in file:
        counter.add_clause([int(text) for text in line.split()[:-1]])
print(json.dumps({"models": str(counter.count())}))
"""


class NotWritten(Exception):
    """The task has something that this formula does not say."""


class PlanFormula:
    """The joint plans of a task with so many steps, as models of a formula in conjunctive form.

    Parameters
    ----------
    loaded
        The joint model and its task; ground actions, robots and the first task are read.
    steps
        The number of joint steps.
    most
        The most actions that a plan may have, without those that do nothing; None: any number.
    least
        The least number of them.

    Raises
    ------
    NotWritten
        A condition is no conjunction of literals over states, or an action has several robots.
    """

    def __init__(
        self, loaded: PlanningInstance, steps: int, least: int = 0, most: int | None = None
    ) -> None:
        from planners.joint.model import FullState

        model, task = loaded.model, loaded.tasks[0]
        if isinstance(task.goal, FullState):
            raise NotWritten("a goal that is a whole state")
        self.clauses: list[list[int]] = []
        self.size = 0
        #: Per step and robot the variables of its actions; the first one is idling.
        self.chosen: list[list[list[int]]] = []
        self._actions: list[list[GroundAction]] = [[] for _ in model.robots]
        for action in model.actions:
            if len(action.owners) != 1 or action.parts:
                raise NotWritten("an action of several robots")
            self._actions[action.owners[0]].append(action)
        self._conditions = {
            id(action): literals(action.precondition) for own in self._actions for action in own
        }
        facts = list(model.codec.facts)
        true = {facts[number] for number in model.codec.true_facts(task.init)} | model.statics
        goal = literals(task.goal)
        mentioned = {fact for fact, _ in goal}
        for own in self._actions:
            for action in own:
                mentioned |= {fact for fact, _ in self._conditions[id(action)]}
                mentioned |= {effect.atom for effect in action.effects}
        now = {fact: self._fresh() for fact in sorted(mentioned, key=str)}
        for fact, variable in now.items():
            self.clauses.append([variable if fact in true else -variable])
        for _ in range(steps):
            now = self._step(now)
        for fact, value in goal:
            self.clauses.append([now[fact] if value else -now[fact]])
        if most is not None:
            self._count(least, most)

    @property
    def sampled(self) -> list[int]:
        """The variables that are the plan: the robots' actions."""
        return [variable for step in self.chosen for own in step for variable in own]

    def _fresh(self) -> int:
        self.size += 1
        return self.size

    def _any(self, variables: Sequence[int]) -> int:
        """A variable that is true where one of these is, and nowhere else."""
        if len(variables) == 1:
            return variables[0]
        found = self._fresh()
        self.clauses.append([-found, *variables])
        self.clauses += [[found, -variable] for variable in variables]
        return found

    def _step(self, now: dict[Atom, int]) -> dict[Atom, int]:
        """The clauses of a joint step; the variables of the facts after it."""
        own = [[self._fresh() for _ in (None, *actions)] for actions in self._actions]
        self.chosen.append(own)
        touched: list[dict[str, dict[Atom, int]]] = []
        for robot, variables in enumerate(own):
            self._exactly_one(variables)
            footprint: dict[str, dict[Atom, list[int]]] = {
                kind: {} for kind in ("adds", "deletes", "needs", "forbids")
            }
            for action, variable in zip(self._actions[robot], variables[1:], strict=True):
                for fact, value in self._conditions[id(action)]:
                    self.clauses.append([-variable, now[fact] if value else -now[fact]])
                for kind, fact in footprints(action, self._conditions[id(action)]):
                    footprint[kind].setdefault(fact, []).append(variable)
            touched.append(
                {
                    kind: {fact: self._any(labels) for fact, labels in found.items()}
                    for kind, found in footprint.items()
                }
            )
        for one, other in permutations(touched, 2):
            for kind, against in (("deletes", "needs"), ("deletes", "adds"), ("adds", "forbids")):
                for fact in one[kind].keys() & other[against].keys():
                    self.clauses.append([-one[kind][fact], -other[against][fact]])
        after = {}
        for fact, before in now.items():
            adding = [robot["adds"][fact] for robot in touched if fact in robot["adds"]]
            deleting = [robot["deletes"][fact] for robot in touched if fact in robot["deletes"]]
            after[fact] = self._after(before, adding, deleting)
        return after

    def _after(self, before: int, adding: list[int], deleting: list[int]) -> int:
        """A fact after a step: it is added, or was true and is not deleted."""
        if not adding and not deleting:
            return before
        after = self._fresh()
        self.clauses += [[-variable, after] for variable in adding]
        self.clauses += [[-variable, -after, *adding] for variable in deleting]
        self.clauses.append([-after, before, *adding])
        self.clauses.append([after, -before, *deleting])
        return after

    def _exactly_one(self, variables: Sequence[int]) -> None:
        """One of some variables is true, by whether one up to here is."""
        self.clauses.append([*variables])
        so_far = variables[0]
        for variable in variables[1:]:
            self.clauses.append([-so_far, -variable])
            so_far = self._any([so_far, variable])

    def _count(self, least: int, most: int) -> None:
        """The actions that are no idling are so many: a sequential counter."""
        counted = [
            self._any(variables[1:]) for step in self.chosen for variables in step if variables[1:]
        ]
        # at_least[k]: of those so far more than k are true.
        at_least: list[int] = []
        for variable in counted:
            more = []
            for k in range(min(len(at_least) + 1, most + 1)):
                fewer = [at_least[k - 1], variable] if k else [variable]
                both = fewer[0] if len(fewer) == 1 else self._all(fewer)
                more.append(self._any([both, at_least[k]]) if k < len(at_least) else both)
            at_least = more
        if len(at_least) > most:
            self.clauses.append([-at_least[most]])
        if least:
            self.clauses.append([at_least[least - 1]] if least <= len(at_least) else [])

    def _all(self, variables: Sequence[int]) -> int:
        """A variable that is true where all of these are, and nowhere else."""
        return -self._any([-variable for variable in variables])


def literals(formula: Formula) -> list[tuple[Atom, bool]]:
    """The literals of a conjunction."""
    from planners.pddl.lifted import TRUE, And, Atom, Not

    if isinstance(formula, And):
        return [found for part in formula.parts for found in literals(part)]
    if isinstance(formula, Atom):
        return [(formula, True)]
    if isinstance(formula, Not) and isinstance(formula.part, Atom):
        return [(formula.part, False)]
    if formula == TRUE:
        return []
    raise NotWritten("a condition that is no conjunction of facts")


def footprints(
    action: GroundAction, conditions: Iterable[tuple[Atom, bool]]
) -> Iterable[tuple[str, Atom]]:
    """What an action needs, forbids, adds and deletes; what it adds, it does not delete."""
    from planners.pddl.lifted import TRUE

    for fact, value in conditions:
        yield "needs" if value else "forbids", fact
    if any(effect.condition != TRUE for effect in action.effects):
        raise NotWritten("a conditional effect")
    adds = {effect.atom for effect in action.effects if effect.adds}
    yield from (("adds", fact) for fact in sorted(adds, key=str))
    deletes = {effect.atom for effect in action.effects if not effect.adds} - adds
    yield from (("deletes", fact) for fact in sorted(deletes, key=str))


def answer(formula: PlanFormula) -> bool:
    """Whether a formula has a model, by CaDiCaL."""
    from pysat.solvers import Cadical153

    with Cadical153(bootstrap_with=formula.clauses) as solver:
        return bool(solver.solve())


def listed(formula: PlanFormula, most: int) -> int:
    """How many plans a formula has, found one by one by CaDiCaL until no other is left.

    It stops at one more than ``most``.
    """
    from pysat.solvers import Cadical153

    found = 0
    with Cadical153(bootstrap_with=formula.clauses) as solver:
        while found <= most and solver.solve():
            found += 1
            true = set(solver.get_model() or ())
            solver.add_clause([-variable for variable in formula.sampled if variable in true])
    return found


def one(name: str, given: argparse.Namespace) -> dict[str, Any]:
    """The answer to a question about a row; for the number of models the formula is written."""
    loaded = coverage.load(name, given.cost)
    most = None if given.cost == "makespan" else given.second
    if given.question == "shorter":
        return {"found": [k for k in range(given.makespan) if answer(PlanFormula(loaded, k))]}
    if given.question == "cheaper":
        if not most:
            return {"found": []}
        formula = PlanFormula(loaded, given.makespan, most=most - 1)
        return {"found": [most - 1] if answer(formula) else []}
    formula = PlanFormula(loaded, given.makespan, most or 0, most)
    if given.question == "listed":
        return {"listed": str(listed(formula, _LISTED))}
    with Path(given.out).open("w") as file:
        print("p cnf", formula.size, len(formula.clauses), file=file)
        print("c p show", *formula.sampled, 0, file=file)
        for clause in formula.clauses:
            print(*clause, 0, file=file)
    return {"clauses": len(formula.clauses)}


def asked(
    name: str, question: str, figures: dict[str, Any], given: argparse.Namespace
) -> dict[str, Any]:
    """The answer to a question about a row, from processes with limits; its seconds and memory."""
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "plans.cnf")
        arguments = [__file__, name, "--question", question, "--out", out]
        for key in ("makespan", "second"):
            arguments += [f"--{key}", str(figures[key])]
        arguments += ["--cost", given.cost, "--limit", str(given.limit)]
        done = run_python(arguments, most=20 * given.limit)
        if "clauses" in done.data:
            count = ("-c", COUNT, out, str(given.limit), str(coverage.MEMORY))
            done = run_python(count, most=20 * given.limit, python=given.python)
    return {**done.data, "seconds": done.seconds, "memory": done.memory}


def measured(name: str, known: KeptRows, given: argparse.Namespace) -> dict[str, Any]:
    """The figures of a row: the search's, and the answers to the questions about it."""
    how = coverage.Asked("", 10, given.cost)
    figures = known.get(how.key(name), partial(coverage.measured, name, given.limit, how))
    if "plans" not in figures:
        return {"row": name}
    found = {key: figures[key] for key in ("makespan", "second")} | {"plans": str(figures["plans"])}
    for question in QUESTIONS:
        found[question] = asked(name, question, figures, given)
    return {"row": name, "version": coverage.project(), **found}


def one_by_one(key: str, figures: dict[str, Any], given: argparse.Namespace) -> dict[str, Any]:
    """The answer to the last question, about a row whose models were not counted."""
    return {"row": key, **asked(figures["row"], "listed", figures, given)}


def cells(figures: dict[str, Any], last: dict[str, Any] | None) -> Iterator[object]:
    """The line of a row; exits with an error where a number differs.

    ``last`` is the answer to the last question, None where it was not asked.
    """
    yield from (figures[key] for key in ("row", "makespan", "second"))
    answers = [figures[question] for question in QUESTIONS]
    for own in answers[:2]:
        if own.get("found"):
            raise SystemExit(f"{figures['row']}: a better plan was found: {figures}")
        yield own.get("refused", "none" if "found" in own else "?")
    models = answers[2].get("models")
    one_by_one = None if last is None else last.get("listed")
    if {models, one_by_one} - {None, figures["plans"]}:
        raise SystemExit(f"{figures['row']}: the number of models differs: {figures}, {last}")
    yield figures["plans"]
    yield models or answers[2].get("refused", "?")
    yield "" if last is None else one_by_one or "?"
    answers += [] if last is None else [last]
    yield round(sum(own["seconds"] for own in answers), 1)
    yield max(own["memory"] for own in answers)


def main() -> None:
    """Print what the arguments say."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rows", nargs="*", metavar="ROW", help="rows, or beginnings of their names")
    parser.add_argument("--first", type=int, default=10, metavar="N", help="problems of a domain")
    parser.add_argument("--limit", type=int, default=60, metavar="SECONDS", help="CPU seconds (60)")
    parser.add_argument("--cost", default="makespan+actions", help="of CoDMAP's tasks")
    parser.add_argument("--kept", type=Path, metavar="FILE", help="where lines are kept")
    parser.add_argument("--searched", type=Path, metavar="FILE", help="what coverage.py kept")
    parser.add_argument("--python", default=sys.executable, help="a Python that has the counter")
    for hidden in ("--question", "--out"):
        parser.add_argument(hidden, help=argparse.SUPPRESS)
    for hidden in ("--makespan", "--second"):
        parser.add_argument(hidden, type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.question:
        resource.setrlimit(resource.RLIMIT_CPU, (given.limit, given.limit + 1))
        resource.setrlimit(resource.RLIMIT_AS, (coverage.MEMORY, coverage.MEMORY))
        try:
            print(json.dumps(one(given.rows[0], given)))
        except NotWritten as error:
            print(json.dumps({"refused": str(error)}))
        return
    known, searched = KeptRows(given.kept), KeptRows(given.searched)
    table = PrintedTable(*COLUMNS)
    for name in asked_for(coverage.rows(given.first), given.rows):
        found = known.get(name, partial(measured, name, searched, given))
        if "plans" not in found:
            continue
        last = None
        if not {"models", "refused"} & found["models"].keys() and int(found["plans"]) <= _LISTED:
            key = f"{name} (one by one)"
            last = known.get(key, partial(one_by_one, key, found, given))
        table.print(*cells(found, last))


if __name__ == "__main__":
    main()
