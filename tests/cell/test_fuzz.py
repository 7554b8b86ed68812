"""A small part of the fuzz campaign: every kind of file and wire input, always the same ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.fuzz.campaign import fuzz, input_of
from benchmarks.fuzz.kinds import kinds

KINDS = {kind.name: kind for kind in kinds()}


@pytest.mark.parametrize("name", KINDS)
def test_mutated_input_is_read_or_refused(name: str) -> None:
    outcome = fuzz(KINDS[name], 40)
    assert not outcome.bad
    assert outcome.inputs == 40


@pytest.mark.parametrize("name", KINDS)
def test_what_is_mutated_is_good_itself(name: str, tmp_path: Path) -> None:
    for example in KINDS[name].examples:
        KINDS[name].read(tmp_path, example)


def test_the_inputs_are_always_the_same_and_not_all_alike() -> None:
    for kind in KINDS.values():
        assert input_of(kind, 3) == input_of(kind, 3)
        assert len({input_of(kind, number) for number in range(20)}) > 15
