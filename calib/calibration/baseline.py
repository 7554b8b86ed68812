"""Zhang's baseline: closed form, then maximum likelihood with one focal length for all frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.frames import Usable, require_frames
from calib.calibration.result import VALUES, Covariance, Rejection, Solution
from calib.chain.optics import COLUMN, optics_row
from calib.chain.projection import project
from calib.errors import CalibrationError
from calib.paper.extrinsics import board_poses
from calib.paper.zhang import centred_camera_matrix, zhang_algebraic, zhang_pinhole
from calib.solver.free_poses import FreePoseFit, fit_free_poses
from calib.solver.unknowns import plain_optics
from calib.views import BoolArray, FloatArray, Views

FRAME_OUTLIER = 6.0
"""A frame this many times worse than the median one is a wrong detection."""

_ROUNDS = 8
"""Wrong corners bend the fit that finds them: it is repeated until it leaves out the same."""

CORNER_OUTLIER = 8.0
_LONGEST_LENS = 25.0
"""Scale factor over image size: a field of 2.3 degrees, narrower than any cell's camera."""

_SQUARE_SHARE = 0.03
"""A wrong detection is off by a good share of a square; a lens that moves its focus is not."""


@dataclass(frozen=True)
class Baseline:
    """Zhang's two solutions, and what was thrown out on the way.

    Attributes
    ----------
    algebraic:
        None where the closed form has no solution; `missing` says why.
    mle:
        Maximum likelihood.
    used:
        (N,) frames.
    weight:
        (N, M) one for a corner that takes part.
    """

    algebraic: Solution | None
    mle: Solution
    used: BoolArray
    weight: FloatArray
    rejected: tuple[Rejection, ...]
    missing: dict[str, str]

    def without_skew(self, views: Views) -> Solution:
        """Maximum likelihood with the skew at zero, as most other programs take it."""
        row = self.mle.optics[np.flatnonzero(self.used)[0]].copy()
        row[COLUMN["skew_px"]] = 0.0
        poses, free = self.mle.camera_from_board, plain_optics(row)
        fit = fit_subset(views, self.used, row, poses, self.weight, free)
        return as_solution(fit, self.weight, free)


def fit_baseline(views: Views, usable: Usable) -> Baseline:
    """Zhang's calibration, wrong frames and corners left out.

    Raises
    ------
    CalibrationError
        The views do not fix the camera.
    """
    missing: dict[str, str] = {}
    optics, poses = _start(views, usable, missing)
    settled = settle(views, optics, poses, usable, VALUES)
    used, weight = settled.used, settled.weight
    algebraic = _algebraic(views, usable, used, weight, missing)
    return replace(settled, algebraic=algebraic, missing=missing)


def settle(
    views: Views, optics: FloatArray, poses: FloatArray, usable: Usable, free: tuple[str, ...]
) -> Baseline:
    """Maximum likelihood from a start on, wrong frames and corners left out.

    Parameters
    ----------
    optics, poses:
        (K,) and (N, 4, 4) near enough for the iteration.
    free:
        Names of the columns to fit.

    Raises
    ------
    CalibrationError
        The views do not fix the camera.
    """
    used, weight = usable.used.copy(), usable.good.astype(float)
    rejected: list[Rejection] = list(usable.rejected)
    for _ in range(_ROUNDS):
        fit = fit_subset(views, used, optics, poses, weight, free)
        worse = _bad_frames(fit.residual_px, views, used)
        before, weight = weight, _corner_weight(fit, views, used)
        if not worse and np.array_equal(weight[used], before[used]):
            break
        rejected += worse
        used = used & ~np.isin(views.frame, [r.frame for r in worse])
        require_frames(int(used.sum()), len(views))
    fit = fit_subset(views, used, fit.optics[np.flatnonzero(used)[0]], poses, weight, free)
    _check(fit, views)
    mle = as_solution(fit, weight, free)
    return Baseline(None, mle, used, weight, tuple(rejected), {})


def _start(views: Views, usable: Usable, missing: dict[str, str]) -> tuple[FloatArray, FloatArray]:
    """(K,) optics and (N, 4, 4) poses near enough for the iteration."""
    poses = np.full((len(views), 4, 4), np.nan)
    homographies = usable.homographies[usable.used]
    try:
        row, poses[usable.used] = zhang_pinhole(homographies, views.width_px, views.height_px)
        if _plausible(row, views):
            row[COLUMN["skew_px"]] = 0.0
            return row, poses
    except CalibrationError as error:
        missing["zhang_algebraic"] = str(error)
    A = centred_camera_matrix(homographies, views.width_px, views.height_px)
    poses[usable.used] = board_poses(homographies, A)
    row = optics_row(
        alpha_px=A[0, 0],
        beta_px=A[1, 1],
        u0_px=A[0, 2],
        v0_px=A[1, 2],
        height_px=views.height_px,
    )
    return row, poses


def _plausible(row: FloatArray, views: Views) -> bool:
    size = max(views.width_px, views.height_px)
    alpha, beta = row[COLUMN["alpha_px"]], row[COLUMN["beta_px"]]
    centred = (
        abs(row[COLUMN["u0_px"]] / views.width_px - 0.5) < 0.4
        and abs(row[COLUMN["v0_px"]] / views.height_px - 0.5) < 0.4
    )
    return bool(centred and 0.2 * size < alpha < _LONGEST_LENS * size and 0.6 < alpha / beta < 1.6)


