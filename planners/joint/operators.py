# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground actions as tables: which are applicable in which states, and what they add and delete."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planners.grounding import GroundAction, GroundEffect
from planners.joint.conditions import Evaluator, Labels, speaks_of_step, split_condition
from planners.joint.states import StateCodec, TrueFacts, test_bits
from planners.joint.tables import Bools, Ints, Numbers, Rows, ranges
from planners.pddl.lifted import TRUE, Formula

#: Looking up one true fact takes about as long as testing so many.
_LOOK_UP = 3


@dataclass(frozen=True, slots=True)
class _Level:
    """One depth of the tree: each node's children (facts to test), and operators that end in it."""

    first_child: Ints
    child_fact: Ints
    first_operator: Ints
    operators: Ints

    def below(self, rows: Rows, true: TrueFacts, row: Ints, node: Ints) -> tuple[Ints, Ints]:
        """The children (row, child) whose fact is true, of pairs of a row and a node.

        Either each child's fact is tested, or each true fact is looked up among the children,
        whichever is less work.
        """
        counts = self.first_child[node + 1] - self.first_child[node]
        facts_of_row = true.first[row + 1] - true.first[row]
        if int(counts.sum()) <= _LOOK_UP * int(facts_of_row.sum()):
            child = ranges(self.first_child[node], counts)
            row = np.repeat(row, counts)
            holds = test_bits(rows, row, self.child_fact[child])
            return row[holds], child[holds]
        fact = true.fact[ranges(true.first[row], facts_of_row)]
        row, node = np.repeat(row, facts_of_row), np.repeat(node, facts_of_row)
        parents = np.repeat(np.arange(len(self.first_child) - 1), np.diff(self.first_child))
        facts = int(max(self.child_fact.max(), true.fact.max(initial=0))) + 1
        keys, wanted = parents * facts + self.child_fact, node * facts + fact
        child = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        found = keys[child] == wanted
        return row[found], child[found]


class Matcher:
    """A tree in which the path to an operator tests each fact that it requires to be true once.

    Parameters
    ----------
    required
        For each operator the numbers of the facts that it requires to be true.
    forbidden
        For each operator the mask of facts that it requires to be false (operators x words).
    """

    def __init__(self, required: Sequence[frozenset[int]], forbidden: Rows) -> None:
        self._forbidden = forbidden
        self._has_forbidden = bool(forbidden.any())
        frequency = Counter(fact for facts in required for fact in facts)
        # Frequent facts first: operators then share long beginnings of their paths.
        paths = [sorted(facts, key=lambda f: (-frequency[f], f)) for facts in required]
        self._levels: list[_Level] = []
        nodes: list[list[int]] = [list(range(len(required)))]
        depth = 0
        while nodes:
            first_child, child_fact, first_operator, operators = [0], [], [0], []
            following: list[list[int]] = []
            for members in nodes:
                children: dict[int, list[int]] = {}
                for operator in members:
                    if len(paths[operator]) == depth:
                        operators.append(operator)
                    else:
                        children.setdefault(paths[operator][depth], []).append(operator)
                for fact in sorted(children):
                    child_fact.append(fact)
                    following.append(children[fact])
                first_child.append(len(child_fact))
                first_operator.append(len(operators))
            self._levels.append(
                _Level(
                    *(
                        np.array(a, np.int64)
                        for a in (first_child, child_fact, first_operator, operators)
                    )
                )
            )
            nodes, depth = following, depth + 1

    def match(self, rows: Rows) -> tuple[Ints, Ints]:
        """All pairs (row number, operator) with the operator's literals satisfied, sorted."""
        true = TrueFacts.of(rows)
        row = np.arange(len(rows))
        node = np.zeros(len(rows), np.int64)
        found_rows: list[Ints] = []
        found_operators: list[Ints] = []
        for level in self._levels:
            counts = level.first_operator[node + 1] - level.first_operator[node]
            found_rows.append(np.repeat(row, counts))
            found_operators.append(level.operators[ranges(level.first_operator[node], counts)])
            row, node = level.below(rows, true, row, node)
        rows_out = np.concatenate(found_rows)
        operators_out = np.concatenate(found_operators)
        if self._has_forbidden:
            fact_blocks = self._forbidden.shape[1]
            clash = (rows[rows_out, :fact_blocks] & self._forbidden[operators_out]).any(axis=1)
            rows_out, operators_out = rows_out[~clash], operators_out[~clash]
        order = np.lexsort((operators_out, rows_out))
        return rows_out[order], operators_out[order]


