"""Hazards that arms of either maker share: how they are brought about and what must follow."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from subprocess import DEVNULL, PIPE
from typing import Any

import pytest
from benches import (
    UR_HOME,
    best_of_three,
    halted_s,
    halts_short_of,
    quickly,
    stays,
    truly_moving,
    until,
    wait_steady,
)

from drivers.errors import ArmStopped, DeviceRefused
from drivers.ur import URArm
from sim.arm import SimArm
from sim.peers.ur import URController


def halts_within(
    goal_s: float,
    moving: Callable[[], AbstractContextManager[tuple[Any, Any, SimArm]]],
    end: Callable[[Any, Any], None],
    far: tuple[float, ...],
    *,
    then: Callable[[Any, Any], None] = lambda driven, controller: None,
) -> None:
    """The arm halts on its way to `far`, at most `goal_s` after `end` began, and stays.

    `moving` gives what drives it (an arm, or the process that has it), the controller and the
    simulated arm; `end` and `then`, after the halt, get the first two.
    """

    def measure() -> float:
        with moving() as (driven, controller, sim):
            since_s = time.monotonic()
            end(driven, controller)
            latency_s = halted_s(controller, since_s)
            then(driven, controller)
            assert halts_short_of(sim, far)
            assert stays(sim)
            return latency_s

    best_of_three(measure, goal_s)


_MOVE_AND_WAIT = """
import signal, sys, time
from drivers.arm import MoveTarget
{connect}
# what a shell starts in the background inherits a deaf ear for Ctrl-C
signal.signal(signal.SIGINT, signal.default_int_handler)
arm.connect()
arm.start_move(MoveTarget(joints_rad=tuple(map(float, sys.argv[2:])), joint_speed_rad_s=0.2,
                          tcp_speed_m_s=0.5))
print("moving", flush=True)
time.sleep(60)
"""


@contextmanager
def process_moving(
    connect: str, address: str, sim: SimArm, far: tuple[float, ...]
) -> Iterator[subprocess.Popen[bytes]]:
    """A process of its own whose arm, from the lines `connect`, is on its way to `far`."""
    command = [sys.executable, "-c", _MOVE_AND_WAIT.format(connect=connect), address]
    command += map(str, far)
    with subprocess.Popen(command, stdout=PIPE, stderr=DEVNULL) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"moving\n"
        assert until(lambda: truly_moving(sim))
        try:
            yield process
        finally:
            process.kill()


def recovers_by_the_five_second_rule(arm: URArm, controller: URController, sim: SimArm) -> None:
    """A protective stop is released when its time has come; the arm stands until it is asked."""
    controller.protective_stop()
    assert until(lambda: arm.state().fault is not None)
    with pytest.raises(ArmStopped, match="protective"):
        arm.start_move(quickly(UR_HOME))
    with pytest.raises(DeviceRefused, match="5s"):
        arm.recover()
    controller.wait_out_protective_stop()
    arm.recover()
    assert stays(sim)
    assert arm.state().fault is None
    arm.start_move(quickly(UR_HOME))
    assert wait_steady(arm).joints_rad == pytest.approx(UR_HOME, abs=1e-6)
