"""Simulated devices put back to where an interrupted run left them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cell.storage.recording import FrameRecord
from sim.arm import SimArm
from sim.camera import SimCamera
from sim.clock import SimClock
from sim.log import Row


def remember_run(
    arm: SimArm, camera: SimCamera, clock: SimClock, frames: Sequence[FrameRecord]
) -> None:
    """Let arm, camera and clock be as they were after the last of these frames.

    The pictures that follow are then those of a run that was not interrupted: the arm stands at
    the last view, the lens and whatever has a memory know all frames, and no time has passed.
    Frames that failed their checks are not in the log; what they left behind is forgotten.
    """
    left_s = 0.0
    for frame in frames:
        if frame.joints_rad is None or frame.t_s is None:
            continue
        clocks = (frame.model_extra or {}).get("clocks") or {}
        taken_s = _number(clocks.get("frame_host_s"), frame.t_s)
        connected_s = taken_s - _number(clocks.get("frame_device_s"), taken_s)
        left_s = max(left_s, _number(clocks.get("read_until_host_s"), taken_s))
        joints = np.array(frame.joints_rad)
        came_from = np.array(frame.approach_joints_rad or frame.joints_rad)
        velocity = np.array(frame.joint_velocity_rad_s or np.zeros(len(joints)))
        row = Row(taken_s - connected_s, joints, velocity, came_from, frame.exposure_s or 0.0)
        camera.has_seen(row, arm.has_moved(came_from, joints), connected_s, frame.focus_distance_m)
    clock.sleep(left_s - clock.now())


def _number(value: Any, otherwise: float) -> float:
    return float(value) if isinstance(value, int | float) else otherwise
