# SPDX-License-Identifier: GPL-3.0-or-later
"""The pieces of a PDDL text, however broken: tokens, groups, literals, sections, names."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from random import Random

Mutation = Callable[[str, Random], str]
_TOKEN = re.compile(r";[^\n\r]*|[()]|[^\s();]+|\s+")
#: Words that a reader may stumble over.
ODD = (
    *("9", "9x", "-", "--", "-1", "1.5", "=", "?", "?x", "??", ":x", "nan", "inf", "1e999"),
    *("object", "either", "and", "not", "when", "forall", "total-cost", "define"),
    *("idle", "none", "last", "environment", "robot", "agent", "o0", "p0", "v0"),
    *("x@y", "x.y_z+1", "a,b", "a'b", '"', "\\", "%s", "{0}", "None", "../../x", "$HOME", "`id`"),
    *("#", "_", "@", "é", "\u0130", "\u00b2", "\u0663", "\u200b", "\x00", "\x1b[31m"),
    *("x" * 5_000, "9" * 5_000),
)


def tokens_of(text: str) -> list[str]:
    return _TOKEN.findall(text)


def visible(tokens: Sequence[str]) -> list[int]:
    return [n for n, token in enumerate(tokens) if not token.isspace() and token[0] != ";"]


def edit_tokens(text: str, random: Random, edit: Callable[[list[str], list[int]], None]) -> str:
    """Apply an edit of the token list (and numbers of its visible tokens) one to three times."""
    tokens = tokens_of(text)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        numbers = visible(tokens)
        if numbers:
            edit(tokens, numbers)
    return "".join(tokens)


def groups_of(text: str) -> list[tuple[int, int]]:
    """The spans of all parenthesised groups."""
    spans, opened, at = [], [], 0
    for token in tokens_of(text):
        if token == "(":
            opened.append(at)
        elif token == ")" and opened:
            spans.append((opened.pop(), at + 1))
        at += len(token)
    return spans


def literals_of(text: str) -> list[tuple[int, int]]:
    """The spans of groups without groups inside that stand in another one: atoms, mostly."""
    groups = groups_of(text)
    return [(a, b) for a, b in groups if "(" not in text[a + 1 : b] and (a, b) != groups[-1]]


def sections_of(text: str) -> list[tuple[int, int]]:
    return [(a, b) for a, b in groups_of(text) if text[a + 1 : a + 2] == ":"]


def insert_section(text: str, section: str, random: Random) -> str:
    sections = sections_of(text)
    at = random.choice(sections)[0] if sections else len(text)
    return text[:at] + section + " " + text[at:]


def names_of(text: str) -> list[str]:
    found = {t for t in tokens_of(text) if not t.isspace() and t[0] not in "();" and t != "-"}
    return sorted(found)


def renamed(text: str, names: dict[str, str]) -> str:
    return "".join(names.get(t, t) for t in tokens_of(text))
