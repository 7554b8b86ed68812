"""Numbers of a pose as a rigid transform, in every way that rotations are written."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.views import FloatArray
from cell.verbs.importing import RotationName, Unit

METRES: dict[Unit, float] = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254}
"""Length of each unit."""

THREE_ANGLES: dict[RotationName, Callable[[FloatArray], Rotation]] = {
    "rotvec": Rotation.from_rotvec,
    "rotvec_deg": lambda r: Rotation.from_rotvec(r, degrees=True),
    "rpy": lambda r: Rotation.from_euler("xyz", r),
    "rpy_deg": lambda r: Rotation.from_euler("xyz", r, degrees=True),
    "euler_zyx": lambda r: Rotation.from_euler("ZYX", r),
    "euler_zyx_deg": lambda r: Rotation.from_euler("ZYX", r, degrees=True),
    "euler_xyz": lambda r: Rotation.from_euler("XYZ", r),
    "euler_xyz_deg": lambda r: Rotation.from_euler("XYZ", r, degrees=True),
    "euler_zyz": lambda r: Rotation.from_euler("ZYZ", r),
    "euler_zyz_deg": lambda r: Rotation.from_euler("ZYZ", r, degrees=True),
}
QUATERNIONS: dict[RotationName, Callable[[FloatArray], Rotation]] = {
    "quat_xyzw": Rotation.from_quat,
    "quat_wxyz": lambda q: Rotation.from_quat(np.roll(q, -1)),
}
_UNIT_LENGTH = 1e-2


def read_pose(values: FloatArray, rotation: RotationName) -> tuple[Rotation, FloatArray]:
    """Rotation and position of 6, 7, 12 or 16 numbers.

    Raises
    ------
    ValueError
        They cannot be what they are stated to be.
    """
    if rotation in ("matrix", "matrix_by_columns"):
        return _read_matrix(values, by_columns=rotation == "matrix_by_columns")
    count = 7 if rotation in QUATERNIONS else 6
    if len(values) != count:
        raise ValueError(f"{rotation} needs {count} numbers, not {len(values)}")
    if rotation in QUATERNIONS:
        if not is_unit(values[3:]):
            raise ValueError(f"its quaternion has the length {np.linalg.norm(values[3:]):.4g}")
        return QUATERNIONS[rotation](values[3:]), values[:3]
    return THREE_ANGLES[rotation](values[3:]), values[:3]


def is_unit(quaternion: FloatArray) -> bool:
    """Whether four numbers can be a unit quaternion, as rounded as files write it."""
    return bool(abs(np.linalg.norm(quaternion) - 1) < _UNIT_LENGTH)


def read_matrices(
    poses: Sequence[FloatArray], rotation: RotationName, *, inverted: bool
) -> FloatArray:
    """(N, 4, 4) of poses, positions as they are written; raises `ValueError` as `read_pose`."""
    found = []
    for values in poses:
        turn, place = read_pose(values, rotation)
        transform = RigidTransform.from_components(place, turn)
        found.append((transform.inv() if inverted else transform).as_matrix())
    return np.array(found)


def is_rotation(matrix: FloatArray) -> bool:
    """Whether a 3x3 matrix is one, as rounded as files write it."""
    return bool(
        np.allclose(matrix @ matrix.T, np.eye(3), atol=_UNIT_LENGTH) and np.linalg.det(matrix) > 0
    )


def _read_matrix(values: FloatArray, *, by_columns: bool) -> tuple[Rotation, FloatArray]:
    if len(values) not in (12, 16):
        raise ValueError(f"a matrix has 12 or 16 numbers, not {len(values)}")
    rows = values.reshape(-1, 4)
    if by_columns:
        rows = (values.reshape(4, 4) if len(values) == 16 else values.reshape(4, 3)).T
    if not is_rotation(rows[:3, :3]):
        raise ValueError("its 3x3 part is no rotation")
    return Rotation.from_matrix(rows[:3, :3]), rows[:3, 3]
