# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL that others wrote (../shared/data): tasks with known numbers, and languages with what their
sentences determine.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates, from_listed
from coordlang.language.patterns import varied_tasks
from coordlang.language.sentences import Sentence, sentence
from coordlang.language.words import Language as WordLanguage
from coordlang.required.divergences import required_nodes
from planners.loading import build as build_model
from planners.pddl import read_domain, read_problem
from planners.pddl.factored import read_factored
from planners.pddl.model_options import ModelOptions
from planners.search.plans import Plans
from planners.system.limits import time_limit
from tests.support.domains import SHARED

#: A plan: for each step and robot the subaction's text, None for idling.
Plan = Sequence[Sequence[str | None]]
#: What a listener may want to know of a plan.
Feature = Callable[[Plan], Hashable]
#: Tasks with more plans than this are left out.
MANY = 3000


def _parts(plan: Plan, schemas: Sequence[str]) -> list[tuple[int, int, str]]:
    """(step, robot, subaction) of these schemas."""
    return [
        (step, robot, text)
        for step, texts in enumerate(plan)
        for robot, text in enumerate(texts)
        if text and text[1:-1].split()[0] in schemas
    ]


def who_does_what(*schemas: str) -> Feature:
    """Which robot does which subactions of these schemas, at whatever time."""
    return lambda plan: frozenset((robot, text) for _, robot, text in _parts(plan, schemas))


def who(*schemas: str) -> Feature:
    """Which robots do anything of these schemas."""
    return lambda plan: frozenset(robot for _, robot, _ in _parts(plan, schemas))


def in_which_order(*schemas: str) -> Feature:
    """In which order the robots do the subactions of these schemas, at whatever time."""

    def feature(plan: Plan) -> Hashable:
        parts = _parts(plan, schemas)
        steps = sorted({step for step, _, _ in parts})
        return tuple(
            frozenset((robot, text) for at, robot, text in parts if at == step) for step in steps
        )

    return feature


def exactly(plan: Plan) -> Hashable:
    """The plan itself."""
    return tuple(map(tuple, plan))


def all_of(*features: Feature) -> Feature:
    """Several features together."""
    return lambda plan: tuple(feature(plan) for feature in features)


def agreement(
    language: WordLanguage, candidates: Candidates, told: Feature, left: Feature = exactly
) -> dict[str, int]:
    """Count the tasks whose sentences determine a feature of plans, or leave another one open.

    Only tasks that require coordination and have few plans count.

    Returns
    -------
    dict
        "different": tasks whose plans differ in ``told``; "told": those of them in which all plans
        of every sentence agree on it.  "open": tasks whose plans differ in ``left``; "left": those
        of them in which plans of some sentence differ in it.
    """

    partition = language.partition(candidates.model)
    figures = dict.fromkeys(("different", "told", "open", "left"), 0)
    for space in candidates.spaces:
        word = partition.word_of(space.rows).tolist()
        requires = required_nodes(space)[space.starts]
        for task in requires.nonzero()[0].tolist():
            plans = Plans.of(space, task)
            if plans.count <= MANY:
                values = _values(plans, word, told)
                figures["different"] += len(set().union(*values)) > 1
                figures["told"] += len(set().union(*values)) > 1 and all(
                    len(v) == 1 for v in values
                )
                values = _values(plans, word, left)
                figures["open"] += len(set().union(*values)) > 1
                figures["left"] += any(len(v) > 1 for v in values)
    return figures


def _values(plans: Plans, word: Sequence[int], feature: Feature) -> list[set[Hashable]]:
    """For each sentence, the values of a feature on its plans; ``word`` is that of each state."""

    found: dict[Sentence, set[Hashable]] = {}
    for plan in plans:
        words = sentence(word[state] for state in plans.states(plan))
        texts = [plans.space.model.texts(step) for step in plan]
        found.setdefault(words, set()).add(feature(texts))
    return list(found.values())


@dataclass(frozen=True, slots=True)
class Row:
    """A task: files, the numbers of an independent search, and options.

    ``known``: reachable states, least makespan, plans, and plans with the fewest actions.
    """

    name: str
    folder: str
    domain: str
    problem: str
    known: tuple[int, int, int, int]
    options: tuple[str, ...] = ()

    @property
    def arguments(self) -> tuple[str, ...]:
        """The files and options as ``coordlang`` takes them."""
        place = SHARED / "foreign" / self.folder
        if not self.domain:  # one domain and problem for each robot
            return ("--factored", str(place), *self.options)
        return (str(place / self.domain), str(place / self.problem), *self.options)


