"""Where the camera sits on the flange and the board in the base, both at once.

One closed chain per frame, camera_from_board = flange_from_mounted^-1 base_from_flange^-1
base_from_fixed (camera on the flange) or its mirror image (board on the flange). Rotations start
from Shah's closed form (M. Shah, "Solving the robot-world/hand-eye calibration problem using the
Kronecker product", J. Mechanisms Robotics 5, 2013), which has no order of samples to depend on;
then everything is refined together; lateral, depth and angular residuals are each weighted by
their own scatter, so that a wrong focal length, which moves boards along the axis, weighs little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain.rigid import from_vector, inverse
from calib.errors import CalibrationError
from calib.paper.extrinsics import nearest_rotation
from calib.views import BoolArray, FloatArray, Mount

OUTLIER_SIGMA = 10.0
"""Wrong pairs are off by far more; frames are few and their scatter has long tails."""

MIN_FRAMES = 4
_UNIT_RANGE = (0.7, 1.4)
_NO_UNIT_SHARE = 0.1
"""Miss over the way above which no unit of length explains poses and pictures."""

_SAME_UNIT = 0.3
_LATERAL, _DEPTH, _ANGLES = slice(0, 2), slice(2, 3), slice(3, 6)
_DECIDING = np.array([True, True, False, True, True, True])
_NOT_ANOTHER_POSE = np.array([3e-3] * 3 + [np.radians(0.5)] * 3)
"""Metres and radians below which a frame does not carry another frame's pose, however exact the
others are; far views and a wrong focal length reach such values honestly."""

_MIN_ROTATION_RAD = np.radians(3.0)
_FINEST = 1e-6  # metres or radians: below it numeric derivatives lose their digits


@dataclass(frozen=True)
class HandEye:
    """Both constant transforms of the chain, and how well the frames agree with them.

    Attributes
    ----------
    mount:
        `eye_in_hand`: mounted is the camera, fixed the board. `eye_to_hand`: the other way round.
    flange_from_mounted, base_from_fixed:
        (4, 4).
    covariance:
        (12, 12) of the increments (metres, radians) on the right of `flange_from_mounted`, then
        on the right of `base_from_fixed`, scaled by the residuals.
    used:
        (N,) frames that take part.
    residual_m, residual_rad:
        (N, 3) computed minus robot's: board centre, rotation vector; camera frame.
    """

    mount: Mount
    flange_from_mounted: FloatArray
    base_from_fixed: FloatArray
    covariance: FloatArray
    used: BoolArray
    residual_m: FloatArray
    residual_rad: FloatArray

    def camera_from_board(self, base_from_flange: FloatArray) -> FloatArray:
        """(N, 4, 4) where the robot says the board is."""
        return chain(self.mount, self.flange_from_mounted, base_from_flange, self.base_from_fixed)

    @property
    def rms_m(self) -> float:
        """Robot consistency: root mean square distance of the board's centre, metres."""
        return float(np.sqrt((self.residual_m[self.used] ** 2).sum(axis=1).mean()))

    @property
    def rms_rad(self) -> float:
        """Robot consistency: root mean square angle, radians."""
        return float(np.sqrt((self.residual_rad[self.used] ** 2).sum(axis=1).mean()))


def chain(
    mount: Mount,
    flange_from_mounted: FloatArray,
    base_from_flange: FloatArray,
    base_from_fixed: FloatArray,
) -> FloatArray:
    """(N, 4, 4) camera_from_board of the closed chain."""
    mounted_from_fixed = inverse(base_from_flange @ flange_from_mounted) @ base_from_fixed
    return mounted_from_fixed if mount == "eye_in_hand" else inverse(mounted_from_fixed)


def camera_position_error_m(
    camera_from_board: FloatArray, true_camera_from_board: FloatArray
) -> FloatArray:
    """(N, 3) where the computed camera sits in the true camera's frame (paper, Figs. 4, 15).

    z runs along the optical axis: positive means the computed camera is closer to the board.
    """
    return np.asarray((true_camera_from_board @ inverse(camera_from_board))[..., :3, 3])


