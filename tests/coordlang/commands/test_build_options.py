# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that contradict each other are refused where they are put together, for whoever calls."""

from __future__ import annotations

from typing import Any

import pytest

from coordlang.commands.building import build_language
from coordlang.commands.options import MethodOptions
from planners.pddl.model_options import ModelOptions
from planners.system.errors import UsageError
from tests.support.domains import all_tasks


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"method": "bogus"}, "bogus.*best, greedy, separating, minimal or exhaustive"),
        ({"method": "minimal", "alpha_only": True}, "--alpha-only belongs to --method separating"),
        ({"method": "minimal", "effort": 2}, "--effort belongs to --method best"),
        ({"method": "greedy", "prefer": "flexible"}, "--prefer flexible belongs to --method"),
        ({"method": "separating", "prefer": "flexible"}, "--prefer flexible belongs to --method"),
        ({"method": "minimal", "prefer": "short"}, "short.*flexible or simple"),
    ],
)
def test_bad_build_options(options: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError) as raised:
        build_language(all_tasks("three-cells"), **options)
    assert raised.match(f"(?s){said}")


def test_good_build_options() -> None:
    MethodOptions("separating", alpha_only=True)
    MethodOptions("minimal", prefer="simple")
    MethodOptions("exhaustive", prefer="flexible")


def test_bad_model_options() -> None:
    bogus: Any = "bogus"
    with pytest.raises(UsageError, match=r"(?s)'bogus'.*makespan\+actions"):
        ModelOptions(cost=bogus)
    with pytest.raises(UsageError, match=r"(?s)'bogus'.*environment"):
        ModelOptions(unowned=bogus)
