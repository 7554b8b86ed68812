"""Which frames can be used at all, and their homographies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.calibration.result import Rejection
from calib.errors import CalibrationError
from calib.paper.homography import robust_homographies
from calib.views import BoolArray, FloatArray, Views

COPY = "identical to frame"
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
    wanted, rejected = worth_a_fit(views)
    corners_px = np.where(wanted[:, None, None], views.corners_px, np.nan)
    homographies, good, failed = robust_homographies(views.board.corners_m[:, :2], corners_px)
    more = [Rejection(int(views.frame[i]), failed[i]) for i in failed if wanted[i]]
    used: BoolArray = np.asarray(np.isfinite(homographies).all(axis=(1, 2)))
    require_frames(int(used.sum()), len(views))
    order = {int(frame): i for i, frame in enumerate(views.frame)}
    return Usable(
        homographies, used, good, tuple(sorted((*rejected, *more), key=lambda r: order[r.frame]))
    )


def worth_a_fit(views: Views) -> tuple[BoolArray, tuple[Rejection, ...]]:
    """(N,) frames with corners enough that are no copy of another, and the others with why."""
    seen, first = views.seen.sum(axis=1), _first_of_copies(views)
    copy = first != np.arange(len(views))
    why = {
        int(i): "no corners" if seen[i] == 0 else f"only {seen[i]} corners seen"
        for i in np.flatnonzero((seen < CORNERS_NEEDED) | copy)
    }
    why |= {
        int(i): f"{COPY} {views.frame[first[i]]} to the last bit: counted once"
        for i in np.flatnonzero(copy)
    }
    wanted = ~np.isin(np.arange(len(views)), list(why))
    return wanted, tuple(Rejection(int(views.frame[i]), why[i]) for i in sorted(why))


def _first_of_copies(views: Views) -> NDArray[np.int64]:
    """(N,) the first view with the same corners and pose, bit for bit; itself mostly."""
    known: dict[bytes, int] = {}
    some = views.seen.sum(axis=1) > 0
    both = zip(views.corners_px, views.base_from_flange, some, strict=True)
    return np.array(
        [
            known.setdefault(corners.tobytes() + pose.tobytes(), i) if seen else i
            for i, (corners, pose, seen) in enumerate(both)
        ]
    )


def require_frames(usable: int, recorded: int) -> None:
    """Refuse to calibrate on fewer than three frames."""
    if usable < FRAMES_NEEDED:
        raise CalibrationError(
            f"{usable} of {recorded} frames are usable",
            f"a calibration needs at least {FRAMES_NEEDED} with the board tilted differently"
            " (15 and more are better)",
        )
