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
from cell.storage.files.cell_file import AbbRobot, UniversalRobot
from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings
from drivers.arm import Arm
from drivers.ur import URArm, URSettings
from sim.peers.controller_faults import Stops

_SLOW_RAD_S = 0.05


CASES = [
    pytest.param(name, kind, id=f"{name}: {kind.name}")
    for name in STANDS
    for kind in KINDS
    # what the newer controllers do not share with the older is how orders get there
    if name in ("ur+gige", "abb+robotiq") or kind.name in ("obeyed", "refused, no watchdog")
]


@pytest.fixture
def stand(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Stand]:
    with STANDS[request.param](tmp_path) as stand:
        yield stand


@pytest.fixture
def arm(stand: Stand) -> Iterator[WatchedArm]:
    """The real driver's arm, a second into a slow move of ten."""
    plan, stop = stand.plan, StopRequest()
    guard = replace(Guard.of(plan), joint_speed_rad_s=_SLOW_RAD_S)
    arm = WatchedArm(patient_driver(stand), guard, HostClock(), stop)
    try:
        here = arm.connect()
        threading.Thread(target=ask_on_the_way, args=(stand, stop), daemon=True).start()
        with pytest.raises(StoppedByOperator):
            arm.go(here - 10 * _SLOW_RAD_S * np.eye(6)[5], "a slow turn of the wrist")
        yield arm
    finally:
        stand.arm.restore()
        stand.arm.halt("the test is over")
        arm.arm.close()


def ask_on_the_way(devices: Stand, stop: StopRequest) -> None:
    while not devices.truly_moving():
        time.sleep(0.01)
    time.sleep(1.0)
    stop.ask("the test")


def patient_driver(devices: Stand) -> Arm:
    """Time-outs that a busy machine does not run into."""
    robot = devices.plan.cell.robot
    if isinstance(robot, UniversalRobot):
        return URArm(
            robot.address,
            URSettings(silence_s=2.0, start_timeout_s=30.0, robot_api_port=robot.robot_api_port),
        )
    assert isinstance(robot, AbbRobot)
    return ABBArm(
        devices.arm.url,
        ABBSettings(
            login=FACTORY_LOGIN,
            certificate_sha256=robot.certificate_sha256,
            silence_s=3.0,
            read_timeout_s=2.0,
        ),
    )


@pytest.mark.parametrize(("stand", "kind"), CASES, indirect=["stand"])
def test_a_stop_is_confirmed_where_readings_are_true_and_never_where_they_are_not(
    kind: Kind, stand: Stand, arm: WatchedArm
) -> None:
    for fault, value in kind.faults.items():
        setattr(stand.arm.faults, fault, value)
    word = arm.halt(StoppedByOperator("stopped by the test"))
    if word.stands:
        assert not stand.truly_moving()
    else:
        assert "PRESS THE EMERGENCY STOP" in word.text
    moved_again = arm.stand_by(lambda: False)
    if kind.faults.get("stops") is Stops.RESUMED and word.after_s < kind.faults["late_s"] - 0.2:
        assert moved_again is not None
        assert not stand.truly_moving()
    elif stand.maker not in kind.either:
        assert word.stands == (stand.maker in kind.confirmed), word.text