_WORKSHOP, _DRIVERLOG = (1200, 5, 8, 4), (10_575, 6, 536, 2)
_SHOP = "workshop2_1_2_2_2.pddl"
_GRIPPER = ("--robot-type", "gripper", "--unowned", "environment")
_ARMS = "original_domain.pddl", "original_problem_3.pddl"
_VEHICLES, _HOISTS = ("--robot-type", "vehicle"), ("--robot-type", "hoist")
_FORMS = "domain.pddl", "domain_constrained.pddl"
ROWS = (
    Row("boxpushing", "boxpushing", _FORMS[0], "p2_3_2_1_1_0.pddl", (1296, 6, 2038, 55)),
    Row("workshop-cal", "workshop", "workshop_dom_cal.pddl", _SHOP, _WORKSHOP),
    Row("workshop-cn", "workshop", "workshop_dom_cn.pddl", _SHOP, _WORKSHOP),
    Row("grippers", "grippers", _FORMS[0], "n2-r3-o3-s2.pddl", (2403, 7, 100_752, 3640)),
    Row("transport", "transport", "p11.DOMAIN.pddl", "p11.pddl", (576, 7, 18, 14), _VEHICLES),
    Row("driverlog", "driverlog", _FORMS[0], "pfile1.pddl", _DRIVERLOG),
    Row("driverlog-con", "driverlog", _FORMS[1], "pfile1.pddl", _DRIVERLOG),
    Row("driverlog-fac", "driverlog-factored", "", "", _DRIVERLOG),
    Row("taxi", "taxi", _FORMS[0], "p01.pddl", (280, 10, 28, 4)),
    Row("depot", "depot", _FORMS[0], "pfile1.pddl", (576, 5, 768, 1)),
    Row("depot-con", "depot", _FORMS[1], "pfile1.pddl", (576, 5, 48, 1)),
    Row("mapf", "mapf", "mapf-domain.pddl", "mapf-problem2.pddl", (42, 2, 1, 1)),
    Row("storage", "storage", _FORMS[0], "p05.pddl", (1460, 6, 34, 14), _HOISTS),
    Row("blocks-arms", "blocks-arms", *_ARMS, (361, 5, 204, 84)),
    Row("gripper", "gripper", _FORMS[0], "prob01.pddl", (256, 7, 384, 24), _GRIPPER),
    Row(
        "logistics00",
        "logistics00",
        "domain.pddl",
        "problogistics-4-0.pddl",
        (941_192, 13, 15_000_000_000_000, 3584),  # the number of plans is rounded
        ("--robots", "tru1,tru2,apn1"),
    ),
)
BY_NAME = {row.name: row for row in ROWS}


@dataclass(frozen=True, slots=True)
class Language:
    """Varied tasks of a row (`coordlang.language.patterns`), and what the words say there.

    ``told``: what a sentence says of a plan; all plans of a sentence agree on it, in at least the
    share ``agree`` of the tasks whose plans differ in it.  ``left`` is what a sentence mostly
    leaves open.
    """

    name: str
    row: str
    starts: tuple[str, ...]
    goals: tuple[str, ...]
    told: Feature
    left: Feature = exactly
    cost: str = "makespan+actions"
    remember_actions: bool = False
    agree: float = 1.0


