# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang inspect``: what was understood of a domain and problem."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from os import fspath
from typing import Any

import numpy as np

from coordlang.commands.inputs import Arguments, public
from coordlang.commands.records import WRITTEN, InspectOptions
from coordlang.commands.terminal import WIDTH, columns, echo, line_width, note_single_robot
from planners.grounding.actions import idling_schemas
from planners.joint.interference import footprint
from planners.joint.model import JointModel, show
from planners.loading import PlanningInstance
from planners.pddl.formula_tree import formula_text
from planners.pddl.lifted import Domain, StepAtom, supertypes
from planners.pddl.pddl_text import domain_text, problem_text
from planners.search.reachable import count as count_reachable
from planners.search.search_estimate import SearchEstimate, estimate
from planners.system.errors import note
from planners.system.messages import Presented, counted, some
from planners.system.writing import write_texts

#: States, and joint steps out of one layer, beyond which a search is not likely to end.
_MOST_STATES, _MOST_STEPS = 20_000_000, 50_000_000
#: Reachable states up to which fewest words were proved for all tasks (README.md).
_PROVABLE = 132
#: Reachable states up to which languages for all tasks were built in minutes (docs/evaluation.md).
_ALL_TASKS = 1_000
#: States in which an example of interference is looked for.
_LOOK_AT = 2000
#: Layers that are shown.
_SHOWN = 8
#: Where there are too many states for languages for all tasks.
_TASKS = "use coordlang tasks, or list tasks"


@dataclass(frozen=True, slots=True, repr=False)
class Inspected(Presented):
    """What was understood of a domain and problem; ``print`` shows it as `coordlang inspect`.

    ``objects`` counts them by type, each in all its types; ``subactions[robot][schema]`` counts
    ground subactions, and ``impossible`` are the schemas that have none; ``idle[robot]`` says when
    the robot may idle, ``left_out`` are the schemas that are idling; ``formulas`` shows for each
    schema of ``step_formulas`` what one of its subactions asks of the others.  ``interfering``
    counts pairs of subactions of different robots that cannot share a step; the ``example`` is one
    that meets in a reachable state, None if no state near the start has one.  ``start`` counts the
    fluents that are true at first, ``never`` are the predicates that no state can make true.
    ``estimate`` says how large a search for plans will be; ``reachable``: how many joint states can
    be reached, and joint steps in them, if counted.
    """

    domain: str
    problem: str
    style: str
    robots: tuple[str, ...]
    robots_by: str
    objects: dict[str, int]
    subactions: dict[str, dict[str, int]]
    impossible: tuple[str, ...]
    idle: dict[str, str]
    left_out: tuple[str, ...]
    shared: dict[str, int]
    unowned: str
    step_formulas: dict[str, int]
    formulas: tuple[str, ...]
    without_effects: tuple[str, ...]
    costs: str
    interfering: int
    example: str | None
    fluents: dict[str, int]
    start: dict[str, int]
    statics: dict[str, int]
    never: tuple[str, ...]
    facts: int
    goal: str
    estimate: SearchEstimate
    reachable: tuple[int, int] | None = None
    shown = ("domain", "problem", "robots")

    def data(self) -> dict[str, Any]:
        """Everything as JSON data."""
        data = asdict(self)
        counts = data.pop("reachable") or ()
        return data | dict(zip(("states", "joint_steps"), counts, strict=False))

    def __str__(self) -> str:
        return self.text()

    def text(self, width: int = WIDTH) -> str:
        """Return everything as text, a name in the left column, at most ``width`` wide."""
        return "\n".join(columns(self._lines(), width, indent=""))

    def _lines(self) -> list[tuple[str, str]]:
        none_named = {"error": "not allowed (--unowned)"}
        fluents = f"{counted(self.facts, 'fact')}: {_counts(self.fluents)}"
        lines = [
            ("domain", f"{self.domain}, problem {self.problem}"),
            ("read as", self.style),
            ("objects", _counts(self.objects)),
            ("robots", f"{', '.join(self.robots)} (by {self.robots_by})"),
            *(self._subactions(robot) for robot in self.subactions),
            ("shared", _counts(self.shared)),
            ("no robot named", none_named.get(self.unowned, f"--unowned {self.unowned}")),
            ("step formulas", _counts(self.step_formulas)),
            *(("", f"e.g. {each}") for each in self.formulas),
            ("never possible", ", ".join(self.impossible)),
            ("no effects", ", ".join(self.without_effects)),
            *([("left out", f"{', '.join(self.left_out)}: idling")] if self.left_out else []),
            ("action costs", self.costs),
            ("interference", self._interference()),
            ("fluents", fluents if self.facts else ""),
            ("at the start", _counts(self.start) or "none is true"),
            ("statics", _counts(self.statics)),
            ("never true", ", ".join(self.never)),
            ("goal", self.goal),
            *feasibility(self.estimate),
        ]
        if self.reachable:
            states, steps = self.reachable
            text = f"{counted(states, 'joint state')}, {counted(steps, 'joint step')}"
            lines.append(("reachable", text))
        return [(name, text or "none") for name, text in lines]

    def _interference(self) -> str:
        pairs = counted(self.interfering, "pair")
        if self.example:
            return f"{pairs}, e.g. {self.example}"
        none = ", none of them possible in one state near the start"
        return f"{pairs}{none if self.interfering else ''}"

    def _subactions(self, robot: str) -> tuple[str, str]:
        schemas = self.subactions[robot]
        listed = f": {_counts(schemas)}" if schemas else ""
        number = counted(sum(schemas.values()), "subaction")
        return f"  {robot}", f"{number}{listed}; {self.idle[robot]}"


