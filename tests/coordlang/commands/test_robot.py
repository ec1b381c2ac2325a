# SPDX-License-Identifier: GPL-3.0-or-later
"""``coordlang robot``: processes that act together, over both buses, and what they refuse."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from random import Random
from threading import Timer
from time import monotonic, sleep
from typing import Any
from unittest.mock import patch

import pytest
import trustme

import coordlang as library
from benchmarks.robots import Run, has_arrived, overlaps, spans
from coordlang.commands.robot import Player, RobotInTask, robot
from coordlang.execution.bus import opened
from planners.loading import PlanningInstance
from planners.system.errors import Refuted, UsageError
from tests.coordlang.commands.conftest import FILES, Shell
from tests.support.command import own_process

CORNERS = FILES["CORNERS"]


@pytest.fixture(scope="module")
def loaded() -> PlanningInstance:
    return library.load(*CORNERS, asynchronous=True)


@pytest.fixture(scope="module")
def language(loaded: PlanningInstance, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("robot") / "l.json"
    library.build(loaded, *loaded.problems, method="greedy").language.save(path)
    return path


@pytest.fixture
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One with a short name: the path of a socket has at most some hundred characters."""
    return tmp_path_factory.mktemp("bus")


def team_of(language: Path, loaded: PlanningInstance, **wishes: str) -> dict[str, RobotInTask]:
    return {
        name: robot(language, loaded, loaded.problems[0], robot=name, prefer=wishes.get(name, ()))
        for name in loaded.model.robots
    }


@pytest.mark.thorough
def test_forked_robots_arrive_and_one_of_them_is_killed(
    language: Path, loaded: PlanningInstance, folder: Path
) -> None:
    team = team_of(language, loaded)
    for seed in range(4):
        place = folder / str(seed)
        place.mkdir()
        run = Run(team, place, seed)
        assert run.wait(kill_at=0.05 * seed)
        did = {name: spans(run.lines(name)) for name in team}
        assert not overlaps(did, loaded)
        assert has_arrived(did, loaded)
    # The check can fail: what overlaps is found, and what does not arrive.
    early = {
        name: [(0.0, end, text, met) for _, end, text, met in its] for name, its in did.items()
    }
    assert overlaps(early, loaded)
    assert not has_arrived({**did, "r1": did["r1"][:-1]}, loaded)


class Process:
    """A robot's process, whose driver is the test."""

    def __init__(self, name: str, arguments: list[object]) -> None:
        self.process = subprocess.Popen(
            own_process("robot", *arguments, "--robot", name),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.watch = Timer(60, self.process.kill)  # a robot that waits for ever is an error
        self.watch.daemon = True
        self.watch.start()

    def says(self, **line: object) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(line) + "\n")
        self.process.stdin.flush()

    def hears(self, key: str) -> dict[str, Any]:
        """The next line with a key."""
        assert self.process.stdout is not None
        for text in self.process.stdout:
            line: dict[str, Any] = json.loads(text)
            if key in line:
                return line
        raise AssertionError(f"it ended without {key}")

    def end(self) -> None:
        self.watch.cancel()
        self.process.kill()
        self.process.communicate()


def test_processes_of_the_command_line_one_is_driven_killed_and_started_again(
    language: Path, folder: Path
) -> None:
    bus = ["--bus", f"unix:{folder / 'bus'}"]
    files = [language, *CORNERS, *bus]
    with ExitStack() as stack:

        def started(name: str, *more: object) -> Process:
            found = Process(name, [*files, *more])
            stack.callback(found.end)
            return found

        other = started("r2", "--play", 1)
        own = started("r1")
        first = own.hears("start")
        assert (first["event"], {*first}) == (1, {"event", "start", "time"})
        own.end()
        own = started("r1")
        again = own.hears("event")  # start, if it was killed before the other one knew more
        assert first["start"] in (again.get("underway"), again.get("start"))
        own.says(event=1, done=first["start"].upper())
        for number in (2, 3):
            assert own.hears("start")["event"] == number
            own.says(event=number, done=True)
        assert own.hears("start")["event"] == 4
        assert own.process.stdin is not None
        own.process.stdin.write('{"done": true}')  # a last line without an end
        own.process.stdin.close()
        own.process.stdin = None
        own.hears("finished")
        assert own.process.wait(20) == 0
        lines = other.process.communicate(timeout=20)[0].splitlines()
        assert other.process.returncode == 0
    done = [line["event"] for line in map(json.loads, lines) if "done" in line]
    assert done == [1, 2, 3, 4]


