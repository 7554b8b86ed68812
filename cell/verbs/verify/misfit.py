"""How far the old calibration's predictions miss the new corners, where, and what is expected."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.chain.model import CellModel, Errors, evaluate, predict
from calib.chain.optics import COLUMN
from calib.chain.rigid import inverse
from calib.distributions import chi2_limit
from calib.solver.free_poses import fit_free_poses
from calib.solver.joint import fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import moved, unknowns_of
from calib.views import BoolArray, FloatArray, Views
from cell.verbs.verify.judge import SIGNIFICANT, Judgement
from cell.verbs.verify.old_cell import OldCell
from cell.views.report.geometry import workpiece_error_m

_STILL = Noise(1.0, 1e-7, 1e-7)
"""Poses as logged: nothing but the board's place is fitted."""

_THIRDS = 3
_DISTANCES = 4


@dataclass(frozen=True)
class Misfit:
    """Of N frames, the board where it fits best, everything else by the old calibration.

    Attributes
    ----------
    model:
        The old cell with the board where it is now.
    residual_px:
        (N, M, 2) seen minus predicted; NaN where not seen.
    spread_px:
        (N, M, 2, K) what one sigma of each of K independent errors of calibration and arm makes.
    corner_px:
        One sigma of a corner.
    distance_m:
        (N,) of the board's centre.
    lateral_m:
        (N,) RMS misfit across the axis, at that distance.
    workpiece_m:
        (N,) RMS distance by which the robot would miss a part of the board's size that one
        picture locates with the old calibration.
    """

    model: CellModel
    residual_px: FloatArray
    spread_px: FloatArray
    corner_px: float
    distance_m: FloatArray
    lateral_m: FloatArray
    workpiece_m: FloatArray

    def expected_px(self, mask: BoolArray) -> tuple[float, float]:
        """One sigma of the RMS misfit of some corners, and what chance exceeds once in a hundred.

        The errors that corners share make the RMS of many scatter as that of a few would: so many
        degrees of freedom has the chi square of the same mean and variance (Satterthwaite 1946).

        Parameters
        ----------
        mask:
            (N, M) the corners.
        """
        rows = self.spread_px[mask].reshape(-1, self.spread_px.shape[-1])
        gram, corner = rows.T @ rows, self.corner_px**2
        total = float(np.trace(gram)) + len(rows) * corner
        square = float((gram**2).sum() + 2 * corner * np.trace(gram) + len(rows) * corner**2)
        freedom = total**2 / square
        sigma = float(np.sqrt(2 * total / len(rows)))
        return sigma, sigma * float(np.sqrt(chi2_limit(SIGNIFICANT, freedom) / freedom))

    @property
    def seen(self) -> BoolArray:
        """(N, M) the corners that count."""
        return np.asarray(np.isfinite(self.residual_px).all(axis=2))

    def expected_each(self) -> tuple[FloatArray, FloatArray]:
        """(N,) one sigma and limit of each frame's RMS misfit."""
        frames = np.arange(len(self.residual_px))
        pairs = [self.expected_px(self.seen & (frames == k)[:, None]) for k in frames]
        sigma, limit = np.array(pairs).T
        return sigma, limit


