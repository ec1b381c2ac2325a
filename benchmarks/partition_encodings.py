# SPDX-License-Identifier: GPL-3.0-or-later
"""Lower bounds by two encodings: states that name their words, and states that are the same.

    python benchmarks/partition_encodings.py ROW:K .. [--limit SECONDS]

The clauses are those with which the exact loop refutes K - 1 words (or that it has met when the
limit is over).  *naming* has a variable for each state and word, *naming, leaders* allows one of
symmetric partitions only, both as in the exact method.  *same* is that of Zykov: a variable for
each pair of states in a clause, transitivity by the triangles that a model violates, and for K + 1
states that a model separates, or that a greedy colouring of the merged states cannot colour, a
clause that two of them are the same.  *same, all* has all triangles from the beginning.  The
columns: whether there is a partition, CPU seconds of the solver and what feeds it, conflicts, and
the clauses that were added.  The largest clique of states that single pairs of clauses separate is
printed as well: so many words are needed without any search.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from itertools import combinations, pairwise
from time import process_time

import networkx as nx
import numpy as np
from minimal import inputs
from printed_table import PrintedTable

from coordlang.language.warping import Clause, pair
from coordlang.symmetry.group import symmetry_group
from coordlang.tasks.candidates import Candidates
from coordlang.vocabulary.clauses import (
    most_constrained_first,
    most_frequent_pairs,
    without_implied,
)
from coordlang.vocabulary.necessary_clauses import NecessaryClauses
from coordlang.vocabulary.partitions import Partitions
from coordlang.vocabulary.refuter import Refuter
from coordlang.vocabulary.sat import PartitionProblem, Undecided
from planners.sat import sat_solver, solve_slice

COLUMNS = (
    ("row", 9),
    ("words", 5),
    ("encoding", 17),
    ("answer", 6),
    ("CPU s", 7),
    ("conflicts", 9),
    ("triangles", 9),
    ("cliques", 7),
)
#: Conflicts between looks at the clock, violated pairs and cliques that are met with clauses.
SLICE, PAIRS, CLIQUES = 2_000, 400, 20


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", nargs="+", metavar="ROW:K")
    parser.add_argument("--limit", type=float, default=60, help="CPU seconds for each line")
    arguments = parser.parse_args()
    sizes = dict(row.split(":") for row in arguments.rows)
    table = PrintedTable(*COLUMNS)
    for name, _, candidates in inputs(list(sizes)):
        words = int(sizes[name])
        known = met(candidates, words, arguments.limit)
        states = sorted({s for space in candidates.spaces for s in space.state.tolist()})
        clauses = without_implied(known.clauses, 1_000_000)
        print(f"{name}: {len(clauses):,} clauses; clique {clique_bound(clauses)}")
        leaders = known.group.permutations
        for size in (words - 1, words):
            for encoding, symmetries in (("naming", []), ("naming, leaders", leaders)):
                cells = by_names(states, clauses, size, symmetries, arguments.limit)
                table.print(name, size, encoding, *cells)
            for encoding, every in (("same", False), ("same, all", True)):
                cells = Same(clauses, size, states if every else ()).cells(arguments.limit)
                table.print(name, size, encoding, *cells)


def met(candidates: Candidates, words: int, limit: float) -> NecessaryClauses:
    """The clauses by which the loop of the exact method comes to so many words."""
    known = NecessaryClauses(symmetry_group(candidates))
    refuter = Refuter(candidates.spaces, known.group, len(candidates.rows), 0)
    states = sorted({s for space in candidates.spaces for s in space.state.tolist()})
    partitions = Partitions(states, known.clauses, known.group.permutations)
    size, begin = 2, process_time()
    while size < words and process_time() - begin < limit:
        try:
            partition = partitions.find(size, 100_000)
        except Undecided:
            break
        if partition is None:
            size += 1
            continue
        word = np.zeros(len(candidates.rows), np.int64)
        word[list(partition)] = list(partition.values())
        known.add_all(refuter.violated(word))
    partitions.close()
    return known


def clique_bound(clauses: Iterable[Clause]) -> int:
    """The most states any two of which some clause of one pair separates."""
    graph = nx.Graph([next(iter(clause)) for clause in clauses if len(clause) == 1])
    return max(map(len, nx.find_cliques(graph)), default=1)


def by_names(
    states: Sequence[int],
    clauses: Sequence[Clause],
    size: int,
    symmetries: Sequence[Sequence[int]],
    limit: float,
) -> list[object]:
    """The columns of the encoding that names words."""
    begin = process_time()
    solver = "glucose4" if symmetries else "cadical153"
    problem = PartitionProblem(most_constrained_first(states, clauses), size, solver)
    for clause in clauses:
        problem.separate_one(clause)
    problem.add_lex_leaders(symmetries, most_frequent_pairs(clauses, 100))
    answer = "open"
    while answer == "open" and process_time() - begin < limit:
        try:
            answer = "none" if problem.solve(SLICE) is None else "found"
        except Undecided:
            continue
    conflicts = problem._solver.accum_stats()["conflicts"]
    problem.close()
    return [answer, f"{process_time() - begin:.2f}", conflicts, "", ""]


class Same:
    """The encoding by variables "these two states have one word"."""

    def __init__(self, clauses: Sequence[Clause], size: int, every: Iterable[int]) -> None:
        self.size = size
        self.solver = sat_solver("cadical153")
        self.same: dict[tuple[int, int], int] = {}
        self.triangles: set[frozenset[int]] = set()
        self.cliques: set[frozenset[int]] = set()
        for clause in clauses:
            self.solver.add_clause([-self.variable(*states) for states in sorted(clause)])
        for three in combinations(every, 3):
            self.add_triangle(*three)

    def variable(self, a: int, b: int) -> int:
        """The variable of a pair of states."""
        return self.same.setdefault(pair(a, b), len(self.same) + 1)

    def add_triangle(self, a: int, b: int, c: int) -> bool:
        """Transitivity of three states; whether it is new."""
        states = frozenset((a, b, c))
        if states in self.triangles:
            return False
        self.triangles.add(states)
        x, y, z = self.variable(a, b), self.variable(b, c), self.variable(a, c)
        for clause in ([-x, -y, z], [-x, -z, y], [-y, -z, x]):
            self.solver.add_clause(clause)
        return True

    def add_clique(self, states: Iterable[int]) -> bool:
        """Two of so many states are the same; whether that is new."""
        clique = frozenset(states)
        if clique in self.cliques:
            return False
        self.cliques.add(clique)
        self.solver.add_clause([self.variable(a, b) for a, b in combinations(sorted(clique), 2)])
        return True

    def cells(self, limit: float) -> list[object]:
        """The columns after the solver has answered, or the limit is over."""
        begin = process_time()
        answer = "open"
        while answer == "open" and process_time() - begin < limit:
            satisfiable = solve_slice(self.solver, SLICE, ())
            if satisfiable is False:
                answer = "none"
            elif satisfiable and not self.cut():
                answer = "found"
        conflicts = self.solver.accum_stats()["conflicts"]
        self.solver.delete()
        seconds = f"{process_time() - begin:.2f}"
        return [answer, seconds, conflicts, len(self.triangles), len(self.cliques)]

    def cut(self) -> bool:
        """Add clauses that the model violates; False if it is a partition into few words."""
        model = self.solver.get_model()
        together, apart = nx.Graph(), []
        for states, variable in sorted(self.same.items()):
            together.add_nodes_from(states)
            if model[variable - 1] > 0:
                together.add_edge(*states)
            else:
                apart.append(states)
        part = {s: n for n, own in enumerate(nx.connected_components(together)) for s in own}
        if self.cut_triangles(together, [p for p in apart if part[p[0]] == part[p[1]]]):
            return True
        separated = nx.Graph([(part[a], part[b]) for a, b in apart])
        return self.cut_cliques(separated, {n: s for s, n in sorted(part.items())})

    def cut_triangles(self, together: nx.Graph, wrong: Sequence[tuple[int, int]]) -> bool:
        """Triangles along shortest ways between states that are the same by way of others."""
        for a, b in wrong[:PAIRS]:
            way = nx.shortest_path(together, a, b)
            for here, there in pairwise(way[1:]):
                self.add_triangle(a, here, there)
        return bool(wrong)

    def cut_cliques(self, separated: nx.Graph, state: dict[int, int]) -> bool:
        """Cliques of one word too many, or the colours that leave a vertex none."""
        colours = nx.greedy_color(separated, "DSATUR")
        if max(colours.values(), default=0) < self.size:
            return False
        found = 0
        for vertex in sorted(separated, key=lambda v: (-separated.degree(v), v)):
            clique, others = [vertex], set(separated[vertex])
            while others and len(clique) <= self.size:
                clique.append(max(others, key=lambda u: (len(others & set(separated[u])), -u)))
                others &= set(separated[clique[-1]])
            if len(clique) > self.size:
                found += self.add_clique(state[v] for v in clique)
            if found >= CLIQUES:
                break
        if not found:
            one_of = {colour: vertex for vertex, colour in sorted(colours.items())}
            found += self.add_clique(state[one_of[colour]] for colour in range(self.size + 1))
        assert found, "the model separates what a clause says is not all separated"
        return True


if __name__ == "__main__":
    main()
