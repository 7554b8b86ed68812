"""How well a log of flange poses closes the hand-eye loop, whatever its length unit.

Rotations by Shah's closed form (J. Mechanisms Robotics 5, 2013), repeated on the better half;
then both translations and one factor on the logged lengths by linear least squares. The factor
is one for a log in metres and 0.001 for one in millimetres that says metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain import rigid
from calib.paper.extrinsics import nearest_rotation
from calib.views import BoolArray, FloatArray, Mount

_FEWEST = 5
_ROUNDS = 5


@dataclass(frozen=True)
class Closure:
    """How the loop closes.

    Attributes
    ----------
    flange_from_mounted, base_from_fixed:
        (4, 4) in true metres.
    length_factor:
        What the logged lengths must be multiplied by.
    angle_rad, distance_m:
        (N,) what each frame misses by; NaN where a frame has no pose.
    """

    flange_from_mounted: FloatArray
    base_from_fixed: FloatArray
    length_factor: float
    angle_rad: FloatArray
    distance_m: FloatArray

    def expected(self, mounted_from_fixed: FloatArray) -> FloatArray:
        """(N, 4, 4) base_from_flange that the pictures ask for."""
        asked = rigid.inverse(self.flange_from_mounted @ mounted_from_fixed)
        return np.asarray(self.base_from_fixed @ asked)

    def judging(self, mounted_from_fixed: FloatArray, base_from_flange: FloatArray) -> Closure:
        """The same transforms with what these frames miss by."""
        rx, tx = self.flange_from_mounted[:3, :3], self.flange_from_mounted[:3, 3]
        rz, tz = self.base_from_fixed[:3, :3], self.base_from_fixed[:3, 3]
        both = np.isfinite(mounted_from_fixed) & np.isfinite(base_from_flange)
        known = np.asarray(both.all(axis=(1, 2)))
        angle = _angles(mounted_from_fixed, base_from_flange, rx, rz, known)
        miss = _distances(mounted_from_fixed, base_from_flange, rx, tx, tz, self.length_factor)
        miss[~known] = np.nan
        return replace(self, angle_rad=angle, distance_m=miss)

    @property
    def typical_angle_rad(self) -> float:
        """Median miss of the rotations."""
        return float(np.nanmedian(self.angle_rad))

    @property
    def typical_distance_m(self) -> float:
        """Median miss of the positions."""
        return float(np.nanmedian(self.distance_m))


def close_loop(
    mounted_from_fixed: FloatArray, base_from_flange: FloatArray, *, free_length: bool
) -> Closure | None:
    """Close F X C = Z over all frames; None with fewer than five frames that have both.

    Parameters
    ----------
    mounted_from_fixed:
        (N, 4, 4) camera_from_board for an eye in hand, its inverse else.
    base_from_flange:
        (N, 4, 4) as logged.
    free_length:
        Estimate the factor on the logged lengths, too.
    """
    both = np.isfinite(mounted_from_fixed) & np.isfinite(base_from_flange)
    known = np.asarray(both.all(axis=(1, 2)))
    if known.sum() < _FEWEST:
        return None
    used = known.copy()
    for _ in range(_ROUNDS):
        rx, rz = _rotations(mounted_from_fixed[used], base_from_flange[used])
        angle = _angles(mounted_from_fixed, base_from_flange, rx, rz, known)
        used = known & (angle <= 3.0 * np.nanmedian(angle) + 1e-9)
        if used.sum() < _FEWEST:
            return None
    for _ in range(_ROUNDS):
        tx, tz, factor = _translations(
            mounted_from_fixed[used], base_from_flange[used], rx, free_length
        )
        miss = _distances(mounted_from_fixed, base_from_flange, rx, tx, tz, factor)
        miss[~known] = np.nan
        used = known & (miss <= 4.0 * np.nanmedian(miss) + 1e-9)
    mounted, fixed = np.eye(4), np.eye(4)
    mounted[:3, :3], mounted[:3, 3] = rx, tx
    fixed[:3, :3], fixed[:3, 3] = rz, tz
    return Closure(mounted, fixed, factor, angle, miss)


def _rotations(c: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    back = np.swapaxes(f[:, :3, :3], 1, 2)
    product = np.einsum("nij,nkl->ikjl", back, c[:, :3, :3]).reshape(9, 9)
    u, _, vt = np.linalg.svd(product)
    pair = [m.reshape(3, 3) for m in (u[:, 0], vt[0])]
    rx, rz = (nearest_rotation(m if np.linalg.det(m) > 0 else -m) for m in pair)
    return rx, rz


def _angles(
    c: FloatArray, f: FloatArray, rx: FloatArray, rz: FloatArray, known: BoolArray
) -> FloatArray:
    angle = np.full(len(c), np.nan)
    loop = f[known, :3, :3] @ rx @ c[known, :3, :3] @ rz.T
    angle[known] = Rotation.from_matrix(loop).magnitude()
    return angle


def _translations(
    c: FloatArray, f: FloatArray, rx: FloatArray, free_length: bool
) -> tuple[FloatArray, FloatArray, float]:
    """Solve R_F t_X - t_Z + factor t_F = -R_F R_X t_C."""
    n = len(c)
    rotation = f[:, :3, :3]
    right = -(rotation @ (rx @ c[:, :3, 3, None]))[..., 0]
    left = np.concatenate([rotation, np.tile(-np.eye(3), (n, 1, 1))], axis=2)
    if not free_length:
        solved = np.linalg.lstsq(left.reshape(-1, 6), (right - f[:, :3, 3]).ravel(), rcond=None)[0]
        return solved[:3], solved[3:6], 1.0
    size = max(float(np.abs(f[:, :3, 3]).max()), 1e-12)
    left = np.concatenate([left, f[:, :3, 3, None] / size], axis=2)
    solved = np.linalg.lstsq(left.reshape(-1, 7), right.ravel(), rcond=None)[0]
    return solved[:3], solved[3:6], float(solved[6] / size)


def _distances(
    c: FloatArray, f: FloatArray, rx: FloatArray, tx: FloatArray, tz: FloatArray, factor: float
) -> FloatArray:
    inner = (rx @ c[:, :3, 3, None])[..., 0] + tx
    return np.asarray(
        np.linalg.norm(
            (f[:, :3, :3] @ inner[..., None])[..., 0] + factor * f[:, :3, 3] - tz, axis=1
        )
    )


def mounted_from_fixed(camera_from_board: FloatArray, mount: Mount) -> FloatArray:
    """(N, 4, 4) what the loop needs of the free poses."""
    return camera_from_board if mount == "eye_in_hand" else rigid.inverse(camera_from_board)
