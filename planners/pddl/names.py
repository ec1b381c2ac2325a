# SPDX-License-Identifier: GPL-3.0-or-later
"""The sections, typed lists and names of a text, with helpful errors for what it may not use."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from string import ascii_lowercase

from planners.pddl.lifted import Atom, Signatures, Variable, supertypes
from planners.pddl.sexpr import SECTIONS, UNSUPPORTED, Expression, Group, Token, first_text
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
#: Words of formulas and effects.
_WORDS = frozenset(("and", "or", "not", "imply", "forall", "exists", "when", "increase", "="))
#: Characters of a name in an example.
_SHOWN = 60


def known(names: Iterable[str], wrong: str, what: str) -> str:
    """A remedy: the close match among ``names`` if there is one, else the first ten of them."""
    from difflib import get_close_matches

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


def typed_list(items: Sequence[Expression], what: str) -> list[Typed]:
    """Read ``a b - t c - (either u v) d``; entries without a type get ``object``.

    A dash with no names before it is noted and stands for none, as Fast Downward reads it.  Raises
    `BadInput` where it has no type behind it.
    """
    entries: list[Typed] = []
    waiting: list[Token] = []
    left = iter(items)
    for each in left:
        item = each.token(what)
        if item.text != "-":
            waiting.append(item)
            continue
        kind = next(left, None)
        if kind is None:
            remedy = "Write the type's name after it, or leave the '-' out."
            raise item.fail("expected a type after '-'", remedy)
        types = _types(kind)
        if not waiting:
            noun = what.partition(" ")[2]
            said = f"no {noun} stands before '- {' '.join(types)}': nothing is declared"
            note(said, position=item.position)
        entries += [(name, types) for name in waiting]
        waiting = []
    return entries + [(name, ("object",)) for name in waiting]


def _types(item: Expression) -> tuple[str, ...]:
    if isinstance(item, Token):
        return (item.text,)
    if item.head != "either" or len(item) < 2:
        remedy = "One type is a name, several are (either name name)."
        raise item.fail("expected a type or '(either type ..)'", remedy)
    return tuple(part.token("a type").text for part in item.items[1:])


@dataclass(frozen=True, slots=True)
class Names:
    """What a formula may speak of: types, predicates, actions, objects and the variables in scope.

    ``types`` have their direct supertypes, ``objects`` and ``variables`` their types.  ``actions``
    maps each action to its number of arguments (the agent counted, first).  ``in_domain``: what is
    read is a domain, whose objects are its constants.
    """

    types: dict[str, tuple[str, ...]]
    predicates: Signatures
    functions: Signatures = field(default_factory=dict)
    actions: Mapping[str, int] = field(default_factory=dict)
    objects: dict[str, tuple[str, ...]] = field(default_factory=dict)
    variables: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    in_domain: bool = False
    #: Whether types have one in common, as far as it was asked.
    _common: dict[tuple[Collection[str], Collection[str]], bool] = field(default_factory=dict)

    def word(self, item: Group) -> str:
        """The word of PDDL that a list begins with, if any; ``(or ?x)`` may be an atom."""
        head, is_flat = item.head, not any(isinstance(part, Group) for part in item.items)
        declared = *self.predicates.get(head, ()), self.actions.get(head)
        is_name = head != "=" and len(item) - 1 in declared and is_flat
        return head if head in _WORDS and not is_name else ""

    def with_variables(self, variables: Iterable[Variable]) -> Names:
        """The same names with more variables in scope; a variable of the same name is shadowed."""
        more = {variable.name: variable.types for variable in variables}
        return replace(self, variables={**self.variables, **more})

    def read_variables(self, listed: Expression) -> tuple[Variable, ...]:
        """The variables of a typed list in parentheses."""
        return self.variables_of(listed.group("a list of variables").items)

    def variables_of(self, *lists: Sequence[Expression]) -> tuple[Variable, ...]:
        """The variables of typed lists; their types must be declared."""
        variables: dict[str, Variable] = {}
        for token, types in chain(*(typed_list(items, "a variable") for items in lists)):
            name = token.text
            if not name.startswith("?"):
                remedy = f"Variables start with '?': ?{name}."
                raise token.fail(f"expected a variable, found {echoed(name)}", remedy)
            self.check_types(token, types)
            if name in variables:
                remedy = "Give one of the two another name."
                raise token.fail(f"variable {name} is declared twice", remedy)
            variables[name] = Variable(name, types)
        return tuple(variables.values())

    def check_types(self, token: Token, types: tuple[str, ...]) -> None:
        """Raise `BadInput` if a type of a name is not declared."""
        for name in types:
            if name not in self.types and name != "object":
                what = f"type {echoed(name)} of {echoed(token.text)} is not declared"
                raise token.fail(what, known(self.types, name, "type"))

    def have_common(self, first: Collection[str], second: Collection[str]) -> bool:
        """Whether some type is one of the ``first`` or below and one of the ``second`` or below."""
        if (first, second) not in self._common:
            self._common[first, second] = any(
                not above.isdisjoint(first) and not above.isdisjoint(second)
                for above in (supertypes(self.types, name) for name in ("object", *self.types))
            )
        return self._common[first, second]

    def read_objects(
        self, sections: Sequence[Group], known: Mapping[str, tuple[str, ...]]
    ) -> dict[str, tuple[str, ...]]:
        """Objects with their types: those known, and those that sections declare.

        A section is a typed list, with ``(:private ..)`` groups.
        """
        objects, parts = {**known}, list[tuple[list[Typed], list[Group]]]()
        for section in sections:
            private = [i for i in section.items if isinstance(i, Group) and i.head == ":private"]
            own = [item for item in section.items[1:] if item not in private]
            parts.append((typed_list(own, "an object"), private))
        declared = {*known, *(token.text for own, _ in parts for token, _ in own)}
        for entries, private in parts:
            self._declare(objects, entries)
            for group in private:
                inner = _without_owner(group, declared | objects.keys())
                self._declare(objects, typed_list(inner, "an object"))
        return objects

    def _declare(self, objects: dict[str, tuple[str, ...]], entries: Iterable[Typed]) -> None:
        for token, types in entries:
            self.check_types(token, types)
            if token.text.startswith("?"):
                remedy = f"Names of objects have no '?': {visible(token.text[1:_SHOWN])}."
                raise token.fail("a variable cannot be an object", remedy)
            objects[token.text] = tuple(dict.fromkeys((*objects.get(token.text, ()), *types)))

    def term(self, item: Expression) -> str:
        """A variable in scope or a declared object."""
        if isinstance(item, Group):
            if item.head in self.functions:
                what = f"a numeric or object fluent ({item.head} ..) inside a formula is"
                remedy = "coordlang reads functions only in '(increase (total-cost) ..)'."
                raise item.unsupported(what, remedy)
            remedy = "Arguments are names: atoms are not nested."
            raise item.fail("expected a variable or an object, found a list", remedy)
        if item.text.startswith("?"):
            if item.text not in self.variables:
                remedy = known(self.variables, item.text, "variable")
                raise item.fail(f"variable {item.text} is not declared here", remedy)
        elif item.text not in self.objects:
            remedy = known(self.objects, item.text, "object")
            if self.in_domain:
                remedy += " An object that a domain names belongs in its (:constants ..)."
            raise item.fail(f"object {echoed(item.text)} is not declared", remedy)
        return item.text

    def check_arguments(self, item: Group) -> None:
        """Raise `BadInput` for an argument that has no type in common with what is declared.

        A type above the declared one has: its objects may be of that one.
        """
        signature = self.predicates[item.head].get(len(item) - 1, ())
        for number, (part, allowed) in enumerate(zip(item.items[1:], signature, strict=False), 1):
            term = part.token("a term")
            own = (self.variables if term.text in self.variables else self.objects)[term.text]
            if not self.have_common(own, allowed):
                declared = " ".join(" or ".join(sorted(types)) for types in signature)
                raise term.fail(
                    f"argument {number} of {echoed(item.head)}, {echoed(term.text)}, is of type "
                    f"{' or '.join(own)}, not {' or '.join(sorted(allowed))}",
                    f"It is declared as ({visible(item.head[:_SHOWN])} {declared}): are arguments "
                    "swapped, or is a type missing there?",
                )

    def function(self, item: Group) -> Atom:
        """The term of a declared function, or of ``total-cost``."""
        if item.head not in self.functions and item.head != "total-cost":
            raise unknown("function", item, self.functions)
        arities: Iterable[int] = self.functions.get(item.head, (len(item) - 1,))
        return Atom(item.head, self.arguments(item, arities, "function"))

    def arguments(self, item: Group, arities: Iterable[int], what: str) -> tuple[str, ...]:
        """The arguments of an atom, action or function; `BadInput` where their number is wrong."""
        found = len(item) - 1
        if found not in arities:
            numbers, name = sorted(arities), visible(item.head[:_SHOWN])
            wanted = " or ".join(map(str, numbers)) + f" argument{'s' * (numbers != [1])}"
            forms = " or ".join(f"({' '.join((name, *ascii_lowercase[:n]))})" for n in numbers)
            said = f"{what} {echoed(item.head)} takes {wanted}, found {found}"
            raise item.fail(said, f"Write {forms}, or declare it with {found}.")
        return tuple(self.term(term) for term in item.items[1:])


def unknown(what: str, item: Group, declared: Iterable[str]) -> BadInput | Unsupported:
    """The error for a list whose head is no ``what`` that is declared."""
    timed = item.head == "at" and any(is_token(part, "end", "start") for part in item.items)
    feature = _FEATURES.get("within" if timed else item.head)
    if feature is not None:
        return item.unsupported(f"{feature.format(item.head)} is")
    if item.head in _WORDS:
        remedy = "Effects are atoms, (not ATOM), and, forall, when; only effects may have when."
        return item.fail(f"'{item.head}' cannot stand here", remedy)
    return item.fail(f"unknown {what} {echoed(item.head)}", known(declared, item.head, what))


def _without_owner(section: Group, declared: Collection[str]) -> Sequence[Expression]:
    """The objects of a ``(:private ..)`` group, without an owner in front of them.

    Unfactored MA-PDDL writes ``(:private depot0 hoist0 - hoist)``: the owner is declared elsewhere,
    or again in the group.  What a type stands behind is no owner.
    """
    inner = section.items[1:]
    owner, is_typed = first_text(inner), any(is_token(item, "-") for item in inner[1:2])
    is_owner = owner in declared or any(is_token(item, owner) for item in inner[1:])
    return inner[1:] if is_owner and not is_typed else inner


#: Keyword -> the sections that it begins, in the order of the file.
Sections = dict[str, list[Group]]


def read_header(root: Group, kind: str) -> tuple[str, Sections]:
    """The name in ``(define (kind name) ..)`` and the sections behind it, by keyword.

    Raises `Unsupported` for a section that coordlang cannot read and `BadInput` for one that PDDL
    does not have.
    """
    if root.head != "define":
        remedy = (
            f"A {kind} file is one '(define ({kind} NAME) ..)'; give DOMAIN first, then PROBLEM."
        )
        raise root.fail(f"expected '(define ({kind} ..) ..)'", remedy)
    title = next(iter(root.items[1:]), root)
    if not isinstance(title, Group) or title.head != kind or len(title) != 2:
        other = title.head if isinstance(title, Group) else ""
        remedy = f"As in (define ({kind} NAME) ..)."
        if {kind, other} == {"domain", "problem"}:
            remedy = f"This is a {other} file: the order is [LANGUAGE] DOMAIN PROBLEM."
        raise title.fail(f"expected '({kind} NAME)' after 'define'", remedy)
    sections: Sections = {}
    for item in root.items[2:]:
        section = item.group("a section such as '(:action ..)'")
        if (head := section.head) in UNSUPPORTED:
            remedy = "coordlang reads classical PDDL with instantaneous actions."
            raise section.unsupported(f"{UNSUPPORTED[head]} ({head}) are", remedy)
        if head not in SECTIONS[kind]:
            remedy = f"Known here: {', '.join(sorted(SECTIONS[kind]))}."
            raise section.fail(f"unknown section {echoed(head)} in a {kind}", remedy)
        sections.setdefault(head, []).append(section)
    return title.items[1].token(f"the name of the {kind}").text, sections
