# SPDX-License-Identifier: GPL-3.0-or-later
"""What was built, in lines for a person."""

from __future__ import annotations

from typing import Any

from coordlang.commands.built import Built
from coordlang.required.failures import Failures
from planners.system.notebook import counted


def built_text(built: Built, width: int) -> str:
    """The figures of the making in whole lines of at most ``width`` characters."""
    figures = built.data()
    total = sum(figures["seconds"].values())
    proof = f"at least {figures['lower_bound']} needed, "
    if figures["proved_minimal"]:
        proof = "proved minimal, "
    words, tasks = counted(figures["words"], "word"), counted(figures["tasks"], "task")
    verified = "verified"
    if built.few_words is not None and not figures["verified"]:
        proof, verified = "", "no coordination language"
    repaired = "" if built.repaired is None else f"{built.repaired.text(width)}\n"
    return (
        f"{words} ({figures['method']}, {proof}{verified}) for {tasks}, "
        f"{figures['tasks_requiring_coordination']:,} of which require coordination\n"
        f"{figures['states_on_plans']:,} states on {built.candidates.model.kept_plans}, "
        f"{figures['divergences']:,} divergences, "
        f"{figures['walk_nodes']:,} nodes of plans, {total:.2f} s\n"
        f"{_more_effort(built)}{_fewest(figures)}"
        f"{_failures(built)}{_flexibility(figures)}{_readability(figures)}"
        f"{repaired}"
    )


def _more_effort(built: Built) -> str:
    """What more effort might bring; a whole line."""
    guarantee, effort = built.guarantee, built.job.effort
    if guarantee.method != "best" or guarantee.proved_minimal:
        return ""
    larger = "larger limit" if built.stopped else f"larger --effort than {effort}"
    return (
        f"between {guarantee.lower_bound} and {guarantee.size} words are needed: a {larger} "
        "may find fewer or prove that there are none\n"
    )


def _fewest(figures: dict[str, Any]) -> str:
    """What another cost would change; a whole line."""
    fewest = figures.get("tasks_requiring_coordination_with_fewest_actions")
    if fewest is None:
        return ""
    does = figures["tasks_requiring_coordination"]
    less = ": one word would do" if fewest == 0 else ""
    would = f"{counted(fewest, 'task')} would require coordination"
    return f"with --cost makespan+actions {would}, not {does:,}{less}\n"


def _failures(built: Built) -> str:
    """How often robots fail under as many words as were asked for; whole lines."""
    found = built.few_words
    if found is None:
        return ""
    line = f"robots that choose by themselves {built.failures.text()}"
    if built.verdict.holds:
        line = "no robot fails: this is a coordination language"
    elif found.is_best and len(built.language.words) > 1:
        line += " (the least of all partitions)"
    silence = Failures(found.silence.mean, found.silence.worst)
    return f"{line}\nin silence they {silence.text()}\n"


def _readability(figures: dict[str, Any]) -> str:
    """How short formulas are, where that was optimised; whole lines."""
    if "terms" not in figures:
        return ""
    terms, limits = figures["terms"], figures["limits"]
    proved = (terms, limits) == (figures["terms_lower_bound"], figures["limits_lower_bound"])
    proof = "proved the shortest" if proved else f"at least {figures['terms_lower_bound']}"
    before = f"{counted(figures['terms_before'], 'term')}, {figures['limits_before']} limits"
    return (
        f"formulas of {counted(terms, 'term')} with {counted(limits, 'limit')} on variables "
        f"({before} before; {proof})\n"
    )


def _flexibility(figures: dict[str, Any]) -> str:
    """How many plans the sentences leave open, where that was optimised; whole lines."""
    if "flexibility" not in figures:
        return ""
    return (
        f"a sentence leaves {figures['flexibility']:,.2f} plans open on average ("
        f"{figures['flexibility_before']:,.2f} before, "
        f"{figures['flexibility_bound']:,.2f} at most), "
        f"communication saving {100 * figures['communication_saving']:.1f} %\n"
    )
