"""A stop through each real driver, its controller doing with it as it likes.

`python -m benchmarks.fault_runs.stops` has the same in whole runs, at ten instants each.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fault_runs.stands import STANDS, Stand
from benchmarks.fault_runs.stops import KINDS, Kind
from cell.errors import StoppedByOperator
from cell.sequencer.clock import HostClock
from cell.sequencer.guard import Guard
from cell.sequencer.stop import StopRequest
from cell.sequencer.watched_arm import WatchedArm
from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings
from drivers.arm import Arm
from drivers.ur import URArm, URSettings

_SLOW_RAD_S = 0.05


@pytest.fixture(params=STANDS)
def stand(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[str, Stand]]:
    with STANDS[request.param](tmp_path) as stand:
        yield request.param, stand


@pytest.fixture
def arm(stand: tuple[str, Stand]) -> Iterator[WatchedArm]:
    """The real driver's arm, a second into a slow move of ten."""
    name, devices = stand
    plan, stop = devices.plan, StopRequest()
    guard = replace(Guard.of(plan), joint_speed_rad_s=_SLOW_RAD_S)
    arm = WatchedArm(patient_driver(name, devices), guard, HostClock(), stop)
    try:
        here = arm.connect()
        threading.Thread(target=ask_on_the_way, args=(devices, stop), daemon=True).start()
        with pytest.raises(StoppedByOperator):
            arm.go(here - 10 * _SLOW_RAD_S * np.eye(6)[5], "a slow turn of the wrist")
        yield arm
    finally:
        devices.arm.restore()
        devices.arm.halt("the test is over")
        arm.arm.close()


def ask_on_the_way(devices: Stand, stop: StopRequest) -> None:
    while not devices.truly_moving():
        time.sleep(0.01)
    time.sleep(1.0)
    stop.ask("the test")


def patient_driver(name: str, devices: Stand) -> Arm:
    """Time-outs that a busy machine does not run into."""
    if name.startswith("ur"):
        return URArm(devices.arm.address, URSettings(silence_s=2.0, start_timeout_s=30.0))
    return ABBArm(
        devices.arm.url,
        ABBSettings(login=FACTORY_LOGIN, silence_s=3.0, read_timeout_s=2.0),
    )


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_stop_is_confirmed_where_readings_are_true_and_never_where_they_are_not(
    kind: Kind, stand: tuple[str, Stand], arm: WatchedArm
) -> None:
    name, devices = stand
    for fault, value in kind.faults.items():
        setattr(devices.arm.faults, fault, value)
    word = arm.halt(undisturbed=True)
    if word.stands:
        assert not devices.truly_moving()
    else:
        assert "PRESS THE EMERGENCY STOP" in word.text
    if name not in kind.either:
        assert word.stands == (name in kind.confirmed), word.text
