# SPDX-License-Identifier: GPL-3.0-or-later
"""The monitor in a robot that runs for days: constant time and memory; no file breaks it."""

from __future__ import annotations

import copy
import gc
import gzip
import json
import pickle
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from coordlang.execution import monitor as monitor_module
from coordlang.execution.monitor import EventMonitor, Monitor, MonitorError, NotAllowed, NotPossible
from tests.fuzz.mutations import places


def choices_file(length: int = 3, cells: int = 4) -> dict[str, Any]:
    """A robot's choices: around a ring, with one wait; states 2k - 1, 2k: it has waited, or not."""
    states: list[dict[str, Any]] = []
    for step, waited in [(0, 0), *((step, it) for step in range(1, length + 1) for it in (1, 0))]:
        cell, following = (step - waited) % cells, {}
        if step < length:
            following[f"(move r1 c{cell} c{(cell + 1) % cells})"] = 2 * step + 2 - waited
            if not waited:
                following["idle"] = 2 * step + 1
        left = 1 if waited else length - step + 1
        states.append({"step": step, "left": left, "next": following, "true": [cell]})
        states[-1]["unknown"] = []
    facts = [f"(at r1 c{cell})" for cell in range(cells)]
    entry = {"robot": "r1", "steps": length, "subplans": length + 1, "atoms": "own"}
    entry |= {"facts": facts, "others": ["(at r2 c0)"], "states": states}
    head = {"format": "coordlang/choices", "version": 1, "robots": ["r1", "r2"], "sentence": "w0"}
    return {**head, "choices": [entry]}


def events_file() -> dict[str, Any]:
    """The same of a robot that keeps no common step: each move waits for r2, and meets r3."""
    data = choices_file()
    (entry,) = data["choices"]
    moves = sorted({text for state in entry["states"] for text in state["next"]} - {"idle"})
    event = {"after": {"r2": 1}, "with": {"r3": "(help r3)"}}
    entry["passings"] = {
        "events": {text: {"subaction": text, **event} for text in moves},
        "interferes": {text: {"r2": ["(go r2)"], "r3": []} for text in moves},
        "others": {"r2": [{"(go r2)": 0}], "r3": [{"(help r3)": 1}]},
    }
    return data


def message(call: Callable[[], object]) -> str | None:
    """What a `MonitorError` says, in one short and harmless line; None without an error."""
    try:
        call()
    except MonitorError as error:
        text = str(error)
    else:
        return None
    assert len(text) < 3_000
    assert text.isprintable()
    return text


def one_step(at: Monitor) -> None:
    at.known("(at r1 c1)")
    at.did(at.allowed()[-1])


def carried(program: str, folder: Path, file: bytes) -> str:
    """What a program prints that has the folder of monitor.py and a choices file in sys.argv[1]."""
    (folder / "monitor.py").write_bytes(Path(monitor_module.__file__).read_bytes())
    (folder / "choices.json").write_bytes(file)
    program = f"import sys\nsys.path.insert(0, sys.argv[1])\n{program}"
    command = [sys.executable, "-I", "-S", "-c", program, str(folder)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


# ---- days in a robot


def test_steps_take_constant_memory_and_wake_no_garbage_collector() -> None:
    """What a step allocates at most, even for a moment, does not depend on the steps before."""
    length, grown = 3_000, []
    long = Monitor(choices_file(length, 50))
    at = long.copy()
    at.commit(do="idle")
    gc.collect()
    while not at.finished:
        one_step(at)
    new, *collections = gc.get_count()
    assert (new < 700, collections) == (True, [0, 0])  # 700 wake it if nothing else is said
    tracemalloc.start()
    try:
        begin, _ = tracemalloc.get_traced_memory()
        for _ in range(2):
            at, peaks = long.copy(), [0] * 10  # the peak of each tenth
            for step in range(length):
                now, _ = tracemalloc.get_traced_memory()
                tracemalloc.reset_peak()
                one_step(at)
                at.copy()
                peak = tracemalloc.get_traced_memory()[1] - now
                peaks[10 * step // length] = max(peak, peaks[10 * step // length])
            assert at.finished
            assert peaks[-1] <= peaks[0] <= max(peaks) < 8_192
            grown.append(tracemalloc.get_traced_memory()[0] - begin)
    finally:
        tracemalloc.stop()
    assert max(grown) < 20_000


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda at: pickle.loads(pickle.dumps(at))])
def test_a_monitor_of_many_steps_goes_to_another_process(
    copied: Callable[[Monitor], Monitor],
) -> None:
    at = Monitor(choices_file(2000))
    one_step(at)
    at.commit(visit="(at r1 c3)")
    other = copied(at)
    for _ in range(20):
        now = (at.step, at.remaining, at.allowed(), at.known("(at r1 c3)"))
        assert now == (other.step, other.remaining, other.allowed(), other.known("(at r1 c3)"))
        one_step(at)
        one_step(other)


