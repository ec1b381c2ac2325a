# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to break names: odd ones, equal ones, other case, variables that hide each other."""

from __future__ import annotations

from random import Random

from tests.fuzz.pieces import ODD, names_of, renamed, tokens_of
from tests.fuzz.structure import wrap_group


def odd_name(text: str, random: Random) -> str:
    """One name becomes odd wherever it occurs."""
    names = names_of(text)
    return renamed(text, {random.choice(names): random.choice(ODD)}) if names else text


def one_name(text: str, random: Random) -> str:
    """Several names become one: predicate, type, object and action alike."""
    plain = [name for name in names_of(text) if name[0] not in ":?"]
    if len(plain) < 2:
        return text
    target = random.choice(plain)
    return renamed(
        text, dict.fromkeys(random.sample(plain, min(len(plain), random.choice((1, 2, 4)))), target)
    )


def upper_case(text: str, random: Random) -> str:
    share = random.choice((0.1, 0.5, 1.0))
    return "".join(
        t.upper() if t[0] != ";" and random.random() < share else t for t in tokens_of(text)
    )


def shadow(text: str, random: Random) -> str:
    """Variables take the names of other variables."""
    names = [name for name in names_of(text) if name[0] == "?"]
    if len(names) < 2:
        return wrap_group(text, random)
    a, b = random.sample(names, 2)
    tokens = tokens_of(text)
    share = random.choice((0.2, 0.5, 1.0))
    return "".join(b if t == a and random.random() < share else t for t in tokens)
