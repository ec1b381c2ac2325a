# SPDX-License-Identifier: GPL-3.0-or-later
"""The PDDL that others wrote, in ``../shared/data``: reference numbers, and tasks for languages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plan_features import Feature, all_of, exactly, in_which_order, who, who_does_what

SHARED = Path(__file__).resolve().parent.parent.parent / "shared" / "data"


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the reference table: files, options, and the numbers of an independent search.

    ``factored``: the folder holds one domain and problem per robot.  ``approximate``: the README
    rounds ``plans``.
    """

    name: str
    folder: str
    domain: str
    problem: str
    options: tuple[str, ...]
    states: int
    makespan: int
    plans: int
    fewest: int
    factored: bool = False
    approximate: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """The files and options as ``coordlang`` takes them."""
        place = SHARED / "foreign" / self.folder
        files = (
            ("--factored", str(place))
            if self.factored
            else (str(place / self.domain), str(place / self.problem))
        )
        return (*files, *self.options)


GRIPPER = ("--robot-type", "gripper", "--unowned", "environment")
ROWS = (
    Row("boxpushing", "boxpushing", "domain.pddl", "p2_3_2_1_1_0.pddl", (), 1296, 6, 2038, 55),
    Row(
        "workshop-cal",
        "workshop",
        "workshop_dom_cal.pddl",
        "workshop2_1_2_2_2.pddl",
        (),
        1200,
        5,
        8,
        4,
    ),
    Row(
        "workshop-cn",
        "workshop",
        "workshop_dom_cn.pddl",
        "workshop2_1_2_2_2.pddl",
        (),
        1200,
        5,
        8,
        4,
    ),
    Row("grippers", "grippers", "domain.pddl", "n2-r3-o3-s2.pddl", (), 2403, 7, 100_752, 3640),
    Row(
        "transport",
        "transport",
        "p11.DOMAIN.pddl",
        "p11.pddl",
        ("--robot-type", "vehicle"),
        576,
        7,
        18,
        14,
    ),
    Row("driverlog", "driverlog", "domain.pddl", "pfile1.pddl", (), 10_575, 6, 536, 2),
    Row(
        "driverlog-con",
        "driverlog",
        "domain_constrained.pddl",
        "pfile1.pddl",
        (),
        10_575,
        6,
        536,
        2,
    ),
    Row("driverlog-fac", "driverlog-factored", "", "", (), 10_575, 6, 536, 2, factored=True),
    Row("taxi", "taxi", "domain.pddl", "p01.pddl", (), 280, 10, 28, 4),
    Row("depot", "depot", "domain.pddl", "pfile1.pddl", (), 576, 5, 768, 1),
    Row("depot-con", "depot", "domain_constrained.pddl", "pfile1.pddl", (), 576, 5, 48, 1),
    Row("mapf", "mapf", "mapf-domain.pddl", "mapf-problem2.pddl", (), 42, 2, 1, 1),
    Row(
        "storage", "storage", "domain.pddl", "p05.pddl", ("--robot-type", "hoist"), 1460, 6, 34, 14
    ),
    Row(
        "blocks-arms",
        "blocks-arms",
        "original_domain.pddl",
        "original_problem_3.pddl",
        (),
        361,
        5,
        204,
        84,
    ),
    Row("gripper", "gripper", "domain.pddl", "prob01.pddl", GRIPPER, 256, 7, 384, 24),
    Row(
        "logistics00",
        "logistics00",
        "domain.pddl",
        "problogistics-4-0.pddl",
        ("--robots", "tru1,tru2,apn1"),
        941_192,
        13,
        15_000_000_000_000,
        3584,
        approximate=True,
    ),
)
BY_NAME = {row.name: row for row in ROWS}


@dataclass(frozen=True, slots=True)
class Language:
    """Varied tasks of a row (`coordlang.tasks.patterns`), and what the words say there.

    ``told``: what a sentence says of a plan; all plans of a sentence agree on it, in at least the
    share ``agree`` of the tasks whose plans differ in it.  ``means`` says the same for people.
    ``left`` is what a sentence mostly leaves open.
    """

    name: str
    row: str
    starts: tuple[str, ...]
    goals: tuple[str, ...]
    told: Feature
    left: Feature
    means: str
    cost: str = "makespan+actions"
    remember_actions: bool = False
    agree: float = 1.0