def test_the_loop_opens_and_imports_nothing(tmp_path: Path) -> None:
    """The interpreter reports every file, import and compilation to an audit hook."""
    program = """
from monitor import Monitor, NotAllowed
at = Monitor.read(sys.argv[1] + "/choices.json")
seen = []
sys.addaudithook(lambda event, arguments: seen.append(event))
at.commit(do="(move r1 c1 *)", never="(move r9 *)")
other = at.copy()
while not at.finished:
    at.can(visit="(at r1 c3)") if at.step < 3 else None
    at.known("( AT r1 C1 )")
    at.did(at.allowed()[-1])
    other.did(other.allowed()[0])
    at.remaining, at.step
    try:
        at.did("(fly r1)")
    except NotAllowed:
        pass
assert at.step == other.step == 600
print(*sorted(set(seen)))
"""
    heard = carried(program, tmp_path, json.dumps(choices_file(600)).encode())
    assert not {"open", "import", "compile", "exec"} & set(heard.split())


# ---- files

GONE = object()
#: A place (of the choices of r1, or below "/" of the file), what stands there, and what is said.
MALFORMED: list[tuple[str, Any, str]] = [
    ("/choices", GONE, "'choices' is missing"),
    ("atoms", GONE, "'atoms' is missing"),
    ("states 4 unknown", GONE, "state 4: 'unknown' is missing"),
    ("states", {"0": {}}, "'states' is a dict, not a list"),
    ("states 0 step", 0.0, "'step' is 0.0, not a whole number"),
    ("states 3 next", {"idle": 1}, "state 3 does not lead"),
    ("states 0 next idle", 3, "state 0 does not lead"),
    ("states 0 next", {"idle": 1}, "says 4 subplans are left, but there are 1"),
    ("states 5 next", {"x": 6}, "state 5 does not lead|has x in"),
    ("states 0 next (Fly R1)", 1, r"state 0: 'next' has \(Fly R1\) in place"),
    ("states 3 next", {}, "3 ends after|state 5 cannot be reached"),
    ("states 1 left", 2, "state 1 says 2 subplans are left, but th"),
    ("states 1 left", "9" * 10**6, r"state 1 says 9+\.\. \(1,000,"),
    ("states 1 left", "¹", "state 1 says ¹"),
    ("states 0 true", [50], "'true' has 50; facts are numbers below"),
    ("states 0 unknown", [0], "fact 0 is true and unknown"),
    ("others", ["(at r1 c0)"], "an atom occurs twice"),
    ("atoms", "all", "'atoms' is all, not exact or own"),
    ("robot", "r1\x1b[2J", r"control characters: r1\\x1b\[2J"),
    ("steps", 4, "'steps' is 4, but the states have 3"),
    ("subplans", 5, "says 5 subplans are left, but there are 4"),
    ("facts 3", "(at \ud800)", r"has \(at \\ud800\) in place"),
    ("/choices", 2 * choices_file()["choices"], "choices of r1 twice"),
    ("/version", 1.0, r"version 1\.0; this program"),
]


@pytest.mark.parametrize(
    ("place", "value", "reason"), MALFORMED, ids=[f"{n} {m[0]}" for n, m in enumerate(MALFORMED)]
)
def test_malformed_data_is_refused_with_a_reason(place: str, value: Any, reason: str) -> None:
    data = choices_file()
    at: Any = data if place[0] == "/" else data["choices"][0]
    *path, key = place.strip("/").split(maxsplit=3)
    for step in path:
        at = at[int(step) if step.isdigit() else step]
    key = int(key) if key.isdigit() else key  # type: ignore[assignment]
    if value is GONE:
        del at[key]
    else:
        at[key] = value
    with pytest.raises(MonitorError, match=reason):
        Monitor(data, "r1")
    assert len(message(partial(Monitor, data, "r1")) or "") < 1_000


