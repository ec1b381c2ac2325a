# SPDX-License-Identifier: GPL-3.0-or-later
"""Hashes of what a result depends on: code, input files, parameters, versions."""

from __future__ import annotations

import json
import platform
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from coordlang.evaluation.lab.recipe import Settings, Unit

#: Packages whose versions are recorded with each result.
_PACKAGES = ("coordlang", "numpy", "python-sat", "tarski")
#: Below `coordlang`: what only renders results.
_RENDERING = (
    "cli",
    "report",
    "explanation",
    "certificate",
    "evaluation/lab/figure_style.py",
    "evaluation/lab/plots.py",
    "evaluation/lab/page.py",
)


@cache
def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return sha256(path.read_bytes()).hexdigest()


@cache
def code_hash() -> str:
    """Return the SHA-256 of all source files of both packages that results can depend on."""
    root = Path(__file__).resolve().parents[3]
    digest = sha256()
    for package in ("planners", "coordlang"):
        for path in sorted((root / package).rglob("*.py")):
            name = path.relative_to(root).as_posix()
            if not any(name.startswith(f"coordlang/{part}") for part in _RENDERING):
                digest.update(f"{name} {file_hash(path)}\n".encode())
    return digest.hexdigest()


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:  # run from a checkout that is not installed
            found[package] = "unknown"
    return found


def inputs(unit: Unit, settings: Settings) -> dict[str, str]:
    """Return the SHA-256 of each of the files that a unit reads."""
    return {name: file_hash(settings.domains / name) for name in unit.files}


def identity(unit: Unit, settings: Settings) -> str:
    """Return the hash of everything that a unit's result depends on."""
    parts = {
        "experiment": unit.experiment,
        "key": unit.key,
        "parameters": dict(unit.parameters),
        "seed": settings.seed,
        "inputs": inputs(unit, settings),
        "versions": versions(),
        "code": code_hash(),
    }
    return sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
