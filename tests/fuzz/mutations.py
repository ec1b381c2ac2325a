# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways to break a PDDL text: its tokens, groups, literals, names, sections, layout and bytes."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from random import Random

Mutation = Callable[[str, Random], str]
Span = tuple[int, int]
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


def groups_of(text: str) -> list[Span]:
    """The spans of all parenthesised groups; the whole text is the last one."""
    spans, opened, at = [], [], 0
    for token in tokens_of(text):
        if token == "(":
            opened.append(at)
        elif token == ")" and opened:
            spans.append((opened.pop(), at + 1))
        at += len(token)
    return spans


def sections_of(text: str) -> list[Span]:
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


# Tokens

Edit = Callable[[list[str], list[int], Random], None]


def on_tokens(edit: Edit) -> Mutation:
    """An edit of the list of tokens (and the numbers of its visible ones), one to three times."""

    def mutate(text: str, random: Random) -> str:
        tokens = tokens_of(text)
        for _ in range(random.choice((1, 1, 1, 2, 3))):
            numbers = [n for n, t in enumerate(tokens) if not t.isspace() and t[0] != ";"]
            if numbers:
                edit(tokens, numbers, random)
        return "".join(tokens)

    mutate.__name__ = edit.__name__
    return mutate


@on_tokens
def drop(tokens: list[str], numbers: list[int], random: Random) -> None:
    del tokens[random.choice(numbers)]


@on_tokens
def double(tokens: list[str], numbers: list[int], random: Random) -> None:
    n = random.choice(numbers)
    tokens.insert(n, tokens[n] + " ")


@on_tokens
def swap(tokens: list[str], numbers: list[int], random: Random) -> None:
    a, b = random.choice(numbers), random.choice(numbers)
    tokens[a], tokens[b] = tokens[b], tokens[a]


@on_tokens
def replace_token(tokens: list[str], numbers: list[int], random: Random) -> None:
    """A word takes the place of another: wrong kinds, but mostly balanced parentheses."""
    words = [n for n in numbers if tokens[n] not in "()"]
    if words:
        others = (*(tokens[n] for n in words), *ODD, "and", "not", "forall")
        tokens[random.choice(words)] = random.choice(others)


@on_tokens
def other_variable(tokens: list[str], numbers: list[int], random: Random) -> None:
    """A variable gives its place to another one."""
    found = [n for n in numbers if tokens[n][0] == "?"]
    if found:
        tokens[random.choice(found)] = tokens[random.choice(found)]


@on_tokens
def number(tokens: list[str], numbers: list[int], random: Random) -> None:
    """A number becomes strange."""
    places = [n for n in numbers if re.fullmatch(r"-?\d+(\.\d+)?", tokens[n])]
    odd = ("-1", "0.5", "1e9", "9" * 400, "9" * 20, "\u0663", "x", "+3", ".5", "5.", "007")
    if places:
        tokens[random.choice(places)] = random.choice(odd)


@on_tokens
def comment(tokens: list[str], numbers: list[int], random: Random) -> None:
    """A comment behind a random token, among them such as mean something."""
    said = random.choice(
        (
            *("; x", ";;;;", ";", "; (((", "; )))", "; \x00", "; subaction", "; subaction r1"),
            *("; subaction r1 idle", "; subaction r1 (move ?from ?to)", "; subaction r1 ("),
            *("; subaction r1 ()", "; subactions follow"),
        )
    )
    tokens.insert(random.randrange(len(tokens) + 1), f" {said}\n")


# Groups

_OF_TWO = ("(or {0} {1})", "(imply {0} {1})", "(when {0} {1})")
#: What comes before and after a group.
_AROUND = (
    *(("(not ", ")"), ("(and ", ")"), ("(or ", ")"), ("(imply (and) ", ")"), ("(when (and) ", ")")),
    *(("(", ")"), ("(forall (?r ?o ?x) ", ")"), ("(exists (?from ?a) ", ")"), ("(forall () ", ")")),
    *(("(increase ", " 1)"), ("(when ", " (and))"), ("(preference p ", ")"), ("(at 5 ", ")")),
    *(("(= ", " 1)"), ("(:private ", ")"), ("(either ", ")"), ("(oneof ", ")")),
)


def drop_group(text: str, random: Random) -> str:
    start, end = random.choice(groups_of(text)[:-1] or [(0, 0)])
    return text[:start] + random.choice(("", "()")) + text[end:]


def swap_groups(text: str, random: Random) -> str:
    spans = groups_of(text)[:-1]
    if len(spans) < 2:
        return text
    (a, b), (c, d) = sorted(random.sample(spans, 2))
    if d <= b:  # one inside the other: the inner one takes the place of the outer one
        return text[:a] + text[c:d] + text[b:]
    return text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]


def wrap_group(text: str, random: Random) -> str:
    """A group becomes part of another connective or quantifier."""
    start, end = random.choice(groups_of(text) or [(0, 0)])
    before, after = random.choice(_AROUND)
    return text[:start] + before + text[start:end] + after + text[end:]


def nest(text: str, random: Random) -> str:
    """10,000 levels (or just below the reader's limit) around a group."""
    depth = random.choice((10_000, 180, 30))
    start, end = random.choice(groups_of(text) or [(0, 0)])
    heads = ("(not ", "(and ", "(or ", "(forall (?r) ", "(when (and) ", "(imply (and) ", "(")
    head = random.choice(heads)
    return text[:start] + head * depth + text[start:end] + ")" * depth + text[end:]


