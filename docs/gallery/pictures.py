# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of docs/gallery.md: maps of words, taken out of the pages of ``coordlang report``.

``python docs/gallery/pictures.py`` runs the builds that the gallery shows, has Chromium open the
report of each language, and writes its first picture beside this file.  Run it from the root.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SVG = "http://www.w3.org/2000/svg"
#: Rules of coordlang/report/page.css that the picture needs, by how they begin.
NEEDED = (".c0 ", ".c5 ", ".w ", ".w-name", ".unmapped", ".state-link", ".outer")
#: What these rules take from the page, in light and in dark.
NAMES = ("paper", "ink", "soft", "line", "strong", "floor", "word-ink")


def run(*command: str, folder: str) -> str:
    """What a program prints."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout


def style() -> str:
    """The rules of the report's page for the shapes of its maps."""
    css = (ROOT / "coordlang" / "report" / "page.css").read_text(encoding="utf-8")
    colours = [
        "; ".join(f"--{name}: {value}" for name, value in re.findall(r"--([\w-]+): ([^;]+);", block)
                  if name in NAMES)
        for block in re.findall(r":root \{(.*?)\n *\}", css, re.DOTALL)[:2]
    ]  # fmt: skip
    rules = [line for line in css.splitlines() if line.startswith(NEEDED)]
    dark = f"@media (prefers-color-scheme: dark) {{ svg {{ {colours[1]} }} }}"
    font = "text { font-family: Helvetica, Arial, sans-serif }"
    return "\n".join([f"svg {{ {colours[0]}; background: var(--paper) }}", dark, font, *rules])


def picture(page: str) -> str:
    """The map of words of a report's page, as a file of its own."""
    found = re.search(r'id="atlas-picture"[^>]*>(<svg.*?</svg>)', page, re.DOTALL)
    assert found is not None, "the page has no map of words"
    ET.register_namespace("", SVG)
    root = ET.fromstring(found[1].replace("<svg", f'<svg xmlns="{SVG}"', 1))
    for element in [root, *root.iter()]:
        for name in ("tabindex", "style", "data-state"):
            element.attrib.pop(name, None)
        for title in element.findall(f"{{{SVG}}}title"):
            element.remove(title)
    width, height = map(float, root.attrib["viewBox"].split()[2:])
    scale = 420 / max(width, height)
    root.set("width", f"{width * scale:.0f}")
    root.set("height", f"{height * scale:.0f}")
    root.insert(0, ET.Element(f"{{{SVG}}}style"))
    root[0].text = style()
    text = ET.tostring(root, encoding="unicode")
    return re.sub(r"\d+\.\d{2,}", lambda number: f"{float(number[0]):.1f}", text) + "\n"


def main() -> None:
    """Write the pictures."""
    page = (HERE.parent / "gallery.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "domains").symlink_to(ROOT / "domains")
        for line in re.findall(r"^\$ (coordlang build .*)$", page, re.MULTILINE):
            command = shlex.split(line)
            domain, problem, language = *command[2:4], command[-1]
            coordlang = [sys.executable, "-m", "coordlang"]
            run(*coordlang, *command[1:], folder=folder)
            run(*coordlang, "report", language, domain, problem, "-o", "page.html", folder=folder)
            chromium = ("chromium", "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom")
            dom = run(*chromium, f"file://{folder}/page.html", folder=folder)
            path = HERE / Path(language).with_suffix(".svg").name
            path.write_text(picture(dom), encoding="utf-8")
            print(path.name, path.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
