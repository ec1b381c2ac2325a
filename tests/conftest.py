"""Running the command line in this process: its exit code, output and messages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from coordlang.cli import run

ROOT = Path(__file__).parent.parent
DOMAINS = ROOT / "domains"


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


Command = Callable[..., Outcome]


@pytest.fixture
def coordlang(capfd: pytest.CaptureFixture[str]) -> Command:
    def call(*arguments: object) -> Outcome:
        code = run([str(a) for a in arguments])
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        return Outcome(code, out, err)

    return call


@pytest.fixture
def t_map() -> tuple[Path, Path]:
    return DOMAINS / "t-map" / "domain.pddl", DOMAINS / "t-map" / "problem.pddl"


@pytest.fixture
def language(coordlang: Command, t_map: tuple[Path, Path], tmp_path: Path) -> Path:
    path = tmp_path / "language.json"
    assert coordlang("build", *t_map, "--tasks", "all", "-o", path).code == 0
    return path
