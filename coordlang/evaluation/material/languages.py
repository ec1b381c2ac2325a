# SPDX-License-Identifier: GPL-3.0-or-later
"""The languages that experiments use, built once and stored."""

from __future__ import annotations

import fcntl
import json
from hashlib import sha256
from pathlib import Path
from typing import TextIO

from coordlang.building import Built, build_language
from coordlang.evaluation.lab.identity import code_hash, file_hash
from coordlang.evaluation.lab.recipe import Settings
from coordlang.evaluation.material.suite import World
from coordlang.language.file import read_language, write_language
from coordlang.language.words import Language
from coordlang.tasks.candidates import Candidates
from coordlang.tasks.listed import ListedTask
from coordlang.tolerating import WordLimit, build_few_words
from planners.errors import UsageError
from planners.loading import ModelOptions

#: The methods that experiments compare, in the order of tables.
COMPARED = ("greedy", "separating", "minimal", "flexible")
#: What the methods are called in texts.
TITLES = {
    "plan": "plan",
    "greedy": "greedy",
    "separating": "separating",
    "minimal": "minimal",
    "flexible": "minimal, most flexible",
    "slack": "greedy, slack 1",
    "few": "the best two words",
    "silence": "one word",
}
#: Plans within slack 1, under words that see what is left of it.
_SLACK = ModelOptions(slack=1, sees_slack=True)
#: Words, at most, of what is no coordination language.
_FEW = {"few": 2, "silence": 1}


def language_for(
    world: World, method: str, settings: Settings, listed: tuple[ListedTask, ...] = ()
) -> tuple[Candidates, Language]:
    """Return the candidate tasks of a world and a language for them, built once and stored.

    The method "flexible" is ``--method minimal --prefer flexible``, "slack" is ``--slack 1
    --words-see-slack``, and "few" and "silence" are ``--words 2`` and ``1``.

    Raises
    ------
    OutOfTime, OutOfMemory
        If a limit ended the method early: what it then has depends on the machine.
    UsageError
        If the language cannot be stored.
    """
    options = _SLACK if method == "slack" else None
    candidates = world.candidates(settings.domains, listed, options)
    path = settings.cache / f"{_key(world, method, settings, listed)}.json.gz"
    with _opened_lock(settings.cache, path) as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # waits for a process that builds it
        if path.exists():
            return candidates, read_language(path)
        built = _built(candidates, method, settings.seed)
        if built.stopped is not None:
            raise built.stopped
        write_language(built.language, path)
        return candidates, built.language


def _built(candidates: Candidates, method: str, seed: int) -> Built:
    if method == "flexible":
        return build_language(candidates, "minimal", seed=seed, prefer="flexible")
    if method in _FEW:
        return build_few_words(candidates, WordLimit(_FEW[method]), seed=seed)[0]
    return build_language(candidates, "greedy" if method == "slack" else method, seed=seed)


def _opened_lock(cache: Path, path: Path) -> TextIO:
    """The file by which processes wait for each other, in a folder that is made."""
    try:
        cache.mkdir(parents=True, exist_ok=True)
        return open(f"{path}.lock", "w")
    except OSError as error:
        raise UsageError(
            f"{cache} cannot be written: {error.strerror}",
            remedy="Say --results DIR, with a folder that you may write to.",
        ) from None


def _key(world: World, method: str, settings: Settings, listed: tuple[ListedTask, ...]) -> str:
    parts = {
        "files": [file_hash(settings.domains / name) for name in world.files],
        "tasks": [[task.init, task.goal] for task in listed],
        "kind": world.tasks,
        "method": method,
        "seed": settings.seed,
        "code": code_hash(),
    }
    return sha256(json.dumps(parts).encode()).hexdigest()[:24]
