# SPDX-License-Identifier: GPL-3.0-or-later
"""Languages in which the words of some states decide those of others."""

from __future__ import annotations

import pytest

from coordlang.commands.building import build_language
from coordlang.language.candidates import Candidates
from coordlang.language.partition import Partition
from coordlang.verification.candidates import verify_candidates
from coordlang.vocabulary.job import Assignment, Job
from coordlang.vocabulary.loop import Languages
from coordlang.vocabulary.tied_words import TiedWords, _values
from planners.parallel.workers import Workers
from tests.support.domains import all_tasks


def found(candidates: Candidates, size: int) -> tuple[Job, Languages, Assignment | None]:
    job = build_language(candidates, "greedy").job
    languages = Languages.of(job)
    search = TiedWords(job, languages)
    try:
        return job, languages, search.find(size, 60)
    finally:
        search.close()


@pytest.mark.parametrize(("stem", "least"), [("gw1-2x2", 3), ("gw2-2x3", 5), ("gwb2-3x3", 3)])
def test_what_is_found_is_a_language_of_its_kind(stem: str, least: int) -> None:
    """Verified by definition; none is found with fewer words than are needed."""
    candidates = all_tasks("grid", stem)
    job, languages, language = found(candidates, least)
    assert language is not None
    partition = Partition.of_states(candidates.rows, language)
    assert verify_candidates(partition, candidates, Workers()).holds
    assert any(
        len({(language[s], other) for s, other in zip(job.states, tied, strict=True)})
        == len({*tied})
        for tied in (
            *([language[to[s]] for s in job.states] for to in languages.known.group.permutations),
            *(value[list(job.states)].tolist() for value in _values(candidates)),
        )
    ), "the word says where a state's image is, or the value of a variable says the word"
    assert found(candidates, least - 1)[2] is None
