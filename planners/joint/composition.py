# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint steps: composed of the robots' own subactions, or as joint-action PDDL writes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import combinations, pairwise, product
from math import prod

import numpy as np

from planners.grounding.actions import GroundAction
from planners.joint.conditions import Evaluator, Labels, Operators, speaks_of_step
from planners.joint.interference import Choices, compatible, conflict
from planners.joint.model import Options, Stepper, Steps, products
from planners.joint.states import TrueFacts
from planners.joint.tables import Bools, Ints, Numbers, Rows, differs, ranges, spans
from planners.pddl.formula_tree import conjuncts, formula_text, joined, signed
from planners.pddl.lifted import FALSE, And, Atom, Formula, Junction, StepAtom
from planners.pddl.model_options import Cost
from planners.system.errors import OutOfMemory, Position
from planners.system.limits import memory_left, more_memory
from planners.system.messages import counted


class ComposingStepper(Stepper):
    """The `Stepper` of PDDL with one action per robot: every robot picks one subaction or idles.

    ``subactions`` are each robot's ground actions, shared ones in the lists of all their owners;
    ``labelled`` the same with None first (idling).  ``tables[i, j]`` (i < j) says which labels of
    two robots may share a step (`planners.joint.interference`).  ``piece`` joint steps are composed
    at a time, before that is looked up; combinations that need more than ``memory_left`` bytes are
    not made.
    """

    piece = 1_000_000
    memory_left = staticmethod(memory_left)

    def __init__(
        self,
        evaluator: Evaluator,
        robots: Sequence[str],
        subactions: Sequence[Sequence[GroundAction]],
        cost: Cost,
        idling_costs: Sequence[int],
    ) -> None:
        self._evaluator, self._robots = evaluator, tuple(robots)
        self.labelled: list[list[GroundAction | None]] = [[None, *own] for own in subactions]
        known = [Choices(own) for own in self.labelled]
        self.tables = {
            (i, j): compatible(known[i], known[j], i, j)
            for i, j in combinations(range(len(robots)), 2)
        }
        #: Pairs of robots some of whose labels may not meet.
        self._apart = {pair for pair, table in self.tables.items() if not table.all()}
        self._robot = [
            _Subactions(own, evaluator, number, cost, idling_costs[number])
            for number, own in enumerate(self.labelled)
        ]
        #: For each robot the second cost component of each of its labels.
        self.costs = [robot.cost for robot in self._robot]

    def steps(self, rows: Rows, options: Options | None = None) -> Steps:
        """See `Stepper`."""
        chosen = self.choices(rows) if options is None else options
        waits = [own.waits(rows, *its) for own, its in zip(self._robot, chosen, strict=True)]
        parts = []
        for span in list(spans(products(chosen), self.piece)) or [slice(0, 0)]:
            source, labels = self._compose(rows, chosen, waits, span)
            parts.append((source, labels, *self._apply(rows, source, labels)))
        return Steps(*map(np.concatenate, zip(*parts, strict=True)))

    def choices(self, rows: Rows) -> Options:
        """For each robot the labels whose conditions on the state hold, by state (CSR)."""
        true, every = TrueFacts(rows), np.arange(len(rows) + 1)
        found = [robot.operators.applicable(rows, true) for robot in self._robot]
        return [(np.searchsorted(row, every), label) for row, label in found]

    def allows(self, row: Rows, labels: Sequence[int]) -> bool:
        """Whether labels are among the `choices` in a state."""
        pairs = zip(self._robot, labels, strict=True)
        return all(own.operators.allows(row, label) for own, label in pairs if label)

    def is_fixed(self, labels: Sequence[int]) -> bool:
        """Whether what labels do, and beside which others, depends on no state and no formula."""
        return not any(own.depends[label] for own, label in zip(self._robot, labels, strict=True))

    def fixed_step(self, row: Rows, labels: Sequence[int]) -> Rows | None:
        """What a step leads to whose labels a state allows, and that `is_fixed`.

        As `steps` finds it of many states; of one this is far quicker: plans of rovers p12 without
        a common step take half as long.
        """
        if not all(self.tables[i, j][labels[i], labels[j]] for i, j in self._apart):
            return None
        adds, deletes = np.zeros_like(row), np.zeros_like(row)
        for own, label in zip(self._robot, labels, strict=True):
            adds |= own.operators.adds[label]
            deletes |= own.operators.deletes[label]
        return (row & ~deletes) | adds

    def most_steps(self, rows: Rows) -> int:
        """Products of the own choices."""
        counts = [np.diff(first).tolist() for first, _ in self.choices(rows)]
        return sum(map(prod, zip(*counts, strict=True)))

    def why_not(self, row: Rows, labels: Sequence[int]) -> str:
        """The first rule that these labels break in a state."""
        return next(self._broken_rules(row, labels), "this is a joint step")

    def _broken_rules(self, row: Rows, labels: Sequence[int]) -> Iterator[str]:
        acting = {i: action for i, own in enumerate(self.labelled) if (action := own[labels[i]])}
        for action, robot, part in self._unmet(acting, row, labels, of_step=False):
            yield f"{self._robots[robot]} cannot {action.label} here: it needs {_text(part)}"
        for action in acting.values():
            for owner in action.owners:
                if acting.get(owner) != action:
                    yield f"{action.label} needs {self._robots[owner]} to choose it too"
        different = list(dict.fromkeys(acting.values()))
        for number, second in enumerate(different):
            yield from filter(None, (conflict(first, second) for first in different[:number]))
        for action, *_ in self._unmet(acting, row, labels, of_step=True):
            what = "needs another subaction in the same step, which is not chosen"
            yield f"{action.label} {what}"

    def _unmet(
        self, acting: Mapping[int, GroundAction], row: Rows, labels: Sequence[int], *, of_step: bool
    ) -> Iterator[tuple[GroundAction, int, Formula]]:
        """The conjuncts of preconditions that do not hold: about the state, or about the step."""
        beside = row[None, :], np.zeros(1, np.int64), np.array([labels], np.int32)
        for robot, action in acting.items():
            for part in conjuncts(action.precondition):
                if speaks_of_step(part) == of_step and not self._evaluator.holds(part, *beside)[0]:
                    yield action, robot, part

    def interfering_pairs(self) -> int:
        """See `Stepper`."""
        return sum(int(np.count_nonzero(~table[1:, 1:])) for table in self.tables.values())

    def conflicts(self, rows: Rows) -> Iterator[tuple[object, str]]:
        """See `Stepper`."""
        options, why = self.choices(rows), cache(self._conflict)
        robots = range(len(self._robots))
        for state, (i, j) in product(range(len(rows)), combinations(robots, 2)):
            mine, theirs = (
                labels[first[state] : first[state + 1]]
                for first, labels in (options[i], options[j])
            )
            for a, b in np.argwhere(~self.tables[i, j][np.ix_(mine, theirs)]).tolist():
                pair = i, j, int(mine[a]), int(theirs[b])
                if text := why(*pair):
                    yield pair, text

    def _conflict(self, i: int, j: int, mine: int, theirs: int) -> str | None:
        first, second = self.labelled[i][mine], self.labelled[j][theirs]
        return conflict(first, second) if first and second else None

    def _compose(
        self, rows: Rows, options: Options, waits: Sequence[Bools], span: slice
    ) -> tuple[Ints, Labels]:
        source = np.arange(span.start, span.stop)
        # By robot its option in each combination so far.
        picked: list[Ints] = []
        for j, (first, own) in enumerate(options):
            counts = first[source + 1] - first[source]
            self._require_room(int(counts.sum()), j, len(rows[span]))
            mine = ranges(first[source], counts)
            each = np.repeat(np.arange(len(source)), counts)
            source, picked = source[each], [*(before[each] for before in picked), mine]
            for i in range(j):
                if (i, j) not in self._apart:
                    continue
                fits = self.tables[i, j][options[i][1][picked[i]], own[picked[j]]]
                if not fits.all():
                    kept = np.flatnonzero(fits)
                    source, picked = source[kept], [before[kept] for before in picked]
        columns = [own[mine] for (_, own), mine in zip(options, picked, strict=True)]
        labels = np.stack(columns, axis=1, dtype=np.int32, casting="same_kind")
        fits = np.ones(len(source), np.bool_)
        for i, robot in enumerate(self._robot):
            asking = np.flatnonzero(fits & waits[i][picked[i]])
            robot.drop_unmet(fits, asking, i, rows, source, labels)
        return (source, labels) if fits.all() else (source[fits], labels[fits])

    def _require_room(self, combinations: int, robot: int, states: int) -> None:
        """Stop before combinations with one more robot's labels take more memory than there is."""
        # A number of the state and one of each label so far, in two copies, and what compares them.
        needed = 8 * (2 * robot + 6) * combinations
        if combinations > self.piece and needed > self.memory_left():
            raise OutOfMemory(
                f"{robot + 1} of {len(self._robots)} robots have {combinations:,} combinations of "
                f"subactions in {counted(states, 'state')}: about {needed / 2**30:,.1f} GiB, "
                f"and {self.memory_left() / 2**30:.1f} GiB are left",
                remedy=f"Use fewer robots, or {more_memory()}.",
            )

    def _apply(self, rows: Rows, source: Ints, labels: Labels) -> tuple[Rows, Ints]:
        before, cost = rows[source], np.zeros(len(source), np.int64)
        adds, deletes = np.zeros_like(before), np.zeros_like(before)
        for robot, mine in zip(self._robot, labels.T, strict=True):
            added, deleted = robot.operators.changes(rows, source, mine, labels)
            adds |= added
            deletes |= deleted
            cost += robot.cost[mine]
        return (before & ~deletes) | adds, cost


