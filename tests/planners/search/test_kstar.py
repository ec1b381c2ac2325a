# SPDX-License-Identifier: GPL-3.0-or-later
"""All optimal plans counted by K*, an independent planner, from the plain PDDL of the joint model.

In the explicit form one plain action is one joint action, so the counts must be equal.  K* comes
with ``pip install '.[oracles]'``; without it these tests are skipped.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from planners.classical import compile_classical, to_pddl
from planners.loading import load
from planners.search.optimal_plans import search
from planners.search.plans import Plans
from tests.support.domains import DOMAINS

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("folder", "stem", "count"),
    [
        ("t-map", "problem", 2),
        ("three-cells", "problem", 4),
        ("grid", "corners-3x3", 18),
        ("grid-joint", "corners-3x3", 18),
        ("grid", "corners-4x4", 236),
        ("corridor", "problem", 32),
    ],
)
def test_k_star_counts_the_same_plans(
    folder: str, stem: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planners = pytest.importorskip(
        "kstar_planner.planners", reason="K* is not installed (extra oracles)"
    )
    loaded = load(DOMAINS / folder / "domain.pddl", [DOMAINS / folder / f"{stem}.pddl"])
    plain = compile_classical(loaded.model, loaded.tasks[0], limit=100_000)
    assert plain.form == "explicit"
    ours = Plans.of(search(loaded.model, loaded.tasks[0]))
    assert ours.count == count
    domain, problem = tmp_path / "d.pddl", tmp_path / "p.pddl"
    for path, text in zip((domain, problem), to_pddl(plain), strict=True):
        path.write_text(text)
    monkeypatch.chdir(tmp_path)
    found = planners.plan_topk(domain, problem, number_of_plans_bound=count + 100, timeout=120)[
        "plans"
    ]
    best = min(plan["cost"] for plan in found)
    assert best == ours.space.cost_of(0)[0]
    # More plans were asked for than there are optimal ones: none is missing.
    assert any(plan["cost"] > best for plan in found)
    assert len({tuple(plan["actions"]) for plan in found if plan["cost"] == best}) == count
