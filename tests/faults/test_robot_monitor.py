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
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from coordlang.execution import monitor as monitor_module
from coordlang.execution.monitor import Monitor, MonitorError, NotAllowed, NotPossible

LENGTH = 10_000
DEEP = 100_000
CELLS = 50


def choices_file(length: int) -> dict[str, Any]:
    """The data of a choices file of one robot, which goes around a ring and may wait once.

    States 2k - 1 and 2k are those after k steps in which it has waited already, or not yet.
    """
    states = [_state(0, 0, waited=False, length=length)]
    for step in range(1, length + 1):
        states.append(_state(step, 2 * step - 1, waited=True, length=length))
        states.append(_state(step, 2 * step, waited=False, length=length))
    entry = {
        "robot": "r1",
        "steps": length,
        "subplans": length + 1,
        "atoms": "own",
        "facts": [f"(at r1 c{cell})" for cell in range(CELLS)],
        "others": ["(at r2 c0)"],
        "states": states,
    }
    return {
        "format": "coordlang/choices",
        "version": 1,
        "robots": ["r1", "r2"],
        "sentence": "w0",
        "choices": [entry],
    }


def _state(step: int, number: int, *, waited: bool, length: int) -> dict[str, Any]:
    cell = (step - waited) % CELLS
    following = {}
    if step < length:
        after = 2 * step + 1 if waited else 2 * step + 2
        following[f"(move r1 c{cell} c{(cell + 1) % CELLS})"] = after
        if not waited:
            following["idle"] = 2 * step + 1
    return {
        "step": step,
        "left": 1 if waited else length - step + 1,
        "next": following,
        "true": [cell],
        "unknown": [],
    }


@pytest.fixture(scope="module")
def long() -> Monitor:
    return Monitor(choices_file(LENGTH))


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
    at.known("(at r1 c7)")
    at.did(at.allowed()[-1])


# ---- days in a robot


def test_a_step_needs_as_much_memory_late_as_early(long: Monitor) -> None:
    """What a step allocates at most, even for a moment, does not depend on the steps before."""
    at = long.copy()
    peaks = []
    tracemalloc.start()
    try:
        for _ in range(LENGTH):
            before, _ = tracemalloc.get_traced_memory()
            tracemalloc.reset_peak()
            one_step(at)
            at.copy()
            peaks.append(tracemalloc.get_traced_memory()[1] - before)
    finally:
        tracemalloc.stop()
    assert at.finished
    assert max(peaks) < 8_192
    assert max(peaks[-1000:]) <= max(peaks[:1000])


def test_missions_do_not_take_memory(long: Monitor) -> None:
    tracemalloc.start()
    try:
        begin, _ = tracemalloc.get_traced_memory()
        at = long.copy()
        for _ in range(LENGTH - 1):
            one_step(at)
        assert tracemalloc.get_traced_memory()[0] - begin < 20_000
    finally:
        tracemalloc.stop()


def test_steps_do_not_wake_the_garbage_collector(long: Monitor) -> None:
    at = long.copy()
    at.commit(do="idle")
    gc.collect()
    before = [generation["collections"] for generation in gc.get_stats()]
    while not at.finished:
        one_step(at)
    assert [generation["collections"] for generation in gc.get_stats()] == before


def test_a_promise_that_is_renewed_does_not_grow() -> None:
    at = Monitor(choices_file(60))
    sizes = set()
    while at.step < 50:
        at.commit(never="(move r2 *)", visit="(at r1 c9)")
        sizes.add(tuple(map(len, (at.promised.visit, at.promised.never))))
        one_step(at)
    assert sizes == {(1, 1)}


