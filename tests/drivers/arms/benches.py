"""Each driver on its bench: the driver, the arm behind the wire, and the faults one can order."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from stand_in import HOME, StandInArm

from drivers.arm import Arm, ArmState, Motion, MoveTarget
from drivers.ur import URArm, URSettings
from sim.peers.ur import URController

_numbers = itertools.count(2)


@dataclass
class Bench:
    arm: Arm
    truth: Callable[[], ArmState]
    home: tuple[float, ...]
    trip: Callable[[], None]
    lose: Callable[[], None]
    stop_times_s: Callable[[], list[float]]

    def nearby(self, shift_rad: float = 0.15) -> tuple[float, ...]:
        return tuple(angle + shift_rad for angle in self.home)


def own_address() -> str:
    """A loopback address that no other bench of any test process has."""
    process = os.getpid() % 50_000
    return f"127.{process // 250 + 10}.{process % 250}.{next(_numbers)}"


def dh_of(sim: StandInArm) -> tuple[tuple[float, ...], ...]:
    theta, d, a, alpha = sim.kinematics.dh.T
    return tuple(theta), tuple(a), tuple(d), tuple(alpha)


@contextmanager
def ur_peer() -> Iterator[tuple[URController, StandInArm]]:
    sim = StandInArm()
    with URController(sim, own_address(), dh=dh_of(sim)) as controller:
        yield controller, sim


@contextmanager
def ur_bench() -> Iterator[Bench]:
    with ExitStack() as stack:
        controller, sim = stack.enter_context(ur_peer())
        controller.tcp_offset = (0.01, -0.02, 0.15, 0.1, 0.2, 0.3)
        arm = URArm(controller.address, URSettings(start_timeout_s=5.0))
        stack.callback(arm.close)
        yield Bench(
            arm,
            sim.state,
            HOME,
            controller.protective_stop,
            controller.kill,
            lambda: [event.t_s for event in controller.events if event.what.startswith("halt")],
        )


def until(condition: Callable[[], bool], timeout_s: float = 5.0) -> bool:
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def wait_steady(arm: Arm, timeout_s: float = 10.0) -> ArmState:
    assert until(lambda: arm.state().motion is not Motion.MOVING, timeout_s), "still moving"
    return arm.state()


def slowly(joints_rad: tuple[float, ...]) -> MoveTarget:
    return MoveTarget(joints_rad=joints_rad, joint_speed_rad_s=0.2, tcp_speed_m_s=0.5)


def quickly(joints_rad: tuple[float, ...]) -> MoveTarget:
    return MoveTarget(joints_rad=joints_rad, joint_speed_rad_s=1.0, tcp_speed_m_s=0.9)