@public(InspectOptions)
def inspect(files: Arguments, options: InspectOptions) -> Inspected:
    """Show what was understood of a domain and its first problem.

    O(pairs of subactions) for the interference count; the work in states is bounded
    (`planners.search.search_estimate`), unless reachable ones are counted.
    """
    loaded = files.instance()
    model, domain, (task, *_) = loaded.model, loaded.domain, loaded.tasks
    found, layers = estimate(model, task)
    start = model.codec.true_facts(task.init)
    idling = idling_schemas(domain)
    acting = {action.schema for action in model.actions}
    asking, formulas = _formulas(model)
    fluents = _counted(fact.predicate for fact in model.codec.facts)
    statics = _counted(atom.predicate for atom in model.statics)
    idle = "where a joint action says so" if model.is_joint_action else "may idle in every step"
    rows = np.concatenate(layers)[:_LOOK_AT]
    inspected = Inspected(
        domain=domain.name,
        problem=loaded.problems[0].name,
        style=_style(domain),
        robots=model.robots,
        robots_by=loaded.team.by,
        objects=_objects(loaded),
        subactions=_subactions(model),
        impossible=tuple(s.name for s in domain.schemas if s.name not in acting | idling),
        idle=dict.fromkeys(model.robots, idle),
        left_out=tuple(sorted(idling)),
        shared=_shared(model),
        unowned=loaded.options.unowned,
        step_formulas=asking,
        formulas=formulas,
        without_effects=tuple(sorted({a.schema for a in model.actions if not a.effects})),
        costs=_costs(domain, model.cost),
        interfering=model.stepper.interfering_pairs(),
        example=next((s for _, s in model.stepper.conflicts(model.codec.facts_part(rows))), None),
        fluents=fluents,
        start=_counted(model.codec.facts.atoms[fact].predicate for fact in start),
        statics=statics,
        never=tuple(sorted(domain.predicates.keys() - fluents.keys() - statics.keys())),
        facts=len(model.codec.facts),
        goal=formula_text(loaded.problems[0].goal),
        estimate=found,
        reachable=count_reachable(model, task.init[None, :]) if options.states else None,
    )
    if options.write is not None:
        texts = domain_text(domain), problem_text(loaded.problems[0], domain)
        write_texts(fspath(options.write), dict(zip(WRITTEN, texts, strict=True)))
    return inspected


def show_inspect(found: Inspected, options: InspectOptions) -> None:
    """Print what was understood."""
    if options.write is not None:
        note(f"written to {fspath(options.write)}: {', '.join(WRITTEN)}")
    note_single_robot(found.robots)
    echo(json.dumps(found.data()) if options.as_json else found.text(line_width()))


def _style(domain: Domain) -> str:
    if domain.is_joint_action:
        return "joint-action PDDL (subaction comments)"
    if any(schema.agent is not None for schema in domain.schemas):
        return "MA-PDDL (:agent)"
    return "plain PDDL with robots as objects"


def _subactions(model: JointModel) -> dict[str, dict[str, int]]:
    return {
        robot: _counted(label[1:-1].split(" ")[0] for label in own[1:])
        for robot, own in zip(model.robots, model.labels, strict=True)
    }


def _shared(model: JointModel) -> dict[str, int]:
    """How many subactions of each schema robots choose together."""
    if model.is_joint_action:
        return {}
    return _counted(action.schema for action in model.actions if len(action.owners) > 1)


def _objects(loaded: PlanningInstance) -> dict[str, int]:
    """How many objects each type has; untyped ones count as ``object``."""
    found: list[str] = []
    for own in loaded.problems[0].objects.values():
        types = {t for each in own for t in supertypes(loaded.domain.types, each)}
        found += types if own == ("object",) else types - {"object"}
    return _counted(found)


