# SPDX-License-Identifier: GPL-3.0-or-later
"""What a goal needs, how facts become true, and what is said of a goal out of reach."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

from planners.grounding.actions import GroundAction
from planners.joint.conditions import split_condition, split_effects
from planners.joint.model import FullState, Goal, JointModel, show
from planners.joint.tables import Ints, Rows
from planners.pddl.formula_tree import required_atoms
from planners.pddl.lifted import FALSE

#: What to try besides a larger limit.
SMALLER = "a task with a shorter plan, fewer objects or fewer robots"
#: The value of a state from which the goal is proved unreachable.
FAR = 2**30
#: A table of states -> a lower bound for each, or `FAR`.
Values = Callable[[Rows], Ints]
#: States in which the reason why actions cannot share a step is looked for.
_LOOK_AT = 1_000
#: Actions that are never possible, of which a message says why.
_SHOWN = 3


def goal_facts(model: JointModel, goal: Goal) -> frozenset[int]:
    """The facts that must be true in every goal state, as far as single literals say."""
    if isinstance(goal, FullState):
        return frozenset(goal.facts)
    index = model.codec.facts.index
    return frozenset(index[atom] for atom in required_atoms(goal) if atom in index)


class FactsOf(NamedTuple):
    """What a ground action reads and writes, as facts by number, as far as that is certain.

    It ``needs`` facts to be true, and in any case ``adds`` some and ``deletes`` others; each of the
    ``conditional`` effects is (facts that must be true besides, the fact, whether it is added).
    """

    needs: frozenset[int]
    adds: frozenset[int]
    deletes: frozenset[int]
    conditional: tuple[tuple[frozenset[int], int, bool], ...]

    @classmethod
    def of(cls, model: JointModel, action: GroundAction) -> FactsOf:
        """Those of an action; facts that are never true are left out."""
        adds, deletes, conditional = split_effects(action, model.codec.facts)
        facts = model.codec.facts
        return cls(
            split_condition(action.precondition, facts)[0],
            frozenset(adds),
            frozenset(deletes).difference(adds),
            tuple(
                (split_condition(e.condition, facts)[0], facts.index[e.atom], e.adds)
                for e in conditional
            ),
        )

    @property
    def touched(self) -> frozenset[int]:
        """The facts that it may change."""
        return self.adds.union(self.deletes, (fact for _, fact, _ in self.conditional))

    def ways(self) -> Iterator[tuple[frozenset[int], frozenset[int]]]:
        """Every (facts that must be true, facts that become true together)."""
        if self.adds:
            yield self.needs, self.adds
        for needs, fact, adds in self.conditional:
            if adds:
                yield self.needs | needs, frozenset((fact,))


def searched(model: JointModel, goal: Goal, seen: Rows, left_out: int = 0) -> str:
    """What was searched without reaching a goal, and why it may be out of reach.

    Facts that no action makes true, of the goal or of what actions of a robot need, else what kept
    robots from acting together most often.  ``seen`` are the states that were searched,
    ``left_out`` counts those next to them from which a heuristic proves that there is no way.
    """
    said = "No other state can be reached."
    if left_out:
        said = (
            f"{len(seen):,} {'state was' if len(seen) == 1 else 'states were'} searched. "
            f"From {left_out:,} more the goal cannot be reached, as a lower bound proves."
        )
    elif len(seen) > 1:
        said = f"All {len(seen):,} reachable states were searched."
    if lacking := _lacking(model, goal):
        return "\n  ".join((said, *lacking))
    looked_at = model.codec.facts_part(seen[:: len(seen) // _LOOK_AT + 1])
    conflicts = Counter(model.stepper.conflicts(looked_at))
    if not conflicts:
        return said
    [((_, why), states)] = conflicts.most_common(1)
    return (
        f"{said}\n  Of pairs of actions that cannot share a step, the one met most often "
        f"({states:,} of {len(looked_at):,} states looked at): {why}."
    )


def _lacking(model: JointModel, goal: Goal) -> list[str]:
    """Sentences about what nothing makes true.

    Of robots that lack something static (a tool, perhaps as it is meant) only if an atom of the
    goal is out of reach of all.
    """
    if goal == FALSE:
        return ["The goal is false in every state: static facts or equalities say so."]
    atoms = () if isinstance(goal, FullState) else required_atoms(goal)
    missing = [show(atom) for atom in atoms if atom not in model.codec.facts]
    said = [f"The goal needs {atom}, and nothing makes it true." for atom in missing[:1]]
    limited = () if missing else {one.robot for one in model.impossible if not one.is_fluent}
    never = [one for one in model.impossible if one.robot not in limited]
    return [*said, *map(str, never[:_SHOWN])]
