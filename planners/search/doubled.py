# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot in two places: facts true at the start that exclude each other in what actions do."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import product

from planners.joint.model import JointModel, show
from planners.pddl.lifted import Atom, Domain, Problem
from planners.search.state_variables import counted_groups
from planners.system.errors import note


def note_doubled(domain: Domain, problems: Sequence[Problem], model: JointModel) -> None:
    """Note where two values of what actions only exchange are true at the start of a problem.

    As (at r1 a) and (at r1 b), if robots leave a place where they enter another one.  Values of a
    predicate only that some action exchanges: two free hands are no mistake.
    """
    exchanged = _exchanged(domain)
    for problem in problems:
        found = _doubled(problem, model, exchanged)
        if found:
            name, atoms = found
            note(
                f"{' and '.join(sorted(map(show, atoms)))} are true at the start, and actions only "
                f"ever put one such fact about {name} in the place of another",
                position=problem.source.section(":init"),
                remedy="If one of them is a mistake, remove it from (:init ..).",
            )


def _exchanged(domain: Domain) -> set[tuple[str, int]]:
    """Predicates with the position of an argument that stays while some action changes others."""
    return {
        (new.atom.predicate, position)
        for schema in domain.schemas
        for new, old in product(schema.effects, repeat=2)
        if new.adds > old.adds and new.atom.predicate == old.atom.predicate
        for position, (a, b) in enumerate(zip(new.atom.args, old.atom.args, strict=False))
        if a == b and new.atom != old.atom
    }


def _doubled(
    problem: Problem, model: JointModel, exchanged: set[tuple[str, int]]
) -> tuple[str, list[Atom]] | None:
    """An object and facts about it, of which only one should be true."""
    facts: dict[tuple[str, int, str], list[Atom]] = defaultdict(list)
    for atom in problem.init:
        for position, name in enumerate(atom.args):
            if (atom.predicate, position) in exchanged:
                facts[atom.predicate, position, name].append(atom)
    suspect = {key: atoms for key, atoms in sorted(facts.items()) if len(atoms) > 1}
    if not suspect:
        return None
    groups = counted_groups(model, model.state(problem.init), lambda count: count > 1)
    for (_, _, name), atoms in suspect.items():
        numbers = {model.codec.facts.index[atom] for atom in atoms}
        if any(numbers <= set(group.facts) for group in groups):
            return name, atoms
    return None
