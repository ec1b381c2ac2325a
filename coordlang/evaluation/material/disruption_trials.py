"""Trials of tasks in which something turns out to be impossible after agreement.

The plan or the sentence survives it or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random
from statistics import fmean

from coordlang.evaluation.material.disruptions import Hazard, Sayings, exact_odds
from coordlang.evaluation.material.warehouse import Corners, Delivery, human_in
from coordlang.language.words import Language
from coordlang.tasks.candidates import Candidates
from coordlang.use.sentence.task_language import TaskLanguage, languages_in_tasks
from planners.errors import OutOfMemory

#: Sentences of parts of plans (summed over plan-space edges) up to which all are looked at.
MOST_SENTENCES = 2_000_000


@dataclass(frozen=True, slots=True)
class Trial:
    """Tasks (by number) to be done one after the other, and a hazard.

    The hazard appears when they begin.
    """

    tasks: tuple[int, ...]
    hazard: int


@dataclass(frozen=True, slots=True)
class Trials:
    """All equally likely trials over the tasks of one plan space."""

    sayings: Sayings
    hazards: tuple[Hazard, ...]
    trials: tuple[Trial, ...]

    def sample(self, runs: int, random: Random) -> dict[str, int]:
        """Successes in random trials.

        The same task, hazard and plan for both, the sentence being that plan's.
        """
        plan = sentence = 0
        for _ in range(runs):
            trial = self.trials[random.randrange(len(self.trials))]
            hazard = self.hazards[trial.hazard]
            drawn = [(task, *self.sayings.draw(task, random)) for task in trial.tasks]
            plan += not any(hazard.breaks(agreed) for _, agreed, _ in drawn)
            sentence += all(self.sayings.survives(task, words, hazard) for task, _, words in drawn)
        return {"runs": runs, "plan": plan, "sentence": sentence}

    def exact(self) -> dict[str, float] | None:
        """Success rates over all trials, plans drawn uniformly.

        *possible*: some optimal plan would have done.

        None where there are too many sentences to look at all of them.
        """
        spoken = self.sayings.spoken
        try:
            odds = exact_odds(spoken.space, spoken.word, self.hazards, MOST_SENTENCES)
        except OutOfMemory:
            return None
        found = [[odds[task][trial.hazard] for task in trial.tasks] for trial in self.trials]
        return {
            "plan": round(fmean(_product([o.plan for o in legs]) for legs in found), 6),
            "sentence": round(fmean(_product([o.sentence for o in legs]) for legs in found), 6),
            "possible": round(
                fmean(_product([float(o.possible) for o in legs]) for legs in found), 6
            ),
        }


def _product(shares: Sequence[float]) -> float:
    result = 1.0
    for share in shares:
        result *= share
    return result


def _only(candidates: Candidates, language: Language) -> Sayings:
    assert len(candidates.spaces) == 1, "these worlds are small"
    return Sayings(next(iter(languages_in_tasks(language, candidates))))


def warehouse_trials(
    candidates: Candidates, language: Language, every: Sequence[Delivery]
) -> Trials:
    """Trials of deliveries in a warehouse, with a human in the way."""
    sayings = _only(candidates, language)
    model = candidates.model
    corners = {cell for delivery in every for cell in delivery.start}
    cells = sorted({fact.args[1] for fact in model.codec.facts} - corners)
    hazards = tuple(human_in(model, cell) for cell in cells)
    number = _task_numbers(sayings.spoken)
    trials = [
        Trial(tuple(number[leg] for leg in delivery.legs), hazard)
        for delivery in every
        for hazard in range(len(hazards))
    ]
    return Trials(sayings, hazards, tuple(trials))


def _task_numbers(spoken: TaskLanguage) -> dict[tuple[Corners, Corners], int]:
    """The task of each leg.

    Tasks are grouped by goal in a plan space, so they are found by their states.
    """
    space, codec = spoken.space, spoken.model.codec
    found = {}
    for task, start in enumerate(space.starts.tolist()):
        node = start
        while space.layer[node] > 0:
            node = int(space.target[space.first[node]])
        ends = [codec.key(space.rows[space.state[n]]) for n in (start, node)]
        found[_corners(ends[0]), _corners(ends[1])] = task
    return found


def _corners(key: str) -> Corners:
    cell = {words[1]: words[2] for words in (atom.strip("()").split() for atom in key.split(") ("))}
    return cell["r1"], cell["r2"]


def subaction_trials(candidates: Candidates, language: Language) -> Trials:
    """On other worlds a subaction turns out to be impossible.

    Some optimal plan of the task needs it.
    """
    sayings = _only(candidates, language)
    model, space = candidates.model, sayings.spoken.space
    used = sorted(
        {
            (robot, label)
            for robot in range(len(model.robots))
            for label in set(space.labels[:, robot].tolist())
        }
    )
    does_nothing = {action.label for action in model.actions if action.does_nothing}
    hazards = []
    for robot, label in used:
        if label and model.labels[robot][label] not in does_nothing:
            forbidden = tuple(
                frozenset([label]) if i == robot else frozenset[int]()
                for i in range(len(model.robots))
            )
            hazards.append(Hazard(f"{model.robots[robot]} {model.labels[robot][label]}", forbidden))
    trials = []
    met = [_starts_meeting(sayings.spoken, hazard) for hazard in hazards]
    for task in range(len(space.starts)):
        trials += [Trial((task,), number) for number, tasks in enumerate(met) if tasks[task]]
    return Trials(sayings, tuple(hazards), tuple(trials))


def _starts_meeting(spoken: TaskLanguage, hazard: Hazard) -> list[bool]:
    """For each task whether some optimal plan needs what the hazard forbids."""
    space = spoken.space
    hit = ~hazard.spares(space)
    meets = [False] * len(space)
    bounds = zip(space.first[:-1].tolist(), space.first[1:].tolist(), strict=True)
    for node, (low, high) in enumerate(bounds):
        meets[node] = bool(hit[low:high].any()) or any(
            meets[t] for t in space.target[low:high].tolist()
        )
    return [meets[node] for node in space.starts.tolist()]
