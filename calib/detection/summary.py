"""Turns fitted corners into what a detection reports."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.detection.refine import Fitted
from calib.detection.result import Detection
from calib.detection.saddle import CONTRAST, MEAN
from calib.views import Board


def saturated_share(image: NDArray[np.float32], fitted: Fitted, limit: float) -> float:
    """Share of the bright pixels between the outermost corners that reach `limit`."""
    corners = fitted.corners_px
    outline = np.array([corners[0, 0], corners[0, -1], corners[-1, -1], corners[-1, 0]])
    low = np.clip(np.floor(outline.min(axis=0)).astype(int), 0, None)
    high = np.clip(np.ceil(outline.max(axis=0)).astype(int) + 1, low + 1, None)
    part = image[low[1] : high[1], low[0] : high[0]]
    mask = np.zeros(part.shape, np.uint8)
    cv2.fillConvexPoly(mask, np.rint(outline - low).astype(np.int32), 1)
    bright = part[(mask > 0) & (part > np.median(fitted.parameters[..., MEAN]))]
    return float((bright >= limit).mean()) if bright.size else 0.0


def as_detection(
    fitted: Fitted, unseen: NDArray[np.bool_], board: Board, saturated: float
) -> Detection:
    """The detection of a grid, NaN for its (rows, cols) `unseen` corners."""
    M = board.corner_count
    covariance = np.where(unseen[..., None, None], np.nan, fitted.covariance_px2).reshape(M, 2, 2)

    def of_seen(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(unseen, np.nan, values).reshape(M)

    return Detection(
        corners_px=np.where(unseen[..., None], np.nan, fitted.corners_px).reshape(M, 2),
        covariance_px2=covariance,
        sigma_px=np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 2),
        blur_px=of_seen(fitted.blur_px),
        contrast=of_seen(2 * np.abs(fitted.parameters[..., CONTRAST])),
        upside_down_known=board.identified or (board.rows + board.cols) % 2 == 1,
        saturated=saturated,
    )
