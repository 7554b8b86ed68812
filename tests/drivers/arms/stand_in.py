"""A kinematic arm: joints run straight to the target at constant speed and stop dead."""

from __future__ import annotations

import time
from threading import RLock

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import OutOfReach, arm
from drivers.arm import ArmState, Motion, MoveTarget
from drivers.errors import SafetyError

HOME = (0.1, -1.4, 1.6, -1.7, -1.5, 0.2)


class StandInArm:
    tried_on_hardware = False

    def __init__(self, model="ur5e", home=HOME):
        self.kinematics = arm(model)
        self._lock = RLock()
        self._begin = self._end = np.array(home)
        self._t0 = self._duration = 0.0

    def connect(self):
        pass

    def close(self):
        self.stop()

    def state(self):
        with self._lock:
            now = time.monotonic()
            joints, moving = self._joints(now)
            speed = (self._end - self._begin) / self._duration if moving else np.zeros(6)
            pose = RigidTransform.from_matrix(self.kinematics.forward(joints))
            motion = Motion.MOVING if moving else Motion.STEADY
            return ArmState(now, now, tuple(joints), tuple(speed), pose, motion)

    def start_move(self, target: MoveTarget):
        with self._lock:
            if target.joints_rad is not None:
                goal = np.array(target.joints_rad)
            else:
                matrix = target.base_from_flange.as_matrix()
                try:
                    goal = self.kinematics.inverse(matrix, self._joints(time.monotonic())[0])
                except OutOfReach as error:
                    raise SafetyError(str(error)) from None
            self._begin, _ = self._joints(time.monotonic())
            self._end = goal
            self._t0 = time.monotonic()
            longest = np.abs(self._end - self._begin).max()
            self._duration = max(longest / target.joint_speed_rad_s, 1e-6)

    def stop(self):
        with self._lock:
            here, _ = self._joints(time.monotonic())
            self._begin = self._end = here

    def _joints(self, now):
        share = (now - self._t0) / self._duration if self._duration else 1.0
        if share >= 1.0 or np.array_equal(self._begin, self._end):
            return self._end, False
        return self._begin + share * (self._end - self._begin), True
