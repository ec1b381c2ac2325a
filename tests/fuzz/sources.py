# SPDX-License-Identifier: GPL-3.0-or-later
"""The files to break: pairs of a domain and a problem that are read without an error."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tests.support.domains import DOMAINS, SHARED

FOREIGN = SHARED / "foreign"


@dataclass(frozen=True)
class Pair:
    """A domain and a problem that are read without an error, with the options they need."""

    name: str
    domain: str
    problem: str
    options: tuple[str, ...] = ()


_SHIPPED = (
    ("three-cells", "problem.pddl"),
    ("t-map", "problem.pddl"),
    ("corridor", "problem.pddl"),
    ("grid", "gw1-2x2.pddl"),
    ("grid", "three-robots-3x3.pddl"),
    ("grid-joint", "three-cells.pddl"),
)
_FOREIGN: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("blocks-arms", "original_domain.pddl", "original_problem_3.pddl", ()),
    ("boxpushing", "domain.pddl", "p2_3_2_1_1_0.pddl", ()),
    ("depot", "domain.pddl", "pfile1.pddl", ()),
    ("driverlog", "domain.pddl", "pfile1.pddl", ()),
    (
        "gripper",
        "domain.pddl",
        "prob01.pddl",
        ("--robot-type", "gripper", "--unowned", "environment"),
    ),
    ("mapf", "mapf-domain.pddl", "mapf-problem2.pddl", ()),
    ("storage", "domain.pddl", "p05.pddl", ("--robot-type", "hoist")),
    ("taxi", "domain.pddl", "p01.pddl", ()),
    (
        "transport",
        "p11.DOMAIN.pddl",
        "p11.pddl",
        ("--robot-type", "vehicle", "--cost", "makespan+cost"),
    ),
    ("workshop", "workshop_dom_cal.pddl", "workshop2_1_2_2_2.pddl", ()),
    ("workshop", "workshop_dom_cn.pddl", "workshop2_1_2_2_2.pddl", ()),
)


def pairs(*, foreign: bool = True) -> list[Pair]:
    """The files to break; without ``foreign`` only those that come with the project."""
    found = [
        Pair(
            folder,
            _read(DOMAINS / folder / "domain.pddl"),
            _read(DOMAINS / folder / problem),
        )
        for folder, problem in _SHIPPED
    ]
    if foreign and FOREIGN.is_dir():
        found += [
            Pair(
                folder, _read(FOREIGN / folder / domain), _read(FOREIGN / folder / problem), options
            )
            for folder, domain, problem, options in _FOREIGN
        ]
    return found


def _read(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "surrogateescape")


def as_bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogateescape")
