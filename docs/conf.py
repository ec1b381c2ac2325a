# SPDX-License-Identifier: GPL-3.0-or-later
"""Sphinx: these pages, and a reference made of the docstrings with one page for each room.

``sphinx-build -W -n -b html docs docs/_build/html`` writes the site, without warnings.
"""

from __future__ import annotations

import contextlib
import pkgutil
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from docutils.nodes import Element
    from sphinx.addnodes import pending_xref
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

#: The folders with modules, packages before what is in them.
ROOMS = sorted(
    {
        path.parent.relative_to(HERE.parent).as_posix()
        for package in ("planners", "coordlang")
        for path in (HERE.parent / package).rglob("*.py")
    },
    key=lambda room: (not room.startswith("planners"), room),
)


def in_order(folder: Path) -> list[Path]:
    """The modules of a folder by name."""
    return sorted(path for path in folder.glob("*.py") if path.name != "__init__.py")


import coordlang  # noqa: E402 - the one of this checkout

project = "coordlang"
release = version = coordlang.__version__
project_copyright = "the coordlang maintainers, GPL-3.0-or-later"

extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
exclude_patterns = ["_build"]
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
suppress_warnings = [
    "misc.highlighting_failure",  # JSON with ".." for what is left out
    "ref.python",  # two classes of one name, in an annotation that does not say which
]
#: Names of other projects that are imported for annotations only, names of what functions read
#: (unions without an entry), and types with arguments.
nitpick_ignore_regex = [
    ("py:.*", r"Axes|Figure|Drawing|Point|(Problem|Language)Source|types\.Annotated|.*\[.*")
]

default_role = "autolink"  # a name in single backticks links to its entry, where it has one
autodoc_member_order = "bysource"
autodoc_preserve_defaults = False  # signatures of functions with options are made, not written
python_use_unqualified_type_names = True
autosummary_generate = False
numpydoc_show_class_members = False

html_theme = "furo"
html_title = "coordlang"
html_show_sourcelink = False
html_static_path, html_css_files = ["_static"], ["wide.css"]

ROOM = """\
{title}
{line}

.. automodule:: {package}
   :members:
   :ignore-module-all:

{modules}
"""
MODULE = """\
{title}
{line}

.. automodule:: {module}
   :members:
   :ignore-module-all:
   :show-inheritance:
"""


def heading(text: str, mark: str) -> dict[str, str]:
    """A heading of reStructuredText."""
    return {"title": text, "line": mark * len(text)}


def write_rooms(app: Sphinx) -> None:
    """Write a page for each room, with an entry for each of its modules."""
    folder = HERE / "api" / "rooms"
    folder.mkdir(parents=True, exist_ok=True)
    packages = {room.replace("/", "."): room for room in ROOMS}
    for stale in {path.name for path in folder.iterdir()} - {f"{name}.rst" for name in packages}:
        (folder / stale).unlink()
    for package, room in packages.items():
        modules = (
            MODULE.format(module=f"{package}.{path.stem}", **heading(path.stem, "-"))
            for path in in_order(HERE.parent / room)
        )
        text = ROOM.format(package=package, modules="\n".join(modules), **heading(package, "="))
        page = folder / f"{package}.rst"
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def public_names() -> Iterator[str]:
    """A line for each name that ``import coordlang`` gives, with a link to its entry."""
    for name in coordlang.__all__:
        thing = getattr(coordlang, name)
        if name.startswith("_"):
            continue
        summary = (thing.__doc__ or "").strip().split("\n", 1)[0].replace("``", "`")
        yield f"| {{py:obj}}`{name} <{thing.__module__}.{thing.__qualname__}>` | {summary} |"


def toctree(pages: list[str], caption: str) -> str:
    """A hidden table of contents in MyST."""
    return "\n".join(["", ":::{toctree}", ":hidden:", f":caption: {caption}", *pages, ":::", ""])


def read_source(app: Sphinx, docname: str, source: list[str]) -> None:
    """Complete the two indexes, and turn links to files that are no pages into their names."""
    above = "../" * (docname.count("/") + 1)
    text = re.sub(rf"\[([^\]]+)\]\({re.escape(above)}[^)]+\)", r"\1", source[0])
    if docname == "index":
        text += toctree([*re.findall(r"\]\(([\w/-]+)\.md\)", text), "api/index"], "Pages")
    elif docname == "api/index":
        text = text.replace("<!-- public names -->", "\n".join(public_names()))
        text += toctree([f"rooms/{room.replace('/', '.')}" for room in ROOMS], "Rooms")
    source[0] = text


def imported(name: str) -> object | None:
    """What a full name means, None if nothing."""
    with contextlib.suppress(ImportError, AttributeError, ValueError):
        return pkgutil.resolve_name(name)
    return None


def link_as_python_does(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, contnode: Element
) -> Element | None:
    """Link a name as it is written where it stands: imported, renamed, or of the module itself.

    A name that means something but has no entry, as those of other projects, stays plain text;
    one that means nothing is left to the warning.
    """
    if node.get("refdomain") != "py":
        return None
    target = node["reftarget"]
    module, owner = node.get("py:module"), node.get("py:class")
    names = [target, f"{module}.{target}", f"{module}.{owner}.{target}", f"builtins.{target}"]
    thing = next((found for name in names if (found := imported(name)) is not None), None)
    python = env.domains.python_domain
    home = f"{getattr(thing, '__module__', '')}.{getattr(thing, '__qualname__', '')}"
    home = next((name for name in names if name in python.objects), home)
    if thing is None:  # imported in annotations only
        homes = [name for name in python.objects if name.rpartition(".")[2] == target]
        home = homes[0] if len(homes) == 1 else ""
    if home in python.objects:
        return python.resolve_xref(env, node["refdoc"], app.builder, "obj", home, node, contnode)
    return contnode if thing is not None else None


def no_signature(app: Sphinx, what: str, *_: object) -> tuple[None, None] | None:
    """Leave out the call of a type alias; numpydoc would look for it in the docstring."""
    return (None, None) if what in ("data", "attribute", "type") else None


def setup(app: Sphinx) -> None:
    """Connect what is above."""
    app.connect("autodoc-process-signature", no_signature, priority=400)
    app.connect("builder-inited", write_rooms)
    app.connect("source-read", read_source)
    app.connect("missing-reference", link_as_python_does)
