"""Which frames can be used at all, and their homographies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.calibration.result import Rejection
from calib.errors import CalibrationError
from calib.paper.homography import robust_homography
from calib.views import BoolArray, FloatArray, Views

CORNERS_NEEDED = 8
FRAMES_NEEDED = 3


@dataclass(frozen=True)
class Usable:
    """(N, 3, 3) homographies, NaN where a frame has none; (N, M) corners near them; why not."""

    homographies: FloatArray
    used: BoolArray
    good: BoolArray
    rejected: tuple[Rejection, ...]


def usable_frames(views: Views) -> Usable:
    """Fit every frame's homography; frames that have none are rejected with the reason.

    Raises
    ------
    CalibrationError
        Fewer than three frames are left.
    """
    homographies = np.full((len(views), 3, 3), np.nan)
    good = np.zeros(views.seen.shape, dtype=bool)
    flat = views.board.corners_m[:, :2]
    rejected = []
    for i, frame in enumerate(views.frame):
        seen = int(views.seen[i].sum())
        if seen < CORNERS_NEEDED:
            reason = "no corners" if seen == 0 else f"only {seen} corners seen"
            rejected.append(Rejection(int(frame), reason))
            continue
        try:
            homographies[i], good[i] = robust_homography(flat, views.corners_px[i])
        except CalibrationError as error:
            rejected.append(Rejection(int(frame), str(error)))
    used: BoolArray = np.asarray(np.isfinite(homographies).all(axis=(1, 2)))
    require_frames(int(used.sum()), len(views))
    return Usable(homographies, used, good, tuple(rejected))


def require_frames(usable: int, recorded: int) -> None:
    """Refuse to calibrate on fewer than three frames."""
    if usable < FRAMES_NEEDED:
        raise CalibrationError(
            f"{usable} of {recorded} frames are usable; a calibration needs at least"
            f" {FRAMES_NEEDED} with the board tilted differently (15 and more are better)"
        )