def test_the_loop_opens_and_imports_nothing(tmp_path: Path) -> None:
    """The interpreter reports every file, import and compilation to an audit hook."""
    (tmp_path / "monitor.py").write_bytes(Path(monitor_module.__file__).read_bytes())
    (tmp_path / "choices.json").write_text(json.dumps(choices_file(600)))
    program = """
import sys
sys.path.insert(0, sys.argv[1])
from monitor import Monitor, NotAllowed
at = Monitor.read(sys.argv[1] + "/choices.json")
seen = []
sys.addaudithook(lambda event, arguments: seen.append(event))
at.commit(do="(move r1 c4 *)", never="(move r9 *)")
other = at.copy()
while not at.finished:
    at.can(visit="(at r1 c7)") if at.step < 3 else None
    at.known("( AT r1 C7 )")
    at.did(at.allowed()[-1])
    other.did(other.allowed()[0])
    at.remaining, at.step
    try:
        at.did("(fly r1)")
    except NotAllowed:
        pass
assert at.step == other.step == 600
print(sorted(set(seen)))
"""
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", program, str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert not {"open", "import", "compile", "exec"} & set(
        json.loads(done.stdout.replace("'", '"'))
    )


def test_copies_go_their_own_ways() -> None:
    start = Monitor(choices_file(700))
    at = start.copy()
    while not at.finished:
        for other in (at.copy(), copy.copy(at), copy.deepcopy(at), pickle.loads(pickle.dumps(at))):
            before = at.step, at.allowed(), at.remaining
            other.did(other.allowed()[0])
            assert (at.step, at.allowed(), at.remaining) == before
            assert other.step == at.step + 1
        for _ in range(100):
            one_step(at)
    assert (start.step, at.step) == (0, 700)


# ---- files


def small() -> dict[str, Any]:
    return choices_file(3)


