# SPDX-License-Identifier: GPL-3.0-or-later
"""Mutants are run and judged: no traceback, no hang, a documented exit code, a useful message."""

from __future__ import annotations

import contextlib
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.mutants import Mutant, arguments_of, mutant
from tests.fuzz.runner import Outcome, run
from tests.fuzz.sources import Pair

#: docs/cli.md.  32 is left out: no external program should fail here.
DOCUMENTED = frozenset({0, 1, 2, 3, 11, 22, 23, 31, 34, 130})
_FRESH = 25
_PLACE = re.compile(r":\d+:\d+: ")
#: Errors of a PDDL file that have no place inside it.
_PLACELESS = ("no such file", "found an empty file", "binary file")


@dataclass(frozen=True)
class Failure:
    mutant: Mutant
    outcome: Outcome
    why: str


@dataclass
class Report:
    """The sum of a run."""

    codes: Counter[tuple[str, str]] = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)
    slowest: list[tuple[float, str]] = field(default_factory=list)

    def text(self) -> str:
        columns = sorted(
            {code for _, code in self.codes}, key=lambda c: (not c.isdigit(), c.zfill(4))
        )
        commands = sorted({command for command, _ in self.codes})
        rows = [["command", *columns, "all"]]
        for command in commands:
            counts = [self.codes[command, code] for code in columns]
            rows.append([command, *map(str, counts), str(sum(counts))])
        total = [sum(self.codes[command, code] for command in commands) for code in columns]
        rows.append(["all", *map(str, total), str(sum(total))])
        lines = [
            "exit codes",
            *("  " + "".join(f"{cell:>9}" for cell in row) for row in rows),
            "",
            "slowest",
        ]
        lines += [
            f"  {seconds:6.2f} s  {what}"
            for seconds, what in sorted(self.slowest, reverse=True)[:5]
        ]
        lines += ["", f"{len(self.failures)} failures"]
        for failure in self.failures:
            m = failure.mutant
            lines.append(f"  #{m.number} {m.pair.name}, {m.what}, {m.command}: {failure.why}")
            lines += [
                f"      {line}" for line in failure.outcome.err.strip()[-600:].splitlines()[-4:]
            ]
        return "\n".join(lines)


def complaint(m: Mutant, outcome: Outcome, written: bool) -> str | None:
    """What is wrong with an outcome, or None."""
    code, err = outcome.code, outcome.err
    for sign in ("Traceback", "Exception ignored", "Fatal Python error"):
        if sign in err:
            return f"{sign!r} on stderr (exit {code})"
    if code is None:
        return f"no answer after {outcome.seconds:.1f} s: a hang, or the process died"
    if code not in DOCUMENTED:
        return f"exit code {code}"
    if outcome.left:
        return f"left behind: {', '.join(outcome.left)}"
    if written != (m.command == "build" and code in (0, 3)):
        return f"exit code {code} and {'a' if written else 'no'} language file"
    if code == 0:
        return None if outcome.out.strip() else "no output"
    if code == 2 and m.pair.options:
        return None  # --robot-type of a type that the mutation took away
    if not re.search(r"^coordlang: (?!note: )\S", err, re.MULTILINE):
        return f"exit code {code} without a message"
    if code in (31, 34):
        if "domain.pddl" not in err and "problem.pddl" not in err:
            return f"exit code {code}: the message names no file"
        if not _PLACE.search(err) and not any(text in err for text in _PLACELESS):
            return f"exit code {code}: the message names no line"
    return None


def fuzz(
    numbers: Sequence[int],
    seed: int,
    sources: Sequence[Pair],
    *,
    keep: Path | None = None,
    only_light: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Report:
    """Run mutants and judge them; files of failures go to ``keep``.

    An interrupt (Ctrl-C) ends it early, with the report so far.
    """
    report = Report()
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-") as name,
        contextlib.suppress(KeyboardInterrupt),
    ):
        for done, number in enumerate(numbers):
            m = mutant(number, seed, sources)
            if only_light and not m.light:
                continue
            _judge(m, Path(name), report, keep)
            if done % 20 == 0:
                progress(f"{done} of {len(numbers)}")
    return report


def _judge(m: Mutant, folder: Path, report: Report, keep: Path | None) -> None:
    work = folder / "work"
    work.mkdir(exist_ok=True)
    (work / "domain.pddl").write_bytes(m.domain)
    (work / "problem.pddl").write_bytes(m.problem)
    language = work / "language.json"
    language.unlink(missing_ok=True)
    outcome = run(folder, arguments_of(m), fresh=m.number % _FRESH == 0)
    report.codes[m.command, "killed" if outcome.code is None else str(outcome.code)] += 1
    report.slowest = sorted(
        [*report.slowest, (outcome.seconds, f"#{m.number} {m.pair.name}, {m.what}")]
    )[-5:]
    why = complaint(m, outcome, language.exists())
    if why is None:
        return
    report.failures.append(Failure(m, outcome, why))
    if keep is not None:
        target = keep / f"{m.number:06}"
        target.mkdir(parents=True, exist_ok=True)
        (target / "domain.pddl").write_bytes(m.domain)
        (target / "problem.pddl").write_bytes(m.problem)
        text = f"{why}\n{m.what}\n\ncoordlang {' '.join(arguments_of(m))}\n\n{outcome.err}"
        (target / "why.txt").write_text(text, errors="replace")
