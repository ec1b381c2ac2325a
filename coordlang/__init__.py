# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordination languages.

The fewest words that let robots plan on their own and still act together.

The commands of the command line are functions here, with the options as keywords::

    import coordlang

    built = coordlang.build("domain.pddl", "problem.pddl", tasks="all", method="minimal")
    built.language.save("language.json")
    print(coordlang.verify("language.json", "domain.pddl", "problem.pddl").holds)

A domain, problem, language, plan or task list is a path or a parsed object.  Names are imported
when they are first used: ``import coordlang`` itself loads the standard library only.  See
docs/library.md.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from coordlang.commands.build import build as build
    from coordlang.commands.check import check as check
    from coordlang.commands.choices import choices as choices
    from coordlang.commands.coordination import coordination as coordination
    from coordlang.commands.domains import import_site as import_site
    from coordlang.commands.explain import explain as explain
    from coordlang.commands.export import export as export
    from coordlang.commands.inputs import load as load
    from coordlang.commands.inputs import load_language as load_language
    from coordlang.commands.inspect import inspect as inspect
    from coordlang.commands.lift import ground as ground
    from coordlang.commands.lift import lift as lift
    from coordlang.commands.plans import plans as plans
    from coordlang.commands.sentences import plan as plan
    from coordlang.commands.sentences import say as say
    from coordlang.commands.sentences import understand as understand
    from coordlang.commands.simulate import simulate as simulate
    from coordlang.commands.verify import verify as verify
    from coordlang.execution.monitor import EventMonitor as EventMonitor
    from coordlang.execution.monitor import Monitor as Monitor
    from coordlang.execution.monitor import MonitorError as MonitorError
    from coordlang.execution.monitor import NotAllowed as NotAllowed
    from coordlang.execution.monitor import NotPossible as NotPossible
    from coordlang.execution.plan_sentence import NotOptimal as NotOptimal
    from coordlang.execution.task_language import NoPlanFits as NoPlanFits
    from coordlang.language.words import Language as Language
    from coordlang.required.miscoordination import Inseparable as Inseparable
    from planners.search.plan_file import NotAPlan as NotAPlan
    from planners.system.errors import BadInput as BadInput
    from planners.system.errors import CoordlangError as CoordlangError
    from planners.system.errors import OutOfMemory as OutOfMemory
    from planners.system.errors import OutOfTime as OutOfTime
    from planners.system.errors import ProvedImpossible as ProvedImpossible
    from planners.system.errors import Refuted as Refuted
    from planners.system.errors import Unsupported as Unsupported
    from planners.system.errors import UsageError as UsageError
    from planners.system.limits import time_limit as time_limit

__version__ = "1.0.0"

#: Modules of `coordlang.commands` with one function each, of the same name.
_COMMANDS = "inspect check coordination build verify choices simulate explain plans export"
#: Module -> the public names that it defines.
_DEFINED_IN = {
    **{f"coordlang.commands.{name}": name for name in _COMMANDS.split()},
    "coordlang.commands.lift": "lift ground",
    "coordlang.commands.sentences": "say understand plan",
    "coordlang.commands.inputs": "load load_language",
    "coordlang.commands.domains": "import_site",
    "coordlang.language.words": "Language",
    "coordlang.execution.monitor": "EventMonitor Monitor MonitorError NotAllowed NotPossible",
    "coordlang.execution.task_language": "NoPlanFits",
    "coordlang.execution.plan_sentence": "NotOptimal",
    "coordlang.required.miscoordination": "Inseparable",
    "planners.search.plan_file": "NotAPlan",
    "planners.system.errors": "CoordlangError Refuted UsageError ProvedImpossible OutOfMemory "
    "OutOfTime BadInput Unsupported",
    "planners.system.limits": "time_limit",
}
_MODULE_OF = {name: module for module, names in _DEFINED_IN.items() for name in names.split()}

__all__ = [*_MODULE_OF, "__version__"]


def why_not_here() -> str | None:
    """Return why coordlang does not run on this system, or None where it does."""
    if sys.platform == "win32" or importlib.util.find_spec("resource") is None:
        return (
            f"coordlang runs on Linux, not on this system ({sys.platform}): its limits "
            "of time and memory need POSIX signals\n"
            "  On Windows use WSL (https://learn.microsoft.com/windows/wsl/install): "
            "`wsl --install`, then `pip install coordlang` in it."
        )
    return None


def __getattr__(name: str) -> object:
    module = _MODULE_OF.get(name)
    if module is None:
        raise AttributeError(f"module 'coordlang' has no attribute {name!r}")
    if why_not := why_not_here():
        raise OSError(why_not)
    value: object = getattr(importlib.import_module(module), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _refuse_foreign_planners() -> None:
    """Raise `ImportError` where another package named ``planners`` hides the one of coordlang."""
    ours = os.path.join(os.path.dirname(os.path.dirname(os.path.realpath(__file__))), "planners")
    found = importlib.util.find_spec("planners")
    if found is None:
        raise ImportError(
            f"coordlang needs its package 'planners', and there is none at {ours}: "
            "install coordlang again",
            name="planners",
        )
    folders = found.submodule_search_locations
    places = list(folders) if folders else [found.origin or "a module without a file"]
    if os.path.realpath(places[0]) != ours:
        raise ImportError(
            f"coordlang needs its own package 'planners' ({ours}), but Python finds another one "
            f"first: {os.path.abspath(places[0])}\n"
            "  Rename that file or folder, or start Python from another directory.",
            name="planners",
            path=places[0],
        )


_refuse_foreign_planners()