def entry_of(data: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = data["choices"][0]
    return found


def changed(path: list[Any], value: Any) -> Callable[[dict[str, Any]], None]:
    def change(data: dict[str, Any]) -> None:
        place: Any = entry_of(data)
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value

    return change


def refusal(data: Any, robot: str | None = "r1") -> str:
    with pytest.raises(MonitorError) as caught:
        Monitor(data, robot)
    return str(caught.value)


STATES = ["states"]
MALFORMED: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "states are an object": (changed(STATES, {"0": {}}), "'states' is a dict, not a list"),
    "step is a float": (changed([*STATES, 0, "step"], 0.0), "'step' is 0.0, not a whole number"),
    "step is true": (changed([*STATES, 1, "step"], True), "'step' is True, not a whole number"),
    "a cycle": (changed([*STATES, 3, "next"], {"idle": 1}), "state 3 does not lead"),
    "beyond the end": (changed([*STATES, 0, "next", "idle"], 7), "state 0 does not lead"),
    "to a float": (changed([*STATES, 0, "next", "idle"], 1.0), "state 0 does not lead"),
    "two steps on": (changed([*STATES, 0, "next", "idle"], 3), "state 0 does not lead"),
    "unreachable": (changed([*STATES, 0, "next"], {"idle": 1}), "state 2 cannot be reached"),
    "no subaction": (changed([*STATES, 5, "next"], {"x": 6}), "state 5 does not lead|has x in"),
    "not plain": (
        lambda data: entry_of(data)["states"][0]["next"].update({"(Fly R1)": 1}),
        r"state 0: 'next' has \(Fly R1\) in place",
    ),
    "ends early": (changed([*STATES, 3, "next"], {}), "3 ends after|state 5 cannot be reached"),
    "left is false": (changed([*STATES, 1, "left"], 2), "state 1 says 2 subplans are left, but th"),
    "left is true": (changed([*STATES, 1, "left"], True), "state 1 says True"),
    "left is long": (changed([*STATES, 1, "left"], "9" * 10**6), r"state 1 says 9+\.\. \(1,000,"),
    "left is no number": (changed([*STATES, 1, "left"], "¹"), "state 1 says ¹"),
    "facts beyond": (changed([*STATES, 0, "true"], [50]), "'true' has 50; facts are numbers below"),
    "facts as text": (changed([*STATES, 0, "true"], "0"), "'true' is 0, not a list"),
    "true and unknown": (changed([*STATES, 0, "unknown"], [0]), "fact 0 is true and unknown"),
    "atoms twice": (changed(["others"], ["(at r1 c0)"]), "an atom occurs twice"),
    "an atom is null": (changed(["others"], [None]), "'others' has None in place"),
    "atoms is odd": (changed(["atoms"], "all"), "'atoms' is all, not exact or own"),
    "robot with escapes": (changed(["robot"], "r1\x1b[2J"), r"control characters: r1\\x1b\[2J"),
    "steps": (changed(["steps"], 4), "'steps' is 4, but the states have 3"),
    "subplans": (changed(["subplans"], 5), "says 5 subplans are left, but there are 4"),
    "a surrogate": (changed(["facts", 3], "(at \ud800)"), r"has \(at \\ud800\) in place"),
    "a robot twice": (lambda data: data["choices"].append(entry_of(data)), "choices of r1 twice"),
    "choices is an object": (lambda data: data.update(choices={"r1": 1}), "'choices' is a dict"),
    "choices is empty": (lambda data: data["choices"].clear(), "it has those of no robot"),
    "version is a float": (lambda data: data.update(version=1.0), r"version 1\.0; this program"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed_data_is_refused_with_a_reason(name: str) -> None:
    change, reason = MALFORMED[name]
    data = small()
    Monitor(data, "r1")
    change(data)
    with pytest.raises(MonitorError, match=reason) as caught:
        Monitor(data, "r1")
    assert len(str(caught.value)) < 1000
    assert str(caught.value).isprintable()


def test_missing_keys() -> None:
    for key in ("robot", "atoms", "facts", "others", "states"):
        data = small()
        del entry_of(data)[key]
        assert f"'{key}' is missing" in refusal(data)
    for key in ("step", "left", "next", "true", "unknown"):
        data = small()
        del entry_of(data)["states"][4][key]
        assert f"state 4: '{key}' is missing" in refusal(data)
    for key in ("sentence", "choices"):
        data = small()
        del data[key]
        assert f"'{key}' is missing" in refusal(data)


def nested(depth: int) -> list[Any]:
    deep: list[Any] = []
    for _ in range(depth):
        deep = [deep]
    return deep


def places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) inside."""
    keys = list(data) if isinstance(data, dict) else range(len(data))
    for key in keys:
        yield data, key
        if isinstance(data[key], dict | list):
            yield from places(data[key])


def test_deep_data_in_every_place() -> None:
    """Refused with a short message, or ignored where the key is."""
    deep = nested(DEEP)
    whole = small()
    entry_of(whole)["facts"] = entry_of(whole)["facts"][:4]
    ignored = 0
    for number in range(sum(1 for _ in places(whole))):
        data = copy.deepcopy(whole)
        place, key = list(places(data))[number]
        place[key] = deep
        ignored += message(partial(Monitor, data, "r1")) is None
    assert ignored == 3  # "robots" and its members


TEXT = json.dumps(choices_file(3))
FILES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "this is no JSON, or it is cut off"),
    "cut off": (TEXT.encode()[:-30], "cut off"),
    "two values": (TEXT.encode() * 2, "Extra data"),
    "a list": (b"[]", "expected a choices file"),
    "not UTF-8": (TEXT.replace("w0", "wé").encode("latin-1").replace(b"\\", b""), "byte|no JSON"),
    "UTF-16": (TEXT.encode("utf-16"), "byte 0 is no UTF-8"),
    "deep lists, cut off": (b"[" * DEEP, "nested too deeply"),
    "deep in an ignored key": (
        TEXT[:-1].encode() + b', "x": ' + b"[" * DEEP + b"]" * DEEP + b"}",
        "nested too deeply",
    ),
    "NaN": (TEXT.replace('"step": 0', '"step": NaN').encode(), "NaN is no number in JSON"),
    "1e999": (TEXT.replace('"step": 0', '"step": 1e999').encode(), "'step' is inf"),
    "huge number": (
        TEXT.replace('"step": 0', '"step": ' + "9" * 10**5).encode(),
        "this is no JSON",
    ),
    "a key twice": (
        TEXT.replace('"step": 0', '"step": 0, "step": 0').encode(),
        "'step' occurs twice",
    ),
    "a subaction twice": (
        TEXT.replace('"idle": 1', '"idle": 1, "idle": 1').encode(),
        "'idle' occurs twice",
    ),
    "gzip cut off": (gzip.compress(TEXT.encode())[:-20], "cut off"),
    "gzip spoilt": (gzip.compress(TEXT.encode())[:40] + b"\xff" * 40, "cut off"),
    "gzip in gzip": (gzip.compress(gzip.compress(TEXT.encode())), "byte 1 is no UTF-8"),
    "a bomb": (gzip.compress(b" " * (1 << 20) + b"{}"), r"more than 1,000,000 bytes"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_none(name: str, tmp_path: Path) -> None:
    content, reason = FILES[name]
    path = tmp_path / "choices.json"
    path.write_bytes(content)
    with pytest.raises(MonitorError, match=reason) as caught:
        Monitor.read(str(path), "r1", max_bytes=1_000_000)
    assert len(str(caught.value)) < 1000


def test_byte_order_mark_and_limit(tmp_path: Path) -> None:
    path = tmp_path / "choices.json"
    content = b"\xef\xbb\xbf" + TEXT.encode()
    for text in (content, gzip.compress(content)):
        path.write_bytes(text)
        assert Monitor.read(str(path), max_bytes=len(content)).remaining == 4
        with pytest.raises(MonitorError, match="max_bytes"):
            Monitor.read(str(path), max_bytes=len(content) - 1)


def test_an_endless_file() -> None:
    with pytest.raises(MonitorError, match="more than 10,000 bytes"):
        Monitor.read("/dev/zero", max_bytes=10_000)


def test_a_file_that_does_not_fit_into_the_memory(tmp_path: Path) -> None:
    (tmp_path / "monitor.py").write_bytes(Path(monitor_module.__file__).read_bytes())
    (tmp_path / "choices.json").write_bytes(b"[" + b"[]," * 2_000_000 + b"[]]")
    program = """
import resource, sys
sys.path.insert(0, sys.argv[1])
from monitor import Monitor, MonitorError
resource.setrlimit(resource.RLIMIT_AS, (128 << 20, 128 << 20))
try:
    Monitor.read(sys.argv[1] + "/choices.json")
except MonitorError as error:
    print(error)
"""
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", program, str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == f"{tmp_path}/choices.json: it does not fit into the memory\n"


def doubling(steps: int) -> dict[str, Any]:
    """Two moves in every state, to one next state: 2^steps subplans."""
    states = []
    for step in range(steps + 1):
        following = {"(a)": step + 1, "(b)": step + 1} if step < steps else {}
        states.append({"step": step, "left": 0, "next": following, "true": [], "unknown": []})
    return {**entry_of(small()), "steps": steps, "states": states}


def test_counts_with_more_digits_than_python_reads() -> None:
    """As with more than 4,300 digits where the limit is not lowered; a wrong digit is refused."""
    entry = doubling(3_000)
    del entry["subplans"]
    for state in entry["states"]:
        state["left"] = str(1 << 3_000 - state["step"])
    limit = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(640)
    try:
        data = {**small(), "choices": [entry]}
        assert Monitor(data).remaining == 1 << 3_000
        left = entry["states"][0]["left"]
        entry["states"][0]["left"] = left[:-1] + "9"
        assert refusal(data).endswith("but there are about 2^3001")
    finally:
        sys.set_int_max_str_digits(limit)


def test_counts_take_no_more_memory_than_the_file() -> None:
    """The file claims one subplan in each state, of 2^20000."""
    data = {**small(), "choices": [doubling(20_000)]}
    for state in entry_of(data)["states"]:
        state["left"] = 1
    tracemalloc.start()
    try:
        message = refusal(data)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert "says 1 subplans are left, but there are 2" in message
    assert peak < 12_000_000


# ---- mutations

NASTY = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 60),
    st.sampled_from([2**31, 2**63, -(2**63), 10**400, 1.0, 0.5, float("inf"), float("nan")]),
    st.sampled_from(["", "idle", "(x)", "(at r1 c1)", "((x))", "\ud800", "\x1b[2J", "x" * 10_000]),
    st.recursive(st.integers(-1, 8), lambda inner: st.lists(inner, max_size=3), max_leaves=5),
    st.dictionaries(st.sampled_from(["idle", "(x)", "step", "next"]), st.integers(-1, 8)),
    st.builds(nested, st.just(60)),
)


def check_is_sound(at: Monitor) -> None:
    """The monitor of a file that is taken can be walked, and its counts are right."""
    subplans = 0
    open_ends = [at]
    while open_ends:
        here = open_ends.pop()
        subplans += here.finished
        for text in here.allowed():
            after = here.copy()
            after.did(text)
            open_ends.append(after)
        for atom in ("(at r1 c0)", "(at r1 c1)", "(at r2 c0)"):
            said = message(partial(here.known, atom))
            assert said is None or "is no atom that can change" in said
    assert at.remaining == subplans
    assert at.can().subplans == subplans


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(st.tuples(st.integers(0), st.sampled_from("sdm"), NASTY), min_size=1, max_size=3))
def test_mutated_data(mutations: list[tuple[int, str, Any]]) -> None:
    """Set, drop or move anything anywhere: a `MonitorError`, or a sound monitor."""
    data = choices_file(3)
    entry_of(data)["facts"] = entry_of(data)["facts"][:4]
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
    if message(lambda: Monitor(data, "r1")) is None:
        check_is_sound(Monitor(data, "r1"))


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    packed=st.booleans(),
    changes=st.lists(
        st.tuples(st.integers(0, 4000), st.integers(0, 3), st.binary(max_size=4)), max_size=3
    ),
)
@example(packed=True, changes=[(20, 3, b"\xff\xff")])
def test_mutated_bytes(
    tmp_path_factory: pytest.TempPathFactory, packed: bool, changes: list[tuple[int, int, bytes]]
) -> None:
    """Replace, insert or drop bytes anywhere, also in a compressed file."""
    path = tmp_path_factory.getbasetemp() / "mutated.json"
    content = gzip.compress(TEXT.encode(), mtime=0) if packed else TEXT.encode()
    for at, dropped, inserted in changes:
        at %= len(content) + 1
        content = content[:at] + inserted + content[at + dropped :]
    path.write_bytes(content)
    if message(lambda: Monitor.read(str(path), "r1")) is None:
        check_is_sound(Monitor.read(str(path), "r1"))


# ---- what a robot says


@pytest.mark.parametrize(
    "said", ["x" * 10**6, "(move\x1b[2J r1)", "(" * 10**5, " " * 10**6, "(x)" * 10**5, "\ud800", ""]
)
def test_messages_are_short_and_harmless(said: str) -> None:
    at = Monitor(small())
    for call in (
        at.did,
        at.known,
        lambda text: at.can(visit=text),
        lambda text: at.commit(do=text),
    ):
        assert message(partial(call, said)) is not None
    assert (at.step, at.remaining) == (0, 4)


@pytest.mark.parametrize("said", [0, True, [], {}, b"idle", 1.5, object()])
def test_what_is_no_text_is_refused(said: Any) -> None:
    at = Monitor(small())
    for call in (at.did, at.known):
        with pytest.raises(MonitorError, match="is no PDDL text"):
            call(said)


def test_patterns_with_many_stars() -> None:
    """They are matched in linear time; `re` takes longer than the robot lives."""
    at = Monitor(small())
    with pytest.raises(NotPossible):
        at.commit(do="(" + "*1" * 25 + "x)")
    for pattern, possible in [
        ("(*)", True),
        ("(m*r1*c0*c1)", True),
        ("(move r1 c0 c1)", True),
        ("(move*c0 c*c1)", False),
        ("(move r1 c0 c1*1)", False),
        ("(*c1*c0*)", False),
        ("(**move** *)", True),
    ]:
        assert bool(at.can(do=pattern)) == possible, pattern
    with pytest.raises(NotAllowed):
        at.did("(move r1 *)")
