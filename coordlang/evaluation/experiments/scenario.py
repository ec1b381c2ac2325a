"""The motivating scenario: a place of interest appears, and one robot makes a detour.

The other robot never knows.

On the map `corridor` two robots trade rooms through a corridor with one passing place.  They have
agreed on the sentence of the first optimal plan.  Then a place becomes interesting that robot 1
would not pass.  If one of its choices under the sentence goes there, it goes; robot 2 does its own
part as before, and both are still on an optimal plan.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from random import Random
from typing import Any

from coordlang.evaluation.lab.figure_style import drawing
from coordlang.evaluation.lab.recipe import (
    Figure,
    Recipe,
    Record,
    Result,
    Section,
    Settings,
    Unit,
    done,
    percent,
    table,
)
from coordlang.evaluation.material.disruptions import Sayings, own_choices
from coordlang.evaluation.material.grid_drawing import Path, draw_map, place_of
from coordlang.evaluation.material.languages import TITLES, language_for
from coordlang.evaluation.material.suite import OTHERS, WORLDS, World
from coordlang.tasks.listed import ListedTask
from coordlang.use.choices.automaton import Automaton
from coordlang.use.sentence.task_language import TaskLanguage, languages_in_tasks
from planners.joint.model import JointModel
from planners.search.plans import Plan, Plans

METHODS = ("greedy", "separating", "minimal")
CORRIDOR = World("corridor", "corridor", "problem", "problem")
#: The cells of the two rooms.
ROOMS = tuple(
    tuple(f"c{row}-{column}" for row in range(3) for column in columns)
    for columns in ((0, 1), (7, 8))
)
#: The scenario that is drawn: where robots 1 and 2 start and go to, and the place that becomes
#: interesting.
START, GOAL, PLACE = ("c0-0", "c0-8"), ("c2-8", "c2-0"), "c2-7"


def trading_rooms() -> tuple[ListedTask, ...]:
    """The candidate tasks.

    Robot 1 from any cell of the left room to any of the right one, robot 2 the other way.
    """
    left, right = ROOMS
    return tuple(
        ListedTask(_at(start), _at(goal))
        for start in product(left, right)
        for goal in product(right, left)
    )


def _at(cells: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"(at r{n} {cell})" for n, cell in enumerate(cells, 1))


def units(settings: Settings) -> list[Unit]:
    """The pieces of work, with all their parameters."""
    methods = ("greedy",) if settings.quick else METHODS
    found = [
        Unit(
            "scenario",
            f"corridor/{method}",
            {"world": "corridor", "method": method, "samples": None},
            CORRIDOR.files,
            15.0,
        )
        for method in methods
    ]
    for world in OTHERS[: 1 if settings.quick else None]:
        for method in METHODS:
            parameters = {"world": world.name, "method": method, "samples": 3 * settings.samples}
            found.append(Unit("scenario", f"{world.name}/{method}", parameters, world.files, 5.0))
    return found


def run(unit: Unit, settings: Settings) -> Result:
    """One piece of work, as JSON data."""
    asked = unit.parameters
    if asked["world"] == "corridor":
        candidates, language = language_for(CORRIDOR, asked["method"], settings, trading_rooms())
    else:
        candidates, language = language_for(WORLDS[asked["world"]], asked["method"], settings)
    spoken = list(languages_in_tasks(language, candidates))
    result: Result = {"words": len(language.words)}
    if asked["world"] == "corridor":
        result["drawn"] = detour(next(one for one in spoken if _ends(one) == (START, GOAL)))
    elif asked["samples"] < len(spoken):
        spoken = Random(f"{settings.seed} {asked['world']}").sample(spoken, asked["samples"])
    return result | {"tasks": len(spoken), **freedom(spoken)}


def freedom(spoken: Sequence[TaskLanguage]) -> dict[str, int]:
    """Things that robots may do beyond their part of the first plan, summed over tasks and robots.

    A thing is a cell that a robot enters, or a subaction where there are no cells.  ``plan``:
    things in its part of the agreed plan; ``sentence``: further ones in its choices under the
    plan's sentence; ``optimal``: further ones in all optimal plans of the task, which would take
    another agreement.
    """
    plan = sentence = optimal = 0
    sayings: Sayings | None = None
    for one in spoken:
        if sayings is None or sayings.spoken.space is not one.space:
            sayings = Sayings(one)
        first, words = sayings.first(one.task)
        for robot, choices in enumerate(sayings.choices(one.task, words)):
            agreed = _things(one.model, robot, {step[robot] for step in first})
            every = own_choices(one, robot)
            plan += len(agreed)
            sentence += len(_things(one.model, robot, set(choices.label.tolist())) - agreed)
            optimal += len(_things(one.model, robot, set(every.label.tolist())) - agreed)
    return {"plan": plan, "sentence": sentence, "optimal": optimal}


def _things(model: JointModel, robot: int, labels: set[int]) -> set[str]:
    nothing = {action.label for action in model.actions if action.does_nothing}
    texts = {model.labels[robot][label] for label in labels if label}
    return {place_of(text) or text for text in texts - nothing}


def detour(spoken: TaskLanguage) -> Result:
    """What happens when `PLACE` becomes interesting.

    The agreed parts, and robot 1's when it goes there.
    """
    sayings = Sayings(spoken)
    plan, words = sayings.first(spoken.task)
    model = spoken.model
    choices = sayings.choices(spoken.task, words)[0]
    wanted = {n for n, text in enumerate(model.labels[0]) if place_of(text) == PLACE}
    agreed = tuple(step[0] for step in plan)
    ways = [way for way in subplans(choices) if wanted & set(way)]
    found: Result = {
        "sentence": [spoken.partition.words[w] for w in words],
        "agreed": [_walk(model, plan, robot) for robot in range(2)],
        "ways": len(ways),
        "detour": None,
    }
    plans = Plans.of(spoken.space, spoken.task)
    # All parts of robot 1 that go there on some optimal plan, and those that would do with robot
    # 2's agreed part.
    parts = {
        tuple(step[0] for step in other) for other in plans if wanted & {step[0] for step in other}
    }
    fitting = [part for part in parts if plans.rank(_mixed(part, plan)) is not None]
    found |= {"plans": plans.count, "parts": len(parts), "parts_that_fit": len(fitting)}
    if ways:
        way = max(
            ways,
            key=lambda w: (
                sum(a == b for a, b in zip(w, agreed, strict=True)),
                tuple(-x for x in w),
            ),
        )
        executed = _mixed(way, plan)
        found["detour"] = _walk(model, executed, 0)
        found["optimal"] = plans.rank(executed) is not None
    return found


def subplans(automaton: Automaton) -> list[tuple[int, ...]]:
    """All subplans that an automaton accepts, as label numbers."""
    found: list[tuple[tuple[int, ...], int]] = [((), 0)]
    for _ in automaton.layers[1:]:
        found = [
            ((*way, label), to) for way, state in found for label, to in automaton.moves(state)
        ]
    return [way for way, _ in found]


def _mixed(way: Sequence[int], plan: Plan) -> Plan:
    """Robot 1 goes its way, the others do their part of the plan."""
    return tuple((label, *step[1:]) for label, step in zip(way, plan, strict=True))


def _walk(model: JointModel, plan: Plan, robot: int) -> list[str]:
    """The cells of a robot, step by step."""
    cells = [START[robot]]
    for step in plan:
        cells.append(
            (place_of(model.labels[robot][step[robot]]) if step[robot] else None) or cells[-1]
        )
    return cells


def _ends(spoken: TaskLanguage) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Where the robots start and end; all optimal plans of these tasks end in one state."""
    space, codec, node = spoken.space, spoken.model.codec, spoken.start
    while space.layer[node] > 0:
        node = int(space.target[space.first[node]])
    keys = (codec.key(space.rows[space.state[n]]) for n in (spoken.start, node))
    start, goal = (tuple(atom.strip("()").split()[2] for atom in key.split(") (")) for key in keys)
    return start, goal


