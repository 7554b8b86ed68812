"""What a pose's numbers mean: said by the user, or concluded from names, numbers and pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.rigid import inverse
from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing import RotationName, Unit
from cell.verbs.importing.pose_files import RawPose

Witness = Callable[[Sequence[FloatArray]], FloatArray]
"""(R, 2) how far off each reading (N, 4, 4) of all poses is by the pictures: radians, share."""

_FARTHEST_M = 4.0
"""No arm this program knows reaches farther; larger numbers are millimetres."""

_GOOD = np.array([0.06, 0.3])
"""Radians, and share of the flange's way, that rough intrinsics and a poor arm may make: a wrong
reading is off by half the way and more."""

_TELLS_APART = 3.0
"""A reading counts as decided when the next best is so many times worse."""

_LEAST = 0.005

_READ: dict[RotationName, tuple[int, Callable[[FloatArray], Rotation]]] = {
    "quat_xyzw": (4, Rotation.from_quat),
    "quat_wxyz": (4, lambda q: Rotation.from_quat(np.roll(q, -1))),
    "rotvec": (3, Rotation.from_rotvec),
    "rotvec_deg": (3, lambda r: Rotation.from_rotvec(r, degrees=True)),
    "rpy": (3, lambda r: Rotation.from_euler("xyz", r)),
    "rpy_deg": (3, lambda r: Rotation.from_euler("xyz", r, degrees=True)),
    "euler_zyx": (3, lambda r: Rotation.from_euler("ZYX", r)),
    "euler_zyx_deg": (3, lambda r: Rotation.from_euler("ZYX", r, degrees=True)),
    "euler_xyz": (3, lambda r: Rotation.from_euler("XYZ", r)),
    "euler_xyz_deg": (3, lambda r: Rotation.from_euler("XYZ", r, degrees=True)),
    "euler_zyz": (3, lambda r: Rotation.from_euler("ZYZ", r)),
    "euler_zyz_deg": (3, lambda r: Rotation.from_euler("ZYZ", r, degrees=True)),
}
_MATRICES: tuple[RotationName, ...] = ("matrix", "matrix_by_columns")


@dataclass(frozen=True)
class Convention:
    """How poses are written.

    Attributes
    ----------
    rotation:
        What the numbers after the position are.
    unit:
        Of the position.
    inverted:
        Whether they are flange_from_base.
    guessed:
        What was not said but concluded, each as a sentence to be told aloud.
    """

    rotation: RotationName
    unit: Unit
    inverted: bool = False
    guessed: tuple[str, ...] = ()

    def transform(self, pose: RawPose) -> RigidTransform:
        """base_from_flange; raises `InputError` where the numbers cannot be what they are said."""
        scale = 1e-3 if self.unit == "mm" else 1.0
        try:
            turn, p = _read(pose.values, self.rotation)
        except ValueError as fault:
            raise InputError(f"{pose.where}: is no pose as {self.rotation}: {fault}") from None
        found = RigidTransform.from_components(scale * p, turn)
        return found.inv() if self.inverted else found


def _read(values: FloatArray, rotation: RotationName) -> tuple[Rotation, FloatArray]:
    if rotation in _MATRICES:
        rows = values.reshape(-1, 4)
        if rotation == "matrix_by_columns":
            rows = (values.reshape(4, 4) if len(values) == 16 else values.reshape(4, 3)).T
        return _orthonormal(rows[:3, :3]), rows[:3, 3]
    count, read = _READ[rotation]
    if len(values) != 3 + count:
        raise ValueError(f"{rotation} needs {3 + count} numbers")
    return read(values[3:]), values[:3]


def _matrix(values: FloatArray, rotation: RotationName) -> FloatArray:
    turn, p = _read(values, rotation)
    return np.asarray(RigidTransform.from_components(p, turn).as_matrix())


def _orthonormal(matrix: FloatArray) -> Rotation:
    if not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-2) or np.linalg.det(matrix) < 0:
        raise ValueError("its 3x3 part is no rotation")
    return Rotation.from_matrix(matrix)


def conclude(
    poses: Sequence[RawPose],
    rotation: RotationName | None,
    unit: Unit | None,
    inverted: bool | None = False,
    witness: Witness | None = None,
) -> Convention:
    """The convention of these poses: as said, else what names, numbers or pictures decide.

    Parameters
    ----------
    rotation, unit, inverted:
        As said; None where it was not.
    witness:
        What the pictures say of a reading of the rotations; None where they say nothing.

    Raises
    ------
    InputError
        Several readings are left; the message names them.
    """
    readings = (rotation,) if rotation is not None else _possible(poses)
    ways = (inverted,) if inverted is not None else (False, True)
    chosen, turned, told = _decide(poses, [(r, w) for r in readings for w in ways], witness)
    guessed: list[str] = []
    if rotation is None:
        guessed.append(f"rotations are {chosen} (say so with --rotation {chosen})")
    if unit is None:
        unit, why = _unit(poses, chosen)
        guessed.append(f"positions are in {unit}, {why} (say so with --unit {unit})")
    if inverted is None:
        name, option = _DIRECTION[turned]
        guessed.append(f"poses are {name} (say so with {option})")
    return Convention(chosen, unit, turned, (*guessed, *told))


_DIRECTION = {
    False: ("base_from_flange", "--not-inverted"),
    True: ("flange_from_base", "--inverted"),
}


def _possible(poses: Sequence[RawPose]) -> tuple[RotationName, ...]:
    """What names and numbers allow; at least one."""
    named, width = poses[0].rotations, len(poses[0].values)
    if width >= 12:
        return ("matrix_by_columns",) if _by_columns(poses) else ("matrix",)
    if width == 7:
        return named or ("quat_xyzw", "quat_wxyz")
    possible = named or tuple(name for name, (count, _) in _READ.items() if count == 3)
    largest = max(float(np.abs(pose.values[3:]).max()) for pose in poses)
    if largest > 2 * np.pi + 0.01:
        degrees = tuple(name for name in possible if name.endswith("_deg"))
        return degrees or possible
    return possible


def _by_columns(poses: Sequence[RawPose]) -> bool:
    """Whether the translation stands in the last row."""
    if len(poses[0].values) != 16:
        return False
    matrices = np.array([pose.values.reshape(4, 4) for pose in poses])
    return bool((matrices[:, :3, 3] == 0).all() and (matrices[:, 3, :3] != 0).any())


def _decide(
    poses: Sequence[RawPose],
    readings: Sequence[tuple[RotationName, bool]],
    witness: Witness | None,
) -> tuple[RotationName, bool, tuple[str, ...]]:
    """Rotation, direction, and what there is to tell of how it was decided."""
    misfits = _misfits(poses, readings, witness)
    if misfits is None:
        rotations = list(dict.fromkeys(rotation for rotation, _ in readings))
        if len(rotations) > 1:
            raise InputError(_ask(poses, rotations))
        told = () if witness is None else ("the pictures could not be asked about the rotations",)
        return readings[0][0], readings[0][1], told
    size = np.hypot(misfits[:, 0], misfits[:, 1])
    order = np.argsort(size, kind="stable")
    best, least = readings[order[0]], max(float(size[order[0]]), _LEAST)
    rivals = [readings[k] for k in order[1:] if size[k] < _TELLS_APART * least]
    angle, share = misfits[order[0]]
    off = f"{np.degrees(angle):.2f} degrees, places to {1e2 * share:.1f} % of the way"
    if (misfits[order[0]] > _GOOD).any():
        if len(readings) == 1:
            return (*best, (f"BUT THE PICTURES SPEAK AGAINST IT: turns agree only to {off}",))
        raise InputError(
            f"{_ask(poses, [r for r, _ in readings])} By the pictures the best of them"
            f" ({best[0]}) agrees only to {off}: check the poses and which picture each is of."
        )
    if any(rival[0] != best[0] for rival in rivals):
        raise InputError(_ask(poses, [best[0], *(rival[0] for rival in rivals)]))
    if rivals:
        return best[0], readings[0][1], ("the pictures do not tell the direction of the poses",)
    return (*best, (f"the pictures bear this out: robot's and camera's turns agree to {off}",))


def _misfits(
    poses: Sequence[RawPose],
    readings: Sequence[tuple[RotationName, bool]],
    witness: Witness | None,
) -> FloatArray | None:
    """(R, 2) by the pictures, infinite for what the numbers forbid; None: not known."""
    if witness is None:
        return None
    out = np.full((len(readings), 2), np.inf)
    for k, (rotation, turned) in enumerate(readings):
        try:
            read = np.array([_matrix(pose.values, rotation) for pose in poses])
        except ValueError:
            continue
        (out[k],) = witness([inverse(read) if turned else read])
    return out if np.isfinite(out).any() else None


def _unit(poses: Sequence[RawPose], rotation: RotationName) -> tuple[Unit, str]:
    if poses[0].unit is not None:
        return poses[0].unit, "as their names tell"
    try:
        farthest = max(float(np.abs(_read(p.values, rotation)[1]).max()) for p in poses)
    except ValueError:  # told when the poses are read
        return "m", "as nothing tells otherwise"
    return (
        "mm" if farthest > _FARTHEST_M else "m",
        f"as the largest coordinate is {farthest:.4g}",
    )


def _ask(poses: Sequence[RawPose], readings: Sequence[RotationName]) -> str:
    where, left = poses[0].where, " or ".join(dict.fromkeys(f"--rotation {r}" for r in readings))
    if len(poses[0].values) == 7:
        return (
            f"{where}: a quaternion may be written x y z w or w x y z, and nothing tells which."
            " Say --rotation quat_xyzw (ROS, scipy) or --rotation quat_wxyz (ABB, Eigen)."
        )
    return (
        f"{where}: three numbers of a rotation may be a rotation vector (UR) or angles about axes"
        " (rpy: fixed x y z, Fanuc, ROS; euler_zyx: KUKA; euler_xyz: Staubli, Mecademic; euler_zyz:"
        f" Kawasaki, Doosan), and nothing tells which. Say {left}."
    )
