"""Each driver on its bench: the driver, the arm behind the wire, and the faults one can order."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import arm as kinematics_of
from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings
from drivers.abb.transport import certificate_of
from drivers.arm import Arm, ArmState, Motion, MoveTarget
from drivers.errors import DeviceError, DeviceUnreachable, StopFailed
from drivers.ur import URArm, URSettings
from sim.arm import SimArm
from sim.clock import WallClock
from sim.peers.abb import ABBController
from sim.peers.loopback import own_address
from sim.peers.ur import URController

UR_HOME = (0.1, -1.4, 1.6, -1.7, -1.5, 0.2)
UR_FAR = tuple(angle + 0.6 for angle in UR_HOME)

PATIENT_UR: dict[str, Any] = {"silence_s": 1.5, "watchdog_hz": 0.5, "start_timeout_s": 30.0}
PATIENT_ABB: dict[str, Any] = {
    "silence_s": 1.5,
    "connect_timeout_s": 1.2,
    "read_timeout_s": 1.2,
    "link_watch_s": 4.0,
}
"""A machine that is busy with something else keeps devices and drivers alike from answering: where
a test asks what is done and not how soon, that must not end it."""


@dataclass
class Bench:
    """`watched`: there is a controller that looks after its own link."""

    arm: Arm
    sim: SimArm
    model: str
    home: tuple[float, ...]
    trip: Callable[[], None]
    lose: Callable[[], None]
    stop_times_s: Callable[[], list[float]]
    watched: bool = True

    def nearby(self, shift_rad: float = 0.15) -> tuple[float, ...]:
        return tuple(angle + shift_rad for angle in self.home)

    def true_joints(self) -> np.ndarray:
        return self.sim.truth().joints_rad

    def true_pose(self) -> RigidTransform:
        return RigidTransform.from_matrix(kinematics_of(self.model).forward(self.true_joints()))

    def truly_moving(self) -> bool:
        return truly_moving(self.sim)


def simulated(model: str, home: tuple[float, ...]) -> SimArm:
    arm = SimArm(kinematics_of(model), WallClock(), np.array(home))
    arm.connect()
    arm.state()  # its kinematics are compiled now, not while a driver waits for an answer
    arm.close()
    return arm


@contextmanager
def ur_peer(model: str = "ur5e", **more: Any) -> Iterator[tuple[URController, SimArm]]:
    sim = simulated(model, UR_HOME)
    with URController(sim, own_address(), kinematics=kinematics_of(model), **more) as controller:
        yield controller, sim


@contextmanager
def sim_bench() -> Iterator[Bench]:
    sim = simulated("ur5e", UR_HOME)
    stopped_s: list[float] = []
    stop = sim.stop

    def noted_stop() -> None:
        stop()
        stopped_s.append(time.monotonic())

    def lose() -> None:
        sim.faults.unreachable = True

    sim.stop = noted_stop  # type: ignore[method-assign]
    yield Bench(
        sim, sim, "ur5e", UR_HOME, sim.protective_stop, lose, lambda: stopped_s, watched=False
    )


ROBOT_API_PORT = 8080


@contextmanager
def ur_bench(robot_api_port: int | None = None) -> Iterator[Bench]:
    with ExitStack() as stack:
        controller, sim = stack.enter_context(ur_peer(robot_api_port=robot_api_port))
        controller.tcp_offset = (0.01, -0.02, 0.15, 0.1, 0.2, 0.3)
        settings = URSettings(**PATIENT_UR, robot_api_port=ROBOT_API_PORT)
        arm = URArm(controller.address, settings)
        stack.callback(arm.close)
        yield Bench(
            arm,
            sim,
            "ur5e",
            UR_HOME,
            controller.protective_stop,
            controller.kill,
            lambda: [event.t_s for event in controller.events if event.what.startswith("halt")],
        )


@contextmanager
def polyscope_x_bench() -> Iterator[Bench]:
    with ur_bench(ROBOT_API_PORT) as bench:
        yield bench


ABB_HOME = (0.1, 0.2, -0.3, 0.1, 0.6, 0.2)


@contextmanager
def abb_peer(egm_port: int | None = None, **more: Any) -> Iterator[tuple[ABBController, SimArm]]:
    sim = simulated("irb140", ABB_HOME)
    with ABBController(sim, own_address(), egm_port=egm_port, **more) as controller:
        yield controller, sim


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])


@contextmanager
def abb_bench(egm: bool = False, omnicore: bool = False) -> Iterator[Bench]:
    port = free_udp_port() if egm else None
    with ExitStack() as stack:
        controller, sim = stack.enter_context(abb_peer(port, omnicore=omnicore))
        arm = ABBArm(controller.url, abb_settings(controller, egm_port=port, **PATIENT_ABB))
        stack.callback(arm.close)
        yield Bench(
            arm,
            sim,
            "irb140",
            ABB_HOME,
            controller.guard_stop,
            controller.kill,
            lambda: [event.t_s for event in controller.events if event.what.startswith("halt")],
        )


def abb_settings(controller: ABBController, **more: Any) -> ABBSettings:
    """A login, and the controller's certificate where it shows one."""
    shown = certificate_of(controller.address, controller.port)
    return ABBSettings(login=FACTORY_LOGIN, certificate_sha256=shown, **more)


