# SPDX-License-Identifier: GPL-3.0-or-later
"""The sections, typed lists and names of a text, with helpful errors for what it may not use."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

from planners.pddl.lifted import Atom, Domain, Signatures, Variable, have_common
from planners.pddl.sexpr import SECTIONS, UNSUPPORTED, Document, Expression, Group, Token
from planners.system.errors import BadInput, Unsupported, note
from planners.system.messages import echoed, visible

#: Characters of a wrong name that are compared with the declared names.
_LONGEST_COMPARED = 200
#: What stands in conditions or effects of PDDL that is not supported, by the word it begins with.
_FEATURES = {
    **dict.fromkeys(("<", "<=", ">", ">="), "numeric condition '({} ..)'"),
    **dict.fromkeys(
        ("assign", "increase", "decrease", "scale-up", "scale-down"), "numeric effect '({} ..)'"
    ),
    **dict.fromkeys(
        ("always", "sometime", "within", "at-most-once", "sometime-after", "hold-after"),
        "trajectory constraint '({} ..)'",
    ),
    **dict.fromkeys(("oneof", "probabilistic", "unknown"), "non-deterministic effect '({} ..)'"),
    "preference": "a preference",
}
#: Arguments in an example.
_LETTERS = tuple("abcdefghij")
#: Characters of a name in an example.
_SHOWN = 60


def known(names: Iterable[str], wrong: str, what: str) -> str:
    """A remedy: the close match among ``names`` if there is one, else the first ten of them."""
    names = sorted(names)
    close = get_close_matches(wrong[:_LONGEST_COMPARED], names, n=1)
    if close:
        return f"Did you mean {echoed(close[0])}?"
    if not names:
        return f"No {what} is declared."
    listed = ", ".join(names[:10]) + (", .." if len(names) > 10 else "")
    return f"Declared {what}s: {listed}."


def is_token(item: Expression, *texts: str) -> bool:
    """Whether ``item`` is a token with one of these texts."""
    return isinstance(item, Token) and item.text in texts


#: One entry of a typed list: a name and its types.
Typed = tuple[Token, tuple[str, ...]]


def typed_list(document: Document, items: Sequence[Expression], what: str) -> list[Typed]:
    """Read ``a b - t c - (either u v) d``; entries without a type get ``object``.

    A dash with no names before it is noted and stands for none, as Fast Downward reads it.  Raises
    `BadInput` where it has no type behind it.
    """
    entries: list[Typed] = []
    waiting: list[Token] = []
    at = 0
    while at < len(items):
        item = document.token(items[at], what)
        if item.text != "-":
            waiting.append(item)
            at += 1
            continue
        if at + 1 == len(items):
            raise document.fail(
                "expected a type after '-'",
                item,
                "Write the type's name after it, or leave the '-' out.",
            )
        types = _types(document, items[at + 1])
        if not waiting:
            noun = what.partition(" ")[2]
            note(
                f"no {noun} stands before '- {' '.join(types)}': nothing is declared",
                position=document.source.position(item.offset),
            )
        entries += [(name, types) for name in waiting]
        waiting = []
        at += 2
    return entries + [(name, ("object",)) for name in waiting]


def _types(document: Document, item: Expression) -> tuple[str, ...]:
    if isinstance(item, Token):
        return (item.text,)
    if item.head != "either" or len(item) < 2:
        raise document.fail(
            "expected a type or '(either type ..)'",
            item,
            "One type is a name, several are (either name name).",
        )
    return tuple(document.token(part, "a type").text for part in item.items[1:])


@dataclass(frozen=True, slots=True)
class Names:
    """What a formula may speak of: types, predicates, actions, objects and the variables in scope.

    ``types`` have their direct supertypes, ``objects`` and ``variables`` their types.  ``actions``
    maps each action to its number of arguments (the agent counted, first).
    """

    document: Document
    types: Mapping[str, tuple[str, ...]]
    predicates: Mapping[str, frozenset[int]]
    signatures: Signatures = field(default_factory=dict)
    functions: Mapping[str, frozenset[int]] = field(default_factory=dict)
    actions: Mapping[str, int] = field(default_factory=dict)
    objects: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    variables: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    #: Whether types have one in common, as far as it was asked.
    _common: dict[tuple[Collection[str], Collection[str]], bool] = field(default_factory=dict)

    @classmethod
    def of(cls, document: Document, domain: Domain) -> Names:
        """What a text about a domain may speak of, without objects."""
        return cls(document, domain.types, domain.predicates, domain.signatures, domain.functions)

    def with_variables(self, variables: Iterable[Variable]) -> Names:
        """The same names with more variables in scope; a variable of the same name is shadowed."""
        more = {variable.name: variable.types for variable in variables}
        return replace(self, variables={**self.variables, **more})

    def read_variables(self, listed: Expression) -> tuple[Variable, ...]:
        """The variables of a typed list in parentheses."""
        return self.variables_of(self.document.group(listed, "a list of variables").items)

    def variables_of(self, items: Sequence[Expression]) -> tuple[Variable, ...]:
        """The variables of a typed list; their types must be declared."""
        variables: list[Variable] = []
        for token, types in typed_list(self.document, items, "a variable"):
            name = token.text
            if not name.startswith("?"):
                what = f"expected a variable, found {echoed(name)}"
                raise self.document.fail(what, token, f"Variables start with '?': ?{name}.")
            self.check_types(token, types)
            if any(variable.name == name for variable in variables):
                what = f"variable {name} is declared twice"
                raise self.document.fail(what, token, "Give one of the two another name.")
            variables.append(Variable(name, types))
        return tuple(variables)

    def check_types(self, token: Token, types: tuple[str, ...]) -> None:
        """Raise `BadInput` if a type of a name is not declared."""
        for name in types:
            if name not in self.types and name != "object":
                what = f"type {echoed(name)} of {echoed(token.text)} is not declared"
                raise self.document.fail(what, token, known(self.types, name, "type"))

    def term(self, item: Expression) -> str:
        """A variable in scope or a declared object."""
        if isinstance(item, Group):
            if item.head in self.functions:
                what = f"a numeric or object fluent ({item.head} ..) inside a formula is"
                remedy = "coordlang reads functions only in '(increase (total-cost) ..)'."
                raise self.document.unsupported(what, item, remedy)
            remedy = "Arguments are names: atoms are not nested."
            raise self.document.fail("expected a variable or an object, found a list", item, remedy)
        if item.text.startswith("?"):
            if item.text not in self.variables:
                remedy = known(self.variables, item.text, "variable")
                raise self.document.fail(f"variable {item.text} is not declared here", item, remedy)
        elif item.text not in self.objects:
            remedy = known(self.objects, item.text, "object")
            title = self.document.root.items[1:2]
            if title and isinstance(title[0], Group) and title[0].head == "domain":
                remedy += " An object that a domain names belongs in its (:constants ..)."
            raise self.document.fail(f"object {echoed(item.text)} is not declared", item, remedy)
        return item.text

    def check_arguments(self, item: Group) -> None:
        """Raise `BadInput` for an argument that has no type in common with what is declared.

        A type above the declared one has: its objects may be of that one.
        """
        signature = self.signatures.get((item.head, len(item) - 1), ())
        for number, (term, allowed) in enumerate(zip(item.items[1:], signature, strict=False), 1):
            assert isinstance(term, Token)
            own = (self.variables if term.text in self.variables else self.objects)[term.text]
            if (own, allowed) not in self._common:
                self._common[own, allowed] = have_common(self.types, own, allowed)
            if not self._common[own, allowed]:
                declared = " ".join(" or ".join(sorted(types)) for types in signature)
                raise self.document.fail(
                    f"argument {number} of {echoed(item.head)}, {echoed(term.text)}, is of type "
                    f"{' or '.join(own)}, not {' or '.join(sorted(allowed))}",
                    term,
                    f"It is declared as ({visible(item.head[:_SHOWN])} {declared}): are arguments "
                    "swapped, or is a type missing there?",
                )

    def function(self, item: Group) -> Atom:
        """The term of a declared function, or of ``total-cost``."""
        if item.head not in self.functions and item.head != "total-cost":
            raise self.unknown("function", item, self.functions)
        arities = self.functions.get(item.head, {len(item) - 1})
        return Atom(item.head, self.arguments(item, arities, "function"))

    def unknown(self, what: str, item: Group, declared: Iterable[str]) -> BadInput | Unsupported:
        """The error for a list whose head is no ``what`` that is declared."""
        timed = item.head == "at" and any(is_token(part, "end", "start") for part in item)
        feature = _FEATURES.get("within" if timed else item.head)
        if feature is not None:
            return self.document.unsupported(f"{feature.format(item.head)} is", item)
        remedy = known(declared, item.head, what)
        return self.document.fail(f"unknown {what} {echoed(item.head)}", item, remedy)

    def arguments(self, item: Group, arities: Iterable[int], what: str) -> tuple[str, ...]:
        """The arguments of an atom, action or function; `BadInput` where their number is wrong."""
        found = len(item) - 1
        if found not in arities:
            numbers, name = sorted(arities), visible(item.head[:_SHOWN])
            wanted = " or ".join(map(str, numbers)) + f" argument{'s' * (numbers != [1])}"
            forms = " or ".join(f"({' '.join((name, *_LETTERS[:n]))})" for n in numbers)
            said = f"{what} {echoed(item.head)} takes {wanted}, found {found}"
            raise self.document.fail(said, item, f"Write {forms}, or declare it with {found}.")
        return tuple(self.term(term) for term in item.items[1:])


def read_objects(
    names: Names, items: Sequence[Expression], into: dict[str, tuple[str, ...]]
) -> None:
    """Add a typed list of objects, with ``(:private ..)`` groups, to ``into`` (name -> types)."""
    document = names.document
    private = [item for item in items if isinstance(item, Group) and item.head == ":private"]
    entries = typed_list(document, [i for i in items if i not in private], "an object")
    declared = {token.text for token, _ in entries}
    for section in private:
        entries += typed_list(document, _without_owner(section, declared), "an object")
    for token, types in entries:
        names.check_types(token, types)
        name = token.text
        if name.startswith("?"):
            raise document.fail(
                "a variable cannot be an object",
                token,
                f"Names of objects have no '?': {visible(name[1:_SHOWN])}.",
            )
        old = into.get(name, ())
        into[name] = (*old, *(t for t in types if t not in old))


def _without_owner(section: Group, declared: Set[str]) -> Sequence[Expression]:
    """The objects of a ``(:private ..)`` group, without an owner in front of them.

    Unfactored MA-PDDL writes ``(:private depot0 hoist0 - hoist)``: the owner is declared elsewhere,
    or again in the group.
    """
    inner = section.items[1:]
    if not inner or not isinstance(inner[0], Token):
        return inner
    owner = inner[0].text
    repeated = any(is_token(item, owner) for item in inner[1:])
    return inner[1:] if repeated or owner in declared else inner


#: Keyword -> the sections that it begins, in the order of the file.
Sections = dict[str, list[Group]]


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
        section = document.group(item, "a section such as '(:action ..)'")
        _require_known(document, section, kind)
        sections.setdefault(section.head, []).append(section)
    return document.token(title.items[1], f"the name of the {kind}").text, sections


def _require_known(document: Document, section: Group, kind: str) -> None:
    head = section.head
    if head in UNSUPPORTED:
        remedy = "coordlang reads classical PDDL with instantaneous actions."
        raise document.unsupported(f"{UNSUPPORTED[head]} ({head}) are", section, remedy)
    if head not in SECTIONS[kind]:
        raise document.fail(
            f"unknown section {echoed(head)} in a {kind}",
            section,
            "Known here: " + ", ".join(sorted(SECTIONS[kind])) + ".",
        )
