# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to break the structure: tokens, groups and literals that are missing, doubled or moved."""

from __future__ import annotations

from random import Random

from tests.fuzz.pieces import ODD, edit_tokens, groups_of, literals_of


def drop(text: str, random: Random) -> str:
    def edit(tokens: list[str], numbers: list[int]) -> None:
        del tokens[random.choice(numbers)]

    return edit_tokens(text, random, edit)


def double(text: str, random: Random) -> str:
    def edit(tokens: list[str], numbers: list[int]) -> None:
        n = random.choice(numbers)
        tokens.insert(n, tokens[n] + " ")

    return edit_tokens(text, random, edit)


def swap(text: str, random: Random) -> str:
    def edit(tokens: list[str], numbers: list[int]) -> None:
        a, b = random.choice(numbers), random.choice(numbers)
        tokens[a], tokens[b] = tokens[b], tokens[a]

    return edit_tokens(text, random, edit)


def replace_token(text: str, random: Random) -> str:
    """A word takes the place of another: wrong kinds, but mostly balanced parentheses."""

    def edit(tokens: list[str], numbers: list[int]) -> None:
        words = [n for n in numbers if tokens[n] not in "()"]
        if words:
            tokens[random.choice(words)] = random.choice(
                (*(tokens[n] for n in words), *ODD, "and", "not", "forall")
            )

    return edit_tokens(text, random, edit)


def drop_group(text: str, random: Random) -> str:
    spans = groups_of(text)[:-1]
    if not spans:
        return text
    start, end = random.choice(spans)
    return text[:start] + random.choice(("", "()")) + text[end:]


def swap_groups(text: str, random: Random) -> str:
    spans = groups_of(text)[:-1]
    if len(spans) < 2:
        return text
    (a, b), (c, d) = sorted(random.sample(spans, 2))
    if d <= b:  # one inside the other: the inner one takes the place of the outer one
        return text[:a] + text[c:d] + text[b:]
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


#: What comes before and after a group.
_AROUND = (
    *(("(not ", ")"), ("(and ", ")"), ("(or ", ")"), ("(imply (and) ", ")"), ("(when (and) ", ")")),
    *(("(", ")"), ("(forall (?r ?o ?x) ", ")"), ("(exists (?from ?a) ", ")"), ("(forall () ", ")")),
    *(("(increase ", " 1)"), ("(when ", " (and))"), ("(preference p ", ")"), ("(at 5 ", ")")),
    *(("(= ", " 1)"), ("(:private ", ")"), ("(either ", ")"), ("(oneof ", ")")),
)


def wrap_group(text: str, random: Random) -> str:
    """A group becomes part of another connective or quantifier."""
    spans = groups_of(text)
    if not spans:
        return text
    start, end = random.choice(spans)
    before, after = random.choice(_AROUND)
    return text[:start] + before + text[start:end] + after + text[end:]


def edit_literal(text: str, random: Random) -> str:
    """One to three atoms are left out, negated, said twice, or get their words in another order."""
    for _ in range(random.choice((1, 1, 2, 3))):
        spans = literals_of(text)
        if not spans:
            return text
        start, end = random.choice(spans)
        atom = text[start:end]
        words = atom[1:-1].split()
        if len(words) > 2:
            first, *rest = words
            random.shuffle(rest)
            words = [first, *rest]
        other = text[slice(*random.choice(spans))]
        new = random.choice(
            (
                "",
                f"(not {atom})",
                f"{atom} {atom}",
                f"({' '.join(words)})",
                other,
                f"{atom} {other}",
                f"(or {atom} {other})",
                f"(imply {atom} {other})",
                f"(when {atom} {other})",
            )
        )
        text = text[:start] + new + text[end:]
    return text


def other_variable(text: str, random: Random) -> str:
    """A variable gives its place to another one, once or twice."""

    def edit(tokens: list[str], numbers: list[int]) -> None:
        found = [n for n in numbers if tokens[n][0] == "?"]
        if found:
            tokens[random.choice(found)] = tokens[random.choice(found)]

    return edit_tokens(text, random, edit)


def unbalance(text: str, random: Random) -> str:
    at = random.randrange(len(text) + 1)
    return text[:at] + random.choice("()") * random.choice((1, 1, 2, 500)) + text[at:]


def nest(text: str, random: Random) -> str:
    """10,000 levels (or just below the reader's limit) around a group."""
    depth = random.choice((10_000, 180, 30))
    spans = groups_of(text)
    if not spans:
        return text
    start, end = random.choice(spans)
    head = random.choice(
        ("(not ", "(and ", "(or ", "(forall (?r) ", "(when (and) ", "(imply (and) ", "(")
    )
    return text[:start] + head * depth + text[start:end] + ")" * depth + text[end:]
