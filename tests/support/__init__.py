# SPDX-License-Identifier: GPL-3.0-or-later
"""What several tests need: shipped worlds, random models, naive twins, commands, pages."""

from functools import partial
from typing import Any

import pytest


def marked(mark: Any, *cases: Any) -> list[Any]:
    """Cases of a table with a mark: each a value, or a tuple of all arguments of a test."""
    each = (case if isinstance(case, tuple) else (case,) for case in cases)
    return [pytest.param(*case, marks=mark) for case in each]


#: Cases that only the thorough, or the slow, tests have.
thorough, slow = (partial(marked, mark) for mark in (pytest.mark.thorough, pytest.mark.slow))
