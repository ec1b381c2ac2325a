# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the list of rooms and files in docs/extending.md from the opening lines of the modules.

``python docs/generate_extending.py`` writes the part of the page between the two marks;
``--check`` exits with 1 if that would change the page.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "extending.md"
BEGIN = "<!-- the files, by docs/generate_extending.py -->\n"
END = "<!-- end of the files -->\n"

#: The rooms in the order in which data flows, from PDDL text to the command line.
ROOMS = (
    "planners",
    "planners/pieces",
    "planners/pddl",
    "planners/grounding",
    "planners/joint",
    "planners/search",
    "planners/cache",
    "planners/check",
    "planners/classical",
    "coordlang",
    "coordlang/tasks",
    "coordlang/places",
    "coordlang/symmetry",
    "coordlang/required",
    "coordlang/tolerance",
    "coordlang/vocabulary",
    "coordlang/language",
    "coordlang/verification",
    "coordlang/certificate",
    "coordlang/lifted",
    "coordlang/use",
    "coordlang/use/sentence",
    "coordlang/use/choices",
    "coordlang/use/export",
    "coordlang/use/simulation",
    "coordlang/use/unified",
    "coordlang/explanation",
    "coordlang/report",
    "coordlang/evaluation",
    "coordlang/evaluation/experiments",
    "coordlang/evaluation/lab",
    "coordlang/evaluation/material",
    "coordlang/api",
    "coordlang/cli",
)


def undeclared(root: Path) -> list[str]:
    """Folders with modules that `ROOMS` does not have, and rooms that are no such folder."""
    real = {
        path.parent.relative_to(root).as_posix()
        for package in ("planners", "coordlang")
        for path in (root / package).rglob("*.py")
    }
    return sorted(real ^ set(ROOMS))


def opening(path: Path) -> str:
    """The first line of a module's docstring, as Markdown."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    if text is None:
        raise SystemExit(f"{path.relative_to(ROOT)}: a module begins with a docstring")
    return text.split("\n", 1)[0].replace("``", "`").replace("|", "\\|")


def imported(path: Path, package: str) -> Iterator[str]:
    """The modules of its own room that a module imports when it is imported."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            if node.module == package:
                yield from (alias.name for alias in node.names)
            elif node.module.startswith(package + "."):
                yield node.module[len(package) + 1 :].split(".")[0]


def in_order(room: Path) -> list[Path]:
    """The modules of a room, each one after those of the room that it imports."""
    package = ".".join(room.relative_to(ROOT).parts)
    files = {path.stem: path for path in sorted(room.glob("*.py")) if path.stem != "__init__"}
    sorter = TopologicalSorter(
        {name: sorted({*imported(path, package)} & {*files}) for name, path in files.items()}
    )
    return [files[name] for name in sorter.static_order()]


def listing() -> str:
    """A section for each room: its own first line, and a table of its files."""
    if wrong := undeclared(ROOT):
        raise SystemExit(f"ROOMS in docs/generate_extending.py and the folders differ: {wrong}")
    lines = []
    for name in ROOMS:
        room = ROOT / name
        lines += [f"### {name}", "", opening(room / "__init__.py"), ""]
        if files := in_order(room):
            lines += ["| file | what it is |", "|---|---|"]
            lines += [f"| `{path.name}` | {opening(path)} |" for path in files]
            lines += [""]
    return "".join(f"{line}\n" for line in lines)


def main(check: bool) -> int:
    """Write the page, or with ``check`` only say whether it is as it would be written."""
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    after = rest.split(END)[1]
    written = f"{before}{BEGIN}\n{listing()}{END}{after}"
    if check and written != page:
        sys.stderr.write("docs/extending.md is stale: run python docs/generate_extending.py\n")
        return 1
    if not check:
        PAGE.write_text(written, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
