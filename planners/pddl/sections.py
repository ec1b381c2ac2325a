# SPDX-License-Identifier: GPL-3.0-or-later
"""The sections of a PDDL file, by keyword."""

from __future__ import annotations

from planners.pddl.names import group, token
from planners.pddl.sexpr import Document, Group
from planners.system.messages import echoed

#: Keyword -> the sections that it begins, in the order of the file.
Sections = dict[str, list[Group]]

_UNSUPPORTED = {
    ":durative-action": "durative actions",
    ":derived": "derived predicates (axioms)",
    ":constraints": "trajectory constraints",
    ":process": "processes (PDDL+)",
    ":event": "events (PDDL+)",
}


def read_header(document: Document, kind: str) -> tuple[str, Sections]:
    """The name in ``(define (kind name) ..)`` and the sections behind it, by keyword.

    Raises `Unsupported` for a section that coordlang cannot read and `BadInput` for one that PDDL
    does not have.
    """
    root = document.root
    if root.head != "define":
        raise document.fail(
            f"expected '(define ({kind} ..) ..)'",
            root,
            remedy=f"A {kind} file is one '(define ({kind} NAME) ..)'; give "
            f"DOMAIN first, then PROBLEM.",
        )
    title = root.items[1] if len(root) > 1 else root
    if not isinstance(title, Group) or title.head != kind or len(title) != 2:
        other = title.head if isinstance(title, Group) else ""
        raise document.fail(
            f"expected '({kind} NAME)' after 'define'",
            title,
            f"This is a {other} file: the order is DOMAIN PROBLEM."
            if {kind, other} == {"domain", "problem"}
            else f"As in (define ({kind} NAME) ..).",
        )
    sections: Sections = {}
    for item in root.items[2:]:
        section = group(document, item, "a section such as '(:action ..)'")
        _require_known(document, section, kind)
        sections.setdefault(section.head, []).append(section)
    return token(document, title.items[1], f"the name of the {kind}").text, sections


def _require_known(document: Document, section: Group, kind: str) -> None:
    head = section.head
    if head in _UNSUPPORTED:
        remedy = "coordlang reads classical PDDL with instantaneous actions."
        raise document.unsupported(f"{_UNSUPPORTED[head]} ({head}) are", section, remedy)
    if head not in _SECTIONS[kind]:
        raise document.fail(
            f"unknown section {echoed(head)} in a {kind}",
            section,
            "Known here: " + ", ".join(sorted(_SECTIONS[kind])) + ".",
        )


_SECTIONS = {
    "domain": {
        *(":requirements", ":types", ":constants", ":predicates", ":functions", ":action"),
        *(":concurrency-constraint", ":positive-dependence"),
    },
    "problem": {
        *(":domain", ":requirements", ":objects", ":init", ":goal", ":metric", ":length"),
    },
}
