# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of robots with wheels, played on the page: where the record says, when it says."""

from __future__ import annotations

import math
import re
from pathlib import Path

import msgspec
import pytest

from coordlang.report import simulated
from coordlang.report.page import Report, make_report
from coordlang.report.simulated import simulated_data
from coordlang.simulation.record import SimulationRecord, to_bytes
from coordlang.simulation.simulator import Settings
from tests.coordlang.report.conftest import Opened, Opener, make_language
from tests.support.command import Command
from tests.support.domains import DOMAINS
from tests.support.simulation import recorded

FILES = DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"
#: Pixels of a metre, and what is left free around the walls.
METRE, EDGE = 100, 100 / 12


def page_of(record: SimulationRecord | None) -> Report:
    language, domain, problem = make_language("t-map", "problem")
    return make_report(language, domain, [problem], tasks_shown=1, simulated=record)


def seen(opened: Opened, thing: str) -> tuple[float, float, float]:
    """Where a disc is drawn, in pixels, and where it heads, in radians counterclockwise."""
    found = opened.page.evaluate(
        """name => { const disc = document.querySelector(`.wheeled[data-thing=${name}]`);
           return disc.getAttribute('transform') + disc.querySelector('line').getAttribute('transform'); }""",
        thing,
    )
    x, y, degrees = map(float, re.findall(r"-?\d+\.?\d*", found))
    return x, y, math.radians(-degrees)


def slide(opened: Opened, frame: int) -> None:
    opened.page.evaluate(
        """frame => { const slider = document.querySelector('#floor-transport input');
           slider.value = frame; slider.dispatchEvent(new Event('input')); }""",
        frame,
    )


def test_robots_are_drawn_where_they_were(open_page: Opener) -> None:
    record = recorded("t-map", "nothing", Settings(), 2)
    opened = open_page(page_of(record).html)
    left = min(min(wall[0], wall[2]) for wall in record.walls)
    top = max(max(wall[1], wall[3]) for wall in record.walls)
    for number, run in enumerate(record.runs):
        opened.page.select_option("#run-select", str(number))
        last = len(run.poses["r1"]) - 1
        for frame in (0, last // 2, last):
            slide(opened, frame)
            for robot in record.robots:
                x, y, heading = run.poses[robot][frame]
                px, py, turned = seen(opened, robot)
                assert px == pytest.approx((x - left) * METRE + EDGE, abs=0.7)
                assert py == pytest.approx((top - y) * METRE + EDGE, abs=0.7)
                assert math.remainder(turned - heading, 2 * math.pi) == pytest.approx(0, abs=0.01)
        assert opened.page.inner_text("#floor-transport output").endswith(f"{run.seconds:.1f} s")


def test_what_happened_is_listed_and_leads_to_when_it_did(open_page: Opener) -> None:
    record = recorded("t-map", "nothing", Settings(), 2)
    stuck = next(number for number, run in enumerate(record.runs) if not run.arrived)
    opened = open_page(page_of(record).html)
    opened.page.select_option("#run-select", str(stuck))
    events = record.runs[stuck].events
    assert opened.page.locator("#floor-events button").count() == len(events)
    opened.page.locator("#floor-events button").first.click()
    assert opened.page.inner_text("#floor-transport output").startswith(f"{events[0].time:.1f} s")
    assert "1 step done" in opened.page.inner_text("#floor-does")
    opened.page.locator("#floor-events button").last.click()
    assert opened.page.locator("#floor-events .ahead").count() == 0


def test_a_page_holds_some_runs_of_many(monkeypatch: pytest.MonkeyPatch) -> None:
    record = recorded("t-map", "nothing", Settings(), 2)
    one = sum(map(len, record.runs[0].poses.values()))
    monkeypatch.setattr(simulated, "MOST_POSES", one)
    assert len(simulated_data(record)["runs"]) == 1
    said = (
        b"Nothing is agreed: each robot follows an optimal plan of its own. A common clock begins"
    )
    some = page_of(record).html
    assert said in some
    assert b"The first 1 of 2 runs.</p>" in some
    monkeypatch.setattr(simulated, "MOST_POSES", 10 * one)
    assert b" of 2 runs." not in page_of(record).html
    monkeypatch.setattr(simulated, "MOST_POSES", 0)
    assert len(simulated_data(record)["runs"]) == 1, "one at least"


def test_runs_of_another_domain_and_no_runs_are_refused(
    coordlang: Command, language: Path, tmp_path: Path
) -> None:
    record = recorded("t-map", "nothing", Settings(), 2)
    path, page = tmp_path / "run.json", tmp_path / "page.html"
    shown = ("report", language, *FILES, "-o", page, "--run", path, "--tasks-shown", "1")
    path.write_bytes(to_bytes(record))
    assert b'id="floor"' not in page_of(None).html
    assert coordlang(*shown).code == 0
    assert b'id="floor"' in page.read_bytes()
    for wrong, said in (
        (msgspec.structs.replace(record, domain={"name": "x", "sha256": "0"}), "another domain"),
        (msgspec.structs.replace(record, runs=[]), "no run"),
    ):
        path.write_bytes(to_bytes(wrong))
        outcome = coordlang(*shown)
        assert outcome.code == 31
        assert said in outcome.err