class _Subactions:
    """One robot's labels as tables: what they do, their ``cost``, and formulas about the step."""

    def __init__(
        self,
        actions: Sequence[GroundAction | None],
        evaluator: Evaluator,
        robot: int,
        cost: Cost,
        idling_cost: int,
    ) -> None:
        self._evaluator = evaluator
        self.operators = Operators(actions, evaluator)
        # A shared subaction is paid once, by the first of its owners.
        own = [a.second_cost(cost) if a.owners[0] == robot else 0 for a in actions if a]
        self.cost = np.array([idling_cost, *own], np.int64)
        #: By label which of ``_formulas`` it asks of the step, or -1; these are with what of the
        #: state is enough.
        self._asked: Ints = np.full(len(actions), -1)
        numbers: dict[Formula, int] = {}
        for label, formulas in self.operators.step_formulas.items():
            self._asked[label] = numbers.setdefault(And(tuple(formulas)), len(numbers))
        self._formulas = [(formula, _enough(formula)) for formula in numbers]
        #: Which labels ask something of the step, or do what depends on the state.
        self.depends = self._asked >= 0
        self.depends[list(self.operators.conditional)] = True

    def waits(self, rows: Rows, first: Ints, label: Ints) -> Bools:
        """Which options in the states of a table (CSR) depend on what the others choose."""
        asked = self._asked[label]
        found: Bools = asked >= 0
        row = np.repeat(np.arange(len(rows)), np.diff(first))
        for there in _by_value(np.flatnonzero(found), asked):
            _, enough = self._formulas[asked[there[0]]]
            found[there] = ~self._evaluator.holds(enough, rows, row[there])
        return found

    def drop_unmet(
        self, fits: Bools, asking: Ints, robot: int, rows: Rows, source: Ints, labels: Labels
    ) -> None:
        """Clear ``fits`` where a formula about the step is not met, of the items ``asking``."""
        asked = self._asked[labels[:, robot]]
        for there in _by_value(asking, asked):
            formula, _ = self._formulas[asked[there[0]]]
            fits[there] = self._evaluator.holds(formula, rows, source[there], labels[there])