def test_robots_agree_on_what_they_wish(language: Path, loaded: PlanningInstance) -> None:
    problem = loaded.problems[0]
    for wishes in (
        {},
        {"r1": "avoid:(at r1 c1-1)", "r2": "shortest"},
        {"r1": "shortest", "r2": "most-plans"},
        {"r2": "avoid:(at r1 c1-1)"},
    ):
        executives = [one.executive for one in team_of(language, loaded, **wishes).values()]
        for _ in range(5):
            for own in executives:
                own.tick(0.0)
                for to, data in own.messages():
                    next(o for o in executives if o.robot == to).hears(data, 0.0)
        lines = [line for own in executives for line in own.lines]
        (agreed,) = {line["sentence"] for line in lines if "sentence" in line}
        wished = [*wishes.values()] or ["most-plans"]
        if "avoid:(at r1 c1-1)" in wished:
            wished = ["avoid:(at r1 c1-1)", *({*wished} - {"avoid:(at r1 c1-1)"})]
        assert agreed == library.plan(language, loaded, problem, prefer=wished).sentence
    again = [robot(language, loaded, problem, robot="r1", run=run).run for run in (None, "a", "b")]
    assert len({*again}) == 3


def test_what_cannot_be_is_refused(language: Path, folder: Path, shell: Shell) -> None:
    words = library.plan(language, *CORNERS, prefer="most-plans").sentence
    start = f"robot {language} CORNERS"
    shell(f"{start} --robot r3 --bus unix:{folder}", 2, "there is no such robot", "r1, r2")
    shell(f'{start} "{words}" --robot r1 --prefer shortest', 2, "the sentence is given")
    shell(f"{start} --robot r1 --prefer nothing", 2, "there is no such preference")
    shell(f"{start} --robot r1 --bus mqtt", 2, "there is no such bus", "unix:FOLDER")
    shell(f"{start} --robot r1 --bus unix:{folder}/{'long' * 40}", 2, "cannot be opened")
    shell(
        f"{start} --robot r1 --silent-after 0", 2, "--silent-after 0.0: expected a number above 0"
    )
    shell(f'{start} "w0 w9" --robot r1', 31, "w9")
    shell(f"{start}", 2, "--robot")
    shell("build CORNERS --method greedy -o step.json", 0)
    shell("robot step.json CORNERS --robot r1", 2, "for joint steps", "--asynchronous")
    shell(f"robot {language} {CORNERS[0]} {FILES['SQUARE'][1]} --robot r1", 31)
    with ExitStack() as stack:
        found = Process("r1", [language, *CORNERS, "--bus", f"unix:{folder}"])
        stack.callback(found.end)
        assert found.process.stdin is not None
        while not (folder / "r1").exists():
            assert found.process.poll() is None
        shell(f"{start} --robot r1 --bus unix:{folder}", 2, "r1 is on this bus already")
        found.process.stdin.close()
        found.process.stdin = None
        assert found.process.wait(20) == 31
    command = own_process("robot", language, *CORNERS, "--robot", "r1", "--bus", f"unix:{folder}")
    for closed in ('exec "$@" <&-', 'exec "$@" 0>/dev/null'):
        assert subprocess.run(["sh", "-c", closed, "sh", *command], timeout=20).returncode == 31


def test_robots_with_different_sentences_end(language: Path, folder: Path) -> None:
    one, other = (
        library.plan(language, *CORNERS, prefer=f"avoid:(at r1 {place})").sentence
        for place in ("c1-1", "c0-1")
    )
    assert one != other
    with ExitStack() as stack:
        team = []
        for name, sentence in (("r1", one), ("r2", other)):
            files = [language, *CORNERS, sentence, "--bus", f"unix:{folder}", "--play", 1]
            team.append(Process(name, files))
            stack.callback(team[-1].end)
        assert [own.process.wait(20) for own in team] == [1, 1]


def test_a_bus_takes_any_names_and_carries_on_when_its_folder_is_removed(folder: Path) -> None:
    names = ["r", "r.lock", ".", "..", "a/b"]
    where = f"unix:{folder / 'bus'}"
    with ExitStack() as stack:
        buses = {
            name: stack.enter_context(closing(opened(where, "run", name, names))) for name in names
        }
        for name in names:
            with pytest.raises(UsageError, match="on this bus already"):
                opened(where, "run", name, names)
        for is_removed in (False, True):
            if is_removed:
                shutil.rmtree(folder / "bus")
                # And once more, while the first one enters.
                stack.enter_context(patch("fcntl.flock", side_effect=[FileNotFoundError, *names]))
            for _ in range(2):
                for bus in buses.values():
                    assert all(bus.send(name, name.encode()) for name in names)
                heard = {name: {*bus.receive()} for name, bus in buses.items()}
            assert heard == {name: {name.encode()} for name in names}
        shutil.rmtree(folder / "bus")
        (folder / "bus").touch()
        with pytest.raises(UsageError, match="cannot be opened: File exists"):
            buses["r"].send("a/b", b"")


