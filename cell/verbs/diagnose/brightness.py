"""Picture by picture: how bright the board is, against its distance and along the run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.chain.model import evaluate
from calib.discovery.diagnosis import Diagnosis
from calib.views import FloatArray
from cell.errors import InputError
from cell.storage.recording import Recording

_WHITE = 90.0
_ABOUT_SAMPLES = 200
_FEWEST = 8
_CLEAR_SIGMA = 4.0
_WORTH_REPORTING = 0.02


def white_level(image: NDArray[np.generic], corners_px: FloatArray) -> float:
    """Grey level (0 to 1) of the board's white squares: the 90th percentile among its corners.

    Parameters
    ----------
    image:
        (h, w) or (h, w, 3), 8 or 16 bit.
    corners_px:
        (M, 2), NaN where not seen.
    """
    full = 65535.0 if image.dtype == np.uint16 else 255.0
    low = np.maximum(np.nanmin(corners_px, axis=0), 0).astype(int)
    high = np.nanmax(corners_px, axis=0).astype(int) + 1
    stride = max(int((high - low).max()) // _ABOUT_SAMPLES, 1)
    part = image[low[1] : high[1] : stride, low[0] : high[0] : stride].astype(np.float64)
    if part.size == 0:
        return float("nan")
    return float(np.percentile(part, _WHITE)) / full


def brightness_notes(recording: Recording, found: Diagnosis) -> tuple[str, ...]:
    """Sentences on how the light followed distance and time; none without pictures."""
    views = found.views
    by_number = {frame.frame: frame for frame in recording.frames}
    level = np.full(len(views), np.nan)
    for i, number in enumerate(views.frame):
        frame = by_number.get(int(number))
        if frame is None or frame.image is None:
            continue
        try:
            level[i] = white_level(recording.image(frame), views.corners_px[i])
        except InputError:
            continue
    if np.isfinite(views.exposure_s).all():
        level = level * np.median(views.exposure_s) / views.exposure_s
    if np.isfinite(level).sum() < _FEWEST:
        return ()
    distance_m = evaluate(found.twin.model, views).distance_m
    order = np.arange(len(views), dtype=np.float64)
    reported = _trend(
        level, distance_m, "with the board's distance, from the nearest to the farthest"
    )
    reported += _trend(level, order, "from the first frame to the last")
    return reported or (
        f"the board's white is the same in all pictures ({np.nanmedian(level):.0%})",
    )


def _trend(level: FloatArray, along: FloatArray, suffix: str) -> tuple[str, ...]:
    """A sentence where the level follows something clearly, by more than two percent."""
    known = np.isfinite(level) & np.isfinite(along)
    x, y = along[known], level[known] / float(np.median(level[known]))
    spread = x - x.mean()
    if not spread.any():
        return ()
    slope = float(spread @ y / (spread @ spread))
    rest = y - y.mean() - slope * spread
    sigma = float(np.sqrt(rest @ rest / max(len(x) - 2, 1) / (spread @ spread)))
    change = slope * float(np.ptp(x))
    if abs(slope) < _CLEAR_SIGMA * sigma or abs(change) < _WORTH_REPORTING:
        return ()
    return (f"the board's white changes by {change:+.0%} {suffix}",)
