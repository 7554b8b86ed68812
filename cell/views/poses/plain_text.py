"""Plain text for everybody: matrix, position, quaternion, angles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cell.views.poses.placement import Placement


def text(found: Sequence[Placement]) -> str:
    """Each transform in the ways that people type it in."""
    return "\n".join(_one(placement) for placement in found)


def _one(placement: Placement) -> str:
    matrix = placement.transform.matrix
    rows = "\n".join("  " + " ".join(f"{value: .9f}" for value in row) for row in matrix)
    mm = ", ".join(f"{1e3 * value:.4f}" for value in placement.p_m)
    q = ", ".join(f"{value:.9f}" for value in placement.q_xyzw)
    rpy = ", ".join(f"{value:.5f}" for value in placement.angles("xyz", degrees=True))
    abc = ", ".join(f"{value:.5f}" for value in placement.angles("ZYX", degrees=True))
    vector = ", ".join(f"{value:.9f}" for value in np.asarray(placement.rotation.as_rotvec()))
    return (
        f"{placement.direction}\n"
        f"{placement.about}; {placement.sigma}\n"
        f"position (mm): {mm}\n"
        f"quaternion x, y, z, w: {q}\n"
        f"roll, pitch, yaw about fixed x, y, z (degrees; Fanuc W, P, R): {rpy}\n"
        f"angles about moving z, y, x (degrees; KUKA A, B, C): {abc}\n"
        f"rotation vector (rad; UR): {vector}\n"
        f"4x4 matrix (m):\n{rows}\n"
    )
