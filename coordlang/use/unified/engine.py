"""The engine: unified-planning's oneshot planner, anytime planner and plan validator.

This module imports unified-planning; `coordlang.use.unified.register` makes the factory import it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any
from warnings import warn

from unified_planning.engines import (
    AnytimeGuarantee,
    Credits,
    Engine,
    FailedValidationReason,
    LogLevel,
    LogMessage,
    OptimalityGuarantee,
    PlanGenerationResult,
    PlanGenerationResultStatus,
    ValidationResult,
    ValidationResultStatus,
)
from unified_planning.engines.mixins import (
    AnytimePlannerMixin,
    OneshotPlannerMixin,
    PlanValidatorMixin,
)
from unified_planning.exceptions import UPUsageError
from unified_planning.model import ProblemKind
from unified_planning.model.problem_kind_versioning import LATEST_PROBLEM_KIND_VERSION
from unified_planning.plans import PlanKind

from coordlang.language.file import read_language
from coordlang.language.recorded import options_of
from coordlang.language.words import Language
from coordlang.use.sentence.fitting_plans import NoPlanFits
from coordlang.use.sentence.plan_sentence import NotAPlan, NotOptimal, sentence_of_plan
from coordlang.use.sentence.task_language import TaskLanguage, language_in_task
from coordlang.use.unified import NAME
from coordlang.use.unified.plans import NoSteps, of_up, to_up
from coordlang.use.unified.translation import Subactions, Translated, translate
from planners.check.validate import validate
from planners.errors import (
    BadInput,
    CoordlangError,
    OutOfMemory,
    OutOfTime,
    ProvedImpossible,
    Unsupported,
    UsageError,
)
from planners.limits import time_limit
from planners.loading import ModelOptions, build
from planners.pddl.robots import RobotSelection
from planners.search.optimal_plans import search
from planners.search.plan_space import PlanSpace
from planners.search.plans import Plans

_Status = PlanGenerationResultStatus
_FEATURES = {
    "problem_class": ("ACTION_BASED", "ACTION_BASED_MULTI_AGENT"),
    "typing": ("FLAT_TYPING", "HIERARCHICAL_TYPING"),
    "conditions_kind": (
        "NEGATIVE_CONDITIONS",
        "DISJUNCTIVE_CONDITIONS",
        "EQUALITIES",
        "EXISTENTIAL_CONDITIONS",
        "UNIVERSAL_CONDITIONS",
    ),
    "effects_kind": (
        "CONDITIONAL_EFFECTS",
        "FORALL_EFFECTS",
        "STATIC_FLUENTS_IN_BOOLEAN_ASSIGNMENTS",
        "FLUENTS_IN_BOOLEAN_ASSIGNMENTS",
    ),
    "multi_agent": ("AGENT_SPECIFIC_PRIVATE_GOAL", "AGENT_SPECIFIC_PUBLIC_GOAL"),
    "quality_metrics": ("MAKESPAN",),
}
_PLANS = (PlanKind.PARTIAL_ORDER_PLAN, PlanKind.SEQUENTIAL_PLAN, PlanKind.TIME_TRIGGERED_PLAN)


@dataclass(frozen=True, slots=True)
class _Solved:
    """The plans that are asked for."""

    found: Translated
    space: PlanSpace
    task_language: TaskLanguage | None


class CoordlangEngine(Engine, OneshotPlannerMixin, AnytimePlannerMixin, PlanValidatorMixin):  # type: ignore[misc]
    """Plans of least makespan, in joint steps, for all robots of a problem together.

    Parameters
    ----------
    robots, robot_type, unowned
        Who acts, in a problem without agents: objects or their names; a type or its name; who owns
        actions without a robot ("error", "environment" or "shared").  Without them the robots are
        found as in PDDL (docs/pddl.md).
    subactions
        Each action is a whole joint step: action -> robot -> its part, as in joint-action PDDL.
    cost, remember_actions
        As on the command line.
    language, sentence
        A language (or the name of its file) and a sentence: only plans that fit.  The language
        brings robots and cost.
    plan_kind
        The kind of the plans, a `PlanKind`: partial-order (default), sequential or time-triggered.
        Where each action is a whole step, or there is one robot, sequential is the default.
    """

    def __init__(
        self,
        *,
        robots: Sequence[Any] = (),
        robot_type: Any = None,
        unowned: str | None = None,
        subactions: Subactions | None = None,
        cost: str | None = None,
        remember_actions: bool = False,
        language: Language | str | None = None,
        sentence: str | Sequence[str] | None = None,
        plan_kind: Any = None,
    ) -> None:
        Engine.__init__(self)
        OneshotPlannerMixin.__init__(self)
        AnytimePlannerMixin.__init__(self)
        if sentence is not None and language is None:
            raise UPUsageError("a sentence needs its language")
        if plan_kind is not None and plan_kind not in _PLANS:
            raise UPUsageError(
                f"{plan_kind}: plans are partial-order, sequential or time-triggered"
            )
        self._robots = [r if isinstance(r, str) else r.name for r in robots]
        self._robot_type = (
            robot_type if robot_type is None or isinstance(robot_type, str) else robot_type.name
        )
        self._unowned, self._cost, self._remember = unowned, cost, remember_actions
        self._subactions, self._sentence, self._plan_kind = subactions, sentence, plan_kind
        try:
            self._language = (
                language
                if language is None or isinstance(language, Language)
                else read_language(language)
            )
        except BadInput as error:
            raise UPUsageError(str(error)) from None

    @property
    def name(self) -> str:
        return NAME

    @staticmethod
    def supported_kind() -> ProblemKind:
        """Costs of actions and lengths of plans are no metrics here.

        The makespan always comes first.
        """
        kind = ProblemKind(version=LATEST_PROBLEM_KIND_VERSION)
        for group, features in _FEATURES.items():
            for feature in features:
                getattr(kind, f"set_{group}")(feature)
        return kind

    @staticmethod
    def supports(problem_kind: ProblemKind) -> bool:
        return bool(problem_kind <= CoordlangEngine.supported_kind())

    @staticmethod
    def supports_plan(plan_kind: PlanKind) -> bool:
        return plan_kind in _PLANS

    @staticmethod
    def satisfies(optimality_guarantee: OptimalityGuarantee) -> bool:
        return True

    @staticmethod
    def ensures(anytime_guarantee: AnytimeGuarantee) -> bool:
        return bool(anytime_guarantee == AnytimeGuarantee.OPTIMAL_PLANS)

    @staticmethod
    def get_credits(**kwargs: Any) -> Credits | None:
        return None

    # Planning.

    def _solve(
        self,
        problem: Any,
        heuristic: Any = None,
        timeout: float | None = None,
        output_stream: Any = None,
    ) -> PlanGenerationResult:
        _ignored(heuristic=heuristic, output_stream=output_stream)
        solved = self._solved(problem, timeout)
        if isinstance(solved, PlanGenerationResult):
            return solved
        plans = Plans.of(solved.space)
        return self._result(self._done(problem), solved, plans, 0, problem)

    def _get_solutions(
        self, problem: Any, timeout: float | None = None, output_stream: Any = None
    ) -> Iterator[PlanGenerationResult]:
        """Every plan once: all but the last are `INTERMEDIATE`."""
        _ignored(output_stream=output_stream)
        end = None if timeout is None else time.monotonic() + timeout
        solved = self._solved(problem, timeout)
        if isinstance(solved, PlanGenerationResult):
            yield solved
            return
        plans = Plans.of(solved.space)
        for number in range(plans.count):
            if end is not None and time.monotonic() > end:
                yield self._none(_Status.TIMEOUT, f"{number} of {plans.count} plans in time")
                return
            last = number == plans.count - 1
            yield self._result(
                self._done(problem) if last else _Status.INTERMEDIATE,
                solved,
                plans,
                number,
                problem,
            )

    def _solved(self, problem: Any, timeout: float | None) -> _Solved | PlanGenerationResult:
        """The plans as a graph; or the result that says why there are none."""
        main = threading.current_thread() is threading.main_thread()
        if timeout is not None and not main:
            warn("coordlang: timeouts of the search hold in the main thread only", stacklevel=4)
        try:
            with time_limit(timeout) if main else nullcontext():
                return self._search(problem)
        except ProvedImpossible as error:
            return self._none(_Status.UNSOLVABLE_PROVEN, str(error))
        except NoPlanFits as error:
            # Other plans there may be: this is not what "proven" says.
            return self._none(_Status.UNSOLVABLE_INCOMPLETELY, str(error))
        except Unsupported as error:
            return self._none(_Status.UNSUPPORTED_PROBLEM, str(error))
        except OutOfTime as error:
            return self._none(_Status.TIMEOUT, str(error))
        except (OutOfMemory, MemoryError) as error:
            return self._none(_Status.MEMOUT, str(error) or "out of memory")
        except (BadInput, UsageError) as error:
            raise UPUsageError(str(error)) from error

    def _search(self, problem: Any) -> _Solved:
        found = translate(problem, self._subactions)
        if self._language is None:
            loaded = build(found.domain, [found.problem], self._options(found))
            return _Solved(found, search(loaded.model, loaded.tasks[0]), None)
        task_language = self._speak(found)
        space = (
            task_language.space
            if self._sentence is None
            else task_language.plans_with(task_language.words_of(self._sentence))
        )
        return _Solved(found, space, task_language)

    def _speak(self, found: Translated) -> TaskLanguage:
        """The language in this problem.

        Texts are not compared, because the problem has none of its own.
        """
        assert self._language is not None
        provenance = replace(
            self._language.provenance,
            domain=_without(self._language.provenance.domain, "sha256"),
            model=_without(self._language.provenance.model, "problem_sha256", "world_sha256"),
        )
        language = replace(self._language, provenance=provenance)
        return language_in_task(language, found.domain, found.problem, self._options(found))

    def _options(self, found: Translated) -> ModelOptions:
        names = {o.name: name for name, o in found.objects.items()}
        robots = tuple(names.get(robot, robot) for robot in self._robots)
        if self._language is not None:
            remember = self._remember or None
            return options_of(
                self._language,
                robots=robots,
                unowned=self._unowned,
                cost=self._cost,
                remember_actions=remember,
            )
        kind = (
            None
            if self._robot_type is None
            else found.types.get(self._robot_type, self._robot_type)
        )
        choice = RobotSelection(robots, kind, self._unowned or "error")  # type: ignore[arg-type]
        return ModelOptions(choice, self._cost or "makespan", self._remember)  # type: ignore[arg-type]

    def _done(self, problem: Any) -> PlanGenerationResultStatus:
        """Optimal, unless a metric that is not ours was to be ignored (`skip_checks`)."""
        metrics = getattr(problem, "quality_metrics", ())
        ours = all(type(metric).__name__ == "MinimizeMakespan" for metric in metrics)
        return _Status.SOLVED_OPTIMALLY if ours else _Status.SOLVED_SATISFICING

    def _result(
        self,
        status: PlanGenerationResultStatus,
        solved: _Solved,
        plans: Plans,
        number: int,
        problem: Any,
    ) -> PlanGenerationResult:
        plan = plans.unrank(number)
        whole = plans.space.model.is_joint_action or len(plans.space.model.robots) == 1
        kind = self._plan_kind or (
            PlanKind.SEQUENTIAL_PLAN if whole else PlanKind.PARTIAL_ORDER_PLAN
        )
        messages = []
        if solved.task_language is not None and not solved.task_language.covered:
            text = "the language does not cover this task: it guarantees nothing here"
            messages.append(LogMessage(LogLevel.WARNING, text))
        makespan, second = plans.space.cost_of(0)
        metrics = {"makespan": str(makespan), "plans": str(plans.count)}
        if plans.space.model.cost != "makespan":
            metrics["second cost"] = str(second)
        up_plan = to_up(solved.found, plans, plan, kind, problem.environment)
        return PlanGenerationResult(status, up_plan, self.name, metrics, messages)

    def _none(self, status: PlanGenerationResultStatus, why: str) -> PlanGenerationResult:
        return PlanGenerationResult(
            status, None, self.name, log_messages=[LogMessage(LogLevel.INFO, why)]
        )

    # Validation.

    def _validate(self, problem: Any, plan: Any) -> ValidationResult:
        """By the rules of joint steps (`planners.check.validate`).

        Under a sentence the plan must be optimal and fit, too.
        """
        try:
            found = translate(problem, self._subactions)
            loaded = build(found.domain, [found.problem], self._options(found))
            steps = of_up(found, loaded.model, loaded.team, plan)
        except NoSteps as error:
            return self._invalid(str(error), FailedValidationReason.MUTEX_CONFLICT)
        except CoordlangError as error:
            raise UPUsageError(str(error)) from error
        verdict = validate(found.domain, found.problem, loaded.team, [texts for texts, _ in steps])
        if not verdict.valid and verdict.step == len(steps):
            return self._invalid(verdict.reason, FailedValidationReason.UNSATISFIED_GOALS)
        if not verdict.valid:
            assert verdict.step is not None
            action = next(iter(steps[verdict.step][1]), None)
            reason = f"step {verdict.step + 1}: {verdict.reason}"
            return self._invalid(reason, FailedValidationReason.INAPPLICABLE_ACTION, action)
        if self._sentence is not None:
            task_language = self._speak(found)
            try:
                said = sentence_of_plan(task_language, [texts for texts, _ in steps])
            except (NotAPlan, NotOptimal) as error:
                return self._invalid(str(error), None)
            if said != task_language.words_of(self._sentence):
                return self._invalid(
                    f'the sentence of this plan is "{task_language.text(said)}"', None
                )
        return ValidationResult(
            ValidationResultStatus.VALID, self.name, metrics={"makespan": str(len(steps))}
        )

    def _invalid(
        self, why: str, reason: FailedValidationReason | None, action: Any = None
    ) -> ValidationResult:
        messages = [LogMessage(LogLevel.INFO, why)]
        return ValidationResult(
            ValidationResultStatus.INVALID,
            self.name,
            messages,
            reason=reason,
            inapplicable_action=action,
        )


def _ignored(**given: Any) -> None:
    for name, value in given.items():
        if value is not None:
            warn(f"coordlang ignores {name}", stacklevel=5)


def _without(entries: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in entries.items() if key not in keys}
