"""An arm that does not do as ordered, seen by its readings through the real drivers.

`python -m benchmarks.fault_runs.disturbances` has all of them on every cell, at more instants.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.fault_runs.disturbances import DISTURBANCES, complaints, trials_of
from benchmarks.fault_runs.stops import slow_stand

KINDS = {kind.name: kind for kind in DISTURBANCES}


@pytest.mark.parametrize(
    ("stand", "name"),
    [("ur+gige", "pushed where it stands"), ("abb+robotiq", "another way, 8° beside")],
)
def test_an_arm_that_does_something_else_is_stopped_and_that_is_reported(
    stand: str, name: str, tmp_path: Path
) -> None:
    kind = KINDS[name]
    with slow_stand(stand, tmp_path, 10.0) as devices:
        (trial,) = trials_of(devices, tmp_path / "runs", stand, kind, 1, seed=2)
    assert not complaints(kind, trial), trial.output