def section(records: Sequence[Record]) -> Section:
    """The results, as this section of the page."""
    found = done(records)
    mine = [r for r in found if r.unit.parameters["world"] == "corridor"]
    others = [r for r in found if r.unit.parameters["world"] != "corridor"]
    blocks: list[str | Figure] = [_DEFINITION]
    shown = [r for r in mine if r.result["drawn"]["detour"]]
    if shown:
        blocks += [Figure("scenario", _ALT, lambda: _drawn(shown[-1])), _told(shown[-1])]
    if mine:
        blocks += [_FREEDOM, _table(mine + others)]
    return Section(tuple(blocks))


_DEFINITION = f"""\
Two robots trade rooms on the map `domains/corridor`: r1 from {START[0]} to {GOAL[0]}, r2 from {START[1]} to {GOAL[1]}.
They have agreed on the sentence of the first plan found. On the way {PLACE} becomes a place of interest. r1 finds a way
there among its own choices and takes it. r2 is not told, does what it would have done, and nothing is late. (Candidate tasks:
robot 1 from any cell of the left room to any of the right one, robot 2 the other way.)"""

_ALT = (
    "Above the agreed plan in the corridor; below r1 passes the place of interest and r2 does "
    "the same as before"
)

_FREEDOM = """\
Over all tasks of the corridor, and on worlds that are no grids, summed over the robots of a task: cells (there: subactions)
in the agreed plan; those that robots may visit beyond them without a word to anybody, which under a plan are none; and those
of all optimal plans, for the rest of which robots would have to agree anew."""


