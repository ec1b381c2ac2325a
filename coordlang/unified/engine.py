# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine: unified-planning's oneshot planner, anytime planner and plan validator.

This module imports unified-planning; `coordlang.unified.register` makes the factory import it.
"""

from __future__ import annotations

import math
import re
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

import unified_planning.engines as up
from unified_planning.engines import FailedValidationReason as Reason
from unified_planning.engines import LogLevel, LogMessage
from unified_planning.engines import PlanGenerationResultStatus as Status
from unified_planning.engines import ValidationResultStatus as Validity
from unified_planning.engines.mixins import (
    AnytimePlannerMixin,
    OneshotPlannerMixin,
    PlanValidatorMixin,
)
from unified_planning.exceptions import UPUnsupportedProblemTypeError, UPUsageError
from unified_planning.model import ProblemKind
from unified_planning.model.metrics import MinimizeMakespan
from unified_planning.model.problem_kind_versioning import LATEST_PROBLEM_KIND_VERSION
from unified_planning.plans import PlanKind

from coordlang.execution.plan_sentence import NotOptimal, sentence_of_plan
from coordlang.execution.task_language import NoPlanFits, TaskLanguage, language_in_task
from coordlang.language.file import read_language
from coordlang.language.recorded import options_of
from coordlang.language.words import Language
from coordlang.unified import NAME
from coordlang.unified.plans import Invalid, leaves_steps_open, of_up, to_up
from coordlang.unified.translation import FEATURES, Concurrency, Subactions, Translated, translate
from planners.check.rules import Verdict, validate
from planners.grounding.actions import idling_schemas
from planners.loading import build
from planners.pddl.model_options import ModelOptions
from planners.search.optimal_plans import search
from planners.search.plan_file import NotAPlan
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans, Texts
from planners.system.errors import (
    BadInput,
    CoordlangError,
    Note,
    OutOfMemory,
    OutOfTime,
    Position,
    ProvedImpossible,
    Unsupported,
    UsageError,
)
from planners.system.limits import time_limit
from planners.system.options import checked_argument, record_from

#: The kinds of plans that the engine returns and validates.
PLAN_KINDS = (PlanKind.PARTIAL_ORDER_PLAN, PlanKind.SEQUENTIAL_PLAN, PlanKind.TIME_TRIGGERED_PLAN)
#: The parameters that are options of the model.
_MODEL = ("robots", "robot_type", "unowned", "cost", "remember_actions")
#: The types of other parameters.
_KINDS: Mapping[str, Any] = {
    "subactions": Mapping,
    "concurrency": Mapping,
    "language": str | PathLike[str] | Language,
    "sentence": str | Iterable[str],
}
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

    def __post_init__(self) -> None:
        if self.sentence is not None and self.language is None:
            raise UsageError("a sentence needs its language", remedy="Give language, too.")
        if self.plan_kind not in (None, *PLAN_KINDS):
            raise UsageError(
                f"there is no kind of plans {self.plan_kind}",
                remedy="Plans are partial-order, sequential or time-triggered.",
            )

    @classmethod
    def of(cls, **given: Any) -> EngineOptions:
        """Check the engine's parameters; objects and types may be given by their names.

        Raises `UPUsageError` for a value that there is not, or a language that cannot be read.
        """
        _model, *others = cls.__dataclass_fields__
        known = (*_MODEL, *others)
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
            for name, kind in _KINDS.items():
                if given.get(name) is not None:
                    given[name] = checked_argument(name, kind, given[name])
            return cls(model, **{**given, "language": _read(given.get("language"))})
        except (BadInput, UsageError) as error:
            raise UPUsageError(in_parameters(error)) from None

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
    """The language, which may be given by the name of its file, for problems without texts."""
    if given is None:
        return None
    language = given if isinstance(given, Language) else read_language(given)
    if language.tolerance is not None and language.tolerance.slack:
        raise UsageError(
            "this language is for plans within slack, and this engine gives optimal plans only",
            remedy="Build the language without slack.",
        )
    recorded = language.provenance
    domain, model = {**recorded.domain, "sha256": None}, {**recorded.model, "world_sha256": None}
    provenance = replace(recorded, domain=domain, model=model)
    return replace(language, provenance=provenance, position=Position("the language file"))


#: What is said of a plan that is valid step by step, and orders its actions less than that.
_OPEN = (
    "the plan's order does not say which actions share a step: each was taken to be done as early "
    "as its predecessors allow, and in another order it may be no plan"
)
#: What ends a search without a plan, and what it means; the first that fits counts.
_STATUS: dict[type[Exception], Status] = {
    # There may be plans with another sentence, so this is not a proof that there is none.
    NoPlanFits: Status.UNSOLVABLE_INCOMPLETELY,
    ProvedImpossible: Status.UNSOLVABLE_PROVEN,
    Unsupported: Status.UNSUPPORTED_PROBLEM,
    OutOfTime: Status.TIMEOUT,
    OutOfMemory: Status.MEMOUT,
    MemoryError: Status.MEMOUT,
}


class CoordlangEngine(up.Engine, OneshotPlannerMixin, AnytimePlannerMixin, PlanValidatorMixin):  # type: ignore[misc]
    """Plans of least makespan, in joint steps, for all robots of a problem together.

    ``robots``, ``robot_type`` and ``unowned`` say who acts in a problem without agents: objects or
    their names; a type or its name; who owns actions without a robot ("error", "environment" or
    "shared").  Without them the robots are found as in PDDL (docs/pddl.md).  With ``subactions``
    each action is a whole joint step: action -> robot -> its part, as in joint-action PDDL.
    ``concurrency`` has, for a problem with agents, formulas about the same joint step as further
    preconditions: action -> PDDL text, in which ``?agent`` is the one that acts and ``agent`` their
    type.  ``cost`` and ``remember_actions`` are as on the command line.  ``language`` (or the name
    of its file) and ``sentence``: only plans with this sentence; the language brings robots and
    cost.

    ``plan_kind`` is the kind of the plans, a `PlanKind`: partial-order (default), sequential or
    time-triggered.  Where each action is a whole step, or there is one robot, sequential is the
    default.

    Raises `UPUsageError` for a value that there is not, here or, if it contradicts the problem or
    the language, when a problem is solved.
    """

    def __init__(self, **parameters: Any) -> None:
        up.Engine.__init__(self)
        OneshotPlannerMixin.__init__(self)
        AnytimePlannerMixin.__init__(self)
        self._options = EngineOptions.of(**parameters)

    @property
    def name(self) -> str:
        """The name of the engine in unified-planning."""
        return NAME

    @staticmethod
    def supported_kind() -> ProblemKind:
        """What problems may have; of the metrics the makespan alone, which always comes first."""
        return ProblemKind(FEATURES | {"MAKESPAN"}, LATEST_PROBLEM_KIND_VERSION)

    @staticmethod
    def supports(problem_kind: ProblemKind) -> bool:
        """Whether problems of this kind can be planned for."""
        return bool(problem_kind <= CoordlangEngine.supported_kind())

    @staticmethod
    def supports_plan(plan_kind: PlanKind) -> bool:
        """Whether plans of this kind can be validated."""
        return plan_kind in PLAN_KINDS

    @staticmethod
    def satisfies(optimality_guarantee: up.OptimalityGuarantee) -> bool:
        """Every plan is optimal."""
        return True

    @staticmethod
    def ensures(anytime_guarantee: up.AnytimeGuarantee) -> bool:
        """Optimal plans one after another are ensured, improving plans are not."""
        return bool(anytime_guarantee == up.AnytimeGuarantee.OPTIMAL_PLANS)

    # Planning.

    def _solve(
        self,
        problem: Any,
        heuristic: Any = None,
        timeout: float | None = None,
        output_stream: Any = None,
    ) -> up.PlanGenerationResult:
        first = next(self._get_solutions(problem, timeout))
        return first if first.plan is None else replace(first, status=_done(problem))

    def _get_solutions(
        self, problem: Any, timeout: float | None = None, output_stream: Any = None
    ) -> Iterator[up.PlanGenerationResult]:
        """Every plan once: all but the last are `INTERMEDIATE`."""
        end = math.inf if timeout is None else time.monotonic() + timeout
        if timeout is not None and threading.current_thread() is not threading.main_thread():
            text = "coordlang: timeouts of the search hold in the main thread only"
            warnings.warn(text, stacklevel=3)
            timeout = None
        try:
            with time_limit(timeout):
                found, space, messages = self._search(problem)
        except (BadInput, UsageError) as error:
            raise UPUsageError(in_parameters(error)) from error
        except tuple(_STATUS) as error:
            status = next(s for kind, s in _STATUS.items() if isinstance(error, kind))
            yield self._none(status, in_parameters(error) or "out of memory")
            return
        messages += [_warning(f"{metric} is ignored") for metric in _other_metrics(problem)]
        yield from self._results(problem, found, space, messages, end)

    def _results(
        self, problem: Any, found: Translated, space: PlanSpace, notes: list[LogMessage], end: float
    ) -> Iterator[up.PlanGenerationResult]:
        """The plans of a space, one by one; no further one from the time ``end`` on."""
        plans, model = Plans.of(space), space.model
        whole = model.is_joint_action or len(model.robots) == 1
        kind = PlanKind.SEQUENTIAL_PLAN if whole else PlanKind.PARTIAL_ORDER_PLAN
        kind = self._options.plan_kind or kind
        makespan, second = space.cost_of(0)
        metrics = {"makespan": str(makespan), "plans": str(plans.count)}
        if model.cost != "makespan":
            metrics["second cost"] = str(second)
        for number in range(plans.count):
            if time.monotonic() > end:
                yield self._none(Status.TIMEOUT, f"{number} of {plans.count} plans in time")
                return
            status = _done(problem) if number == plans.count - 1 else Status.INTERMEDIATE
            plan = to_up(found, plans, plans.unrank(number), kind, problem.environment)
            yield up.PlanGenerationResult(status, plan, self.name, {**metrics}, [*notes])

    def _search(self, problem: Any) -> tuple[Translated, PlanSpace, list[LogMessage]]:
        """The optimal plans, under the sentence if one is given."""
        options = self._options
        with _notes() as messages:
            found = translate(problem, options.subactions, options.concurrency)
            if (metrics := _other_metrics(problem)) and not self.skip_checks:
                raise Unsupported(
                    f"the quality metric {', '.join(metrics)}",
                    remedy="coordlang minimises the makespan, and nothing else: give "
                    "MinimizeMakespan or no metric. With skip_checks the metric is ignored.",
                )
            if options.language is None:
                loaded = build(found.domain, [found.problem], options.model_options(found))
                return found, search(loaded.model, loaded.tasks[0]), messages
            task_language = self._language_in(found)
        tolerance = task_language.language.tolerance
        if not task_language.covered:
            text = "the language does not cover this task: it guarantees nothing here"
            messages.append(_warning(text))
        if tolerance is not None and tolerance.warning is not None:
            messages.append(_warning(tolerance.warning))
        if options.sentence is None:
            return found, task_language.space, messages
        words = task_language.words_of(options.sentence)
        return found, task_language.plans_with(words), messages

    def _language_in(self, found: Translated) -> TaskLanguage:
        """The language in this problem."""
        language, options = self._options.language, self._options.model_options(found)
        assert language is not None
        return language_in_task(language, found.domain, found.problem, options)

    def _none(self, status: Status, why: str) -> up.PlanGenerationResult:
        messages = [LogMessage(LogLevel.INFO, why)]
        return up.PlanGenerationResult(status, None, self.name, log_messages=messages)

    # Validation.

    def _validate(self, problem: Any, plan: Any) -> up.ValidationResult:
        """By the rules of joint steps (`planners.check.rules`).

        Under a sentence the plan must be optimal and have it, too.  A metric does not matter.
        """
        try:
            with _notes() as messages:
                options = self._options
                found = translate(problem, options.subactions, options.concurrency)
                loaded = build(found.domain, [found.problem], options.model_options(found))
                steps = of_up(found, loaded.model, loaded.team, plan)
                texts = [step for step, _ in steps]
                is_joint = loaded.model.is_joint_action
                names = [next(iter(actions)) for _, actions in steps] if is_joint else None
                verdict = validate(
                    found.domain, found.problem, loaded.team, texts, joint_actions=names
                )
                is_plan = verdict.valid
                wrong = self._other_sentence(found, texts) if is_plan else _refuted(verdict, steps)
        except Invalid as error:
            wrong = error
        except Unsupported as error:
            raise UPUnsupportedProblemTypeError(in_parameters(error)) from error
        except CoordlangError as error:
            raise UPUsageError(in_parameters(error)) from error
        if wrong is not None:
            return up.ValidationResult(
                Validity.INVALID,
                self.name,
                [LogMessage(LogLevel.INFO, str(wrong))],
                reason=wrong.reason,
                inapplicable_action=wrong.action,
            )
        metrics = {"makespan": str(len(steps))}
        if leaves_steps_open(plan):
            messages.append(_warning(_OPEN))
        return up.ValidationResult(Validity.VALID, self.name, messages, metrics=metrics)

    def _other_sentence(self, found: Translated, plan: Sequence[Texts]) -> Invalid | None:
        """Why a plan has another sentence than the one given, or none; None if all is well."""
        if self._options.sentence is None:
            return None
        task_language = self._language_in(found)
        wanted = task_language.words_of(self._options.sentence)
        idling = idling_schemas(found.domain)
        acting = [
            tuple(None if own and own[1:-1].split()[0] in idling else own for own in step)
            for step in plan
        ]
        try:
            words = sentence_of_plan(task_language, acting)
        except (NotAPlan, NotOptimal) as error:
            return Invalid(in_parameters(error))
        said = f'the sentence of this plan is "{task_language.text(words)}"'
        return None if words == wanted else Invalid(said)


def _refuted(verdict: Verdict, steps: Sequence[Any]) -> Invalid:
    """What an invalid plan breaks: the rules in a step of `of_up`, or the goal at the end."""
    assert verdict.step is not None
    if verdict.step == len(steps):
        return Invalid(verdict.reason, Reason.UNSATISFIED_GOALS)
    _, actions = steps[verdict.step]
    why = f"step {verdict.step + 1}: {verdict.reason}"
    return Invalid(why, Reason.INAPPLICABLE_ACTION, next(iter(actions.values()), None))


@contextmanager
def _notes() -> Iterator[list[LogMessage]]:
    """Notes given inside, as messages: users of unified-planning read results."""
    messages: list[LogMessage] = []
    with warnings.catch_warnings(record=True) as caught:
        yield messages
    for given in caught:
        if isinstance(given.message, Note):
            messages.append(_warning(in_parameters(given.message)))
        else:
            warnings.warn_explicit(given.message, given.category, given.filename, given.lineno)


def _warning(text: str) -> LogMessage:
    return LogMessage(LogLevel.WARNING, text)


def _other_metrics(problem: Any) -> list[str]:
    """The problem's metrics that are not the makespan."""
    metrics = getattr(problem, "quality_metrics", ())
    return [type(m).__name__ for m in metrics if not isinstance(m, MinimizeMakespan)]


def _done(problem: Any) -> Status:
    """Optimal, unless a metric that is not ours was ignored (`skip_checks`)."""
    return Status.SOLVED_SATISFICING if _other_metrics(problem) else Status.SOLVED_OPTIMALLY