_MOVED = who_does_what("pick", "drop")
_DRIVEN = who_does_what("board-truck", "load-truck", "unload-truck", "drive-truck", "walk")
_STACKED = who_does_what("pick-up", "put-down", "stack", "unstack")
_LOADED = all_of(who_does_what("load", "unload", "drive"), in_which_order("load"))
_LIFTED = who_does_what(
    *("lift-pallet", "examine-pallet", "enter-forklift", "drive-forklift", "unlock"), "press-switch"
)
_PLACES = ("(inroom a0 ?)", "(inroom a1 ?)"), ("(examined p0)", "(inroom a0 ?)")
_CRATES = (), ("(on crate0 ?)", "(on crate1 ?)")
_BALLS = "(at ball1 ?)", "(at ball2 ?)"
_DRIVERS, _TRUCKS = ("(at driver1 ?)", "(at driver2 ?)"), ("(at truck-1 ?)", "(at truck-2 ?)")
_PACKAGES = "(at package-1 ?)", "(at package-2 ?)"
_LOADS = "(at truck1 ?)", "(at package1 ?)", "(at package2 ?)"
_TAXIS = "(at t1 ?)", "(at t2 ?)", "(at p1 ?)", "(at p2 ?)"
_AGENTS, _OCCUPIED = ("(at a1 ?)", "(at a7 ?)"), "(occupied ?)"
_HOISTED = ("(at hoist0 ?)", "(at hoist1 ?)", "(clear ?)"), ("(in crate0 ?)", "(in crate1 ?)")
_BLOCKS = "(on ? a)", "(on ? b)", "(on ? c)"
LANGUAGES = (
    Language("boxpushing", "boxpushing", (), ("(at s1 ?)", "(at m1 ?)"), who("push-small")),
    Language("workshop-cal", "workshop-cal", *_PLACES, _LIFTED),
    Language("workshop-cn", "workshop-cn", *_PLACES, _LIFTED),
    Language(
        "grippers",
        "grippers",
        ("(at-robby robot1 ?)",),
        _BALLS,
        who("pick", "drop"),
        who_does_what("pick"),
    ),
    Language("transport", "transport", _TRUCKS, _PACKAGES, who_does_what("pick-up", "drop")),
    Language("driverlog", "driverlog", _DRIVERS, _LOADS, _DRIVEN),
    Language("taxi", "taxi", (), _TAXIS, who_does_what("enter", "exit")),
    Language("depot", "depot", *_CRATES, _LOADED),
    Language("depot-con", "depot-con", *_CRATES, _LOADED),
    Language("mapf", "mapf", (*_AGENTS, _OCCUPIED), _AGENTS, who_does_what("move"), agree=0.9),
    Language("storage", "storage", *_HOISTED, who("go-out", "lift", "drop")),
    Language("blocks-arms", "blocks-arms", (), _BLOCKS, _STACKED),
    Language("gripper-2", "gripper", ("(at-robby ?)",), _BALLS, _MOVED),
    Language("gripper-3", "gripper", ("(at-robby ?)",), (*_BALLS, "(at ball3 ?)"), _MOVED),
)
LANGUAGE_BY_NAME = {language.name: language for language in LANGUAGES}


def load(row: Row, cost: str, *, remember_actions: bool = False) -> Any:
    """The joint model of a row."""

    words = dict(zip(row.options[::2], row.options[1::2], strict=True))
    choice = ModelOptions(
        tuple(words["--robots"].split(",")) if "--robots" in words else (),
        words.get("--robot-type"),
        words.get("--unowned", "error"),  # type: ignore[arg-type]
    )
    if not row.domain:
        domain, problem = read_factored(str(SHARED / "foreign" / row.folder))
    else:
        domain = read_domain(row.arguments[0])
        problem = read_problem(row.arguments[1], domain)
    options = replace(choice, cost=cost, remember_actions=remember_actions)  # type: ignore[arg-type]
    return build_model(domain, [problem], options)


def build(language: Language, seconds: float) -> dict[str, object]:
    """Build and verify the two languages of a row, and see what the smaller one determines."""

    row = BY_NAME[language.row]
    loaded = load(row, language.cost)
    tasks = varied_tasks(loaded, language.starts, language.goals)
    options = replace(loaded.options, remember_actions=language.remember_actions)
    candidates = from_listed(loaded.domain, loaded.problems, tasks, options)
    first = build_language(candidates, "greedy")
    with time_limit(seconds):
        built = build_language(candidates, "minimal")
    guarantee = built.language.guarantee
    return {
        "tasks": candidates.count,
        "requiring": built.first_differences.requiring,
        "states": candidates.states,
        "greedy": first.language.guarantee.size,
        "words": guarantee.size,
        "bound": guarantee.lower_bound,
        "proved": guarantee.proved_minimal,
        "verified": built.verdict.holds,
        **agreement(built.language, candidates, language.told, language.left),
    }
