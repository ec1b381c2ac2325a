"""Sentences by definition: every plan is listed, and its words are looked up in the language's own
list of states.
"""

from __future__ import annotations

from functools import cache
from random import Random

from hypothesis import assume

from coordlang.building import build_language
from coordlang.language.partition import Partition
from coordlang.language.words import Language
from coordlang.required.miscoordination import Inseparable
from coordlang.tasks.candidates import Candidates, from_listed, from_problems
from coordlang.tasks.listed import ListedTask
from coordlang.use.sentence.task_language import TaskLanguage
from planners.errors import ProvedImpossible
from planners.loading import ModelOptions, build
from planners.pddl import parse_domain, parse_problem, read_domain, read_problem
from planners.pddl.lifted import Domain, Problem
from planners.pddl.sexpr import Source
from planners.search.plans import Plan, Plans
from planners.search.reachable import explore
from tests.conftest import DOMAINS
from tests.coordlang.naive import TooLarge, listed
from tests.coordlang.random_models import graph_text, random_model
from tests.use.random_chores import random_chores

#: More plans than this are not listed.
MOST = 1000

#: Every shipped domain; of the many maps that differ in size only, some.
SHIPPED = [
    f"{path.parent.name}/{path.stem}"
    for path in sorted(DOMAINS.glob("*/*.pddl"))
    if path.name != "domain.pddl"
    and (
        path.parent.name not in ("grid", "grid-joint")
        or path.stem in ("corners-4x4", "gw2-2x3", "gwb5-3x3", "three-cells")
    )
] + ["grid/three-robots-3x3"]


@cache
def shipped(name: str) -> tuple[Candidates, TaskLanguage]:
    """The task of a shipped problem with the greedy language for it; actions remembered where plans
    are inseparable.
    """
    folder, _, stem = name.partition("/")
    domain = read_domain(DOMAINS / folder / "domain.pddl")
    problem = read_problem(DOMAINS / folder / f"{stem}.pddl", domain)
    for remember in (False, True):
        candidates = from_problems(domain, [problem], ModelOptions(remember_actions=remember))
        try:
            language = build_language(candidates).language
        except Inseparable:
            continue
        return candidates, spoken_in(candidates, language)
    raise AssertionError(name)


def random_task_language(seed: int, robots: int) -> tuple[Candidates, TaskLanguage]:
    """A task of a random model, one of its longer ones, under a random partition; some states are
    left to the default.

    No coordination language, mostly: saying and understanding, searching and wishing do not depend
    on it.
    """
    random = Random(seed)
    if seed % 2 == 0:
        domain, problem, options = random_chores(seed, robots)
    elif seed % 5 == 0:
        domain, problem, options = random_model(seed, robots)
    else:  # robots on a graph
        options = ModelOptions(cost=random.choice(["makespan", "makespan", "makespan+actions"]))
        text, task = graph_text(random, robots)
        domain = parse_domain(Source("random-domain.pddl", text))
        problem = parse_problem(Source("random-problem.pddl", task), domain)
    try:
        if seed % 2 == 0:
            candidates = from_problems(domain, [problem], options)
        else:
            candidates = from_listed(
                domain, [problem], [long_task(random, domain, problem, options)], options
            )
    except ProvedImpossible:
        assume(False)
    assume(0 < Plans.of(candidates.spaces[0]).count <= 300)
    size = random.choice([1, 2, 2, 3, 3, 4, 5])
    used = sorted(set(candidates.spaces[0].state.tolist()))
    mapped = [n for n in used if random.random() < 0.9] or used[:1]
    partition = {n: random.randrange(size) for n in mapped}
    language = Language.of(Partition.of_states(candidates.rows, partition), candidates.model)
    return candidates, spoken_in(candidates, language)


def long_task(
    random: Random, domain: Domain, problem: Problem, options: ModelOptions
) -> ListedTask:
    """From one reachable state to another one that is far from it, or to some of its literals."""
    loaded = build(domain, [problem], options)
    codec = loaded.model.codec
    space = explore(loaded.model, loaded.tasks[0].init[None, :])
    assume(1 < len(space) <= 400)
    farthest: list[tuple[int, int, list[int]]] = []
    for start in random.sample(range(len(space)), min(8, len(space))):
        layer, seen, depth = [start], {start}, 0
        while after := sorted(
            {t for s in layer for t in space.target[space.first[s] : space.first[s + 1]].tolist()}
            - seen
        ):
            layer, depth = after, depth + 1
            seen.update(layer)
        farthest.append((depth, start, layer))
    _, start, layer = max(farthest)
    true = set(codec.decode(space.rows[random.choice(layer)]))
    literals = [fact if fact in true else f"(not {fact})" for fact in codec.facts.texts]
    if random.random() < 0.3:
        literals = random.sample(literals, random.randint(1, len(literals)))
    return ListedTask(tuple(codec.decode(space.rows[start])), tuple(literals))


def spoken_in(candidates: Candidates, language: Language) -> TaskLanguage:
    space, table = candidates.spaces[0], language.partition(candidates.model)
    return TaskLanguage(language, table, space, 0, table.word_of(space.rows)[space.state], True)


def by_sentence(task_language: TaskLanguage) -> dict[tuple[str, ...], set[Plan]]:
    """All optimal plans of the task by their sentences.  Raises `TooLarge`."""
    space, language = task_language.space, task_language.language
    keys = [space.model.codec.key(row) for row in space.rows]
    groups: dict[tuple[str, ...], set[Plan]] = {}
    for plan in listed(space, task_language.task, MOST):
        words = [
            language.states.get(keys[s], language.default)
            for s in Plans(space, task_language.start, []).states(plan)
        ]
        said = tuple(word for n, word in enumerate(words) if n == 0 or word != words[n - 1])
        groups.setdefault(said, set()).add(plan)
    return groups


__all__ = ["SHIPPED", "TooLarge", "by_sentence", "random_task_language", "shipped"]
