"""Faults of devices, links and our own process, each at a random instant of a run.

`python -m benchmarks.fault_runs` has all of them, at ten instants each.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.fault_runs.faults import FAULTS, Fault, instants
from benchmarks.fault_runs.stands import STANDS
from benchmarks.fault_runs.trial import happening

pytestmark = pytest.mark.slow

SEED = 3
LEFT_OUT = {
    # what one cell shows of our own process holds for the other
    *(("abb+robotiq", name) for name in ("Ctrl-C", "SIGTERM", "terminal closed", "disk full")),
    # drivers' tests have these, at more instants
    ("ur+gige", "camera: 2 % of packets lost"),
    ("ur+gige", "camera: late frames"),
    ("abb+robotiq", "camera: slow answers"),
}
OLDER = ("ur+gige", "abb+robotiq")
OWN_TO_NEWER = {
    "emergency stop",
    "protective stop",
    "program stopped at the pendant",
    "local mode",
    "key turned to manual",
    "connections dropped",
    "Ctrl-C, and the stop is refused",
}
"""What the newer controllers report, or are sent, in a way that the older ones do not have."""

CASES = [
    pytest.param(stand, fault, id=f"{stand}: {fault.name}")
    for stand, faults in FAULTS.items()
    for fault in faults
    if (stand, fault.name) not in LEFT_OUT
    if stand in OLDER or fault.name in OWN_TO_NEWER
]


@pytest.mark.parametrize(("stand", "fault"), CASES)
def test_a_fault_leaves_the_arm_standing_the_recording_whole_and_the_operator_informed(
    stand: str, fault: Fault, tmp_path: Path
) -> None:
    (instant_s,) = instants(stand, fault, 1, SEED)
    with STANDS[stand](tmp_path) as devices:
        came = happening(devices, tmp_path / "run", fault, instant_s)
    assert came is not None, "this machine is too busy: watchdogs ended the runs before the fault"
    assert not came.complaints, came.output
