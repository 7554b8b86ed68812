"""The smallest arm and camera a sequencer can be tried on."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import arm
from drivers.arm import ArmState, Motion, MoveTarget
from drivers.camera import FocusSetting, Frame

BRAKE_S = 0.02
"""From the order to the halt: no arm stands where it was when it was ordered to stop."""
HOME = np.radians([0, -90, 90, -90, -90, 0])


class FastClock:
    """Time that passes only when somebody sleeps."""

    def __init__(self) -> None:
        self.t_s = 100.0

    def now(self) -> float:
        return self.t_s

    def sleep(self, seconds: float) -> None:
        self.t_s += seconds


class FakeArm:
    """Moves straight in joint space at the ordered speed."""

    tried_on_hardware = False

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.now = now
        self.start = self.end = HOME
        self.began_s, self.takes_s = now(), 0.0
        self.calls: list[str] = []
        self.stopped_s: float | None = None
        self.fault: str | None = None
        self.stop_error: Exception | None = None
        self.drift_rad = 0.0
        self.reports_every_s = 0.0
        self.obeys_after_s = 0.0
        """From the first order to the brake; inf for an arm that takes it and drives on."""
        self.brakes_s = np.inf

    def connect(self) -> None:
        self.calls.append("connect")

    @property
    def reported_s(self) -> float:
        every = self.reports_every_s
        return self.now() // every * every if every else self.now()

    @property
    def share(self) -> float:
        now_s = min(self.now(), self.brakes_s)
        return min(1.0, (now_s - self.began_s) / self.takes_s) if self.takes_s else 1.0

    @property
    def moving(self) -> bool:
        return self.share < 1.0 and self.now() < self.brakes_s

    def state(self) -> ArmState:
        joints = self.start + self.share * (self.end - self.start) + self.drift_rad
        motion = Motion.MOVING if self.moving else Motion.STEADY
        return ArmState(
            host_t_s=self.reported_s,
            controller_t_s=None,
            joints_rad=tuple(joints.tolist()),
            joint_velocity_rad_s=(0.0,) * 6,
            base_from_flange=RigidTransform.from_matrix(arm("ur5e").forward(joints)),
            motion=Motion.STOPPED_BY_FAULT if self.fault else motion,
            fault=self.fault,
        )

    def start_move(self, target: MoveTarget) -> None:
        self.calls.append("move")
        self.start = self.start + self.share * (self.end - self.start)
        self.end = np.array(target.joints_rad)
        self.brakes_s = np.inf
        self.began_s = self.now()
        self.takes_s = float(np.abs(self.end - self.start).max()) / target.joint_speed_rad_s

    def stop(self) -> None:
        self.calls.append("stop")
        if self.stop_error is not None:
            raise self.stop_error
        self.stopped_s = self.stopped_s or self.now()
        self.brakes_s = min(self.brakes_s, self.now() + self.obeys_after_s + BRAKE_S)

    def close(self) -> None:
        self.calls.append("close")


class FakeCamera:
    """Its pictures carry their number; `grabs` may hold exceptions to raise."""

    tried_on_hardware = False

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self.now = now
        self.calls: list[str] = []
        self.grabs: list[Exception | None] = []
        self.lag_s = 0.0
        self.size = (480, 640)

    def connect(self) -> None:
        self.calls.append("connect")

    def configure(
        self, *, exposure_s: float | None = None, gain_db: float | None = None
    ) -> Mapping[str, float]:
        return {"exposure_s": exposure_s or 0.0}

    def focus(self, setting: FocusSetting) -> float | None:
        return None

    def grab(self, timeout_s: float) -> Frame:
        self.calls.append("grab")
        fault = self.grabs.pop(0) if self.grabs else None
        if fault is not None:
            raise fault
        image = np.full(self.size, len(self.calls), np.uint8)
        return Frame(image, self.now() - self.lag_s, exposure_s=0.01, raw={"id": len(self.calls)})

    def close(self) -> None:
        self.calls.append("close")
