# SPDX-License-Identifier: GPL-3.0-or-later
"""What results depend on besides their input: the code, and what it runs on."""

from __future__ import annotations

import platform
import sys
from functools import cache
from hashlib import sha256
from pathlib import Path

#: Packages whose versions must be equal where jobs of one batch are done.
_PACKAGES = ("numpy", "scipy", "distributed")


@cache
def code_hash(package: str) -> str:
    """The SHA-256 of all source files of a package, by its name; empty if there is none."""
    found = sha256()
    loaded = sys.modules.get(package)
    for folder in sorted(getattr(loaded, "__path__", ())):
        for path in sorted(Path(folder).rglob("*.py")):
            name = path.relative_to(folder).as_posix()
            found.update(f"{name} {sha256(path.read_bytes()).hexdigest()}\n".encode())
    return found.hexdigest() if loaded is not None else ""


def versions_here(packages: tuple[str, ...]) -> dict[str, str]:
    """What must be equal in all processes that do jobs of one batch.

    Parameters
    ----------
    packages
        The packages whose own code does the work; they are imported.
    """
    from importlib.metadata import PackageNotFoundError, version  # takes long to load

    found = {"Python": ".".join(platform.python_version_tuple()[:2])}
    for package in packages:
        __import__(package)
        found[f"the code of {package}"] = code_hash(package)[:12]
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "none"
    return found


def differing(expected: dict[str, str], packages: tuple[str, ...]) -> str | None:
    """The first version here that is not the expected one, in words; None if all are equal."""
    here = versions_here(packages)
    for name, wanted in expected.items():
        if here.get(name) != wanted:
            return f"{name} is {here.get(name)} there and {wanted} here"
    return None
