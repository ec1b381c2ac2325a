# SPDX-License-Identifier: GPL-3.0-or-later
"""The page in a real Chromium, opened from a file: what it shows is what the planner says."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

import coordlang as door
from coordlang.execution.task_language import language_in_task
from coordlang.language.sentences import sentence
from coordlang.report.page import LARGEST, make_report
from planners.pddl import parse_domain, parse_problem
from planners.pddl.lifted import And
from planners.pddl.sexpr import Source
from planners.search.plans import Plans
from tests.coordlang.report.conftest import (
    Opener,
    World,
    listed_plans,
    make_language,
    make_world,
    refuted,
)
from tests.support import slow, thorough
from tests.support.domains import T_MAP, files_of, read

if TYPE_CHECKING:
    from playwright.sync_api import Page

WORLDS = [
    ("t-map", "problem", "all"),
    ("three-cells", "problem", "all"),
    ("lock", "both-in", "all"),
    ("handover", "two-doors", "all"),
    ("vans", "two-vans", "all"),
    ("elevator", "two-calls", "all"),
    ("grid", "three-robots-3x3", None),
]


def at(key: str, predicate: str = "at") -> dict[str, str]:
    """``(at r1 a) (at r2 b)`` -> r1: a, r2: b."""
    atoms = [atom.strip("()").split() for atom in key.split(") (")]
    return {atom[1]: atom[2] for atom in atoms if atom[0] == predicate}


#: Languages of many states.
LARGE = [
    ("corridor", "problem", "all"),
    ("grid", "gwb7-3x5", "gwb7-3x5.tasks.json"),
    ("grid", "corners-10x10", None),
]


@pytest.mark.parametrize(
    ("domain", "problem", "tasks"), [WORLDS[0], *thorough(*WORLDS[1:]), *slow(*LARGE)]
)
def test_every_page_plays(open_page: Opener, domain: str, problem: str, tasks: str | None) -> None:
    """Every task of the page, at its end and in each robot's place; in the end nothing was logged."""
    world = make_world(domain, problem, tasks)
    assert len(world.report.html) <= LARGEST
    opened = open_page(world.report.html)
    seen = opened.page.evaluate(
        """() => DATA.tasks.map((task, number) => {
          const byId = id => document.getElementById(id), forward = () => document.querySelector('#transport .forward').click();
          openTask(number);
          for (let k = 0; k < task.steps; k++) forward();
          const ends = [byId('now').textContent], output = document.querySelector('#transport output').textContent;
          const without = !byId('without-player').hidden;
          DATA.robots.forEach((_, robot) => {
            document.querySelector(`[data-mode='${robot}']`).click();
            for (let k = 0; k < task.steps + 2; k++) forward();
            ends.push(byId('now').textContent);
          });
          return [output, without, ends];
        })"""
    )
    for task, (output, without, ends) in zip(world.data["tasks"], seen, strict=True):
        assert output == f"step {task['steps']} of {task['steps']}"
        assert without == task["requires"]
        assert len(ends) == 1 + len(world.data["robots"])
        assert all("goal is reached" in end for end in ends)


@pytest.mark.thorough
def test_all_plans_through_the_interface_of_the_page(open_page: Opener) -> None:
    """The page's own counts and ranks, over all sentences of all tasks: none missing or twice."""
    for domain, problem, tasks in WORLDS:
        opened = open_page(make_world(domain, problem, tasks).report.html)
        found = opened.page.evaluate(
            """() => DATA.tasks.map(task => {
              const wordOf = node => DATA.state_words[task.nodes.state[node]];
              const all = new Fits(task, wordOf, null);
              const ranked = new Set();
              for (const s of task.sentences) {
                const fits = new Fits(task, wordOf, s.words);
                if (String(fits.total) !== s.plans) return `${s.words}: ${fits.total} of ${s.plans}`;
                for (let k = 0n; k < fits.total; k++) {
                  const edges = fits.unrank(k);
                  if (fits.rank(edges) !== k) return `rank ${k}`;
                  ranked.add(String(all.rank(edges)));
                }
              }
              const whole = task.sentences.length === task.all_sentences;
              return (whole ? BigInt(ranked.size) === all.total : ranked.size > 200) && String(all.total) === task.plans;
            })"""
        )
        assert set(found) == {True}


