"""Readings of the arm: by polling Robot Web Services, or from EGM's stream."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from drivers.abb.plausible import implausible
from drivers.abb.units import transform_of
from drivers.errors import DeviceError


@dataclass(frozen=True)
class Reading:
    """What the controller reported of the arm.

    Attributes
    ----------
    host_t_s:
        Host clock (`time.monotonic`) when it was asked for, or when EGM's message came.
    controller_t_s:
        The controller's clock; None from RWS, which states none.
    joints_rad:
        Six joint angles.
    base_from_flange:
        Pose of tool0 in the base frame, which is the flange's.
    external:
        The six external axes as the controller gives them, to be sent back unchanged.
    configuration:
        cf1, cf4, cf6, cfx.
    raw:
        The values in ABB's units, for the log.
    """

    host_t_s: float
    controller_t_s: float | None
    joints_rad: tuple[float, ...]
    base_from_flange: RigidTransform
    external: tuple[float, ...]
    configuration: tuple[float, ...]
    raw: dict[str, Any]


def read_rws(
    rws: Any,
    now_s: float,
    limits_rad: Sequence[tuple[float, float]],
    before: Reading | None = None,
) -> Reading:
    """Ask for joints and flange pose, in two requests; they are of one instant if it stands.

    Where the joints are what they were in the reading `before`, to the last digit that the
    controller reports, so is the pose, and it is not asked for again. Raises `DeviceError` for what
    can be no reading of an arm whose joints have the limits `limits_rad`.
    """
    joints = rws.get_jointtarget()
    if before is not None and before.raw.get("jointtarget_deg") == joints.robax.tolist():
        return replace(before, host_t_s=now_s)
    pose = rws.get_robtarget(tool="tool0", wobj="wobj0", coordinate="Base")
    wrong = implausible(joints.robax.tolist(), pose.trans.tolist(), pose.rot.tolist(), limits_rad)
    if wrong is not None:
        raise DeviceError(f"what the controller says of joints and pose cannot be: {wrong}")
    return Reading(
        host_t_s=now_s,
        controller_t_s=None,
        joints_rad=tuple(np.radians(joints.robax).tolist()),
        base_from_flange=transform_of(pose.trans, pose.rot),
        external=tuple(joints.extax.tolist()),
        configuration=tuple(pose.robconf.tolist()),
        raw={
            "source": "rws",
            "jointtarget_deg": joints.robax.tolist(),
            "trans_mm": pose.trans.tolist(),
            "rot_wxyz": pose.rot.tolist(),
        },
    )


def world_from_base(rws: Any) -> RigidTransform:
    """Return where the base stands in the world, which work objects and EGM refer to."""
    poses = {}
    for frame in ("Base", "World"):
        target = rws.get_robtarget(tool="tool0", wobj="wobj0", coordinate=frame)
        if not np.isfinite([*target.trans, *target.rot]).all():
            raise DeviceError("where the controller says that the arm is mounted is not finite")
        poses[frame] = transform_of(target.trans, target.rot)
    return poses["World"] * poses["Base"].inv()
