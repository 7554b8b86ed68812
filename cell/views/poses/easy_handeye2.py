"""easy_handeye2: the `.calib` file that its publisher reads."""

from __future__ import annotations

from collections.abc import Sequence

from cell.views.poses.placement import Placement


def text(found: Sequence[Placement]) -> str:
    """The camera's transform with the frames of the calibration; one file holds one transform."""
    camera = next((p for p in found if p.child == "camera"), found[0])
    names = camera.names
    kind = "eye_in_hand" if camera.parent == "flange" else "eye_on_base"
    x, y, z = camera.p_m
    qx, qy, qz, qw = camera.q_xyzw
    return (
        f"# {camera.direction}; {camera.about}; {camera.sigma}\n"
        "parameters:\n"
        "  name: calibration_cell\n"
        f"  calibration_type: {kind}\n"
        f"  robot_base_frame: {names['base']}\n"
        f"  robot_effector_frame: {names['flange']}\n"
        f"  tracking_base_frame: {names['camera']}\n"
        f"  tracking_marker_frame: {names['board']}\n"
        "  freehand_robot_movement: true\n"
        "transform:\n"
        f"  translation:\n    x: {x:.9f}\n    y: {y:.9f}\n    z: {z:.9f}\n"
        f"  rotation:\n    x: {qx:.9f}\n    y: {qy:.9f}\n    z: {qz:.9f}\n    w: {qw:.9f}\n"
    )