def fit_subset(
    views: Views,
    used: BoolArray,
    optics: FloatArray,
    camera_from_board: FloatArray,
    weight: FloatArray,
    free: tuple[str, ...],
) -> FreePoseFit:
    """`fit_free_poses` on the used frames, its arrays spread over all N with NaN elsewhere."""
    rows = np.broadcast_to(optics, (len(views), optics.shape[-1]))
    fit = fit_free_poses(
        rows[used],
        camera_from_board[used],
        views.board.corners_m,
        views.corners_px[used],
        free,
        weight=weight[used],
    )

    def spread(values: FloatArray) -> FloatArray:
        out = np.full((len(views), *values.shape[1:]), np.nan)
        out[used] = values
        return out

    return replace(
        fit,
        optics=spread(fit.optics),
        camera_from_board=spread(fit.camera_from_board),
        residual_px=spread(fit.residual_px),
    )


def as_solution(fit: FreePoseFit, weight: FloatArray, free: tuple[str, ...]) -> Solution:
    """A fit in the words of the result; the values are those of its first used frame."""
    first = fit.optics[np.flatnonzero(np.isfinite(fit.optics[:, 0]))[0]]
    sigma = np.sqrt(np.diag(fit.covariance))
    return Solution(
        optics=fit.optics,
        camera_from_board=fit.camera_from_board,
        residual_px=np.where(weight[..., None] > 0, fit.residual_px, np.nan),
        values={name: float(first[COLUMN[name]]) for name in (*VALUES, *further(free))},
        sigma={name: float(s) for name, s in zip(free, sigma, strict=True)},
        covariance=Covariance(free, fit.covariance),
    )


def further(free: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the fitted columns that not every solution has."""
    return tuple(name for name in free if name not in VALUES)


def _bad_frames(residual_px: FloatArray, views: Views, used: BoolArray) -> list[Rejection]:
    """Frames whose typical corner is far worse than in the typical frame."""
    distance = np.linalg.norm(residual_px, axis=2)
    typical = np.full(len(views), np.nan)
    typical[used] = np.nanmedian(distance[used], axis=1)
    usual = FRAME_OUTLIER * float(np.nanmedian(typical))
    found = []
    for i in np.flatnonzero(used):
        limit = max(usual, _SQUARE_SHARE * _square_px(views, int(i)))
        if typical[i] > limit:
            reason = f"its corners miss the board by {typical[i]:.1f} px: a wrong detection"
            found.append(Rejection(int(views.frame[i]), reason))
    return found


def _square_px(views: Views, frame: int) -> float:
    """Typical side of a square in one frame, from the area its corners cover."""
    seen = views.seen[frame]
    spread_px = np.linalg.det(np.cov(views.corners_px[frame, seen].T))
    spread_m = np.linalg.det(np.cov(views.board.corners_m[seen, :2].T))
    return float(views.board.square_m * max(spread_px / max(spread_m, 1e-12), 0.0) ** 0.25)


def _corner_weight(fit: FreePoseFit, views: Views, used: BoolArray) -> FloatArray:
    """Zero for a corner far worse than its frame's typical one, whether it had a say or not."""
    distance = np.zeros(views.seen.shape)
    predicted = project(fit.optics[used], fit.camera_from_board[used], views.board.corners_m)
    distance[used] = np.linalg.norm(np.nan_to_num(views.corners_px[used] - predicted), axis=2)
    typical = np.ones(len(views))
    for i in np.flatnonzero(used):
        typical[i] = max(float(np.median(distance[i, views.seen[i]])), 1e-6)
    return np.asarray(views.seen & (distance < CORNER_OUTLIER * typical[:, None]), dtype=float)


def _check(fit: FreePoseFit, views: Views) -> None:
    alpha = float(np.nanmean(fit.optics[:, COLUMN["alpha_px"]]))
    sigma = float(np.sqrt(fit.covariance[0, 0]))
    size = max(views.width_px, views.height_px)
    known = np.isfinite(sigma) and 0 < sigma < 0.3 * alpha
    if not (known and 0.1 * size < alpha < _LONGEST_LENS * size):
        raise CalibrationError(
            f"the views leave the focal length open ({alpha:.0f} ± {sigma:.0f} px):"
            " add views with the board tilted 20 to 45 degrees about both axes"
        )


def _algebraic(
    views: Views,
    usable: Usable,
    used: BoolArray,
    weight: FloatArray,
    missing: dict[str, str],
) -> Solution | None:
    corners = np.where(weight[..., None] > 0, views.corners_px, np.nan)
    try:
        row, found = zhang_algebraic(
            usable.homographies[used],
            views.board.corners_m,
            corners[used],
            views.width_px,
            views.height_px,
        )
    except CalibrationError as error:
        missing["zhang_algebraic"] = str(error)
        return None
    missing.pop("zhang_algebraic", None)
    return unfitted_solution(views, used, weight, np.tile(row, (len(found), 1)), found)


def unfitted_solution(
    views: Views, used: BoolArray, weight: FloatArray, optics: FloatArray, poses: FloatArray
) -> Solution:
    """A solution that was computed and not fitted, from the used frames' optics and poses."""
    full_optics = np.full((len(views), optics.shape[1]), np.nan)
    full_poses = np.full((len(views), 4, 4), np.nan)
    residual = np.full_like(views.corners_px, np.nan)
    full_optics[used], full_poses[used] = optics, poses
    residual[used] = views.corners_px[used] - project(optics, poses, views.board.corners_m)
    residual[weight == 0] = np.nan
    values = {name: float(optics[0, COLUMN[name]]) for name in VALUES}
    return Solution(full_optics, full_poses, residual, values, {})
