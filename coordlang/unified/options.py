# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of the engine, checked before anything is solved, and errors in their words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from unified_planning.exceptions import UPUsageError
from unified_planning.plans import PlanKind

from coordlang.language.file import read_language
from coordlang.language.recorded import options_of
from coordlang.language.words import Language
from coordlang.unified.translation import Concurrency, Subactions, Translated
from planners.pddl.model_options import ModelOptions
from planners.pddl.robots import find_team
from planners.system.errors import BadInput, CoordlangError, UsageError

#: The kinds of plans that the engine returns and validates.
PLAN_KINDS = (PlanKind.PARTIAL_ORDER_PLAN, PlanKind.SEQUENTIAL_PLAN, PlanKind.TIME_TRIGGERED_PLAN)
#: The parameters that are options of the model, too, and that a language may contradict.
_MODEL = ("robots", "unowned", "cost", "remember_actions")
_OPTION = re.compile(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)")


@dataclass(frozen=True, slots=True)
class EngineOptions:
    """The parameters of the engine; `CoordlangEngine` says what they mean."""

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
        robots: Iterable[Any] = (),
        robot_type: Any = None,
        language: Language | str | None = None,
        **given: Any,
    ) -> EngineOptions:
        """Check the engine's parameters; objects and types may be given by their names.

        Raises `UPUsageError` for a value that there is not, or a language that cannot be read.
        """
        for name in given:
            if name not in cls.__dataclass_fields__:
                there_are = ", ".join(cls.__dataclass_fields__)
                raise UPUsageError(f"there is no parameter {name!r}: there are {there_are}")
        try:
            if isinstance(robots, str) or not isinstance(robots, Iterable):
                raise UsageError(
                    f"robots must be a sequence, not {robots!r}",
                    remedy="Give objects or their names in a list.",
                )
            names = tuple(map(_name, robots))
            kind = None if robot_type is None else _name(robot_type)
            options = cls(names, kind, language=_read(language), **given)
            options._check()
        except (BadInput, UsageError) as error:
            raise UPUsageError(in_parameters(error)) from None
        return options

    def _check(self) -> None:
        """Raise `UsageError` for a value that a parameter does not have."""
        if self.sentence is not None and self.language is None:
            raise UsageError("a sentence needs its language", remedy="Give language, too.")
        if self.plan_kind is not None and self.plan_kind not in PLAN_KINDS:
            raise UsageError(
                f"there is no kind of plans {self.plan_kind}",
                remedy="Plans are partial-order, sequential or time-triggered.",
            )
        if not isinstance(self.remember_actions, bool):
            raise UsageError(
                f"remember_actions must not be {self.remember_actions}",
                remedy="Give True or False.",
            )
        self._without_language(self.robots, self.robot_type)

    def model_options(self, found: Translated) -> ModelOptions:
        """How a translated problem is to be understood.

        Raises `UsageError` for an option that contradicts the problem or the language.
        """
        names = {thing.name: name for name, thing in found.objects.items()}
        robots = tuple(names.get(robot, robot) for robot in self.robots)
        kind = self.robot_type and found.types.get(self.robot_type, self.robot_type)
        if self.language is None:
            return self._without_language(robots, kind)
        without = self._without_language(robots, None)
        given = [name for name in _MODEL if getattr(self, name)]
        options = options_of(self.language, without, given)
        if kind is not None:
            team = find_team(found.domain, found.problem, ModelOptions(robot_type=kind))
            if set(team.robots) != set(options.names):
                raise UsageError(
                    f"robot_type {kind} contradicts the language: "
                    f"its robots are {', '.join(options.names)}",
                    remedy="Leave out robot_type.",
                )
        return options

    def _without_language(self, robots: tuple[str, ...], kind: str | None) -> ModelOptions:
        unowned = "error" if self.unowned is None else self.unowned
        cost = "makespan" if self.cost is None else self.cost
        # `ModelOptions` refuses values that there are not.
        return ModelOptions(robots, kind, unowned, cost, self.remember_actions)  # type: ignore[arg-type]


def in_parameters(error: Exception) -> str:
    """What an error or a note says, in words of the engine's parameters.

    Options of the command line become parameters (``--robot-type`` robot_type); of a remedy that
    is a command nothing is left.
    """
    text = str(error)
    if isinstance(error, CoordlangError) and "`coordlang " in (error.remedy or ""):
        text = str(type(error)(error.what, position=error.position))
    text = text.replace("--time-limit", "timeout")
    return _OPTION.sub(lambda option: option[1].replace("-", "_"), text)


def _name(thing: Any) -> str:
    """The name of an object or a type, which may be given by it."""
    name = thing if isinstance(thing, str) else getattr(thing, "name", None)
    if not isinstance(name, str):
        raise UsageError(
            f"{thing!r} is no object or type", remedy="Give one of the problem's, or its name."
        )
    return name


def _read(given: Language | str | None) -> Language | None:
    """The language, which may be given by the name of its file."""
    language = given if given is None or isinstance(given, Language) else read_language(given)
    if language is not None and language.tolerance is not None and language.tolerance.slack:
        raise UsageError(
            "this language is for plans within slack, and this engine gives optimal plans only",
            remedy="Build the language without slack.",
        )
    return language