TEXT = json.dumps(choices_file()).encode()
DEEP = b"[" * 100_000


def step_is(text: bytes) -> bytes:
    return TEXT.replace(b'"step": 0', text, 1)


FILES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "this is no JSON, or it is cut off"),
    "cut off": (TEXT[:-30], "cut off"),
    "two values": (TEXT * 2, "Extra data"),
    "a list": (b"[]", "expected a choices file"),
    "not UTF-8": (TEXT.replace(b"w0", b"w\xe9"), "is no UTF-8"),
    "UTF-16": (TEXT.decode().encode("utf-16"), "byte 0 is no UTF-8"),
    "deep lists, cut off": (DEEP, "nested too deeply"),
    "deep in an ignored key": (
        TEXT[:-1] + b', "x": ' + DEEP + b"]" * len(DEEP) + b"}",
        "nested too deeply",
    ),
    "NaN": (step_is(b'"step": NaN'), "NaN is no number in JSON"),
    "1e999": (step_is(b'"step": 1e999'), "'step' is inf"),
    "huge number": (step_is(b'"step": ' + b"9" * 10**5), "this is no JSON"),
    "a key twice": (step_is(b'"step": 0, "step": 0'), "'step' occurs twice"),
    "gzip cut off": (gzip.compress(TEXT)[:-20], "cut off"),
    "gzip spoilt": (gzip.compress(TEXT)[:40] + b"\xff" * 40, "cut off"),
    "gzip in gzip": (gzip.compress(gzip.compress(TEXT)), "byte 1 is no UTF-8"),
    "a bomb": (gzip.compress(b" " * (1 << 20) + b"{}"), "more than 1,000,000 bytes"),
}


@pytest.mark.parametrize("name", [*FILES, "/dev/zero"])
def test_files_that_are_none(name: str, tmp_path: Path) -> None:
    content, reason = FILES.get(name, (b"", "more than 1,000,000 bytes"))
    path = Path(name) if name[0] == "/" else tmp_path / "choices.json"
    path.write_bytes(content)
    with pytest.raises(MonitorError, match=reason) as caught:
        Monitor.read(str(path), "r1", max_bytes=1_000_000)
    assert len(str(caught.value)) < 1000


def test_byte_order_mark_and_limit(tmp_path: Path) -> None:
    path, content = tmp_path / "choices.json", b"\xef\xbb\xbf" + TEXT
    for text in (content, gzip.compress(content)):
        path.write_bytes(text)
        assert Monitor.read(str(path), max_bytes=len(content)).remaining == 4
        with pytest.raises(MonitorError, match="max_bytes"):
            Monitor.read(str(path), max_bytes=len(content) - 1)


def test_a_file_that_does_not_fit_into_the_memory(tmp_path: Path) -> None:
    program = """
import resource
from monitor import Monitor, MonitorError
resource.setrlimit(resource.RLIMIT_AS, (128 << 20, 128 << 20))
try:
    Monitor.read(sys.argv[1] + "/choices.json")
except MonitorError as error:
    print(error)
"""
    said = carried(program, tmp_path, b"[" + b"[]," * 2_000_000 + b"[]]")
    assert said == f"{tmp_path}/choices.json: it does not fit into the memory\n"


def doubling(steps: int, left: Callable[[int], int | str]) -> dict[str, Any]:
    """Two moves in every state, to one next state: 2^steps subplans; ``left`` is what they say."""
    states = []
    for step in range(steps + 1):
        after = {"(a)": step + 1, "(b)": step + 1} if step < steps else {}
        known: dict[str, Any] = {"true": [], "unknown": []}
        states.append({"step": step, "left": left(steps - step), "next": after, **known})
    data = choices_file()
    data["choices"][0] |= {"steps": steps, "states": states, "subplans": left(steps)}
    return data


def test_large_counts() -> None:
    """More digits than Python reads; and a file that claims one subplan in each state, of 2^20000."""
    data = doubling(3_000, lambda more: str(1 << more))
    limit = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(640)
    try:
        assert Monitor(data).remaining == 1 << 3_000
        first = data["choices"][0]["states"][0]
        first["left"] = first["left"][:-1] + "9"
        with pytest.raises(MonitorError, match=r"but there are about 2\^3001$"):
            Monitor(data)
    finally:
        sys.set_int_max_str_digits(limit)
    data = doubling(20_000, lambda _: 1)
    tracemalloc.start()
    try:
        with pytest.raises(MonitorError, match="says 1 subplans are left, but there are 2"):
            Monitor(data)
        assert tracemalloc.get_traced_memory()[1] < 12_000_000  # no more than the file
    finally:
        tracemalloc.stop()