def test_nothing_is_executed_without_a_guarantee(loaded: PlanningInstance) -> None:
    built = library.build(loaded, *loaded.problems, words=1)
    with pytest.raises(Refuted, match="guarantees nothing"):
        robot(built.language, loaded, loaded.problems[0], robot="r1")


def test_a_way_is_played_by_its_length() -> None:
    near, far = (
        Player(Random(1), {"a": (0.0, 0.0), "b": (metres, 0.0)}, 2.0)._seconds("(move r1 a b)")
        for metres in (1.0, 8.0)
    )
    assert far == 8 * near
    assert Player(Random(1), {}, 2.0)._seconds("(lift r1)") == near


# ---- Zenoh


def ports(number: int) -> list[int]:
    """So many free ports of this machine."""
    with ExitStack() as stack:
        found = [socket.create_server(("127.0.0.1", 0)) for _ in range(number)]
        return [stack.enter_context(one).getsockname()[1] for one in found]


def zenoh_configs(
    folder: Path, names: Mapping[str, int], **more: Mapping[str, Any]
) -> dict[str, str]:
    """A configuration of each robot at a port of its own, without looking for others."""
    kind = "tls" if more else "tcp"
    found = {}
    for name, port in names.items():
        path = folder / f"{name}.json5"
        ends = [f"{kind}/127.0.0.1:{its}" for its in names.values() if its != port]
        config = {
            "mode": "peer",
            "scouting": {"multicast": {"enabled": False}},
            "listen": {"endpoints": [f"{kind}/127.0.0.1:{port}"]},
            "connect": {"endpoints": ends},
            **more.get(name, {}),
        }
        path.write_text(json.dumps(config))
        found[name] = f"zenoh:{path}"
    return found


def test_robots_hear_each_other_over_zenoh(
    language: Path, loaded: PlanningInstance, folder: Path
) -> None:
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed (coordlang[fleet])")
    team = team_of(language, loaded)
    bus = zenoh_configs(folder, dict(zip(team, ports(2), strict=True)))
    run = Run(team, folder, 3, bus)
    assert run.wait(kill_at=0.4)
    did = {name: spans(run.lines(name)) for name in team}
    assert not overlaps(did, loaded)
    assert has_arrived(did, loaded)


def secured(
    folder: Path, authority: trustme.CA, name: str, allowed: Sequence[str]
) -> dict[str, Any]:
    """What docs/robots.md says: certificates of one authority, and who of these may speak."""
    authority.cert_pem.write_to_path(folder / f"{name}-ca.pem")
    issued = authority.issue_cert("127.0.0.1", common_name=name)
    issued.private_key_pem.write_to_path(folder / f"{name}.key")
    issued.cert_chain_pems[0].write_to_path(folder / f"{name}.pem")
    tls = {"root_ca_certificate": f"{folder}/{name}-ca.pem", "enable_mtls": True}
    for side in ("listen", "connect"):
        tls |= {
            f"{side}_private_key": f"{folder}/{name}.key",
            f"{side}_certificate": f"{folder}/{name}.pem",
        }
    rule = {
        "id": "messages",
        "permission": "allow",
        "flows": ["ingress", "egress"],
        "messages": ["put", "declare_subscriber"],
        "key_exprs": ["coordlang/**"],
    }
    control = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule],
        "subjects": [{"id": "fleet", "cert_common_names": [*allowed]}],
        "policies": [{"rules": ["messages"], "subjects": ["fleet"]}],
    }
    return {"transport": {"link": {"tls": tls}}, "access_control": control}


def test_only_robots_with_a_certificate_that_is_named_are_heard(folder: Path) -> None:
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed (coordlang[fleet])")
    ours, theirs = trustme.CA(), trustme.CA()
    names = ["r1", "r2", "r3", "r4"]
    of = {name: theirs if name == "r4" else ours for name in names}
    more = {name: secured(folder, of[name], name, ["r1", "r2"]) for name in names}
    configs = zenoh_configs(folder, dict(zip(names, ports(4), strict=True)), **more)
    with ExitStack() as stack:
        buses = {}
        for name in names:
            buses[name] = stack.enter_context(closing(opened(configs[name], "run", name, names)))
        heard: set[bytes] = set()
        until = monotonic() + 10
        while b"r2" not in heard and monotonic() < until:
            for name in names[1:]:
                buses[name].send("r1", name.encode())
            sleep(0.05)
            heard |= {*buses["r1"].receive()}
        sleep(0.3)
        heard |= {*buses["r1"].receive()}
    assert heard == {b"r2"}
