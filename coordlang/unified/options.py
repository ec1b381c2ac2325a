# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of the engine, checked before anything is solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from unified_planning.exceptions import UPUsageError
from unified_planning.plans import PlanKind

from coordlang.language.file import read_language
from coordlang.language.recorded import options_of
from coordlang.language.words import Language
from coordlang.unified.translation import Concurrency, Subactions, Translated, translate
from planners.errors import BadInput, UsageError
from planners.loading import ModelOptions
from planners.pddl.robots import RobotSelection, find_team

#: The kinds of plans that the engine returns and validates.
PLAN_KINDS = (
    PlanKind.PARTIAL_ORDER_PLAN,
    PlanKind.SEQUENTIAL_PLAN,
    PlanKind.TIME_TRIGGERED_PLAN,
)


@dataclass(frozen=True, slots=True)
class EngineOptions:
    """The parameters of the engine (`CoordlangEngine`), with names in place of objects."""

    robots: tuple[str, ...] = ()
    robot_type: str | None = None
    unowned: str | None = None
    subactions: Subactions | None = None
    concurrency: Concurrency | None = None
    cost: str | None = None
    remember_actions: bool = False
    language: Language | None = None
    sentence: str | Sequence[str] | None = None
    plan_kind: Any = None

    @classmethod
    def of(
        cls,
        *,
        robots: Sequence[Any],
        robot_type: Any,
        remember_actions: bool,
        language: Language | str | None,
        sentence: str | Sequence[str] | None,
        plan_kind: Any,
        **given: Any,
    ) -> EngineOptions:
        """Check the engine's parameters.

        Raises `UPUsageError` for a value that there is not, or a language that cannot be read.
        """
        if sentence is not None and language is None:
            raise UPUsageError("a sentence needs its language")
        if plan_kind is not None and plan_kind not in PLAN_KINDS:
            raise UPUsageError(
                f"{plan_kind}: plans are partial-order, sequential or time-triggered"
            )
        if isinstance(robots, str):
            raise UPUsageError(f"robots must be a sequence of objects or names, not {robots!r}")
        if robots and robot_type is not None:
            raise UPUsageError("give robots or robot_type, not both")
        if not isinstance(remember_actions, bool):
            raise UPUsageError(f"remember_actions must be True or False, not {remember_actions!r}")
        options = cls(
            robots=tuple(_name(robot) for robot in robots),
            robot_type=None if robot_type is None else _name(robot_type),
            remember_actions=remember_actions,
            language=_language(language),
            sentence=sentence,
            plan_kind=plan_kind,
            **given,
        )
        try:
            options._without_language((), None)
        except UsageError as error:
            raise UPUsageError(str(error)) from None
        return options

    def translated(self, problem: Any) -> Translated:
        """Return the problem as PDDL; raises what `translate` raises."""
        return translate(problem, self.subactions, self.concurrency)

    def model_options(self, found: Translated) -> ModelOptions:
        """How a translated problem is to be understood.

        Raises `UsageError` for an option that contradicts the problem or the language.
        """
        names = {thing.name: name for name, thing in found.objects.items()}
        robots = tuple(names.get(robot, robot) for robot in self.robots)
        kind = (
            None if self.robot_type is None else found.types.get(self.robot_type, self.robot_type)
        )
        if self.language is None:
            return self._without_language(robots, kind)
        options = options_of(
            self.language,
            robots=robots,
            unowned=self.unowned,
            cost=self.cost,
            remember_actions=self.remember_actions or None,
        )
        if kind is not None:
            team = find_team(found.domain, found.problem, RobotSelection((), kind))
            if set(team.robots) != set(options.robots.names):
                raise UsageError(
                    f"robot_type {kind} contradicts the language: "
                    f"its robots are {', '.join(options.robots.names)}",
                    remedy="Leave out robot_type.",
                )
        return options

    def _without_language(self, robots: tuple[str, ...], kind: str | None) -> ModelOptions:
        unowned = "error" if self.unowned is None else self.unowned
        cost = "makespan" if self.cost is None else self.cost
        # `ModelOptions` and its parts refuse values that there are not.
        selection = RobotSelection(robots, kind, unowned)  # type: ignore[arg-type]
        return ModelOptions(selection, cost, self.remember_actions)  # type: ignore[arg-type]


def _name(thing: Any) -> str:
    """The name of an object or a type, which may be given by it."""
    if isinstance(thing, str):
        return thing
    name = getattr(thing, "name", None)
    if not isinstance(name, str):
        raise UPUsageError(f"{thing!r} is no object or type and no name of one")
    return name


def _language(given: Language | str | None) -> Language | None:
    if given is None:
        return None
    try:
        language = given if isinstance(given, Language) else read_language(given)
    except BadInput as error:
        raise UPUsageError(str(error)) from None
    if language.tolerance is not None and language.tolerance.slack:
        raise UPUsageError(
            "this language is for plans within slack, and this engine gives optimal plans only"
        )
    return language
