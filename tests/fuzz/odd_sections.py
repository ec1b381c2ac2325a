# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to break sections: too many, empty, twice, of another language; numbers and comments."""

from __future__ import annotations

import re
from random import Random

from tests.fuzz.pieces import insert_section, sections_of, tokens_of


def many_objects(text: str, random: Random) -> str:
    number = random.choice((300, 20_000, 1_000_000))
    kind = random.choice(("", "", " - robot", " - cell", " - object", " - agent"))
    names = " ".join(f"zz{n}" for n in range(number)) + kind
    if re.search(r"\(:objects", text, re.IGNORECASE):
        return re.sub(r"\(:objects", f"(:objects {names} ", text, count=1, flags=re.IGNORECASE)
    return insert_section(text, f"(:constants {names})", random)


def many_sections(text: str, random: Random) -> str:
    number = random.choice((50, 2_000))
    section = random.choice(
        (
            "(:action a{n} :parameters (?r - robot))",
            "(:action a{n} :parameters () :effect (p{n}))",
            "(:predicates (p{n}) (q{n} ?x))",
            "(:types t{n} - t{m})",
            "(:constants c{n})",
            "(:init)",
            "(:requirements :r{n})",
        )
    )
    return insert_section(
        text, " ".join(section.format(n=n, m=n + 1) for n in range(number)), random
    )


def empty_section(text: str, random: Random) -> str:
    sections = sections_of(text)
    if not sections:
        return text
    start, end = random.choice(sections)
    head = tokens_of(text[start + 1 : end])[0]
    return text[:start] + f"({head})" + text[end:]


def double_section(text: str, random: Random) -> str:
    sections = sections_of(text)
    if not sections:
        return text
    start, end = random.choice(sections)
    return text[:end] + text[start:end] * random.choice((1, 1, 30)) + text[end:]


#: Sections that are odd, empty or of another language.
_FOREIGN = (
    *("(:durative-action x)", "(:derived (p ?x) (q ?x))", "(:constraints (and))", "(:init)", "()"),
    *("(:functions (f) - number)", "(:metric minimize (total-time))", "(:objects a b)", "x", "(x)"),
    *("(:goal (and))", "(:types a - b b - a)", "(:types object)", "(:functions)", "(:constants)"),
    *("(:types a - (either b c) object)", "(:predicates (= ?a ?b))", "(:predicates ())"),
    *("(:predicates p)", "(:action)", "(:action x)", "(:action x y)", "(:action x :parameters)"),
    *("(:action (x))", "(:action x :agent)", "(:action x :agent ?a :parameters (?x))"),
    *("(:functions (total-cost))", "(:constants a - )", "(:constants - a)", "(:domain)"),
    *("(:domain x y)", "(:length)", "(:private)", "; subaction\n", "(:concurrency-constraint v)"),
    "(:action x ; subaction r1 (x)\n)",
    "(:action x :parameters (?x) :effect (increase (total-cost) 1e400))",
    f"(:action x :parameters (?r - robot) :effect (increase (total-cost) {'9' * 400}))",
    f"(:action x :parameters (?r - robot) :effect (increase (total-cost) {'9' * 20}))",
    "(:action x :parameters (?a ?b ?c ?d ?e ?f ?g ?h) :effect (and))",
)


def foreign_section(text: str, random: Random) -> str:
    return insert_section(text, random.choice(_FOREIGN), random)


def numbers(text: str, random: Random) -> str:
    """Numbers become strange; where there are none, a cost is added."""
    tokens = tokens_of(text)
    places = [n for n, t in enumerate(tokens) if re.fullmatch(r"-?\d+(\.\d+)?", t)]
    if not places:
        return foreign_section(text, random)
    odd = ("-1", "0.5", "1e9", "9" * 400, "9" * 20, "\u0663", "x", "+3", ".5", "5.", "007")
    tokens[random.choice(places)] = random.choice(odd)
    return "".join(tokens)


def comments(text: str, random: Random) -> str:
    """A comment behind a random token, among them such as mean something."""
    tokens = tokens_of(text)
    said = random.choice(
        (
            *("; x", ";;;;", ";", "; (((", "; )))", "; \x00", "; subaction", "; subaction r1"),
            *("; subaction r1 idle", "; subaction r1 (move ?from ?to)", "; subaction r1 ("),
            *("; subaction r1 ()", "; subactions follow"),
        )
    )
    for _ in range(random.choice((1, 5))):
        tokens.insert(random.randrange(len(tokens) + 1), f" {said}\n")
    return "".join(tokens)
