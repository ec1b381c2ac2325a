# SPDX-License-Identifier: GPL-3.0-or-later
"""PDDL text -> lifted domain and problem, with positions in every error message.

The readers are imported when they are first used: a command's help needs the options of a model,
and no parser.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planners.pddl.domain import parse_domain, read_domain
    from planners.pddl.problem import parse_problem, read_problem

__all__ = ["parse_domain", "parse_problem", "read_domain", "read_problem"]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{name.split('_')[1]}"), name)
