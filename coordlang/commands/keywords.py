# SPDX-License-Identifier: GPL-3.0-or-later
"""Python functions whose keyword arguments are the options of a record."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from planners.system.options import options_of, record_from

Result = TypeVar("Result")


def with_options(
    record: type[object],
) -> Callable[[Callable[..., Result]], Callable[..., Result]]:
    """Let a function with a parameter ``options``, a record, be called with keywords in its place.

    ``with_record`` of the result is the function itself, and ``record`` the record.  The keywords
    are in its signature.
    """

    def decorate(function: Callable[..., Result]) -> Callable[..., Result]:
        own = inspect.signature(function).parameters

        @functools.wraps(function)
        def called(*arguments: object, **keywords: Any) -> Result:
            named = {name: keywords.pop(name) for name in [*keywords] if name in own}
            options = record_from(record, keywords, function.__name__)
            return function(*arguments, options=options, **named)

        parameters = [each for each in own.values() if each.name != "options"]
        parameters += [
            inspect.Parameter(each.name, inspect.Parameter.KEYWORD_ONLY, default=each.default)
            for each in options_of(record)
            if each.option.only != "cli"
        ]
        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.with_record = function  # type: ignore[attr-defined]
        called.record = record  # type: ignore[attr-defined]
        return called

    return decorate