@pytest.mark.thorough
def test_a_robots_options_are_its_own_subplans(open_page: Opener) -> None:
    """What the page lets a robot do at a step: its part in each plan with the sentence."""
    world = make_world("grid", "three-robots-3x3", None)
    spoken = language_in_task(world.language, world.domain, world.problem)
    opened = open_page(world.report.html)
    ways = opened.page.evaluate(
        """() => { const task = DATA.tasks[0], wordOf = node => DATA.state_words[task.nodes.state[node]];
          return task.sentences.slice(0, 10).map(s => { const fits = new Fits(task, wordOf, s.words);
            return DATA.robots.map((_, robot) => { const found = [];
              const walk = (nodes, done) => { const own = fits.options(robot, nodes);
                if (!own.size) found.push(done.map(label => DATA.labels[robot][label].text));
                for (const [label, next] of own) walk(next, [...done, label]); };
              walk(new Set([0]), []); return found; }); }); }"""
    )
    for entry, robots in zip(world.data["tasks"][0]["sentences"], ways, strict=False):
        plans = [
            [spoken.model.texts(step) for step in plan]
            for plan in Plans.of(spoken.plans_with(entry["words"]))
        ]
        for robot, found in enumerate(robots):
            expected = {tuple(step[robot] or "idle" for step in plan) for plan in plans}
            assert sorted(map(tuple, found)) == sorted(expected)


def test_events_are_no_steps(open_page: Opener) -> None:
    """Without a common step the timetable numbers steps with words, and events with robots."""
    built = door.build(*files_of("t-map"), asynchronous=True, method="greedy")
    domain, problem = read("t-map")
    opened = open_page(make_report(built.language, domain, [problem]).html)
    opened.forward()
    assert opened.page.inner_text("#timeline tr:nth-child(2) th") == "event"
    assert opened.page.inner_text("#now").startswith("events 1: r1: ")


@pytest.mark.thorough
def test_choosing_for_a_robot(open_page: Opener) -> None:
    """Every mixture of the robots' choices is optimal; with all plans open some mixture breaks."""
    page = open_page(make_world("grid", "three-robots-3x3", None).report.html).page
    page.click("[data-mode='0']")
    assert page.evaluate("taskView.sentence") >= 0  # being a robot needs a sentence: one was chosen
    for step in range(4):
        labels = [b.get_attribute("title") for b in page.query_selector_all("#choices button")]
        page.keyboard.press(str(len(labels)))  # keys choose, too
        assert page.evaluate(f"DATA.labels[0][taskView.steps[{step}][0]].text") == labels[-1]
    assert all("on an optimal plan" in text for text in endings(page, 25))
    language, domain, problem = make_language("t-map", "problem")
    page = open_page(make_report(refuted(language), domain, [problem], tasks_shown=1).html).page
    assert "no coordination language" in page.inner_text("#task-warning")
    assert "do not mix" in page.inner_text("#without-note")
    assert "; not all of them mix" in page.inner_text("#sentence-list")
    other = "ownText({...DATA.tasks[0].sentences[0], words: [1]}, DATA.tasks[0])"
    assert ";" not in page.evaluate(other)  # of this one nothing is known
    page.click("[data-mode='0']")
    said = endings(page, 12)
    assert any("not part of any optimal plan" in text for text in said)
    assert any("on an optimal plan" in text for text in said)


def endings(page: Page, number: int) -> set[str]:
    """What is said in the end if the others choose again and again."""
    said = set()
    for _ in range(number):
        page.dispatch_event("#transport .plan-nav button", "click")
        for _ in range(4):
            page.dispatch_event("#transport .forward", "click")
        said.add(page.inner_text("#now").rsplit(". ", 1)[-1])
    return said