class Operators:
    """Ground actions, numbered as given, for whole tables of states at a time; None is idling.

    ``adds`` and ``deletes`` (actions, fact blocks) are what they do in every state, ``conditional``
    the effects of those that also depend on it; ``step_formulas`` are the parts of preconditions
    that speak of the joint step, which `applicable` leaves out.
    """

    def __init__(
        self, actions: Sequence[GroundAction | None], codec: StateCodec, evaluator: Evaluator
    ) -> None:
        self._codec, self._evaluator = codec, evaluator
        self._state_formulas: dict[int, list[Formula]] = {}
        self.step_formulas: dict[int, list[Formula]] = {}
        self.conditional: dict[int, list[GroundEffect]] = {}
        self.adds = np.zeros((len(actions), codec.fact_blocks), np.uint64)
        self.deletes = np.zeros_like(self.adds)
        required, forbidden = [frozenset[int]()] * len(actions), np.zeros_like(self.adds)
        for number, action in enumerate(actions):
            if action is None:
                continue
            literals, rest = split_condition(action.precondition, evaluator)
            required[number] = frozenset(fact for fact, positive in literals if positive)
            forbidden[number] = codec.mask(fact for fact, positive in literals if not positive)
            for formula in rest:
                kind = self.step_formulas if speaks_of_step(formula) else self._state_formulas
                kind.setdefault(number, []).append(formula)
            self._enter_effects(number, action)
        self._matcher = Matcher(required, forbidden)

    def _enter_effects(self, number: int, action: GroundAction) -> None:
        index = self._codec.facts.index
        known = [effect for effect in action.effects if effect.atom in index]
        certain = [effect for effect in known if effect.condition == TRUE]
        self.adds[number] = self._codec.mask(index[e.atom] for e in certain if e.adds)
        self.deletes[number] = self._codec.mask(index[e.atom] for e in certain if not e.adds)
        if conditional := [effect for effect in known if effect.condition != TRUE]:
            self.conditional[number] = conditional

    def applicable(self, rows: Rows) -> tuple[Ints, Ints]:
        """Pairs (row, action) whose conditions on the state hold, sorted."""
        row, operator = self._matcher.match(rows)
        keep: Bools = np.ones(len(row), np.bool_)
        for number, formulas in self._state_formulas.items():
            there = np.flatnonzero(operator == number)
            for formula in formulas:
                keep[there] &= self._evaluator.holds(formula, rows, row[there])
        return row[keep], operator[keep]

    def changes(
        self, rows: Rows, source: Ints, chosen: Numbers, labels: Labels | None = None
    ) -> tuple[Rows, Rows]:
        """What the actions ``chosen[k]`` add to ``rows[source[k]]``, and what they delete.

        ``labels[k]`` are what all robots do beside, where conditions may speak of that.
        """
        adds, deletes = self.adds[chosen], self.deletes[chosen]
        for number, effects in self.conditional.items():
            there = np.flatnonzero(chosen == number)
            beside = None if labels is None else labels[there]
            for effect in effects if len(there) else ():
                fires = self._evaluator.holds(effect.condition, rows, source[there], beside)
                into = adds if effect.adds else deletes
                self._codec.set(into, there[fires], [self._codec.facts.index[effect.atom]])
        return adds, deletes
