# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to break the file itself: cut off, damaged, in another encoding, without anything."""

from __future__ import annotations

from random import Random

from tests.fuzz.pieces import tokens_of
from tests.fuzz.sources import as_bytes


def truncate(text: str, random: Random) -> str:
    return text[: random.randrange(len(text) + 1)]


def random_bytes(text: str, random: Random) -> str:
    data = bytearray(as_bytes(text))
    for _ in range(random.choice((1, 2, 10, 200))):
        if data:
            data[random.randrange(len(data))] = random.randrange(256)
    return data.decode("utf-8", "surrogateescape")


def long_line(text: str, random: Random) -> str:
    joined = " ".join(t for t in tokens_of(text) if not t.isspace() and t[0] != ";")
    at = random.randrange(len(joined) + 1)
    return joined[:at] + " " * random.choice((0, 1_000_000)) + joined[at:]


def line_ends(text: str, random: Random) -> str:
    return text.replace("\n", random.choice(("\r\n", "\r", "\r\r\n", "\v", "\f", "\u2028", "\x85")))


def marked(text: str, random: Random) -> str:
    """A byte order mark at the start or elsewhere, or another encoding."""
    kind = random.randrange(4)
    if kind == 0:
        return "\ufeff" + text
    if kind == 1:
        at = random.randrange(len(text) + 1)
        return text[:at] + "\ufeff" + text[at:]
    encoded = text.encode("utf-16" if kind == 2 else "utf-16-be", "surrogatepass")
    return encoded.decode("utf-8", "surrogateescape")


def nothing(text: str, random: Random) -> str:
    rests = ("", " \n", "; nothing\n", "()", "(define)", "(define (domain x))", "(define ())")
    return random.choice((*rests, "\x00", "x", ")"))
