# SPDX-License-Identifier: GPL-3.0-or-later
"""How PDDL files are understood: who the robots are, what optimal means, what states remember."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, cast

from planners.system.errors import UsageError
from planners.system.messages import echoed
from planners.system.options import option

Cost = Literal["makespan", "makespan+actions", "makespan+cost"]
Execution = Literal["lockstep", "asynchronous"]
Unowned = Literal["error", "environment", "shared"]

#: The most slack that is taken: plans of so many joint steps fill any memory.
MOST_SLACK = 1_000_000


@dataclass(frozen=True, slots=True)
class ModelOptions:
    """How the files are to be understood; a language file records it.

    ``robots`` may be given as one text, ``"r1,r2"``; the record holds the names.  ``recorded``: a
    language file said who the robots are, not the user.

    Raises `UsageError` for options that contradict each other; what kind of a value each takes is
    checked where it is given (`planners.system.options`).
    """

    robots: str | Sequence[str] = option((), "The robots, where the domain does not say.", "R1,R2")
    robot_type: str | None = option(None, "The type (or unary predicate) of the robots.", "TYPE")
    unowned: Unowned = option("error", "Who owns actions that name no robot.")
    cost: Cost = option("makespan", "What optimal means.")
    remember_actions: bool = option(False, "Add each robot's last subaction to the state.")
    slack: int = option(
        0, "Plans may take B joint steps more than the least makespan.", "B", least=0
    )
    words_see_slack: bool = option(
        False, "States also say how many steps of the slack are left, and words may differ in that."
    )
    asynchronous: bool = option(
        False, "Robots keep no common step: what counts is what each waits for, not when."
    )
    recorded: bool = False

    def __post_init__(self) -> None:
        whole = self.robots if self.recorded else ()
        object.__setattr__(self, "robots", names_in("--robots", self.robots, whole))
        if self.robot_type is not None:
            if not self.robot_type.strip():
                raise UsageError(
                    "--robot-type: expected a name", remedy="As in --robot-type robot."
                )
            object.__setattr__(self, "robot_type", self.robot_type.lower())
        if self.robots and self.robot_type:
            raise UsageError(
                "--robots and --robot-type both say who the robots are: give one of them",
                remedy="--robots names them one by one.",
            )
        self._check_slack()

    @property
    def names(self) -> tuple[str, ...]:
        """The robots that are named; none where they are to be found."""
        return cast(tuple[str, ...], self.robots)

    def data(self) -> dict[str, str | int]:
        """The cost, and the other options that say what a plan or a state is, where one is used."""
        options: dict[str, str | int] = {
            "remember-actions": self.remember_actions,
            "slack": self.slack,
            "words-see-slack": self.words_see_slack,
            "asynchronous": self.asynchronous,
        }
        if self.unowned != "error":
            options["unowned"] = self.unowned
        return {"cost": self.cost, **{name: value for name, value in options.items() if value}}

    def __str__(self) -> str:
        """These options as text: ``cost makespan, remember-actions``."""
        return ", ".join(
            name if value is True else f"{name} {value}" for name, value in self.data().items()
        )

    def _check_slack(self) -> None:
        if self.slack > MOST_SLACK:
            raise UsageError(
                f"--slack {echoed(str(self.slack))}: more than {MOST_SLACK:,} joint steps",
                remedy="Say --slack 1.",
            )
        for given, name, why in (
            (self.slack, "slack", "no steps are counted"),
            (self.remember_actions, "remember-actions", "nobody acts last"),
        ):
            if self.asynchronous and given:
                raise UsageError(
                    f"--asynchronous --{name}: without a common step {why}",
                    remedy="Leave out one of them.",
                )
        if self.words_see_slack and not self.slack:
            raise UsageError(
                "--words-see-slack belongs to --slack, and there is none",
                remedy="Add --slack 1, or leave out --words-see-slack.",
            )


def names_in(
    spelling: str, given: str | Sequence[str], whole: Sequence[str] = ()
) -> tuple[str, ...]:
    """The names that an option is given, in texts with commas, in lower case.

    Names in ``whole`` may have commas.  Raises `UsageError` for texts without a name.
    """
    texts = [given] if isinstance(given, str) else given
    parts = [part for text in texts for part in ([text] if text in whole else text.split(","))]
    names = [part.strip().lower() for part in parts if part.strip()]
    if not names and given != ():
        raise UsageError(f"{spelling}: expected names", remedy=f"As in {spelling} r1,r2.")
    return tuple(names)
