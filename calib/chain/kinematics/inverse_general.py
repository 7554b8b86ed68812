"""All branches of any six-joint arm: by a search along the last joint, or from many starts.

Nearly every arm has joint 1 upright to parallel joints 2 and 3, and joints 4 and 5 that meet in a
point. That point hangs on joint 3 and on joint 5, so a value of joint 6 alone says where it is, and
joints 1 to 3 follow in closed form, four ways. What is left is one equation in joint 6: the angle
between axes 4 and 5. Its roots are all branches, with a spherical wrist, a wrist that is set off
(ABB GoFa, Fanuc CRX) or parallel joints 2 to 4 (Universal Robots) alike. Every root is brought to
the pose by Newton's method on the whole chain. Arms of another build are solved by the same method
from many starts.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.kinematics.dh import frames
from calib.views import FloatArray

_SAMPLES = 720
_STARTS_LOG2 = 9
_FLAT = 1e-9
"""Residual of a wrist whose last joint is free; samples of it have no sign."""
_NEARLY = 0.02
_ITERATIONS = 12
_REACHED = 1e-10
_SAME_RAD = 1e-5
_MEET_M = 1e-5


class _Axes(NamedTuple):
    """(6, 3) points on the axes and directions at zero joint angles, in the base."""

    point_m: FloatArray
    along: FloatArray


class GeneralInverse:
    """Branches of one arm.

    Parameters
    ----------
    rows, ends:
        Its chain, see `chain_from_axes`.
    """

    def __init__(self, rows: FloatArray, ends: FloatArray) -> None:
        self._rows, self._ends = rows, ends
        poses = ends[0] @ frames(np.zeros(len(rows)), rows)
        self._axes = _Axes(poses[:-1, :3, 3], poses[:-1, :3, 2])
        self._flange = poses[-1] @ ends[1]
        self._elbow = _Elbow.of(self._axes)

    def __call__(
        self, dh: FloatArray, base_from_flange: FloatArray, near_rad: FloatArray
    ) -> FloatArray:
        """(B, 6) joint angles that reach a pose, whole turns not resolved; see `InverseBranches`.

        `near_rad` fixes what a singular pose leaves free.
        """
        if self._elbow is None:
            starts = self._starts(near_rad)
        else:
            starts = self._elbow.starts(base_from_flange @ np.linalg.inv(self._flange), near_rad)
        starts = np.concatenate([starts, near_rad[None]])
        return _distinct(self._polished(starts, base_from_flange))

    def _starts(self, near_rad: FloatArray) -> FloatArray:
        from scipy.stats import qmc  # a second's import, for arms of a general shape only

        spread = qmc.Sobol(len(self._rows), seed=0).random_base2(_STARTS_LOG2)
        return np.asarray(near_rad + 2 * np.pi * (spread - 0.5))

    def _polished(self, joints: FloatArray, goal: FloatArray) -> FloatArray:
        """Those of the starts (S, 6) that Newton's method brings to the goal (4, 4)."""
        for _ in range(_ITERATIONS):
            poses = self._ends[0] @ frames(joints, self._rows)
            tip = poses[:, -1] @ self._ends[1]
            axes = poses[:, :-1, :3, 2]
            arms = tip[:, None, :3, 3] - poses[:, :-1, :3, 3]
            jacobian = np.swapaxes(np.concatenate([np.cross(axes, arms), axes], -1), -1, -2)
            turn = Rotation.from_matrix(goal[:3, :3] @ np.swapaxes(tip[:, :3, :3], -1, -2))
            error = np.concatenate([goal[:3, 3] - tip[:, :3, 3], turn.as_rotvec()], axis=-1)
            size = np.abs(error).max(axis=-1)
            if (size < _REACHED).all():
                break
            normal = np.swapaxes(jacobian, -1, -2) @ jacobian
            damped = normal + 1e-3 * np.minimum(size**2, 1e-2)[:, None, None] * np.eye(6)
            damped += 1e-14 * np.eye(6)
            gradient = np.swapaxes(jacobian, -1, -2) @ error[..., None]
            step = np.linalg.solve(damped, gradient)[..., 0]
            joints = joints + np.clip(step, -0.5, 0.5)
        return np.asarray(joints[size < 1e-8])