def _told(record: Record) -> str:
    r = record.result["drawn"]
    return (
        f"The language is {TITLES[record.unit.parameters['method']]} ({record.result['words']} "
        "words), the sentence "
        f"`{' '.join(r['sentence'])}`. The task has {r['plans']:,} optimal plans. On these r1 can "
        f"pass {PLACE} in "
        f"{r['parts']} ways, of which {r['parts_that_fit']} do with what r2 does; the others "
        "collide or are late. The "
        f"sentence leaves r1 {r['ways']} of them, whatever r2 chooses from its own."
    )


def _table(records: Sequence[Record]) -> str:
    rows = []
    for record in records:
        r, asked = record.result, record.unit.parameters
        name = f"{asked['world']}, {TITLES[asked['method']]}"
        robots = r["tasks"]
        rows.append(
            [
                name,
                r["words"],
                r["tasks"],
                f"{r['plan'] / robots:.2f}",
                f"{r['sentence'] / robots:.2f}",
                f"{r['optimal'] / robots:.2f}",
                percent(r["sentence"] / r["optimal"]) if r["optimal"] else None,
            ]
        )
    head = (
        "world, language",
        "words",
        "tasks",
        "in the plan",
        "more under the sentence",
        "more in optimal plans",
        "share",
    )
    return table(head, rows)


def _drawn(record: Record) -> Any:
    r = record.result["drawn"]
    agreed = [Path("r1", r["agreed"][0]), Path("r2", r["agreed"][1])]
    executed = [Path("r1", r["detour"]), Path("r2", r["agreed"][1])]
    cells = {cell for room in ROOMS for cell in room} | {
        cell for path in (*agreed, *executed) for cell in path.cells
    }
    with drawing(8.2, 6.4, rows=2) as (figure, [above, below]):
        draw_map(above, cells, agreed, None, "agreed: the first optimal plan")
        draw_map(
            below,
            cells,
            executed,
            PLACE,
            f"executed: {PLACE} has become interesting, r1 passes it, r2 is not told",
        )
        return figure


RECIPE = Recipe("scenario", "Motivating scenario: a detour nobody is told of", units, run, section)