def _formulas(model: JointModel) -> tuple[dict[str, int], tuple[str, ...]]:
    """How many subactions of each schema ask something of the others, and what the first asks."""
    there = {action.name for action in model.actions}
    asking: list[str] = []
    found: dict[tuple[str, str], str] = {}
    for action in model.actions:
        own = footprint(action)
        if own.partners or own.excluded:
            asking.append(action.schema)
        for kind, others in (("speaks of", own.partners), ("forbids", own.excluded)):
            if others and (action.schema, kind) not in found:
                # What no robot has is often a mistake in the domain.
                named = _some(others & there) or f"{_some(others)}, which no robot can ever do,"
                found[action.schema, kind] = f"{action.label} {kind} {named} in the same step"
    return _counted(asking), tuple(found.values())


def _some(atoms: frozenset[StepAtom]) -> str:
    return some(sorted(map(show, atoms)), 2)


def _costs(domain: Domain, cost: str) -> str:
    declared = sorted(s.name for s in domain.schemas if s.cost is not None)
    if not declared:
        return "none declared"
    if cost == "makespan+cost":
        return f"used as the second component ({', '.join(declared)})"
    return f"declared ({', '.join(declared)}) and ignored: --cost makespan+cost uses them"


def _counted(names: Iterable[str]) -> dict[str, int]:
    return dict(sorted(Counter(names).items()))


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {number:,}" for name, number in counts.items())


def feasibility(found: SearchEstimate) -> list[tuple[str, str]]:
    """Return lines (name, text): labels, layers, bound, what these mean, what to try."""
    each = [f"{robot} {found.choices[robot]:,} of {n:,}" for robot, n in found.labels.items()]
    further, tasks = ", and no other can be reached", _all_tasks(found.states)
    if found.next_steps is not None:
        steps = counted(found.next_steps, "joint step")
        further = f"; not looked at: the next, with at most about {steps} into it"
        tasks = f"more than {found.states:,} states: {_TASKS}"
    too_large = (found.next_steps or 0) > _MOST_STEPS or (found.expected or 0) > _MOST_STATES
    lines = [
        ("labels", f"{', '.join(each)} possible at the start, idling included"),
        ("first layers", f"{_sizes(found.layers)} states{further}"),
        ("bound", f"{found.heuristic}: {_bound(found)}"),
        ("this task", _this_task(found, too_large)),
        ("--tasks all", tasks),
    ]
    if found.solvable is None and too_large:
        most = max(found.choices, key=lambda robot: found.choices[robot])
        fewer = f"fewer robots ({most} has most choices), " if len(found.choices) > 1 else ""
        lines.append(("try", f"{fewer}fewer objects, only a part of the goal"))
    return lines


def _sizes(layers: Sequence[int]) -> str:
    sizes = [f"{size:,}" for size in layers]
    if len(sizes) > _SHOWN:
        sizes[_SHOWN - 2 : -1] = [".."]
    return ", ".join(sizes)


def _bound(found: SearchEstimate) -> str:
    if found.at_least is None:
        return "no plan is possible"
    text = f"makespan {found.at_least:,} at least"
    if found.within:
        text += f", by which {_sizes(found.within)} of these states are left"
    if found.solver_after is not None and found.next_steps is not None:
        text += f"; a SAT solver is asked after {counted(found.solver_after, 'joint step')}"
    return text


def _this_task(found: SearchEstimate, too_large: bool) -> str:
    if found.solvable is False:
        return "no plan: the goal cannot be reached"
    if found.makespan is not None:
        return f"makespan {found.makespan:,}: plans, coordination and build are feasible"
    text = f"makespan {max(found.hmax or 0, found.at_least or 0):,} at least"
    ends = "whether plans ends is not known: set a --time-limit"
    if found.expected is not None:
        large, by = found.expected >= 1_000_000, f"{found.factor:.1f} times the one before"
        number = f"{found.expected:.1e}" if large else f"{float(f'{found.expected:.2g}'):,.0f}"
        text += f": about {number} states if each layer is {by}"
        if not too_large:
            ends = "plans ends in seconds to minutes if the makespan is not much more"
    if too_large and found.solver_after is None:
        ends = "plans, and all that needs them, are not likely to end"
    return f"{text}; {ends}"


def _all_tasks(states: int) -> str:
    advice = _TASKS
    if states <= _PROVABLE:
        advice = "every method is feasible"
    elif states <= _ALL_TASKS:
        advice = "greedy and separating; minimal is not likely to end with a proof"
    return f"{counted(states, 'state')}, at most {counted(states * (states - 1), 'task')}: {advice}"
