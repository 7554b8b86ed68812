"""Which drawing shows which effect, and what the reader should see in it.

A new effect needs one `register` call; one that is not registered gets the drawing of its link.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from cell.views.report.data import ReportData
from cell.views.report.evidence import arm, board, image, lens, motion, mount, order
from cell.views.report.plot import Figure

Draw = Callable[[ReportData, Mapping[str, Any]], "Figure | None"]


@dataclass(frozen=True)
class Picture:
    """How an effect is shown.

    Attributes
    ----------
    draw:
        Function of the report's data and the effect's entry in diagnosis.json; gives None where
        what it needs was not logged or not measured.
    look_for:
        What the reader should see in it.
    needs:
        What has to be there, in words, for when it is not.
    """

    draw: Draw
    look_for: str
    needs: str


EVIDENCE: dict[str, Picture] = {}


def register(names: str, picture: Picture) -> None:
    """Show the effects or links in `names` (blank-separated) with `picture`."""
    for name in names.split():
        EVIDENCE[name] = picture


def picture_of(effect: Mapping[str, Any]) -> Picture | None:
    """The drawing for an effect of diagnosis.json: its own, else its link's."""
    return EVIDENCE.get(effect["name"]) or EVIDENCE.get(str(effect.get("link")))


_DISTANCE = "each frame's camera pose by its picture and by the robot, and its distance"

register(
    "focus_breathing lens",
    Picture(
        lens.alpha_and_depth,
        "The scale factor, or the depth error in its place, follows the distance: a curve before, "
        "a flat band around zero after.",
        _DISTANCE,
    ),
)
register(
    "entrance_pupil_shift protective_window distance_dependent_distortion",
    Picture(
        lens.alpha_and_depth,
        "The depth error bends with distance, most where the board is near.",
        _DISTANCE,
    ),
)
register(
    "focus_hysteresis",
    Picture(
        lens.by_focus_direction,
        "Frames focused coming from near and from far lie on two branches before, on one after.",
        _DISTANCE + ", and the focus position or the order of the frames",
    ),
)
register(
    "exposure_bias detector",
    Picture(
        lens.by_exposure,
        "The board seems the nearer the longer the exposure (or the higher the gain) before, "
        "and at no exposure after.",
        "exposure or gain of each frame, its camera pose by its picture and by the robot",
    ),
)
register(
    "decentering higher_order_radial sensor_tilt sensor",
    Picture(
        image.before_and_after,
        "Arrows that point the same way in neighbouring cells are a pattern; noise has none.",
        "corner residuals of the plain and of the final model",
    ),
)
register(
    "joint_zero_offset link_geometry joint_compliance joint_periodic_error robot_model "
    "base_compliance arm",
    Picture(
        arm.error_against_joints,
        "The camera's position error follows a joint's angle before, and no joint's after.",
        "joint angles and the camera pose error of each frame",
    ),
)
register(
    "joint_backlash",
    Picture(
        arm.error_against_approach,
        "Frames whose joint came from below and from above differ before, and agree after.",
        "joint angles, the joints each move came from, and the camera pose error",
    ),
)
register(
    "mount_flex mount_play lens_sag mount",
    Picture(
        mount.error_against_gravity,
        "The camera's error follows the direction in which it feels gravity without the effect, "
        "and not with it.",
        "the hand-eye pose, the flange poses and the camera pose error of each frame",
    ),
)
register(
    "thermal_mount_drift thermal_focal_drift thermal_image_drift thermal_board_growth base_drift",
    Picture(
        order.drift,
        "The error moves steadily with time or temperature before, and not after.",
        "time stamps or temperatures and the camera pose error of each frame",
    ),
)
register(
    "mount_slip board_slip optics_step frame_pose_offset frame_pose_swap stale_pictures "
    "stale_poses tool_frame_step base_frame_step corner_order length_unit rotation_convention "
    "bookkeeping",
    Picture(
        order.by_frame,
        "Which frames are off: a step is a slip, single peaks are frames paired with a wrong pose.",
        "the camera pose error of each frame",
    ),
)
register(
    "pose_time_lag rolling_shutter clock",
    Picture(
        motion.error_against_speed,
        "The error grows with the speed along the image before, and not after.",
        "joint speeds and the camera pose error of each frame",
    ),
)
register(
    "board_warp board_scale board_shear board",
    Picture(
        board.shape,
        "The height map shows how far each corner is out of plane; the arrows how far it is "
        "shifted in the plane.",
        "the corners' places as found by the fit",
    ),
)