def _by_value(items: Ints, values: Numbers) -> list[Ints]:
    """The items in groups of equal values."""
    items = items[np.argsort(values[items], kind="stable")]
    first = np.flatnonzero(differs(values[items])).tolist()
    return [items[begin:end] for begin, end in pairwise([*first, len(items)])]


def _enough(formula: Formula) -> Formula:
    """What of the state makes a formula in negation normal form true, whatever the step is."""
    if isinstance(formula, Junction):
        return joined(type(formula), map(_enough, formula.parts))
    return FALSE if isinstance(signed(formula)[0], StepAtom) else formula


def _text(formula: Formula) -> str:
    literal, _ = signed(formula)
    if isinstance(literal, Atom | StepAtom):
        return formula_text(formula)
    return "a formula of its precondition"


class JointActionStepper(Stepper):
    """The `Stepper` of joint-action PDDL: a joint action is written as a whole.

    Actions with the same parts are one joint action if they do the same; different results for the
    same parts are an error (`BadInput`), because no robot could tell them apart.  ``positions`` are
    the schemas' positions, for that message.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        robots: Sequence[str],
        labels: Sequence[Sequence[str]],
        actions: Sequence[GroundAction],
        cost: Cost,
        positions: Mapping[str, Position],
    ) -> None:
        self._positions = positions
        self._robots = tuple(robots)
        self._names, self._actions = [tuple(own) for own in labels], tuple(actions)
        self._operators = Operators(actions, evaluator)
        numbers = [{text: n for n, text in enumerate(own)} for own in labels]
        self._labels = np.array(
            [[numbers[i][p] if p else 0 for i, p in enumerate(a.parts)] for a in actions], np.int32
        ).reshape(len(actions), len(robots))
        self._cost = np.array([action.second_cost(cost) for action in actions], np.int64)

    def steps(self, rows: Rows, options: Options | None = None) -> Steps:
        """See `Stepper`; ``options`` are not looked at: no robot chooses by itself."""
        row, operator = self._operators.applicable(rows)
        adds, deletes = self._operators.changes(rows, row, operator)
        result = (rows[row] & ~deletes) | adds
        labels = self._labels[operator]
        # Of joint actions with the same parts the cheapest comes first, and is kept.
        order = np.lexsort((self._cost[operator], *labels.T[::-1], row))
        row, labels, result = row[order], labels[order], result[order]
        cost, operator = self._cost[operator[order]], operator[order]
        same = np.zeros(len(row), np.bool_)
        same[1:] = (row[1:] == row[:-1]) & (labels[1:] == labels[:-1]).all(axis=1)
        unlike = np.flatnonzero(same[1:] & (result[1:] != result[:-1]).any(axis=1))
        if len(unlike):
            first, second = (self._actions[operator[unlike[0] + k]] for k in (0, 1))
            raise self._positions[second.schema].fail(
                f"{first.label} and {second.label} have the same subactions but different results",
                "The subactions of a joint action must determine what it does: rename one of them.",
            )
        keep = ~same
        return Steps(row[keep], labels[keep], result[keep], cost[keep])

    def choices(self, rows: Rows) -> Options:
        """For each robot the labels that it has in joint steps of each state (CSR)."""
        row, operator = self._operators.applicable(rows)
        found = []
        for own in self._labels[operator].T:
            pairs = np.unique(np.stack((row, own), axis=1), axis=0)
            found.append((np.searchsorted(pairs[:, 0], np.arange(len(rows) + 1)), pairs[:, 1]))
        return found

    def most_steps(self, rows: Rows) -> int:
        """An upper bound on the joint steps out of these states: applicable ground actions."""
        return len(self._operators.applicable(rows)[0])

    def why_not(self, row: Rows, labels: Sequence[int]) -> str:
        """Why these labels are no joint step in a state, in words."""
        found = np.flatnonzero((self._labels == np.array(labels)).all(axis=1))
        parts = " and ".join(
            f"{robot} {own[label] if label else 'idle'}"
            for robot, own, label in zip(self._robots, self._names, labels, strict=True)
        )
        if not len(found):
            return f"no joint action of the domain lets {parts}"
        return f"the joint action {self._actions[found[0]].label} is not applicable here"

    def joint_action(self, row: Rows, labels: Sequence[int]) -> str | None:
        """The ground joint action that these labels are in a state.

        The cheapest, as `steps` takes it.
        """
        _, operators = self._operators.applicable(row[None, :])
        here = operators[(self._labels[operators] == np.array(labels)).all(axis=1)]
        return self._actions[int(here[self._cost[here].argmin()])].label
