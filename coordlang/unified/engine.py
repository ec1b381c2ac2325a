# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine: unified-planning's oneshot planner, anytime planner and plan validator.

This module imports unified-planning; `coordlang.unified.register` makes the factory import it.
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

from coordlang.language.words import Language
from coordlang.use.sentence.fitting_plans import NoPlanFits
from coordlang.use.sentence.plan_sentence import NotAPlan, NotOptimal, sentence_of_plan
from coordlang.use.sentence.task_language import TaskLanguage, language_in_task
from coordlang.unified import NAME
from coordlang.unified.options import PLAN_KINDS, EngineOptions
from coordlang.unified.plans import NoSteps, of_up, to_up
from coordlang.unified.translation import Concurrency, Subactions, Translated
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
from planners.grounding import idling_schemas
from planners.limits import time_limit
from planners.loading import build
from planners.search.optimal_plans import search
from planners.search.plan_file import Texts
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
        "STATIC_FLUENTS_IN_OBJECT_ASSIGNMENTS",
        "FLUENTS_IN_OBJECT_ASSIGNMENTS",
        "FLUENTS_IN_BOOLEAN_ASSIGNMENTS",
    ),
    "fluents_type": ("OBJECT_FLUENTS",),
    "multi_agent": ("AGENT_SPECIFIC_PRIVATE_GOAL", "AGENT_SPECIFIC_PUBLIC_GOAL"),
    "quality_metrics": ("MAKESPAN",),
}


@dataclass(frozen=True, slots=True)
class _Solved:
    """The optimal plans of a problem, under the sentence if one is given."""

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
    concurrency
        For a problem with agents, formulas about the same joint step as further preconditions:
        action -> PDDL text, in which ``?agent`` is the one that acts and ``agent`` their type.
    cost, remember_actions
        As on the command line.
    language, sentence
        A language (or the name of its file) and a sentence: only plans with this sentence.  The
        language brings robots and cost.
    plan_kind
        The kind of the plans, a `PlanKind`: partial-order (default), sequential or time-triggered.
        Where each action is a whole step, or there is one robot, sequential is the default.

    Raises
    ------
    UPUsageError
        For a value that there is not, here or, if it contradicts the problem or the language, when
        a problem is solved.
    """

    def __init__(
        self,
        *,
        robots: Sequence[Any] = (),
        robot_type: Any = None,
        unowned: str | None = None,
        subactions: Subactions | None = None,
        concurrency: Concurrency | None = None,
        cost: str | None = None,
        remember_actions: bool = False,
        language: Language | str | None = None,
        sentence: str | Sequence[str] | None = None,
        plan_kind: Any = None,
    ) -> None:
        Engine.__init__(self)
        OneshotPlannerMixin.__init__(self)
        AnytimePlannerMixin.__init__(self)
        self._options = EngineOptions.of(
            robots=robots,
            robot_type=robot_type,
            unowned=unowned,
            subactions=subactions,
            concurrency=concurrency,
            cost=cost,
            remember_actions=remember_actions,
            language=language,
            sentence=sentence,
            plan_kind=plan_kind,
        )

    @property
    def name(self) -> str:
        """The name of the engine in unified-planning."""
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
        """Whether problems of this kind can be planned for."""
        return bool(problem_kind <= CoordlangEngine.supported_kind())

    @staticmethod
    def supports_plan(plan_kind: PlanKind) -> bool:
        """Whether plans of this kind can be validated."""
        return plan_kind in PLAN_KINDS

    @staticmethod
    def satisfies(optimality_guarantee: OptimalityGuarantee) -> bool:
        """Every plan is optimal."""
        return True

    @staticmethod
    def ensures(anytime_guarantee: AnytimeGuarantee) -> bool:
        """Optimal plans one after another are ensured, improving plans are not."""
        return bool(anytime_guarantee == AnytimeGuarantee.OPTIMAL_PLANS)

    @staticmethod
    def get_credits(**kwargs: Any) -> Credits | None:
        """None: nothing is printed."""
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
            # There may be other plans, so this is not a proof that there is none.
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
        found = self._options.translated(problem)
        if self._options.language is None:
            loaded = build(found.domain, [found.problem], self._options.model_options(found))
            return _Solved(found, search(loaded.model, loaded.tasks[0]), None)
        task_language = self._language_in(found)
        words = self._options.sentence
        if words is None:
            return _Solved(found, task_language.space, task_language)
        fits = task_language.plans_with(task_language.words_of(words))
        return _Solved(found, fits, task_language)

    def _language_in(self, found: Translated) -> TaskLanguage:
        """The language in this problem.

        Texts are not compared, because the problem has none of its own.
        """
        language = self._options.language
        assert language is not None
        provenance = replace(
            language.provenance,
            domain=_without(language.provenance.domain, "sha256"),
            model=_without(language.provenance.model, "problem_sha256", "world_sha256"),
        )
        return language_in_task(
            replace(language, provenance=provenance),
            found.domain,
            found.problem,
            self._options.model_options(found),
        )

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
        default = PlanKind.SEQUENTIAL_PLAN if whole else PlanKind.PARTIAL_ORDER_PLAN
        kind = self._options.plan_kind or default
        messages = []
        if solved.task_language is not None and not solved.task_language.covered:
            text = "the language does not cover this task: it guarantees nothing here"
            messages.append(LogMessage(LogLevel.WARNING, text))
        tolerance = solved.task_language.tolerance if solved.task_language is not None else None
        if tolerance is not None and tolerance.warning is not None:
            messages.append(LogMessage(LogLevel.WARNING, tolerance.warning))
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

        Under a sentence the plan must be optimal and have it, too.
        """
        try:
            found = self._options.translated(problem)
            loaded = build(found.domain, [found.problem], self._options.model_options(found))
            steps = of_up(found, loaded.model, loaded.team, plan)
            texts = [step for step, _ in steps]
            verdict = validate(found.domain, found.problem, loaded.team, texts)
            wrong_sentence = self._wrong_sentence(found, texts) if verdict.valid else None
        except NoSteps as error:
            return self._invalid(str(error), FailedValidationReason.MUTEX_CONFLICT)
        except CoordlangError as error:
            raise UPUsageError(str(error)) from error
        if verdict.valid:
            if wrong_sentence is not None:
                return self._invalid(wrong_sentence, None)
            metrics = {"makespan": str(len(steps))}
            return ValidationResult(ValidationResultStatus.VALID, self.name, metrics=metrics)
        assert verdict.step is not None
        if verdict.step == len(steps):
            return self._invalid(verdict.reason, FailedValidationReason.UNSATISFIED_GOALS)
        action = next(iter(steps[verdict.step][1]), None)
        reason = f"step {verdict.step + 1}: {verdict.reason}"
        return self._invalid(reason, FailedValidationReason.INAPPLICABLE_ACTION, action)

    def _wrong_sentence(self, found: Translated, plan: Sequence[Texts]) -> str | None:
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
            return str(error)
        if words == wanted:
            return None
        return f'the sentence of this plan is "{task_language.text(words)}"'

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
