"""Finds a calibration board's corners in pictures, to a hundredth of a pixel and better."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.detection.aprilgrid import find_aprilgrid
from calib.detection.charuco import find_charuco
from calib.detection.finder import find_chessboard
from calib.detection.first_call import make_ready
from calib.detection.orientation import orient, turned_order, turns_to_agree
from calib.detection.result import Detection, Rejected
from calib.detection.summary import as_detection, saturated_share
from calib.views import Board

__all__ = [
    "Detection",
    "Rejected",
    "detect",
    "make_ready",
    "orient",
    "turned_order",
    "turns_to_agree",
]

_FINDERS = {
    "chessboard": find_chessboard,
    "charuco": find_charuco,
    "aprilgrid": find_aprilgrid,
}


def detect(image: NDArray[Any], board: Board) -> Detection | Rejected:
    """Find `board` in a picture and measure its corners.

    Parameters
    ----------
    image:
        (h, w) grey or (h, w, 3) colour (the mean of the channels is taken), any integer or
        float type.
    board:
        The board to look for.

    Returns
    -------
    The detection, or a `Rejected` with the reason; the latter is false as a condition.
    """
    grey = np.asarray(image)
    if grey.ndim == 3:
        grey = grey.mean(axis=2, dtype=np.float32)
    grey = np.ascontiguousarray(grey, dtype=np.float32)
    found = _FINDERS[board.kind](grey, board)
    if isinstance(found, Rejected):
        return found
    limit = np.iinfo(image.dtype).max if np.issubdtype(image.dtype, np.integer) else np.inf
    fitted, unseen = found
    return as_detection(fitted, unseen, board, saturated_share(grey, fitted, float(limit)))
