"""What a simulated cell logs, as the views that the chain takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.views import FloatArray, Views
from sim.arm import ACCELERATION_RAD_S2, SETTLE_S
from sim.cell import SimulatedCell
from sim.motion import plan_move

AMBIENT_C, WARM_C, WARM_UP_S = 22.0, 34.0, 900.0
"""A camera's body warms from the first to the second with the third as time constant."""


@dataclass(frozen=True)
class Row:
    """One frame's line in the log: time and joints, (6,) each."""

    t_s: float
    joints_rad: FloatArray
    joint_velocity_rad_s: FloatArray
    approach_joints_rad: FloatArray
    exposure_s: float


def views_of(cell: SimulatedCell, rows: list[Row]) -> Views:
    """Views without corners, in the order of `rows`; poses are the nominal kinematics."""
    joints = np.array([row.joints_rad for row in rows])
    t_s = np.array([row.t_s for row in rows])
    blank = Views.blank(
        cell.board,
        width_px=cell.camera.width_px,
        height_px=cell.camera.height_px,
        frames=len(rows),
        mount=cell.mount,
    )
    speeds = np.array([row.joint_velocity_rad_s for row in rows])
    return replace(
        blank,
        base_from_flange=cell.kinematics.forward(joints),
        joints_rad=joints,
        joint_velocity_rad_s=speeds,
        approach_joints_rad=np.array([row.approach_joints_rad for row in rows]),
        t_s=t_s,
        temperature_c=temperature_c(t_s),
        exposure_s=np.array([row.exposure_s for row in rows]),
        robot_model=cell.robot_model,
        payload_kg=cell.payload_kg,
        moving=bool((speeds != 0).any()),
    )


def temperature_c(t_s: FloatArray | float) -> FloatArray:
    """Temperature of the camera's body that long after it was switched on."""
    return np.asarray(WARM_C - (WARM_C - AMBIENT_C) * np.exp(-np.asarray(t_s) / WARM_UP_S))


def tour(
    cell: SimulatedCell,
    joints_rad: FloatArray,
    *,
    speed_m_s: float = 0.1,
    joint_speed_rad_s: float = 0.5,
    dwell_s: float = 1.0,
    exposure_s: float = 0.01,
    joint_velocity_rad_s: FloatArray | None = None,
) -> Views:
    """The log of a run from pose to pose, its times as the arm takes them.

    Parameters
    ----------
    cell:
        Arm and camera.
    joints_rad:
        (N, 6) poses in the order they are visited, from `cell.home_rad` on.
    speed_m_s, joint_speed_rad_s:
        Bounds on the flange and on every joint.
    dwell_s:
        Standstill at each pose after settling.
    exposure_s:
        As logged.
    joint_velocity_rad_s:
        (N, 6) joint speeds at the exposures, for frames captured in motion; at rest where None.
    """
    joints = np.asarray(joints_rad, float)
    came_from = np.concatenate([np.asarray(cell.home_rad, float)[None], joints[:-1]])
    speeds = np.zeros_like(joints) if joint_velocity_rad_s is None else joint_velocity_rad_s
    took = [
        plan_move(
            cell.kinematics,
            start,
            end,
            0.0,
            flange_speed_m_s=speed_m_s,
            joint_speed_rad_s=joint_speed_rad_s,
            acceleration_rad_s2=ACCELERATION_RAD_S2,
        ).profile.duration_s
        for start, end in zip(came_from, joints, strict=True)
    ]
    t_s = np.cumsum(np.array(took) + SETTLE_S + dwell_s)
    rows = [
        Row(t, q, qd, before, exposure_s)
        for t, q, qd, before in zip(t_s, joints, speeds, came_from, strict=True)
    ]
    return views_of(cell, rows)
