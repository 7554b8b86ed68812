"""Perspective or wide: which image the pictures show, by frames that had no say.

A lens narrower than `_NARROW_RAD` is taken as perspective without asking: there the two are the
same to within their radial terms. Beyond, each is fitted with the terms it deserves, and frames
left out are predicted by both. A perspective polynomial that folds before the picture ends must
predict better by as much as a rare term must; one that folds before the farthest corner, or has
no fit at all, is out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.calibration.baseline import Baseline, fit_baseline, settle
from calib.calibration.frames import Usable, usable_frames, worth_a_fit
from calib.calibration.joint_lens import WORTH, deserved_terms
from calib.calibration.pictures import FOLDS, Pictures
from calib.calibration.result import Rejection
from calib.calibration.wide_start import wide_start
from calib.chain.domain import invertible_rad
from calib.chain.sight import unproject
from calib.errors import CalibrationError
from calib.solver.unknowns import plain_optics
from calib.views import BoolArray, FloatArray, Views

NO_HOMOGRAPHY = (
    "the paper's method reads a perspective image, and this lens makes an equidistant one"
)

_NO_POSE = "its corners show the board from no place under a wide lens"
_NARROW_RAD = np.radians(45.0)
_FEW_FRAMES_LOST = 0.7
"""Of the corners that either lens takes, the share that both must take to be compared by them."""


def chosen_baseline(views: Views) -> Baseline:
    """The baseline of the lens that the pictures show; raises as `chosen_lens` does."""
    return chosen_lens(views)[0]


def chosen_lens(views: Views) -> tuple[Baseline, FloatArray | None]:
    """The baseline of the lens that the pictures show.

    Returns
    -------
    The baseline, and (N, 3, 3) homographies, or None with a wide lens, which has none.

    Raises
    ------
    CalibrationError
        The views do not fix either.
    """
    failure: CalibrationError | None = None
    flat: Baseline | None = None
    usable: Usable | None = None
    try:
        usable = usable_frames(views)
        flat = fit_baseline(views, usable)
    except CalibrationError as error:
        failure = error
    if flat is not None and _farthest_rad(flat, views) < _NARROW_RAD:
        assert usable is not None
        return flat, usable.homographies
    wide = _wide(views)
    if wide is not None and (flat is None or _shows_better(wide, flat, views)):
        return wide, None
    if flat is None or usable is None:
        assert failure is not None
        raise failure
    return flat, usable.homographies


def _wide(views: Views) -> Baseline | None:
    """The wide lens's baseline; None where there is none, or the pictures do not reach wide."""
    wanted, rejected = worth_a_fit(views)
    try:
        row, poses = wide_start(views, wanted)
        used: BoolArray = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
        without = views.frame[wanted & ~used]
        rejected += tuple(Rejection(int(frame), _NO_POSE) for frame in without)
        usable = Usable(np.empty((0, 3, 3)), used, views.seen & used[:, None], rejected)
        found = settle(views, row, poses, usable, plain_optics(row))
    except CalibrationError:
        return None
    if _farthest_rad(found, views) < _NARROW_RAD or not _holds(found, views):
        return None
    reason = dict.fromkeys(("zhang_algebraic",), NO_HOMOGRAPHY)
    return replace(found, missing=reason)


def _pictures(baseline: Baseline, views: Views, weight: FloatArray) -> Pictures:
    used = baseline.used
    return Pictures(
        baseline.mle.optics[used],
        baseline.mle.camera_from_board[used],
        views.board.corners_m,
        views.corners_px[used],
        weight[used],
    )


def _farthest_rad(baseline: Baseline, views: Views) -> float:
    pictures = _pictures(baseline, views, baseline.weight)
    return pictures.farthest_rad(pictures.camera_from_board)


def _holds(baseline: Baseline, views: Views) -> bool:
    """Whether the lens can be inverted as far as its corners reach."""
    row = baseline.mle.optics[np.flatnonzero(baseline.used)[0]]
    return _farthest_rad(baseline, views) < invertible_rad(row)


def _shows_better(wide: Baseline, flat: Baseline, views: Views) -> bool:
    taken = [b.used[:, None] & (b.weight > 0) & views.seen for b in (wide, flat)]
    both: BoolArray = taken[0] & taken[1]
    if both.sum() < _FEW_FRAMES_LOST * max(t.sum() for t in taken):
        return bool(taken[0].sum() > taken[1].sum())
    frames = both.sum(axis=1) >= 4
    if frames.sum() < 2 * FOLDS:
        return not _holds(flat, views)
    weight = (both & frames[:, None]).astype(float)
    by_wide, by_flat = (
        _pictures(replace(b, used=b.used & frames), views, weight) for b in (wide, flat)
    )
    wide_off = by_wide.held_out(deserved_terms(by_wide))
    terms = deserved_terms(by_flat)
    flat_off = by_flat.held_out(terms)
    if not np.isfinite(wide_off):
        return False
    fit = by_flat.fit(terms)
    if by_flat.farthest_rad(fit.camera_from_board) >= invertible_rad(fit.optics[0]):
        return True
    whole = _shows_whole_picture(fit.optics[0], views)
    return bool(wide_off * WORTH < flat_off if whole else wide_off < WORTH * flat_off)


def _shows_whole_picture(row: FloatArray, views: Views) -> bool:
    """Whether every border pixel has a line of sight."""
    u, v = np.linspace(0.0, views.width_px - 1.0, 9), np.linspace(0.0, views.height_px - 1.0, 9)
    border = [(x, y) for x in u for y in v if x in (u[0], u[-1]) or y in (v[0], v[-1])]
    return bool(np.isfinite(unproject(row, np.array(border))).all())
