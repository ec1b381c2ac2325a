# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages of shipped domains, each built once, and a real Chromium to open them in."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import from_listed
from coordlang.language.listed import read_task_file
from coordlang.language.words import Language
from coordlang.report.page import Report, make_report
from planners.pddl.lifted import Domain, Problem
from tests.support.domains import DOMAINS, own_task, read
from tests.support.task_languages import built_for

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

CHROMIUM = Path("/usr/bin/chromium")
ARGUMENTS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]


@dataclass(frozen=True)
class World:
    """A language with its files, and its report."""

    language: Language
    domain: Domain
    problem: Problem
    report: Report

    @property
    def data(self) -> dict[str, Any]:
        return data_of(self.report.html)


def data_of(html: bytes) -> dict[str, Any]:
    """The data inside a page."""
    found = re.search(rb'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def listed_plans(task: dict[str, Any]) -> list[tuple[list[int], list[int]]]:
    """All ways through the graph of the page: (edges, nodes)."""
    found = []
    todo: list[tuple[list[int], list[int]]] = [([], [0])]
    while todo:
        edges, nodes = todo.pop()
        if len(edges) == task["steps"]:
            found.append((edges, nodes))
        first = task["first"]
        todo += [
            ([*edges, e], [*nodes, task["target"][e]])
            for e in range(first[nodes[-1]], first[nodes[-1] + 1])
        ]
    return found


@cache
def make_language(
    domain: str, problem: str, tasks: str | None = "all"
) -> tuple[Language, Domain, Problem]:
    lifted, read_problem = read(domain, problem)
    if tasks == "all":
        return built_for(domain, problem, "greedy").language, lifted, read_problem
    candidates = (
        from_listed(lifted, [read_problem], read_task_file(DOMAINS / domain / tasks))
        if tasks
        else own_task(domain, problem)
    )
    return build_language(candidates, "greedy").language, lifted, read_problem


@cache
def make_world(domain: str, problem: str, tasks: str | None = "all") -> World:
    language, lifted, asked = make_language(domain, problem, tasks)
    return World(language, lifted, asked, make_report(language, lifted, [asked], tasks_shown=6))


def refuted(language: Language) -> Language:
    """A language file that is none: all states in one word."""
    return replace(language, states=dict.fromkeys(language.states, language.words[0]))


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: the page is not opened"
    )
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM}: the page is not opened")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        yield browser
        browser.close()


@dataclass
class Opened:
    """An open page with what it logged and asked the network for."""

    page: Page
    messages: list[str]
    requests: list[str]

    def things(self, stage: str = "#stage") -> dict[str, str]:
        """Where the map shows each thing: name -> place."""
        found: dict[str, str] = self.page.evaluate(
            """stage => Object.fromEntries([...document.querySelectorAll(`${stage} .token`)]
               .filter(t => t.style.display !== 'none').map(t => [t.dataset.thing, t.dataset.place]))""",
            stage,
        )
        return found

    def forward(self, steps: int = 1) -> None:
        self.page.evaluate(
            "n => { while (n--) document.querySelector('#transport .forward').click(); }", steps
        )


class Opener:
    def __init__(self, browser: Browser, folder: Path) -> None:
        self.browser = browser
        self.folder = folder
        self.pages: list[Opened] = []

    def __call__(self, html: bytes, **context: Any) -> Opened:
        path = self.folder / f"{len(self.pages)}.html"
        path.write_bytes(html)
        size = {"width": 1200, "height": 900}
        page = self.browser.new_context(viewport=size, **context).new_page()  # type: ignore[arg-type]
        opened = Opened(page, [], [])
        page.on("console", lambda message: opened.messages.append(message.text))
        page.on("pageerror", lambda error: opened.messages.append(str(error)))
        page.on("request", lambda request: opened.requests.append(request.url))
        page.goto(path.as_uri())
        self.pages.append(opened)
        return opened


@pytest.fixture
def open_page(browser: Browser, tmp_path: Path) -> Iterator[Opener]:
    """Opens pages from files; none may log anything or ask for anything but its own file."""
    opener = Opener(browser, tmp_path)
    yield opener
    for opened in opener.pages:
        assert opened.messages == []
        assert [url for url in opened.requests if not url.startswith("file:")] == []
        assert len(opened.requests) >= 1  # the listener works: the page itself was seen
        opened.page.context.close()