def solve_hand_eye(
    camera_from_board: FloatArray,
    base_from_flange: FloatArray,
    mount: Mount,
    board_centre_m: FloatArray,
) -> HandEye:
    """Robust robot-world/hand-eye solution.

    Parameters
    ----------
    camera_from_board, base_from_flange:
        (N, 4, 4); frames with NaN do not take part.
    mount:
        What sits on the flange.
    board_centre_m:
        (3,) in the board's frame: position residuals are taken there.

    Raises
    ------
    CalibrationError
        Fewer than four frames, motions that do not fix the transforms (pure translation,
        rotation about one axis only), or positions in another unit of length than the board's.
    """
    both = np.isfinite(camera_from_board) & np.isfinite(base_from_flange)
    known: BoolArray = np.asarray(both.all(axis=(1, 2)))
    if known.sum() < MIN_FRAMES:
        raise CalibrationError(
            f"{known.sum()} frames have both a board and a flange pose",
            f"hand-eye needs {MIN_FRAMES}, better 15 with the wrist turned about two axes",
        )
    _check_motion(base_from_flange[known])
    problem = _Problem(mount, camera_from_board, base_from_flange, board_centre_m)
    X, Z = _closed_form_robust(problem, known)
    _check_length_unit(problem, known, X)
    used = known.copy()
    for _ in range(5):
        X, Z, covariance, distance = _refine(problem, X, Z, used)
        again = known & (distance < OUTLIER_SIGMA)
        if (again == used).all() or again.sum() < max(MIN_FRAMES, 0.6 * known.sum()):
            break
        used = again
    residual = problem.residuals(X, Z)
    return HandEye(mount, X, Z, covariance, used, residual[:, :3], residual[:, 3:])


@dataclass(frozen=True)
class _Problem:
    mount: Mount
    camera_from_board: FloatArray
    base_from_flange: FloatArray
    centre_m: FloatArray

    def residuals(self, X: FloatArray, Z: FloatArray) -> FloatArray:
        """(N, 6) computed minus robot's, in the camera frame: board centre, rotation vector."""
        robot = chain(self.mount, X, self.base_from_flange, Z)
        here = self.camera_from_board
        moved = (here[:, :3, :3] - robot[:, :3, :3]) @ self.centre_m
        out = np.full((len(here), 6), np.nan)
        out[:, :3] = moved + here[:, :3, 3] - robot[:, :3, 3]
        finite = np.isfinite(out[:, 0])
        turn = here[finite, :3, :3] @ np.swapaxes(robot[finite, :3, :3], 1, 2)
        out[finite, 3:] = Rotation.from_matrix(turn).as_rotvec()
        return out

    def scales(self, residual: FloatArray) -> FloatArray:
        """(6,) robust scatter: of the lateral position, of the depth, and of the angles."""
        scale = np.empty(6)
        for group in (_LATERAL, _DEPTH, _ANGLES):
            scale[group] = max(np.median(np.abs(residual[:, group])) / 0.6745, _FINEST)
        return scale


def _check_motion(base_from_flange: FloatArray) -> None:
    rotations = Rotation.from_matrix(base_from_flange[:, :3, :3])
    relative = (rotations.mean().inv() * rotations).as_rotvec()
    spread = np.linalg.svd(relative, compute_uv=False) / np.sqrt(len(relative))
    if spread[0] < _MIN_ROTATION_RAD:
        raise CalibrationError(
            "the flange keeps one orientation (pure translation): where the camera sits on it"
            " cannot be known",
            "add views with the wrist turned by 20 degrees and more about two axes",
        )
    if spread[1] < _MIN_ROTATION_RAD / 3:
        raise CalibrationError(
            "the flange turns about one axis only: the camera's place along that axis cannot be"
            " known",
            "add views turned by 20 degrees and more about a second axis",
        )


def _check_length_unit(problem: _Problem, known: BoolArray, X: FloatArray) -> None:
    """Solve the translations with the robot's unit of length free: it should come out as one.

    Where they do not fit with any unit, the poses are not these pictures', which is no matter of
    a unit.
    """
    factor, share = _length_factor(problem, known, X)
    if share > _NO_UNIT_SHARE:
        if not _UNIT_RANGE[0] < factor < _UNIT_RANGE[1]:
            raise CalibrationError(
                f"the logged positions do not go with the pictures: with any unit of length they"
                f" miss by {share:.0%} of the flange's way",
                "check which picture each pose is of, and whether tool or base frame was changed"
                " midway; `cell diagnose` names mix-ups of the log",
            )
        return
    if factor < 0:
        raise CalibrationError(
            "the pictures are mirrored: they go with the logged poses only with every length"
            " negative",
            "switch the camera's mirroring (ReverseX) off, or flip the pictures left to right",
        )
    if not _UNIT_RANGE[0] < factor < _UNIT_RANGE[1]:
        raise CalibrationError(*_other_unit(1.0 / factor))


def _length_factor(problem: _Problem, known: BoolArray, X: FloatArray) -> tuple[float, float]:
    """Metres of the board in a unit of the log, and the median miss over the flange's way."""
    C = problem.camera_from_board[known]
    C = C if problem.mount == "eye_in_hand" else inverse(C)
    F = problem.base_from_flange[known]
    back = np.swapaxes(F[:, :3, :3], 1, 2)
    moved = back @ F[:, :3, 3, None]
    left = np.concatenate([np.tile(np.eye(3), (len(F), 1, 1)), -back, moved], axis=2)
    right = -(C[:, :3, 3] @ X[:3, :3].T)
    used = np.ones(len(F), dtype=bool)
    for _ in range(4):
        solved = np.linalg.lstsq(left[used].reshape(-1, 7), right[used].ravel(), rcond=None)[0]
        miss = np.linalg.norm(left @ solved - right, axis=1)
        again = miss <= max(4 * float(np.median(miss)), 1e-9)
        if (again == used).all() or again.sum() < MIN_FRAMES:
            break
        used = again
    factor = float(solved[6])
    way = np.linalg.norm(F[:, :3, 3] - F[:, :3, 3].mean(axis=0), axis=1).mean() * abs(factor)
    return factor, float(np.median(miss)) / max(float(way), 1e-12)