# ---- mutations

NASTY = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 60),
    st.sampled_from([2**31, 2**63, -(2**63), 10**400, 1.0, 0.5, float("inf"), float("nan")]),
    st.sampled_from(["", "idle", "(x)", "(at r1 c1)", "((x))", "\ud800", "\x1b[2J", "x" * 10_000]),
    st.recursive(st.integers(-1, 8), lambda inner: st.lists(inner, max_size=3), max_leaves=5),
    st.dictionaries(st.sampled_from(["idle", "(x)", "step", "next"]), st.integers(-1, 8)),
)


def refused_or_sound(make: Callable[[], Monitor]) -> None:
    """A `MonitorError`, or a monitor that can be walked, with counts that are right."""
    if message(make) is not None:
        return
    at, subplans = make(), 0
    open_ends = [at]
    while open_ends:
        here = open_ends.pop()
        subplans += not here.allowed()
        for text in here.allowed():
            open_ends.append(here.after(text))
            if isinstance(here, EventMonitor):
                assert here.missing(text) or text in here.may_start()
        for atom in ("(at r1 c0)", "(at r1 c1)", "(at r2 c0)"):
            said = message(partial(here.known, atom))
            assert said is None or "is no atom that can change" in said
    assert at.remaining == at.can().subplans == subplans


@pytest.mark.parametrize("kind", [Monitor, EventMonitor])
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.tuples(st.integers(0), st.sampled_from("sdm"), NASTY), min_size=1, max_size=3))
def test_mutated_data(kind: type[Monitor], mutations: list[tuple[int, str, Any]]) -> None:
    """Set, drop or move anything anywhere."""
    data = choices_file() if kind is Monitor else events_file()
    for chosen, how, value in mutations:
        all_places = list(places(data))
        place, key = all_places[chosen % len(all_places)]
        if how == "d":
            del place[key]
        elif how == "m":
            other, elsewhere = all_places[chosen // 7 % len(all_places)]
            place[key] = copy.deepcopy(other[elsewhere])
        else:
            place[key] = value
    refused_or_sound(partial(kind, data, "r1"))


def test_every_move_is_an_event_of_the_file() -> None:
    data = events_file()
    data["choices"][0]["passings"]["events"].popitem()
    with pytest.raises(MonitorError, match=r"'events' lacks \(move r1"):
        EventMonitor(data)
    del data["choices"][0]["states"]
    with pytest.raises(MonitorError, match="the choices of r1: 'states' is missing"):
        EventMonitor(data)


# ---- what a robot says


@pytest.mark.parametrize(
    "said",
    [
        *("x" * 10**6, "(" * 10**5, " " * 10**6, "(x)" * 10**5),
        *("(move\x1b[2J r1)", "\ud800", "", 0, True, [], {}, b"idle", object()),
    ],
    ids=lambda said: ascii(said)[:6],
)
def test_what_is_no_subaction_or_atom_is_refused(said: Any) -> None:
    at = Monitor(choices_file())
    calls: list[Callable[[Any], object]] = [at.did, at.known]
    if isinstance(said, str):
        calls += [lambda text: at.can(visit=text), lambda text: at.commit(do=text)]
    for call in calls:
        assert message(partial(call, said)) is not None
    assert (at.step, at.remaining) == (0, 4)


def test_patterns_with_many_stars() -> None:
    """They are matched in linear time; `re` takes longer than the robot lives."""
    at = Monitor(choices_file())
    with pytest.raises(NotPossible):
        at.commit(do="(" + "*1" * 25 + "x)")
    for pattern in ("(*)", "(m*r1*c0*c1)", "(move r1 c0 c1)", "(**move** *)"):
        assert at.can(do=pattern), pattern
    for pattern in ("(move*c0 c*c1)", "(move r1 c0 c1*1)", "(*c1*c0*)"):
        assert not at.can(do=pattern), pattern
    with pytest.raises(NotAllowed):
        at.did("(move r1 *)")
