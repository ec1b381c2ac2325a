# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of the engine, checked before anything is solved, and errors in their words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from unified_planning.exceptions import UPUsageError
from unified_planning.plans import PlanKind

from coordlang.language.file import read_language
from coordlang.language.recorded import options_of
from coordlang.language.words import Language
from coordlang.unified import NAME
from coordlang.unified.translation import Concurrency, Subactions, Translated
from planners.pddl.model_options import ModelOptions
from planners.system.errors import BadInput, CoordlangError, UsageError
from planners.system.options import record_from

#: The kinds of plans that the engine returns and validates.
PLAN_KINDS = (PlanKind.PARTIAL_ORDER_PLAN, PlanKind.SEQUENTIAL_PLAN, PlanKind.TIME_TRIGGERED_PLAN)
#: The parameters that are options of the model.
_MODEL = ("robots", "robot_type", "unowned", "cost", "remember_actions")
_OPTION = re.compile(r"(?<![\w-])--([a-z]+(?:-[a-z]+)*)")


@dataclass(frozen=True, slots=True)
class EngineOptions:
    """The parameters of the engine; `CoordlangEngine` says what they mean.

    ``model`` has those that are options of the model, as far as they are given.
    """

    model: Mapping[str, Any]
    subactions: Subactions | None = None
    concurrency: Concurrency | None = None
    language: Language | None = None
    sentence: str | Sequence[str] | None = None
    plan_kind: Any = None

    @classmethod
    def of(cls, **given: Any) -> EngineOptions:
        """Check the engine's parameters; objects and types may be given by their names.

        Raises `UPUsageError` for a value that there is not, or a language that cannot be read.
        """
        known = (*_MODEL, *(name for name in cls.__dataclass_fields__ if name != "model"))
        for name in given:
            if name not in known:
                raise UPUsageError(f"there is no parameter {name!r}: there are {', '.join(known)}")
        model = {name: given.pop(name) for name in _MODEL if name in given}
        try:
            if "robots" in model:
                model["robots"] = _names(model["robots"])
            if model.get("robot_type") is not None:
                [model["robot_type"]] = _names([model["robot_type"]])
            record_from(ModelOptions, model, NAME)
            options = cls(model, **{**given, "language": _read(given.get("language"))})
            if options.sentence is not None and options.language is None:
                raise UsageError("a sentence needs its language", remedy="Give language, too.")
            if options.plan_kind not in (None, *PLAN_KINDS):
                raise UsageError(
                    f"there is no kind of plans {options.plan_kind}",
                    remedy="Plans are partial-order, sequential or time-triggered.",
                )
        except (BadInput, UsageError) as error:
            raise UPUsageError(in_parameters(error)) from None
        return options

    def model_options(self, found: Translated) -> ModelOptions:
        """How a translated problem is to be understood.

        Raises `UsageError` for an option that contradicts the problem or the language.
        """
        names = {thing.name: name for name, thing in found.objects.items()}
        given = {name: value for name, value in self.model.items() if value}
        if robots := given.get("robots"):
            given["robots"] = tuple(names.get(robot, robot) for robot in robots)
        if kind := given.get("robot_type"):
            given["robot_type"] = found.types.get(kind, kind)
        made = record_from(ModelOptions, given, NAME)
        return made if self.language is None else options_of(self.language, made, given)


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


def _names(things: Any) -> tuple[str, ...]:
    """The names of objects or types, which may be given by them."""
    if isinstance(things, str) or not isinstance(things, Iterable):
        raise UsageError(
            f"robots must be a sequence, not {things!r}",
            remedy="Give objects or their names in a list.",
        )
    names = []
    for thing in things:
        name = thing if isinstance(thing, str) else getattr(thing, "name", None)
        if not isinstance(name, str):
            raise UsageError(
                f"{thing!r} is no object or type", remedy="Give one of the problem's, or its name."
            )
        names.append(name)
    return tuple(names)


def _read(given: Language | str | None) -> Language | None:
    """The language, which may be given by the name of its file."""
    language = given if given is None or isinstance(given, Language) else read_language(given)
    if language is not None and language.tolerance is not None and language.tolerance.slack:
        raise UsageError(
            "this language is for plans within slack, and this engine gives optimal plans only",
            remedy="Build the language without slack.",
        )
    return language
