"""What a pose's numbers mean: said by the user, or guessed where only one reading is possible."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.views import FloatArray
from cell.errors import InputError
from cell.importing import RotationName, Unit
from cell.importing.pose_files import RawPose

_FARTHEST_M = 4.0
"""No arm this program knows reaches farther; larger numbers are millimetres."""

_READ: dict[str, tuple[int, Callable[[FloatArray], Rotation]]] = {
    "quat_xyzw": (4, Rotation.from_quat),
    "quat_wxyz": (4, lambda q: Rotation.from_quat(np.roll(q, -1))),
    "rotvec": (3, Rotation.from_rotvec),
    "rotvec_deg": (3, lambda r: Rotation.from_rotvec(r, degrees=True)),
    "rpy": (3, lambda r: Rotation.from_euler("xyz", r)),
    "rpy_deg": (3, lambda r: Rotation.from_euler("xyz", r, degrees=True)),
    "euler_zyx_deg": (3, lambda r: Rotation.from_euler("ZYX", r, degrees=True)),
}


@dataclass(frozen=True)
class Convention:
    """How poses are written.

    Attributes
    ----------
    rotation:
        What the numbers after the position are.
    unit:
        Of the position.
    guessed:
        What was not said but concluded, each as a sentence to be told aloud.
    """

    rotation: RotationName
    unit: Unit
    guessed: tuple[str, ...] = ()

    def transform(self, pose: RawPose) -> RigidTransform:
        """One pose; raises `InputError` where its numbers cannot be what they are said to be."""
        scale = 1e-3 if self.unit == "mm" else 1.0
        try:
            if self.rotation == "matrix":
                rows = pose.values.reshape(-1, 4)
                turn, p_m = _orthonormal(rows[:3, :3]), scale * rows[:3, 3]
            else:
                count, read = _READ[self.rotation]
                if len(pose.values) != 3 + count:
                    raise ValueError(f"{self.rotation} needs {3 + count} numbers")
                turn, p_m = read(pose.values[3:]), scale * pose.values[:3]
            return RigidTransform.from_components(p_m, turn)
        except ValueError as fault:
            raise InputError(f"{pose.where}: is no pose as {self.rotation}: {fault}") from None


def _orthonormal(matrix: FloatArray) -> Rotation:
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-2) or np.linalg.det(matrix) < 0:
        raise ValueError("its 3x3 part is no rotation")
    return Rotation.from_matrix(matrix)


def conclude(
    poses: Sequence[RawPose], rotation: RotationName | None, unit: Unit | None
) -> Convention:
    """The convention of these poses: as said, else what the numbers alone decide.

    Raises
    ------
    InputError
        The numbers allow several readings; the message names them.
    """
    guessed: list[str] = []
    if rotation is None:
        rotation = _conclude_rotation(poses)
        guessed.append(f"rotations are {rotation} (say so with --rotation {rotation})")
    if unit is None:
        farthest = max(float(np.abs(_position(pose)).max()) for pose in poses)
        unit = "mm" if farthest > _FARTHEST_M else "m"
        guessed.append(
            f"positions are in {unit}, as the largest coordinate is {farthest:.4g}"
            f" (say so with --unit {unit})"
        )
    return Convention(rotation, unit, tuple(guessed))


def _position(pose: RawPose) -> FloatArray:
    if len(pose.values) >= 12:
        return np.asarray(pose.values.reshape(-1, 4)[:3, 3])
    return np.asarray(pose.values[:3])


def _conclude_rotation(poses: Sequence[RawPose]) -> RotationName:
    width, where = len(poses[0].values), poses[0].where
    if width >= 12:
        return "matrix"
    if width == 7:
        raise InputError(
            f"{where}: a quaternion may be written x y z w or w x y z, and its numbers do not tell"
            " which. Say --rotation quat_xyzw (ROS, scipy) or --rotation quat_wxyz (ABB, Eigen)."
        )
    raise InputError(
        f"{where}: three numbers of a rotation may be a rotation vector or angles about axes. Say"
        " --rotation rotvec (UR), rotvec_deg, rpy, rpy_deg (fixed x y z) or euler_zyx_deg (KUKA)."
    )
