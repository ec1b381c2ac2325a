# SPDX-License-Identifier: GPL-3.0-or-later
"""Features as formulas, what their values mean, and in English."""

from __future__ import annotations

import pytest

from coordlang.lifted.features import UNDEFINED
from coordlang.lifted.notation import condition, english, feature_of, formula
from planners.system.errors import Position

#: Definition, formula, a value, what it means, in English.
WORDED = [
    (
        "(mod (column (at r1)) 3)",
        "column(at(r1)) mod 3",
        1,
        "column(at(r1)) mod 3 = 1",
        "the column of the object in (at r1 ..), modulo 3",
    ),
    (
        "(min (count holds _ box) 2)",
        "min(#holds(_, box), 2)",
        2,
        "#holds(_, box) >= 2",
        "the number of true atoms (holds .. box), where 2 stands for 2 or more",
    ),
    (
        "(sign (- (size (and room (not clean))) (size (some (inverse at) (one r1)))))",
        "sign(|(room and not clean)| - |some at^-1.{r1}|)",
        -1,
        "|(room and not clean)| < |some at^-1.{r1}|",
        "which is larger, the number of objects that are (room and not clean) or the number of "
        "objects that are inversely at-related to something r1",
    ),
    (
        "(same (at r1) (inverse holds r2))",
        "[at(r1) = holds^-1(r2)]",
        0,
        "at(r1) != holds^-1(r2)",
        "whether the object in (at r1 ..) is the object in (holds .. r2)",
    ),
    (
        "(min (gap door (one hall) (some (closure door) all)) 1)",
        "min(door-distance({hall}, some door+.all), 1)",
        0,
        "door-distance({hall}, some door+.all) = 0",
        "the fewest links of door between an object that is hall and one that is door-related in "
        "one or more steps to something any, where 1 stands for 1 or more",
    ),
    (
        "(mod (position next (on r1)) 2)",
        "next-position(on(r1)) mod 2",
        UNDEFINED,
        "next-position(on(r1)) mod 2 undefined",
        "the position along next of the object in (on r1 ..), modulo 2",
    ),
    (
        "(min (degree door (at r1)) 1)",
        "min(door-degree(at(r1)), 1)",
        1,
        "door-degree(at(r1)) >= 1",
        "the number of objects that door links with the object in (at r1 ..), where 1 stands for "
        "1 or more",
    ),
    (
        "(mod (distance door (at r1) (at r2)) 2)",
        "door-distance(at(r1), at(r2)) mod 2",
        0,
        "door-distance(at(r1), at(r2)) mod 2 = 0",
        "the links of door between the object in (at r1 ..) and the object in (at r2 ..), modulo 2",
    ),
]


@pytest.mark.parametrize(("text", "as_formula", "value", "meaning", "said"), WORDED)
def test_worded(text: str, as_formula: str, value: int, meaning: str, said: str) -> None:
    feature = feature_of(text, Position("test"))
    assert formula(feature) == as_formula
    assert condition(feature, value) == meaning
    assert english(feature) == said