class _Elbow(NamedTuple):
    """The build described above: the point where axes 4 and 5 meet, and the axes."""

    centre_m: FloatArray
    axes: _Axes

    @classmethod
    def of(cls, axes: _Axes) -> _Elbow | None:
        """None where the arm is built otherwise."""
        one, two, three, four, five = axes.along[:5]
        parallel = np.linalg.norm(np.cross(two, three)) < 1e-6
        upright = abs(one @ two) < 1e-6
        normal = np.cross(four, five)
        if not (parallel and upright and np.linalg.norm(normal) > 0.1):
            return None
        between = axes.point_m[4] - axes.point_m[3]
        if abs(between @ normal) > _MEET_M * np.linalg.norm(normal):
            return None
        share = np.linalg.lstsq(np.column_stack([four, -five]), between, rcond=None)[0]
        return cls(axes.point_m[3] + share[0] * four, axes)

    def starts(self, moved: FloatArray, near_rad: FloatArray) -> FloatArray:
        """(S, 6) joint angles near every branch; `moved` (4, 4) takes the flange from zero."""
        last = np.linspace(-np.pi, np.pi, _SAMPLES, endpoint=False)
        found = []
        for branch in product((1.0, -1.0), (1.0, -1.0)):
            three, miss = self._first_three(moved, last, branch, near_rad)
            at = _candidates(last, miss, near_rad[5])
            three, _ = self._first_three(moved, at, branch, near_rad)
            known = np.isfinite(three).all(axis=1)
            found.append(self._completed(moved, at[known], three[known]))
        return np.concatenate(found)

    def _first_three(
        self, moved: FloatArray, last_rad: FloatArray, branch: tuple[float, float], near: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Joints 1 to 3 (S, 3) for values (S,) of joint 6, and the residual (S,); NaN: none."""
        points, along = self.axes
        link5 = moved @ _turns(along[5], points[5], -last_rad)
        centre = link5[:, :3, :3] @ self.centre_m + link5[:, :3, 3]
        shoulder, elbow = branch
        pan = self._pan(centre, shoulder, near[0])
        level = _turned(along[0], points[0], -pan, centre)
        lift, bend = self._lift_and_bend(level, elbow)
        joints = np.column_stack([pan, lift, bend])
        turn = self._upper(joints)[:, :3, :3]
        miss = np.einsum("nij,j,nik,k->n", turn, along[3], link5[:, :3, :3], along[4])
        return joints, miss - along[3] @ along[4]

    def _pan(self, centre: FloatArray, sign: float, near_rad: float) -> FloatArray:
        points, along = self.axes
        up, across = along[0], along[1]
        ahead = np.cross(across, up)
        off = centre - points[0]
        x, y = off @ ahead, off @ across
        offset = across @ (self.centre_m - points[0])
        radius = np.hypot(x, y)
        with np.errstate(invalid="ignore", divide="ignore"):
            pan = np.arctan2(y, x) - 0.5 * np.pi + sign * np.arccos(_cosine(offset / radius))
        return np.asarray(np.where(radius > 1e-9, pan, near_rad))

    def _lift_and_bend(self, level: FloatArray, sign: float) -> tuple[FloatArray, FloatArray]:
        points, along = self.axes
        normal = along[1]
        same = float(np.sign(along[2] @ normal))
        x, y = _plane(normal)
        plane = np.column_stack([x, y])
        upper, fore = (points[2] - points[1]) @ plane, (self.centre_m - points[2]) @ plane
        goal = (level - points[1]) @ plane
        r2, r3 = np.hypot(*upper), np.hypot(*fore)
        cosine = ((goal**2).sum(axis=1) - r2**2 - r3**2) / (2 * r2 * r3)
        rest = np.arctan2(fore[1], fore[0]) - np.arctan2(upper[1], upper[0])
        with np.errstate(invalid="ignore"):
            turn = sign * np.arccos(_cosine(cosine)) - rest
        c, s = np.cos(turn), np.sin(turn)
        reached = upper + np.column_stack([c * fore[0] - s * fore[1], s * fore[0] + c * fore[1]])
        lift = np.arctan2(goal[:, 1], goal[:, 0]) - np.arctan2(reached[:, 1], reached[:, 0])
        return lift, same * turn

    def _upper(self, joints: FloatArray) -> FloatArray:
        points, along = self.axes
        pose = _turns(along[0], points[0], joints[:, 0])
        for k in (1, 2):
            pose = pose @ _turns(along[k], points[k], joints[:, k])
        return np.asarray(pose)

    def _completed(self, moved: FloatArray, last: FloatArray, three: FloatArray) -> FloatArray:
        """(S, 6) with joints 4 and 5 from the turn that is left."""
        points, along = self.axes
        link5 = moved @ _turns(along[5], points[5], -last)
        left = np.swapaxes(self._upper(three)[:, :3, :3], -1, -2) @ link5[:, :3, :3]
        q4 = _angle(along[3], along[4], left @ along[4])
        x, _ = _plane(along[4])
        rest = np.swapaxes(_turns(along[3], points[3], q4)[:, :3, :3], -1, -2) @ left
        q5 = _angle(along[4], x, rest @ x)
        return np.column_stack([three, q4, q5, last])


def _candidates(last: FloatArray, miss: FloatArray, near: float) -> FloatArray:
    """Values of joint 6 at or near a root of the residual, and the one that is at hand."""
    ahead = np.roll(miss, -1)
    step = last[1] - last[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        crosses = (miss * ahead <= 0) & (np.maximum(np.abs(miss), np.abs(ahead)) > _FLAT)
        roots = last[crosses] + step * (miss / (miss - ahead))[crosses]
        size = np.abs(miss)
        lowest = (size <= np.roll(size, 1)) & (size <= np.roll(size, -1))
        touches = last[lowest & (size < _NEARLY) & (size > _FLAT)]
    known = np.isfinite(miss)
    edges = last[known & ~(np.roll(known, 1) & np.roll(known, -1))]
    return np.concatenate([roots, touches, edges, [near]])


def _cosine(value: FloatArray) -> FloatArray:
    """The cosine, rounding errors beyond one taken off; NaN where it is none."""
    return np.where(np.abs(value) > 1 + 1e-9, np.nan, np.clip(value, -1, 1))


def _plane(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors that make a right-handed frame with the normal."""
    spare = np.eye(3)[int(np.argmin(np.abs(normal)))]
    x = spare - (spare @ normal) * normal
    x = x / np.linalg.norm(x)
    return x, np.cross(normal, x)


def _angle(axis: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(S,) turn about an axis that takes a vector (3,) to vectors (S, 3), seen along the axis."""
    start = start - (start @ axis) * axis
    return np.asarray(np.arctan2(end @ np.cross(axis, start), end @ start))


def _turns(axis: FloatArray, point: FloatArray, angles: FloatArray) -> FloatArray:
    """(S, 4, 4) turns about an axis in space."""
    pose = np.zeros((len(angles), 4, 4))
    pose[:, :3, :3] = Rotation.from_rotvec(angles[:, None] * axis).as_matrix()
    pose[:, :3, 3] = point - pose[:, :3, :3] @ point
    pose[:, 3, 3] = 1.0
    return pose


def _turned(
    axis: FloatArray, point: FloatArray, angles: FloatArray, places: FloatArray
) -> FloatArray:
    known = np.nan_to_num(angles)
    pose = _turns(axis, point, known)
    moved = np.einsum("nij,nj->ni", pose[:, :3, :3], places) + pose[:, :3, 3]
    return np.where(np.isfinite(angles)[:, None], moved, np.nan)


def _distinct(joints: FloatArray) -> FloatArray:
    """One of each branch, whole turns apart counting as the same."""
    kept: list[FloatArray] = []
    for one in joints:
        apart = (np.abs(np.angle(np.exp(1j * (one - other)))).max() for other in kept)
        if all(gap > _SAME_RAD for gap in apart):
            kept.append(one)
    return np.array(kept).reshape(-1, joints.shape[1])