@pytest.mark.thorough
def test_keys(open_page: Opener) -> None:
    world = make_world("grid", "three-robots-3x3", None)
    opened = open_page(world.report.html)
    page = opened.page
    output = "#transport output"
    right, left = "ArrowRight", "ArrowLeft"
    keys = [(right, 1), (right, 2), (left, 1), ("End", 4), (right, 4), ("Home", 0), (left, 0)]
    for key, step in keys:
        page.keyboard.press(key)  # nothing is focused: the task's player listens
        assert page.inner_text(output) == f"step {step} of 4"
    page.keyboard.press("Space")
    assert page.get_attribute("#transport .play", "aria-label") == "Pause"
    page.wait_for_selector("#transport output:has-text('step 4 of 4')")
    page.wait_for_selector("#transport .play[aria-label='Play']")
    page.focus("[data-sentence='-1']")
    page.keyboard.press("ArrowDown")
    assert page.get_attribute("[data-sentence='0']", "aria-checked") == "true"
    page.focus("#atlas-picture svg")
    page.keyboard.press("ArrowRight")
    assert page.inner_text("#atlas-readout")
    # Everything that can be done can be reached by Tab, and has a name.
    nameless = page.evaluate(
        """() => [...document.querySelectorAll('button, select, input, [role=img], [role=region]')].filter(e =>
          !e.textContent.trim() && !e.getAttribute('aria-label') && !e.labels?.length).map(e => e.outerHTML)"""
    )
    assert nameless == []
    seen = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        seen.add(page.evaluate("document.activeElement.closest('[id]')?.id"))
    assert seen >= {"task-select", "modes", "transport", "sentence-list", "timeline", "space"}
    assert "without-transport" in seen


def test_a_sentence_highlights_what_remains(open_page: Opener) -> None:
    world = make_world("grid", "three-robots-3x3", None)
    opened = open_page(world.report.html)
    for number in (-1, 0, 5, 11):
        opened.page.click(f"[data-sentence='{number}']")
        bright = opened.page.evaluate(
            "[...document.querySelectorAll('#space .n:not(.off)')].map(e => +e.dataset.node).sort((a, b) => a - b)"
        )
        assert bright == sorted(remaining(world, number))


def remaining(world: World, number: int) -> set[int]:
    """Nodes of the page's graph on plans with a sentence: all ways listed."""
    data, task = world.data, world.data["tasks"][0]
    found: set[int] = set()
    for _, nodes in listed_plans(task):
        said = sentence(data["state_words"][task["nodes"]["state"][n]] for n in nodes)
        if number < 0 or said == tuple(task["sentences"][number]["words"]):
            found.update(nodes)
    return found


@pytest.mark.thorough
def test_the_picture_of_the_words(open_page: Opener) -> None:
    """Every state of the language once, with its word; one word on demand; and the map's tint."""
    world = make_world("t-map", "problem")
    page = open_page(world.report.html).page
    for view in (1, 2):
        page.click(f"#atlas-tabs button:nth-child({view})")
        shown = page.evaluate(
            "[...document.querySelectorAll('#atlas .state')].map(e => e.querySelector('title').textContent)"
        )
        expected = sorted(
            f"{word}: " + ", ".join(f"{r} at {p}" for r, p in sorted(at(key).items()))
            for key, word in world.language.states.items()
        )
        assert sorted(shown) == expected
    page.click(".word-row[data-word='1']")
    on = page.evaluate("document.querySelectorAll('#atlas .state:not(.off)').length")
    assert on == world.language.sizes()["w1"]
    page.select_option("#tint", "0")
    row = page.evaluate("told(taskView.states[0])")
    other = row.split(", ")[1].split(" at ")[1]
    tinted = page.evaluate(
        "Object.fromEntries(taskView.scene.places.map(({ tint }, k) => [DATA.places[k].name, tint.textContent]).filter(e => e[1]))"
    )
    assert tinted == {
        at(key)["r1"]: word[1:]
        for key, word in world.language.states.items()
        if at(key)["r2"] == other
    }


