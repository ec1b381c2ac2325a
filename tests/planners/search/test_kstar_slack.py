# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans within slack counted by K* in its top-quality mode.

It counts every sequence of actions within the bound that ends in the goal: for least makespan ``m``
those of ``m``, ``m + 1``, .. ``m + B`` steps.  Ours are written with all steps that are allowed, so
its number is the sum of ours over the slacks up to B.  Steps in which all robots wait would be
dropped by its translator, so they tick (`tests.support.ticking`).  K* comes with ``pip install
'.[oracles]'``; without it these tests are skipped.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from planners.classical import compile_classical, to_pddl
from planners.loading import load
from tests.support.domains import DOMAINS
from tests.support.slack_counts import SLACK_COUNTS
from tests.support.ticking import ticking

pytestmark = pytest.mark.slow

#: Plans that K* is asked for at most: it lists them.
MOST = 100_000


@pytest.mark.parametrize("slack", [1, 2])
@pytest.mark.parametrize(("folder", "stem", "makespan", "counts"), SLACK_COUNTS)
def test_k_star_counts_the_same_plans(
    folder: str,
    stem: str,
    makespan: int,
    counts: tuple[int, ...],
    slack: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    planners = pytest.importorskip(
        "kstar_planner.planners", reason="K* is not installed (extra oracles)"
    )
    wanted = sum(counts[: slack + 1])
    if wanted > MOST:
        pytest.skip("more plans than K* lists in reasonable time")
    loaded = load(DOMAINS / folder / "domain.pddl", [DOMAINS / folder / f"{stem}.pddl"])
    plain = ticking(compile_classical(loaded.model, loaded.tasks[0], limit=100_000))
    assert plain.form == "explicit"
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    for path, text in zip((domain, problem), to_pddl(plain), strict=True):
        path.write_text(text)
    monkeypatch.chdir(tmp_path)
    bound = (makespan + slack + 0.001) / makespan  # a little more: it compares floats
    found = planners.plan_topq(domain, problem, quality_bound=bound, timeout=600)
    assert "search exit code: 0" in found["planner_output"]
    assert len({tuple(plan["actions"]) for plan in found["plans"]}) == wanted
