"""Whether a frame is good enough to keep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.detection import Detection, detect, make_ready
from calib.views import Board
from cell.errors import InputError
from cell.storage.files.camera_file import CameraFile
from cell.storage.files.plan_file import Checks


@dataclass(frozen=True)
class Verdict:
    """What the check of one frame found.

    Attributes
    ----------
    fault:
        None, or why the frame should be taken again.
    detection:
        The board, where one was looked for and found.
    """

    fault: str | None
    detection: Detection | None = None


def make_check_ready(checks: Checks) -> None:
    """Have the search for the board compiled: the first frame is judged while the arm moves on."""
    if checks.board:
        make_ready()


def check_size(image: NDArray[np.generic], camera: CameraFile) -> None:
    """Raise `InputError` for a picture that has not the size which the cell file gives.

    Plan, optics and recording count in the cell file's pixels; a camera with another binning or
    region shows other ones.
    """
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise InputError(
            f"the camera's picture has {width}x{height} pixels, and the cell file says"
            f" {camera.width}x{camera.height}: set the camera's binning and region to what the cell"
            " file says, or write this size as camera.width and camera.height, and plan anew"
        )


def check_frame(image: NDArray[np.generic], board: Board, checks: Checks) -> Verdict:
    """Judge a picture: board found, enough corners, sharp, not saturated."""
    if not checks.board:
        return Verdict(None)
    found = detect(image, board)
    if not isinstance(found, Detection):
        return Verdict(f"board not found: {found.reason}")
    return Verdict(_fault(found, checks), found)


def _fault(found: Detection, checks: Checks) -> str | None:
    corners = int(np.isfinite(found.corners_px).all(axis=1).sum())
    if corners < checks.min_corners:
        return f"only {corners} corners in sight, need {checks.min_corners}"
    if checks.max_blur_px is not None and found.frame_blur_px > checks.max_blur_px:
        return (
            f"blurred: edges are {found.frame_blur_px:.1f} px wide, allowed are"
            f" {checks.max_blur_px:.1f}. Focus, or close the aperture."
        )
    if found.saturated > checks.max_saturated:
        return (
            f"saturated: {found.saturated:.0%} of the board's white is at full scale, allowed are"
            f" {checks.max_saturated:.0%}. Shorten the exposure."
        )
    return None
