"""What a reader asks of a calibration, as linear functions of the numbers that were fitted."""

from __future__ import annotations

import numpy as np

from calib.calibration.uncertainty import focal_length_change_px, workpiece_change_m
from calib.chain.rigid import skew
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views

_HOLDS = {
    "eye_in_hand": {"camera": "flange_from_mounted", "board": "base_from_fixed"},
    "eye_to_hand": {"camera": "base_from_fixed", "board": "flange_from_mounted"},
}


def quantities_of(
    joint: JointFit, views: Views, distance_range_m: tuple[float, float]
) -> dict[str, FloatArray]:
    """(r, p) by name: how a quantity's r numbers follow the p that were fitted.

    Focal length and depth (where a part is for the robot, along the axis) are asked for at
    the nearest and the farthest distance, in the image's middle; a focal length that stands still
    once. Where the board's middle is seen from a logged pose is the mean over the views.
    """
    names = [u.name for u in joint.unknowns]
    eye = np.eye(len(names))

    def rows(*wanted: str) -> FloatArray:
        return np.asarray(eye[[names.index(name) for name in wanted]])

    ends = np.array(distance_range_m)
    middle = np.array([[views.width_px - 1.0, views.height_px - 1.0]]) / 2
    alpha = focal_length_change_px(joint, views, ends)
    depth = workpiece_change_m(joint, views, middle, ends)[:, 0, 2]
    out = {"alpha_near_px": alpha[:1], "alpha_far_px": alpha[1:]}
    if np.allclose(alpha[0], alpha[1]):
        out = {"alpha_px": alpha[:1]}
    out |= {
        "depth_near_m": depth[:1],
        "depth_far_m": depth[1:],
        "principal_point_px": rows("u0_px", "v0_px"),
        "board_in_camera_m": _board_in_camera(joint),
    }
    for thing, frame in _HOLDS[views.mount].items():
        out[f"{thing}_position_m"] = rows(*(f"{frame}.{axis}" for axis in "xyz"))
        out[f"{thing}_turn_rad"] = rows(*(f"{frame}.r{axis}" for axis in "xyz"))
    return out


def _board_in_camera(joint: JointFit) -> FloatArray:
    """(3, p) of the board's middle in the camera's frame, by the logged poses; the views' mean."""
    found = joint.dependence
    pose = slice(len(found.active), len(found.active) + 6)
    middle = np.append(found.state.points_m.mean(axis=0), 1.0)
    at = (found.state.camera_from_board @ middle)[:, :3]
    moves = np.concatenate([np.tile(np.eye(3), (len(at), 1, 1)), -skew(at)], axis=2)
    return np.asarray((moves @ found.local[:, pose]).mean(axis=0))
