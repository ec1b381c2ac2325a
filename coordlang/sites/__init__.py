# SPDX-License-Identifier: GPL-3.0-or-later
"""Places and their coordinates: maps of others, and the domains that come along."""

from __future__ import annotations

import re
from pathlib import Path

from planners.system.errors import UsageError

#: The folder of the domains in an installed package; a checkout has them beside the packages.
_INSTALLED = "shipped_domains"


def shipped_domains() -> Path:
    """Return the folder of the shipped domains; `UsageError` if it was not installed."""
    package = Path(__file__).resolve().parents[1]
    for place in (package / _INSTALLED, package.parent / "domains"):
        if (place / "grid" / "domain.pddl").is_file():
            return place
    remedy = "Install coordlang again, or take the folder domains of its repository."
    raise UsageError(f"the shipped domains are missing: {package / _INSTALLED}", remedy=remedy)


def about(folder: Path) -> str:
    """Return the first sentence of a domain's README."""
    paragraphs = (folder / "README.md").read_text(encoding="utf-8").split("\n\n")
    words = next(text for text in paragraphs[1:] if text[:1].isalpha()).split()
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", " ".join(words))  # links are of Markdown
    return text.partition(". ")[0].rstrip(".") + "."