def _other_unit(ratio: float) -> tuple[str, str]:
    """What to say of positions that are `ratio` times as large as the board's metres."""
    message = (
        "the logged positions and the board's squares disagree about length by a factor of"
        f" {ratio:.4g}"
    )
    for name, count in (("millimetres", 1000.0), ("centimetres", 100.0), ("inches", 1 / 0.0254)):
        if abs(np.log(ratio / count)) < _SAME_UNIT:
            return (
                f"{message}: the positions are in {name}, under a key that says metres"
                " (base_from_flange.p_m), or square_m is so many times too small",
                f"write p_m in metres (divide by {count:.6g}), or mend square_m",
            )
    return message, "check base_from_flange.p_m (metres) and the board's square_m"


def _closed_form_robust(problem: _Problem, known: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Closed form, repeated on the better half until a few wrong pairs no longer matter."""
    used = known.copy()
    for _ in range(4):
        X, Z = closed_form(
            problem.camera_from_board[used], problem.base_from_flange[used], problem.mount
        )
        size = np.linalg.norm(problem.residuals(X, Z)[:, 3:], axis=1)
        again = known & (size <= 4 * max(float(np.median(size[known])), 1e-9))
        if (again == used).all() or again.sum() < MIN_FRAMES:
            break
        used = again
    return X, Z


def closed_form(
    camera_from_board: FloatArray, base_from_flange: FloatArray, mount: Mount
) -> tuple[FloatArray, FloatArray]:
    """(4, 4) flange_from_mounted and base_from_fixed after Shah, from three frames and more.

    Parameters
    ----------
    camera_from_board, base_from_flange:
        (N, 4, 4), all known and right: one wrong pair spoils it.
    """
    C = camera_from_board if mount == "eye_in_hand" else inverse(camera_from_board)
    F = base_from_flange
    back = np.swapaxes(F[:, :3, :3], 1, 2)
    K = np.einsum("nij,nkl->ikjl", back, C[:, :3, :3]).reshape(9, 9)
    u, _, vt = np.linalg.svd(K)
    RX, RZ = (_signed_rotation(m.reshape(3, 3)) for m in (u[:, 0], vt[0]))
    left = np.concatenate([np.tile(np.eye(3), (len(F), 1, 1)), -back], axis=2).reshape(-1, 6)
    right = -(C[:, :3, 3] @ RX.T) - (back @ F[:, :3, 3, None])[..., 0]
    t = np.linalg.lstsq(left, right.ravel(), rcond=None)[0]
    X, Z = np.eye(4), np.eye(4)
    X[:3, :3], X[:3, 3], Z[:3, :3], Z[:3, 3] = RX, t[:3], RZ, t[3:]
    return X, Z


def _signed_rotation(matrix: FloatArray) -> FloatArray:
    return nearest_rotation(matrix if np.linalg.det(matrix) > 0 else -matrix)


def _refine(
    problem: _Problem, X: FloatArray, Z: FloatArray, used: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Weighted least squares from (X, Z); the last result is every frame's distance in sigma."""
    from scipy.optimize import least_squares  # many a verb never needs it

    covariance = np.full((12, 12), np.nan)
    for _ in range(3):
        scale = problem.scales(problem.residuals(X, Z)[used])

        def weighted(
            step: FloatArray, X: FloatArray = X, Z: FloatArray = Z, scale: FloatArray = scale
        ) -> FloatArray:
            moved = problem.residuals(X @ from_vector(step[:6]), Z @ from_vector(step[6:]))
            return np.asarray((moved[used] / scale).ravel())

        fit = least_squares(weighted, np.zeros(12), method="lm", x_scale=np.full(12, 0.1))
        X, Z = X @ from_vector(fit.x[:6]), Z @ from_vector(fit.x[6:])
        freedom = max(6 * int(used.sum()) - 12, 1)
        variance = max(2 * fit.cost / freedom, 1e-12)
        jacobian = np.asarray(fit.jac, dtype=np.float64)
        covariance = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True) * variance
    residual = problem.residuals(X, Z)
    standard = residual / problem.scales(residual[used])
    # A lens that moves its focus shifts good frames along the axis, and only there.
    deciding = np.abs(standard[:, _DECIDING])
    small = np.abs(residual) < _NOT_ANOTHER_POSE
    distance = np.where(small.all(axis=1, where=_DECIDING), 0.0, deciding.max(axis=1))
    distance = np.nan_to_num(distance, nan=np.inf)
    return X, Z, covariance, distance