@contextmanager
def omnicore_bench() -> Iterator[Bench]:
    with abb_bench(omnicore=True) as bench:
        yield bench


@contextmanager
def abb_egm_bench() -> Iterator[Bench]:
    with abb_bench(egm=True) as bench:
        yield bench


def until(condition: Callable[[], bool], timeout_s: float = 20.0) -> bool:
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def wait_steady(arm: Arm, timeout_s: float = 40.0) -> ArmState:
    """The first reading from after this call that reports no motion."""
    since_s, seen = time.monotonic(), []

    def steady() -> bool:
        seen[:] = [arm.state()]
        return seen[0].host_t_s > since_s and seen[0].motion is not Motion.MOVING

    assert until(steady, timeout_s), "still moving"
    return seen[0]


def slowly(joints_rad: tuple[float, ...]) -> MoveTarget:
    return MoveTarget(joints_rad=joints_rad, joint_speed_rad_s=0.1, tcp_speed_m_s=0.5)


def quickly(joints_rad: tuple[float, ...]) -> MoveTarget:
    return MoveTarget(joints_rad=joints_rad, joint_speed_rad_s=1.0, tcp_speed_m_s=0.9)


def truly_moving(sim: SimArm) -> bool:
    return bool(np.abs(sim.truth().joint_velocity_rad_s).max() > 0.0)


def halts_short_of(sim: SimArm, *targets_rad: tuple[float, ...]) -> bool:
    """Whether the arm comes to rest before its target: stopped, if late, on a busy machine."""
    assert until(lambda: not truly_moving(sim))
    return bool(np.abs(np.subtract(sim.truth().joints_rad, targets_rad)).max(axis=1).min() > 0.01)


def halted_s(controller: URController | ABBController, since_s: float) -> float:
    """Time from `since_s` to the halt of the arm, as the controller noted it."""

    def halts() -> list[float]:
        halts = (event.t_s for event in controller.events if event.what.startswith("halt"))
        return [t_s for t_s in halts if t_s >= since_s]

    assert until(lambda: bool(halts())), controller.events
    return halts()[0] - since_s


def stays(sim: SimArm, duration_s: float = 0.3) -> bool:
    before = sim.truth().joints_rad
    time.sleep(duration_s)
    return bool(np.abs(sim.truth().joints_rad - before).max() < 1e-9)


def unreachable(arm: Arm) -> bool:
    try:
        arm.state()
    except (DeviceUnreachable, StopFailed):
        return True
    return False


@contextmanager
def ur_moving(
    polyscope_x: bool = False, **settings: Any
) -> Iterator[tuple[URArm, URController, SimArm]]:
    """A UR arm on its way to `UR_FAR`."""
    api = {"robot_api_port": ROBOT_API_PORT} if polyscope_x else {}
    with ur_peer(**api) as (controller, sim):
        arm = URArm(controller.address, URSettings(**{"start_timeout_s": 20.0, **api, **settings}))
        try:
            arm.connect()
            arm.start_move(slowly(UR_FAR))
            assert until(lambda: truly_moving(sim))
            time.sleep(0.1)
            yield arm, controller, sim
        finally:
            arm.close()


def at_speed(joints_rad: tuple[float, ...], tcp_speed_m_s: float) -> MoveTarget:
    return MoveTarget(joints_rad=joints_rad, joint_speed_rad_s=1.0, tcp_speed_m_s=tcp_speed_m_s)


def best_of_three(measure: Callable[[], float], goal_s: float) -> None:
    """A latency that a busy machine may spoil twice, and one with more to do than cores often."""
    latencies_s: list[Any] = []
    while len(latencies_s) < (3 if os.getloadavg()[0] < 1.5 * (os.cpu_count() or 1) else 12):
        try:
            latencies_s.append(measure())
        except DeviceError as spoiled:  # a time-out, before there was anything to measure
            latencies_s.append(str(spoiled))
            continue
        if latencies_s[-1] < goal_s:
            return
    raise AssertionError(latencies_s)
