# SPDX-License-Identifier: GPL-3.0-or-later
"""The options that functions and commands share: their values, and what contradicts what."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from os import PathLike
from types import CodeType
from typing import TYPE_CHECKING, Literal, TypedDict, Unpack, get_args

if TYPE_CHECKING:
    from coordlang.language.words import Language
    from planners.loading import ModelOptions

Cost = Literal["makespan", "makespan+actions", "makespan+cost"]
Unowned = Literal["error", "environment", "shared"]
Method = Literal["greedy", "separating", "minimal", "exhaustive"]
BuildPreference = Literal["flexible", "simple"]
Unsolvable = Literal["fail", "skip"]
HeuristicName = Literal["relaxed", "manhattan", "blind"]
Target = Literal["pddl", "ltlf", "bt"]
#: Planners whose PDDL differs: what Fast Downward and K* read, or STRIPS alone.
Reader = Literal["fd", "kstar", "pyperplan"]

COSTS: tuple[str, ...] = get_args(Cost)
UNOWNED: tuple[str, ...] = get_args(Unowned)
METHODS: tuple[str, ...] = get_args(Method)
BUILD_PREFERENCES: tuple[str, ...] = get_args(BuildPreference)
UNSOLVABLE: tuple[str, ...] = get_args(Unsolvable)
HEURISTICS: tuple[str, ...] = get_args(HeuristicName)
TARGETS: tuple[str, ...] = get_args(Target)
READERS: tuple[str, ...] = get_args(Reader)


class JobsKeywords(TypedDict, total=False):
    """Who does the jobs of large work (docs/cli.md, cores and machines).

    ``jobs``: processes, one for each core by default; ``scheduler``: a running Dask cluster in
    their place; ``resume``: a folder that keeps finished jobs; ``note`` is called with what a
    person should read, which is a Python warning otherwise.
    """

    jobs: int | None
    scheduler: str | PathLike[str] | None
    resume: str | PathLike[str] | None
    note: Callable[[str], None] | None


class ModelKeywords(TypedDict, total=False):
    """How the PDDL files are understood (docs/cli.md, model options)."""

    robots: str | Sequence[str] | None
    robot_type: str | None
    unowned: Unowned | None
    cost: Cost | None
    remember_actions: bool
    slack: int | None
    words_see_slack: bool


def require_one_of(option: str, value: str | None, known: Sequence[str]) -> None:
    """Raise `UsageError` for a value that the option does not have; None is not given."""
    from planners.errors import UsageError

    if value is not None and value not in known:
        last = f" or {known[-1]}" if len(known) > 1 else known[-1]
        raise UsageError(
            f"{option} {value}: there is no such value",
            remedy=f"Say {', '.join(known[:-1])}{last}.",
        )


def require_seed(seed: int) -> None:
    """Raise `UsageError` for a negative number, which no random choices can begin with."""
    from planners.errors import UsageError

    if seed < 0:
        raise UsageError(f"--seed {seed}: expected 0 or more", remedy="Say 0.")


def _unexpected(keyword: str, function: CodeType) -> str:
    """What Python says of a keyword that a function does not have, with what was meant."""
    own = function.co_varnames[: function.co_argcount + function.co_kwonlyargcount]
    close = get_close_matches(keyword, [*own, *ModelKeywords.__annotations__], n=1)
    meant = f"; did you mean {close[0]!r}?" if close else ""
    return f"{function.co_name}() got an unexpected keyword argument {keyword!r}{meant}"


def names_in(option: str, given: str | Sequence[str] | None) -> list[str]:
    """Return the names that an option is given, in one text or several; none for None.

    Raises `UsageError` for what is no text.
    """
    from planners.errors import UsageError
    from planners.messages import echoed

    if isinstance(given, str):
        return given.split(",")
    found = list(given) if isinstance(given, Iterable) else [given] * (given is not None)
    for name in found:
        if not isinstance(name, str):
            raise UsageError(
                f"{option}: {echoed(name)} is no name", remedy="Give texts, such as 'r1'."
            )
    return [name for name in found if isinstance(name, str)]


@dataclass(frozen=True, slots=True)
class GivenOptions:
    """The model options as they were given; None (no robots, False) where they were not."""

    robots: tuple[str, ...] = ()
    robot_type: str | None = None
    unowned: Unowned | None = None
    cost: Cost | None = None
    remember_actions: bool = False
    slack: int | None = None
    words_see_slack: bool = False

    @classmethod
    def of(cls, **model: Unpack[ModelKeywords]) -> GivenOptions:
        """Check the keywords that a public function passes on.

        Raises
        ------
        UsageError
            For no robots, for robots that are named in two ways, and for what is no value of an
            option.
        TypeError
            For another keyword, in the name of the calling function.
        """
        from planners.errors import UsageError
        from planners.messages import echoed

        if unknown := sorted(model.keys() - ModelKeywords.__annotations__):
            raise TypeError(_unexpected(unknown[0], sys._getframe(1).f_code))
        robots, robot_type = model.get("robots"), model.get("robot_type")
        remember_actions = model.get("remember_actions", False)
        names = names_in("--robots", robots)
        chosen = tuple(name.strip().lower() for name in names if name.strip())
        if robots is not None and not chosen:
            raise UsageError("--robots: expected names", remedy="As in --robots r1,r2.")
        if robot_type is not None and (not isinstance(robot_type, str) or not robot_type.strip()):
            raise UsageError("--robot-type: expected a name", remedy="As in --robot-type robot.")
        if chosen and robot_type:
            raise UsageError(
                "--robots and --robot-type both say who the robots are: give one of them",
                remedy="--robots names them one by one.",
            )
        if not isinstance(remember_actions, bool):
            raise UsageError(
                f"--remember-actions is given or not: {echoed(remember_actions)} is neither",
                remedy="In Python it is True or False.",
            )
        return cls(
            chosen,
            robot_type and robot_type.lower(),
            model.get("unowned"),
            model.get("cost"),
            remember_actions,
            model.get("slack"),
            model.get("words_see_slack", False),
        )

    def options(self) -> ModelOptions:
        """Return the options of a model that no language file describes.

        Raises
        ------
        UsageError
            For a value that an option does not have.
        """
        from planners.loading import ModelOptions
        from planners.pddl.robots import RobotSelection

        unowned = "error" if self.unowned is None else self.unowned
        cost = "makespan" if self.cost is None else self.cost
        selection = RobotSelection(self.robots, self.robot_type, unowned)
        return ModelOptions(
            selection,
            cost,
            self.remember_actions,
            slack=0 if self.slack is None else self.slack,
            sees_slack=self.words_see_slack,
        )

    def for_language(self, language: Language) -> ModelOptions:
        """Return the options that the language records.

        Raises
        ------
        UsageError
            For a given option that contradicts them.
        """
        from coordlang.language.recorded import options_of
        from planners.errors import UsageError

        if self.robot_type:
            raise UsageError(
                "--robot-type: a language file names its robots already",
                remedy="Leave out --robot-type.",
            )
        return options_of(
            language,
            robots=self.robots,
            unowned=self.unowned,
            cost=self.cost,
            remember_actions=self.remember_actions,
            slack=self.slack,
            sees_slack=self.words_see_slack,
        )