@dataclass(frozen=True)
class Place:
    """Part of a misfit: frames of some distances, or a part of the image.

    Attributes
    ----------
    low, high:
        Of the distances, metres, or the place's corners in the image, pixels.
    rms_px, sigma_px, limit_px:
        Length of the misfit there; one sigma of it by all uncertainties; what chance exceeds once
        in a hundred times.
    mean_px:
        Its mean: what points one way is no noise.
    worst_px, worst_at_px:
        The largest, and where in the image.
    lateral_m:
        The same across the axis.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    corners: int
    rms_px: float
    sigma_px: float
    limit_px: float
    mean_px: tuple[float, float]
    worst_px: float
    worst_at_px: tuple[float, float]
    lateral_m: float


def misfit_of(old: OldCell, found: Judgement) -> Misfit:
    """The misfit of the frames that a judgement used."""
    views, weight = found.views, found.weight
    board = tuple(u for u in unknowns_of(old.model) if u.name.startswith(f"{old.board_frame}."))
    start = _at_board(old, old.model, found.still.model)
    fit = fit_joint(start, views, board, _STILL, fixed_noise=True, weight=weight)
    residual = np.where(weight[..., None] > 0, views.corners_px - predict(fit.model, views), np.nan)
    state = evaluate(fit.model, views)
    scale = np.sqrt(state.optics[:, COLUMN["alpha_px"]] * state.optics[:, COLUMN["beta_px"]])
    by_picture = fit_free_poses(
        state.optics, state.camera_from_board, state.points_m, views.corners_px, (), weight=weight
    ).camera_from_board
    return Misfit(
        model=fit.model,
        residual_px=residual,
        spread_px=_spread(old, fit.model, found),
        corner_px=found.noise.corner_px,
        distance_m=state.distance_m,
        lateral_m=state.distance_m / scale * _rms_each(residual),
        workpiece_m=workpiece_error_m(
            inverse(by_picture), inverse(state.camera_from_board), views.board
        ),
    )


def _at_board(old: OldCell, model: CellModel, now: CellModel) -> CellModel:
    return replace(model, **{old.board_frame: getattr(now, old.board_frame)})


def _rms_each(residual_px: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.nanmean((residual_px**2).sum(axis=2), axis=1)))


def _spread(old: OldCell, model: CellModel, found: Judgement) -> FloatArray:
    """(N, M, 2, K) one sigma of each error of old numbers and arm, less what the board takes up."""
    views, noise = found.views, found.noise
    seen = found.weight > 0
    columns = [_response(old, model, root, views) for root in camera_roots(old)]
    columns += list(_flange_columns(model, views, noise))
    small = 1e-5 * np.eye(len(old.unknowns))[old.group("board")]
    by_board = [_response(old, model, step, views) for step in small]
    spread = np.stack([c[seen].ravel() for c in columns], axis=1)
    J = np.stack([c[seen].ravel() for c in by_board], axis=1)
    spread = spread - J @ np.linalg.lstsq(J, spread, rcond=None)[0]
    out = np.zeros((*views.corners_px.shape, len(columns)))
    out[seen] = spread.reshape(-1, 2, len(columns))
    return out


def _response(old: OldCell, model: CellModel, step: FloatArray, views: Views) -> FloatArray:
    """(N, M, 2) change of the predicted pixels by a (P,) step of the unknowns."""
    ahead, behind = (predict(moved(model, old.unknowns, s), views) for s in (step, -step))
    return np.asarray((ahead - behind) / 2)


def camera_roots(old: OldCell) -> FloatArray:
    """(Q, P) steps of the unknowns that together make the camera's part of the covariance."""
    camera = [k for k, u in enumerate(old.unknowns) if not u.name.startswith(old.board_frame)]
    covariance = old.covariance[np.ix_(camera, camera)]
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    roots = np.zeros((len(camera), len(old.unknowns)))
    roots[:, camera] = (scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))).T
    return roots


def _flange_columns(model: CellModel, views: Views, noise: Noise) -> Iterator[FloatArray]:
    """(N, M, 2) for each frame and each of its flange's six numbers, one sigma of it."""
    sigma = [noise.flange_m] * 3 + [noise.flange_rad] * 3
    for k, size in enumerate(sigma):
        error = np.zeros((len(views), 6))
        error[:, k] = size
        ahead, behind = (predict(model, views, errors=Errors(e)) for e in (error, -error))
        for frame in range(len(views)):
            one = np.zeros_like(ahead)
            one[frame] = (ahead[frame] - behind[frame]) / 2
            yield one


def by_distance(found: Misfit, views: Views) -> list[Place]:
    """The misfit over ranges of distance, nearest first."""
    near, far = float(found.distance_m.min()), float(found.distance_m.max())
    edges = np.geomspace(near, far, _DISTANCES + 1)
    which = np.clip(np.searchsorted(edges, found.distance_m, side="right") - 1, 0, _DISTANCES - 1)
    places = []
    for k in np.unique(which):
        taken = which == k
        mask = found.seen & taken[:, None]
        span = found.distance_m[taken]
        places.append(_place(found, views, mask, (float(span.min()),), (float(span.max()),)))
    return places


def over_image(found: Misfit, views: Views) -> list[Place]:
    """The misfit in each ninth of the image that corners were seen in, row by row."""
    u, v = np.moveaxis(np.nan_to_num(views.corners_px), 2, 0)
    seen = found.seen
    places = []
    for row in range(_THIRDS):
        for column in range(_THIRDS):
            low = (column * views.width_px / _THIRDS, row * views.height_px / _THIRDS)
            high = ((column + 1) * views.width_px / _THIRDS, (row + 1) * views.height_px / _THIRDS)
            mask = seen & (u >= low[0]) & (u < high[0]) & (v >= low[1]) & (v < high[1])
            if mask.any():
                places.append(_place(found, views, mask, low, high))
    return places


def _place(
    found: Misfit,
    views: Views,
    mask: BoolArray,
    low: tuple[float, ...],
    high: tuple[float, ...],
) -> Place:
    off = found.residual_px[mask]
    length = np.linalg.norm(off, axis=1)
    worst = int(length.argmax())
    per_px = (found.lateral_m / _rms_each(found.residual_px))[np.nonzero(mask)[0]]
    u, v = views.corners_px[mask][worst]
    mean = off.mean(axis=0)
    sigma, limit = found.expected_px(mask)
    return Place(
        low=low,
        high=high,
        corners=len(off),
        rms_px=float(np.sqrt((length**2).mean())),
        sigma_px=sigma,
        limit_px=limit,
        mean_px=(float(mean[0]), float(mean[1])),
        worst_px=float(length[worst]),
        worst_at_px=(float(u), float(v)),
        lateral_m=float(np.sqrt(((length * per_px) ** 2).mean())),
    )