@pytest.mark.parametrize(
    ("domain", "problem", "tasks"), [WORLDS[0], WORLDS[2], *thorough(WORLDS[3])]
)
def test_the_miscoordination(
    open_page: Opener, domain: str, problem: str, tasks: str | None
) -> None:
    """Played to its end: each robot's plan and what they do together, as the witness has them."""
    world = make_world(domain, problem, tasks)
    opened = open_page(world.report.html)
    witness = world.data["tasks"][0]["witness"]
    for _ in range(witness["breaks"]):
        opened.page.click("#without-transport .forward")
    assert opened.page.inner_text("#verdict") in ("So far, so good.", "")
    for robot, states in enumerate([*witness["states"], witness["together"]]):
        shown = opened.things(f"#acts .act:nth-child({robot + 1})")
        keys = [
            world.data["facts"][f]["text"] for f in world.data["states"][states[witness["breaks"]]]
        ]
        expected = at(" ".join(keys)) | at(" ".join(keys), "lies")
        assert {thing: shown[thing] for thing in expected} == expected
    opened.page.click("#without-transport .forward")
    assert witness["reason"] in opened.page.inner_text("#verdict")
    assert "bad" in (opened.page.get_attribute("#verdict", "class") or "")


def test_a_place_is_chosen_on_the_floor_plan(
    open_page: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the list, by a click, by an arrow key: each other place shows the word of its state."""
    monkeypatch.setattr("coordlang.report.plan._MOST_CELLS", 0)
    language, domain, problem = make_language("t-map", "problem")
    html = make_report(language, domain, [problem], tasks_shown=1).html
    page = open_page(html).page
    words: dict[str, dict[str, str]] = {}
    for key, word in language.states.items():
        where = at(key)
        words.setdefault(where["r1"], {})[where["r2"]] = word.removeprefix("w")
    script = """() => Object.fromEntries([...document.querySelectorAll('#atlas .spot')]
      .map(e => [DATA.places[+e.dataset.place].name, e.querySelector('text').textContent]).filter(e => e[1]))"""
    start = max(words)
    plain = open_page(html, java_script_enabled=False).page
    shown = plain.eval_on_selector_all("#atlas .spot text", "all => all.map(e => e.textContent)")
    here = next(a.args[1] for a in problem.init if (a.predicate, a.args[0]) == ("at", "r1"))
    assert sorted(filter(None, shown)) == sorted(f"w{word}" for word in words[here].values())
    for number, place in enumerate(sorted(words)):
        page.select_option("#plan-place", label=place)
        assert page.evaluate(script) == words[place]
        page.select_option("#plan-place", label=start)
        page.dispatch_event(f"#atlas .spot[data-place='{number}']", "click")
        assert page.evaluate(script) == words[place]
    page.select_option("#plan-place", label="c1-0")
    page.focus("#atlas svg.plan")
    page.keyboard.press("ArrowRight")
    assert page.evaluate(script) == words["c1-1"]
    page.keyboard.press("ArrowUp")
    assert page.evaluate(script) == words["c0-1"]
    page.click(".word-row[data-word='1']")
    script = "document.querySelectorAll('#atlas .spot:not(.off) text:not(:empty)').length"
    assert page.evaluate(script) == list(words["c0-1"].values()).count("1")
    assert page.is_visible("#heat svg.plan")


@pytest.mark.thorough
def test_odd_languages_and_tasks(open_page: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    """No map, facts that look remembered; no state mapped; a task done before it begins."""
    language, domain, problem = make_language("t-map", "problem")
    bare = replace(language, states={})
    done = replace(problem, goal=And(tuple(a for a in problem.init if a.predicate == "at")))
    texts = [path.read_text().replace("(at ", "(last ") for path in T_MAP]
    named = parse_domain(Source("domain", texts[0]))
    asked = parse_problem(Source("problem", texts[1]), named)
    last = door.build(named, asked, method="greedy").language, named, asked
    for spoken, own, asked in [last, (bare, domain, problem), (language, domain, done)]:
        monkeypatch.setattr("coordlang.report.page.MOST_PLACES", 1)
        opened = open_page(make_report(spoken, own, [asked], tasks_shown=1).html)
        assert not opened.page.is_visible("#stage")
        for mode in (-1, 0, 1):
            opened.page.click(f"[data-mode='{mode}']")
            opened.forward(5)
            assert opened.page.inner_text("#timeline")
        assert opened.page.is_visible("#facts li") == (asked is not done)
