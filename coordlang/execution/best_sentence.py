# SPDX-License-Identifier: GPL-3.0-or-later
"""The best sentence for a task, by preferences in order of weight; and what may be preferred."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import islice
from typing import Any

from coordlang.execution.task_language import TaskLanguage
from coordlang.language.sentences import Sentence
from planners.joint.states import split_atoms
from planners.pddl.lifted import Atom
from planners.search.plan_space import PlanSpace
from planners.system.errors import BadInput, UsageError
from planners.system.limits import reaching
from planners.system.messages import echoed

#: Joint actions that are followed at most to find the leading sentences of a task.
_FOLLOWED = 2_000_000
#: In place of a word, and of a node: the plan ends, with no further word.
_END = -1
#: What a preference remembers of a plan's beginning.
Memory = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class PlanPreference:
    """A preference about single plans: an automaton that reads a plan and gives it a grade.

    ``start`` gives the memory in the initial state, ``step`` that after a joint step (labels) into
    a state, both by its number in the plan space's table; ``grade`` gives the grade by the memory
    at the end, the lower the better.  ``text`` is the preference as it is written on the command
    line, ``grades`` says in words what each grade means.
    """

    text: str
    start: Callable[[int], Memory]
    step: Callable[[Memory, tuple[int, ...], int], Memory]
    grade: Callable[[Memory], int]
    grades: tuple[str, ...]


#: ``"shortest"`` and ``"most-plans"`` are preferences about whole sentences.
Preference = str | PlanPreference


def read_preference(task_language: TaskLanguage, text: str) -> Preference:
    """Read ``shortest``, ``most-plans``, ``first:ROBOT`` or ``avoid:ATOMS``; else `UsageError`."""
    kind, _, argument = text.strip().partition(":")
    if task_language.model.is_asynchronous and (kind == "first" or argument.count("(") > 1):
        raise UsageError(
            f"--prefer {echoed(text)}: without a common step nobody goes first, and states are not "
            "passed at once",
            remedy="Use shortest, most-plans, or avoid with one atom.",
        )
    if text.strip() in ("shortest", "most-plans"):
        return text.strip()
    if kind == "first":
        return goes_first(task_language, argument.strip().lower())
    if kind == "avoid":
        return avoids(task_language, argument)
    raise UsageError(
        f"--prefer {echoed(text)}: there is no such preference",
        remedy='Use shortest, most-plans, first:ROBOT or avoid:"(ATOM) ..".',
    )


def goes_first(task_language: TaskLanguage, robot: str) -> PlanPreference:
    """The preference that a robot goes first.

    Robot r goes before robot q if, in the first step in which one of the two *acts* (does not idle)
    and the other one does not, it is r that acts.  Grades: 0 if r goes before every other robot, 2
    if some other robot goes before r, else 1.  Raises `UsageError` for a robot that the model does
    not have.
    """
    own = task_language.robot_number(robot, "--prefer first:")
    others = tuple(other for other in range(task_language.space.robots) if other != own)
    grades = (
        f"{robot} goes first",
        f"no robot goes before {robot}",
        f"another robot goes before {robot}",
    )
    late = (-1,)  # in place of the robots of which it is open: one has acted before this one

    def step(memory: Memory, labels: tuple[int, ...], _state: int) -> Memory:
        acts = labels[own] != 0
        if memory == late or (not acts and any(labels[other] for other in memory)):
            return late
        return tuple(other for other in memory if (labels[other] != 0) == acts)

    def grade(memory: Memory) -> int:
        return 2 if memory == late else int(bool(memory))

    return PlanPreference(f"first:{robot}", lambda _: others, step, grade, grades)


def avoids(task_language: TaskLanguage, atoms: str) -> PlanPreference:
    """The preference that no state of the plan, the first and last included, has all these atoms.

    Grades: 0 if so, else 1; always 0 where one of the atoms can never be true.  Raises `UsageError`
    for text that is not a list of atoms of the problem.
    """
    try:
        wanted = split_atoms(" ".join(atoms.lower().split()).replace("( ", "(").replace(" )", ")"))
    except BadInput as error:
        raise UsageError(f"--prefer avoid:{atoms}: {error.what}", remedy=error.remedy) from None
    if not wanted:
        raise UsageError(
            "--prefer avoid: expected atoms", remedy='As in --prefer avoid:"(at r1 c1-1)".'
        )
    model = task_language.model
    facts, never, codec = [], [], model.codec
    for text in wanted:  # what is always true is left out
        predicate, *args = text[1:-1].split(" ")
        number = codec.facts.numbers.get(text)
        if number is not None:
            facts.append(number)
        elif not _is_declared(task_language, predicate, args):
            raise UsageError(
                f"--prefer avoid:{text}: this is no atom of the problem",
                remedy="Write a predicate of the domain with objects of the problem, as in "
                f"{next(iter(codec.facts.texts), '(at r1 c1-1)')}.",
            )
        elif Atom(predicate, tuple(args)) not in model.statics:
            never.append(text)
    mask = codec.mask(facts)
    has_all = (codec.facts_part(task_language.space.rows) & mask == mask).all(axis=1)
    hit: list[int] = (has_all & (not never)).astype(int).tolist()
    text = " ".join(wanted)
    why = f": {never[0]} can never be true" if never else ""
    grades = (f"it keeps away from {text}{why}", f"it passes through {text}")
    return PlanPreference(
        f"avoid:{text}",
        lambda state: (hit[state],),
        lambda memory, _, state: (memory[0] or hit[state],),
        lambda memory: memory[0],
        grades,
    )


def _is_declared(task_language: TaskLanguage, predicate: str, args: Sequence[str]) -> bool:
    """Whether this is an atom over declared names, be it possible or not."""
    domain, problem = task_language.declared
    return len(args) in domain.predicates.get(predicate, ()) and problem.objects.keys() >= {*args}


# ---- the search


@dataclass(frozen=True, slots=True)
class BestSentence:
    """The best sentence (word numbers), and the exact number of plans that it leaves open.

    ``values`` has for each preference the number of words, the number of plans, or (grade of the
    worst plan left open, grade of the best); so many ``prefixes`` of sentences were looked at.
    """

    words: tuple[int, ...]
    plans: int
    values: tuple[int | tuple[int, int], ...]
    prefixes: int


def best_sentence(task_language: TaskLanguage, preferences: Sequence[Preference]) -> BestSentence:
    """Find the best sentence of the task by preferences in order of weight.

    The second one decides where the first is equal, and so on.

    - ``shortest``: fewest words;
    - ``most-plans``: most optimal plans have it;
    - a `PlanPreference`: the worst plan that has the sentence has the best grade, then the best
      plan has.  Robots that choose for themselves may do otherwise, where mixtures of these plans
      have another sentence.

    Of equal sentences the one with fewest words is taken, then the first by word numbers.
    Best-first search over prefixes of sentences, with a bound on what any continuation can give;
    prefixes that lead to the same nodes with the same counts are one.  ``shortest`` alone takes as
    many prefixes as the sentence has words.  The other preferences ask for the best string of a
    nondeterministic automaton, which has no polynomial algorithm in general (cf. Lyngsø and
    Pedersen 2002 on hidden Markov models).  Raises `OutOfMemory` when there are more prefixes than
    the memory holds.
    """
    graph, seen = _Graph(task_language, preferences), set[object]()

    def so_far() -> str:
        return f"{len(seen):,} beginnings of sentences"

    with reaching(so_far, "a smaller task, or prefer the shortest sentence first"):
        bound, words, plans = next(_whole_sentences(graph, seen))
    values = (abs(value) if isinstance(value, int) else value for value in bound[:-1])
    return BestSentence(words, plans, tuple(values), len(seen))


def leading_sentences(task_language: TaskLanguage, number: int) -> list[tuple[Sentence, int]]:
    """The sentences of the task that leave most plans open, and how many each leaves, exactly.

    At most ``number``, those with most plans first, without a list of all: the search of
    `best_sentence` goes on.  Fewer are found where two million joint actions do not suffice.
    """
    found = _whole_sentences(_Graph(task_language, ["most-plans"]))
    return [(words, plans) for _, words, plans in islice(found, number)]


def _whole_sentences(
    graph: _Graph, seen: set[object] | None = None
) -> Iterator[tuple[tuple[Any, ...], Sentence, int]]:
    """Whole sentences with their bound and plans, best first.

    With ``seen`` the best one is meant, by all values: it gets the prefixes that were looked at,
    one of those that lead to the same points with the same counts.  Without it sentences of equal
    first value come by their words, as far as `_FOLLOWED` joint actions lead.
    """
    words: Sentence = (graph.word[0],)
    counts: Mapping[int, int] = {0: 1}
    queue: list[Any] = [((), words, counts)]
    while queue and (seen is not None or graph.followed < _FOLLOWED):
        bound, words, counts = heappop(queue)
        if words[-1] == _END:
            yield bound, words[:-1], sum(counts.values())
            continue
        if seen is not None:
            same = words[-1], frozenset(counts.items() if graph.open else counts)
            if same in seen:
                continue  # the one that was here before is as good, and shorter or smaller
            seen.add(same)
        for word, further in graph.extensions(words[-1], counts).items():
            bound = graph.bound((*words, word), further)
            heappush(queue, (bound if seen is not None else bound[:1], (*words, word), further))


def grants(
    task_language: TaskLanguage, words: Sequence[int], preferences: Sequence[Preference]
) -> bool:
    """Whether every plan with a sentence has the best grade, for each preference over plans.

    Preferences over whole sentences are granted by none alone: they compare several.
    """
    automata = [one for one in preferences if isinstance(one, PlanPreference)]
    if len(automata) < len(preferences):
        return False
    fits = task_language.plans_with(words)
    return all(
        one.grade(memory) == 0
        for node, memories in _points(fits, int(fits.starts[0]), automata)[0]
        if node == _END
        for one, memory in zip(automata, memories, strict=True)
    )


class _Graph:
    """The task's plans as paths of *points*.

    A point is a plan-space node with what the preferences remember there; behind the last node of
    each plan is one more, of the word `_END`.  Points are numbered from the start on, layer by
    layer.  ``following[p]`` holds pairs (point, number of joint actions); ``node`` and ``word`` are
    those of each point.  The rest bounds the continuations of plans from p on: ``more[p]`` is the
    least number of further words, ``grades[p]`` the least grade for each `PlanPreference`, and
    ``open[p]``, if ``most-plans`` is a preference, has for each next word how many plans from p can
    have one sentence with it, at most.  So many joint actions were ``followed``.

    The prefix of a sentence is its words with the *counts*, how many beginnings of plans come to
    each point with the first state of the last word.  A whole sentence ends with `_END`.
    """

    def __init__(self, task_language: TaskLanguage, preferences: Sequence[Preference]) -> None:
        self.preferences, self.followed = tuple(preferences), 0
        automata = [one for one in preferences if isinstance(one, PlanPreference)]
        points, self.following = _points(task_language.space, task_language.start, automata)
        self.node, memories = zip(*points, strict=True)
        words = [*task_language.word.tolist(), _END]  # the last one is that of the node `_END`
        self.word = [words[node] for node in self.node]
        self.more = [0] * len(points)
        self.grades = [
            tuple(one.grade(memory) for one, memory in zip(automata, own, strict=True))
            for own in memories
        ]
        self.open = [Counter({_END: 1}) for _ in points] if "most-plans" in preferences else []
        for at in reversed(range(len(points))):
            if self.following[at]:
                self._bound_by_followers(at)

    def _bound_by_followers(self, point: int) -> None:
        here, after = self.word[point], self.following[point]
        self.more[point] = min(self.more[q] + (self.word[q] != here) for q, _ in after)
        self.grades[point] = tuple(map(min, zip(*(self.grades[q] for q, _ in after), strict=True)))
        if not self.open:
            return
        self.open[point] = Counter()
        for q, number in after:
            if self.word[q] == here:
                for word, count in self.open[q].items():
                    self.open[point][word] += number * count
            else:
                self.open[point][self.word[q]] += number * max(self.open[q].values())

    def extensions(self, word: int, counts: Mapping[int, int]) -> dict[int, Counter[int]]:
        """The words that may follow a prefix with this last word, with the counts then."""
        inside, todo = Counter(counts), list(counts)
        further: dict[int, Counter[int]] = defaultdict(Counter)
        heapify(todo)
        while todo:
            point = heappop(todo)
            self.followed += len(self.following[point])
            for q, number in self.following[point]:
                if self.word[q] == word and q not in inside:
                    heappush(todo, q)
                counts_then = inside if self.word[q] == word else further[self.word[q]]
                counts_then[q] += inside[point] * number
        return further

    def bound(self, words: Sequence[int], counts: Mapping[int, int]) -> tuple[Any, ...]:
        """The best values and least length of sentences with a prefix; its own if it is whole."""
        length = len(words) - 1 + min(self.more[p] for p in counts)
        most = Counter[int]()
        for point, count in counts.items() if self.open else ():
            for word, number in self.open[point].items():
                most[word] += count * number
        known = {"shortest": length, "most-plans": -max(most.values(), default=0)}
        grades = self._grades(counts)
        values = (known[one] if isinstance(one, str) else next(grades) for one in self.preferences)
        return *values, length

    def _grades(self, counts: Mapping[int, int]) -> Iterator[tuple[int, int]]:
        """The (worst, best) grades at least: all that came to a node can go on as its plans do."""
        by_node: dict[int, list[tuple[int, ...]]] = defaultdict(list)
        for point in counts:
            by_node[self.node[point]].append(self.grades[point])
        best = map(min, zip(*(self.grades[p] for p in counts), strict=True))
        of_node = [tuple(map(max, zip(*grades, strict=True))) for grades in by_node.values()]
        worst = map(min, zip(*of_node, strict=True))
        return zip(worst, best, strict=True)


#: A plan-space node, or `_END`, and what each preference over plans remembers there.
_Point = tuple[int, tuple[Memory, ...]]


def _points(
    space: PlanSpace, start: int, automata: Sequence[PlanPreference]
) -> tuple[list[_Point], list[list[tuple[int, int]]]]:
    """The points from the start on, and what follows each: points with numbers of joint actions."""
    points = [(start, tuple(one.start(int(space.state[start])) for one in automata))]
    number, following = {points[0]: 0}, []
    for point in points:  # grows while it is walked
        after = Counter(_after(space, automata, *point))
        for there in after:
            if number.setdefault(there, len(points)) == len(points):
                points.append(there)
        following.append(sorted((number[there], n) for there, n in after.items()))
    return points, following


def _after(
    space: PlanSpace, automata: Sequence[PlanPreference], node: int, memories: tuple[Memory, ...]
) -> Iterator[_Point]:
    """What comes after a point, once for each joint action."""
    if node != _END and space.layer[node] == 0:
        yield _END, memories
    for edge in space.out_edges(node) if node != _END else ():
        target = space.target_of(edge)
        labels, state = space.labels_of(edge) if automata else (), int(space.state[target])
        steps = zip(automata, memories, strict=True)
        yield target, tuple(one.step(memory, labels, state) for one, memory in steps)
