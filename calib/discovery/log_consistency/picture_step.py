"""Pictures that are of another scale or region from one frame on: binning or region was changed.

Found before anything is fitted: pictures of two cameras have no one calibration, and what passes
for one rejects half of the frames or bends all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.baseline import Baseline, fit_baseline
from calib.calibration.frames import usable_frames
from calib.chain.effect import Present
from calib.chain.effects import find_effect
from calib.errors import CalibrationError
from calib.views import FloatArray, Views

_SUSPECT = 2.0
"""One camera must miss by so many times what each frame's own homography does."""

_LEFT_OUT_SHARE = 0.1
_BETTER = 0.15
"""Two cameras must bring what the mean square has above the homographies' down to this share."""

_FEWEST = 4
_COARSE = 12
_CAP = 36.0
"""A frame counts for so many times the homographies' mean square at most."""

_LEAST_SCALE, _LEAST_SHIFT_PX = 0.02, 20.0
"""Smaller steps are a lens that was touched, and the search names them."""


@dataclass(frozen=True)
class PictureStep:
    """The step, and (2,) the principal point before it."""

    step: Present
    principal_point_px: FloatArray


def find_picture_step(views: Views, baseline: Baseline | None) -> PictureStep | None:
    """The step of the optics that two calibrations show, or None where one will do.

    Parameters
    ----------
    views, baseline:
        The recording's frames, and the calibration of all of them; None where no one camera shows
        them. Homographies say what the pictures' own noise is; a wide lens has none, and its steps
        are left to the search.
    """
    if baseline is not None and baseline.mle.wide:
        return None
    floor = _homographies_mean_square(views)
    single = _costs(views, baseline, floor)
    left_out = 1.0 if baseline is None else 1.0 - baseline.used.mean()
    if single.mean() < _SUSPECT**2 * floor and left_out < _LEFT_OUT_SHARE:
        return None
    inner = range(_FEWEST, len(views) - _FEWEST + 1)
    stride = max(1, len(inner) // _COARSE)
    costs = {at: _split_cost(views, at, floor) for at in inner[::stride]}
    if not costs:
        return None
    near = min(costs, key=lambda at: costs[at])
    for at in range(max(near - stride, _FEWEST), min(near + stride, len(views) - _FEWEST) + 1):
        costs.setdefault(at, _split_cost(views, at, floor))
    best = min(costs, key=lambda at: costs[at])
    if costs[best] - floor > _BETTER * (single.mean() - floor):
        return None
    return _step(views, best)


def as_before(views: Views, found: PictureStep) -> Views:
    """The views with the later frames' corners where the earlier camera would have shown them."""
    given = found.step.as_mapping()
    late = views.frame >= given["at_frame"]
    corners = views.corners_px.copy()
    shift = np.array([given["u_px"], given["v_px"]])
    corners[late] = found.principal_point_px + (
        corners[late] - found.principal_point_px - shift
    ) / (1.0 + given["relative"])
    return replace(views, corners_px=corners)


def _homographies_mean_square(views: Views) -> float:
    """Square per number, in the median over frames, by which corners miss a homography."""
    usable = usable_frames(views)
    flat = np.column_stack([views.board.corners_m[:, :2], np.ones(views.board.corner_count)])
    squares = []
    for i in np.flatnonzero(usable.used):
        shown = flat @ usable.homographies[i].T
        miss = views.corners_px[i] - shown[:, :2] / shown[:, 2:]
        squares.append(float(np.mean(miss[usable.good[i]] ** 2)))
    return float(np.median(squares))


def _costs(views: Views, baseline: Baseline | None, floor: float) -> FloatArray:
    """(N,) mean square of each frame under its camera; the cap for one that was left out."""
    out = np.full(len(views), _CAP * floor)
    if baseline is None:
        return out
    known = np.asarray(baseline.used)
    square = np.nanmean(baseline.mle.residual_px[known] ** 2, axis=(1, 2))
    out[known] = np.minimum(np.nan_to_num(square, nan=np.inf), _CAP * floor)
    return out


def _halves(views: Views, at: int) -> tuple[Views, Views]:
    order = np.arange(len(views))
    return views.take(order[:at]), views.take(order[at:])


def _calibrated(views: Views) -> Baseline | None:
    try:
        return fit_baseline(views, usable_frames(views))
    except CalibrationError:
        return None


def _split_cost(views: Views, at: int, floor: float) -> float:
    halves = _halves(views, at)
    total = sum(float(_costs(half, _calibrated(half), floor).sum()) for half in halves)
    return total / len(views)


def _step(views: Views, at: int) -> PictureStep | None:
    first, second = (_calibrated(half) for half in _halves(views, at))
    if first is None or second is None:
        return None
    before, after = first.mle.values, second.mle.values
    sides = ("alpha_px", "beta_px")
    relative = sum(after[k] for k in sides) / sum(before[k] for k in sides) - 1.0
    u_px, v_px = (after[k] - before[k] for k in ("u0_px", "v0_px"))
    if abs(relative) < _LEAST_SCALE and np.hypot(u_px, v_px) < _LEAST_SHIFT_PX:
        return None
    effect = find_effect("optics_step")
    # frames between the two that nobody recorded are counted to the later ones
    at_frame = float(views.frame[at - 1] + 1)
    given = {"relative": relative, "u_px": u_px, "v_px": v_px, "at_frame": at_frame}
    principal_point_px = np.array([before["u0_px"], before["v0_px"]])
    return PictureStep(Present(effect, effect.values(given)), principal_point_px)
