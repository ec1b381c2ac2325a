# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to break a PDDL text: its tokens, groups, literals, names, bytes; places in JSON data."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

Mutation = Callable[[str, Random], str]
_TOKEN = re.compile(r";[^\n\r]*|[()]|[^\s();]+|\s+")
#: Words that a reader may stumble over.
ODD = (
    *("9", "9x", "-", "--", "-1", "1.5", "007", "+3", ".5", "5.", "=", "?", "?x", "??", ":x"),
    *("nan", "inf", "1e999"),
    *("object", "either", "and", "not", "when", "forall", "total-cost", "define"),
    *("idle", "none", "last", "environment", "robot", "agent", "o0", "p0", "v0"),
    *("x@y", "x.y_z+1", "a,b", "a'b", '"', "\\", "%s", "{0}", "None", "../../x", "$HOME", "`id`"),
    *("#", "_", "@", "é", "\u0130", "\u00b2", "\u0663", "\u200b", "\x00", "\x1b[31m"),
    *("x" * 5_000, "9" * 5_000),
)


def places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) inside of JSON data."""
    if isinstance(data, dict | list):
        for key in [*data] if isinstance(data, dict) else range(len(data)):
            yield data, key
            yield from places(data[key])


def tokens_of(text: str) -> list[str]:
    return _TOKEN.findall(text)


def names_of(text: str) -> list[str]:
    found = {t for t in tokens_of(text) if not t.isspace() and t[0] not in "();" and t != "-"}
    return sorted(found)


def renamed(text: str, names: dict[str, str]) -> str:
    return "".join(names.get(t, t) for t in tokens_of(text))


def edit_tokens(text: str, random: Random) -> str:
    """Leave out, double or replace (words) up to three tokens; mostly parentheses stay balanced."""
    tokens = tokens_of(text)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        seen = [n for n, t in enumerate(tokens) if t.strip() and t[0] != ";"]
        words = [n for n in seen if tokens[n] not in "()"]
        if not words:
            break
        at = random.choice(seen if random.random() < 0.1 else words)
        others = [tokens[n] for n in words]
        alike = [word for word in others if word[0] == tokens[at][0]]  # as variables are
        forms = (["", f"{tokens[at]} {tokens[at]}"], others, alike, alike, ODD)
        tokens[at] = random.choice(random.choice(forms if at in words else forms[:1]))
    return "".join(tokens)


#: What takes the place of a group {0}: also another group {1}, and its words in another order {2}.
_FORMS = (
    *("", "()", "{1}", "{1}", "{2}", "{0} {0}", "{0} {1}", "({0})", "(not {0})", "(not {0})"),
    *("(and {0})", "(or {0})", "(or {0} {1})", "(imply (and) {0})", "(imply {0} {1})", "(= {0} 1)"),
    *("(when (and) {0})", "(when {0} {1})", "(when {0} (and))", "(forall () {0})", "(at 5 {0})"),
    *("(forall (?r ?o ?x) {0})", "(exists (?from ?a) {0})", "(increase {0} 1)", "(oneof {0})"),
    *("(preference p {0})", "(:private {0})", "(either {0})"),
)
#: What is around a group 10,000 times, or just below the reader's limit.
_HEADS = ("(not ", "(and ", "(or ", "(forall (?r) ", "(when (and) ", "(imply (and) ", "(")


def edit_groups(text: str, random: Random) -> str:
    """One to three groups, most of them atoms, become one of `_FORMS`, or lie very deep."""
    for _ in range(random.choice((1, 1, 2, 3))):
        opened, spans, at = [], [], 0
        for token in tokens_of(text):
            if token == "(":
                opened.append(at)
            elif token == ")" and opened:
                spans.append((opened.pop(), at + 1))
            at += len(token)
        atoms = [(a, b) for a, b in spans if "(" not in text[a + 1 : b]]
        if not atoms:
            return text
        start, end = random.choice(random.choice((spans, atoms, atoms)))
        group = moved = text[start:end]
        if (start, end) in atoms:
            first, *rest = group[1:-1].split() or [""]
            moved = f"({' '.join((first, *random.sample(rest, len(rest))))})"
        form = random.choice(_FORMS)
        if random.random() < 0.03:
            depth = random.choice((10_000, 180, 30))
            form = random.choice(_HEADS) * depth + "{0}" + ")" * depth
        other = text[slice(*random.choice(random.choice((spans, atoms))))]
        text = text[:start] + form.format(group, other, moved) + text[end:]
    return text


def odd_name(text: str, random: Random) -> str:
    """One name becomes odd, or several become one, wherever they occur."""
    names, odd = names_of(text), random.choice((True, False))
    plain = names if odd else [name for name in names if name[0] not in ":?"]
    chosen = random.sample(plain, min(len(plain), 1 if odd else random.choice((1, 2, 4))))
    return renamed(text, dict.fromkeys(chosen, random.choice(ODD if odd else plain or ["x"])))


def random_bytes(text: str, random: Random) -> str:
    data = bytearray(text.encode("utf-8", "surrogateescape"))
    for _ in range(random.choice((1, 2, 10, 200)) if data else 0):
        data[random.randrange(len(data))] = random.randrange(256)
    return data.decode("utf-8", "surrogateescape")


#: All of them, and how often each is used: those that get past the reader are worth more.  What
#: `test_odd_pddl` and `test_bad_input` do by hand (line ends, letters, comments) is not among them.
MUTATIONS: dict[Mutation, float] = {edit_tokens: 20, edit_groups: 30, odd_name: 10, random_bytes: 2}