def unbalance(text: str, random: Random) -> str:
    at = random.randrange(len(text) + 1)
    return text[:at] + random.choice("()") * random.choice((1, 1, 2, 500)) + text[at:]


def edit_literal(text: str, random: Random) -> str:
    """One to three atoms are left out, negated, said twice, or get their words in another order."""
    for _ in range(random.choice((1, 1, 2, 3))):
        groups = groups_of(text)
        spans = [(a, b) for a, b in groups[:-1] if "(" not in text[a + 1 : b]]
        if not spans:
            return text
        start, end = random.choice(spans)
        atom, other = text[start:end], text[slice(*random.choice(spans))]
        first, *rest = atom[1:-1].split() or [""]
        random.shuffle(rest)
        forms = ("", "(not {0})", "{0} {0}", "{2}", "{1}", "{0} {1}", *_OF_TWO)
        shuffled = f"({' '.join((first, *rest))})"
        text = text[:start] + random.choice(forms).format(atom, other, shuffled) + text[end:]
    return text


# Names


def odd_name(text: str, random: Random) -> str:
    """One name becomes odd wherever it occurs."""
    names = names_of(text)
    return renamed(text, {random.choice(names): random.choice(ODD)}) if names else text


def one_name(text: str, random: Random) -> str:
    """Several names become one: predicate, type, object and action alike."""
    plain = [name for name in names_of(text) if name[0] not in ":?"]
    chosen = random.sample(plain, min(len(plain), random.choice((1, 2, 4))))
    return renamed(text, dict.fromkeys(chosen, random.choice(plain or ["x"])))


def upper_case(text: str, random: Random) -> str:
    share = random.choice((0.1, 0.5, 1.0))
    return "".join(
        t.upper() if t[0] != ";" and random.random() < share else t for t in tokens_of(text)
    )


def shadow(text: str, random: Random) -> str:
    """A variable takes the name of another one."""
    names = [name for name in names_of(text) if name[0] == "?"]
    if len(names) < 2:
        return wrap_group(text, random)
    a, b = random.sample(names, 2)
    share = random.choice((0.2, 0.5, 1.0))
    return "".join(b if t == a and random.random() < share else t for t in tokens_of(text))


# Sections

_MANY = (
    *("(:action a{n} :parameters (?r - robot))", "(:action a{n} :parameters () :effect (p{n}))"),
    *("(:predicates (p{n}) (q{n} ?x))", "(:types t{n} - t{m})", "(:constants c{n})", "(:init)"),
    "(:requirements :r{n})",
)
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


def many_objects(text: str, random: Random) -> str:
    """In a problem."""
    number = random.choice((300, 20_000, 1_000_000))
    kind = random.choice(("", "", " - robot", " - cell", " - object", " - agent"))
    names = " ".join(f"zz{n}" for n in range(number)) + kind
    if re.search(r"\(:objects", text, re.IGNORECASE):
        return re.sub(r"\(:objects", f"(:objects {names} ", text, count=1, flags=re.IGNORECASE)
    return insert_section(text, f"(:constants {names})", random)


def many_sections(text: str, random: Random) -> str:
    number, section = random.choice((50, 2_000)), random.choice(_MANY)
    sections = (section.format(n=n, m=n + 1) for n in range(number))
    return insert_section(text, " ".join(sections), random)


def empty_section(text: str, random: Random) -> str:
    start, end = random.choice(sections_of(text) or [(0, 0)])
    return (
        text[:start] + "".join(f"({t})" for t in tokens_of(text[start + 1 : end])[:1]) + text[end:]
    )


def double_section(text: str, random: Random) -> str:
    start, end = random.choice(sections_of(text) or [(0, 0)])
    return text[:end] + text[start:end] * random.choice((1, 1, 30)) + text[end:]


def foreign_section(text: str, random: Random) -> str:
    return insert_section(text, random.choice(_FOREIGN), random)


# The file


def as_bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogateescape")


def truncate(text: str, random: Random) -> str:
    return text[: random.randrange(len(text) + 1)]


def random_bytes(text: str, random: Random) -> str:
    data = bytearray(as_bytes(text))
    for _ in range(random.choice((1, 2, 10, 200)) if data else 0):
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
    if kind < 2:
        at = kind * random.randrange(len(text) + 1)
        return text[:at] + "\ufeff" + text[at:]
    encoded = text.encode("utf-16" if kind == 2 else "utf-16-be", "surrogatepass")
    return encoded.decode("utf-8", "surrogateescape")


def nothing(text: str, random: Random) -> str:
    rests = ("", " \n", "; nothing\n", "()", "(define)", "(define (domain x))", "(define ())")
    return random.choice((*rests, "\x00", "x", ")"))


#: All of them, and how often each is used: those that get past the reader are worth more.
MUTATIONS: dict[Mutation, float] = {
    **dict.fromkeys((double, swap, truncate, random_bytes, unbalance, upper_case, long_line), 1),
    **dict.fromkeys(
        (line_ends, marked, empty_section, double_section, foreign_section, comment), 1
    ),
    **dict.fromkeys((many_objects, many_sections), 0.7),
    **dict.fromkeys((other_variable, wrap_group), 8),
    **dict.fromkeys((replace_token, one_name, odd_name), 5),
    **dict.fromkeys((swap_groups, shadow), 4),
    edit_literal: 16,
    drop_group: 6,
    drop: 3,
    number: 2,
    nest: 2,
    nothing: 0.5,
}
#: Those that break names, which both files have.
OF_NAMES: Sequence[Mutation] = (odd_name, one_name, shadow, upper_case)