LANGUAGES = (
    Language(
        "boxpushing",
        "boxpushing",
        (),
        ("(at s1 ?)", "(at m1 ?)"),
        who("push-small"),
        exactly,
        "who of the two pushes the small box; the ways there stay open",
    ),
    Language(
        "workshop-cal",
        "workshop-cal",
        ("(inroom a0 ?)", "(inroom a1 ?)"),
        ("(examined p0)", "(inroom a0 ?)"),
        who_does_what(
            "lift-pallet",
            "examine-pallet",
            "enter-forklift",
            "drive-forklift",
            "unlock",
            "press-switch",
        ),
        exactly,
        "who drives the forklift and lifts the pallet, and who examines it; who unlocks and who "
        "presses the switch",
    ),
    Language(
        "workshop-cn",
        "workshop-cn",
        ("(inroom a0 ?)", "(inroom a1 ?)"),
        ("(examined p0)", "(inroom a0 ?)"),
        who_does_what(
            "lift-pallet",
            "examine-pallet",
            "enter-forklift",
            "drive-forklift",
            "unlock",
            "press-switch",
        ),
        exactly,
        "the same as in the other form of this domain",
    ),
    Language(
        "grippers",
        "grippers",
        ("(at-robby robot1 ?)",),
        ("(at ball1 ?)", "(at ball2 ?)"),
        who("pick", "drop"),
        who_does_what("pick"),
        "which of the robots fetch the balls; with which hand stays open",
    ),
    Language(
        "transport",
        "transport",
        ("(at truck-1 ?)", "(at truck-2 ?)"),
        ("(at package-1 ?)", "(at package-2 ?)"),
        who_does_what("pick-up", "drop"),
        exactly,
        "which truck carries which package; when it does stays mostly open",
    ),
    Language(
        "driverlog",
        "driverlog",
        ("(at driver1 ?)", "(at driver2 ?)"),
        ("(at truck1 ?)", "(at package1 ?)", "(at package2 ?)"),
        who_does_what("board-truck", "load-truck", "unload-truck", "drive-truck", "walk"),
        exactly,
        "which driver takes which truck, where to, and which package it carries; when stays open",
    ),
    Language(
        "taxi",
        "taxi",
        (),
        ("(at t1 ?)", "(at t2 ?)", "(at p1 ?)", "(at p2 ?)"),
        who_does_what("enter", "exit"),
        exactly,
        "which passenger takes which taxi",
    ),
    Language(
        "depot",
        "depot",
        (),
        ("(on crate0 ?)", "(on crate1 ?)"),
        all_of(who_does_what("load", "unload", "drive"), in_which_order("load")),
        exactly,
        "which truck carries a crate, and which crate is loaded first; when the hoist lifts it "
        "stays open",
    ),
    Language(
        "depot-con",
        "depot-con",
        (),
        ("(on crate0 ?)", "(on crate1 ?)"),
        all_of(who_does_what("load", "unload", "drive"), in_which_order("load")),
        exactly,
        "the same as in the other form of this domain",
    ),
    Language(
        "mapf",
        "mapf",
        ("(at a1 ?)", "(at a7 ?)", "(occupied ?)"),
        ("(at a1 ?)", "(at a7 ?)"),
        who_does_what("move"),
        exactly,
        "nearly always which way round each robot goes; when it waits stays mostly open",
        agree=0.9,
    ),
    Language(
        "storage",
        "storage",
        ("(at hoist0 ?)", "(at hoist1 ?)", "(clear ?)"),
        ("(in crate0 ?)", "(in crate1 ?)"),
        who("go-out", "lift", "drop"),
        exactly,
        "which hoists go out and fetch the crates, where both could; else mostly which crate, and "
        "where to",
    ),
    Language(
        "blocks-arms",
        "blocks-arms",
        (),
        ("(on ? a)", "(on ? b)", "(on ? c)"),
        who_does_what("pick-up", "put-down", "stack", "unstack"),
        exactly,
        "which arm moves which block; when it takes it up stays mostly open",
    ),
    Language(
        "gripper-2",
        "gripper",
        ("(at-robby ?)",),
        ("(at ball1 ?)", "(at ball2 ?)"),
        who_does_what("pick", "drop"),
        exactly,
        "which hand takes which ball",
    ),
    Language(
        "gripper-3",
        "gripper",
        ("(at-robby ?)",),
        ("(at ball1 ?)", "(at ball2 ?)", "(at ball3 ?)"),
        who_does_what("pick", "drop"),
        exactly,
        "which hand takes which ball",
    ),
)
LANGUAGE_BY_NAME = {language.name: language for language in LANGUAGES}


def load(row: Row, cost: str, *, remember_actions: bool = False) -> Any:
    """The joint model of a row."""
    from planners.loading import ModelOptions, build
    from planners.pddl import read_domain, read_problem
    from planners.pddl.factored import read_factored
    from planners.pddl.robots import RobotSelection

    words = dict(zip(row.options[::2], row.options[1::2], strict=True))
    choice = RobotSelection(
        tuple(words["--robots"].split(",")) if "--robots" in words else (),
        words.get("--robot-type"),
        words.get("--unowned", "error"),  # type: ignore[arg-type]
    )
    if row.factored:
        domain, problem = read_factored(str(SHARED / "foreign" / row.folder))
    else:
        domain = read_domain(row.arguments[0])
        problem = read_problem(row.arguments[1], domain)
    return build(domain, [problem], ModelOptions(choice, cost, remember_actions))  # type: ignore[arg-type]
