"""What a detection says of one picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Rejected:
    """A picture without a usable board.

    Attributes
    ----------
    reason:
        What was wrong, in words an operator can act on.
    """

    reason: str

    def __bool__(self) -> Literal[False]:
        return False


@dataclass(frozen=True)
class Detection:
    """The board's corners in one picture.

    Attributes
    ----------
    corners_px:
        (M, 2) corners row by row, (0, 0) at the centre of the top-left pixel. Complete for a
        chessboard; NaN for ChArUco corners that were not seen.
    covariance_px2:
        (M, 2, 2) covariance of each corner, from the fit.
    sigma_px:
        (M,) one sigma per axis: the root mean square over the axes of `covariance_px2`.
    blur_px:
        (M,) Gaussian sigma of the edges' blur; what the pixel's own area adds is taken out.
    contrast:
        (M,) grey levels between the bright and the dark squares.
    upside_down_known:
        Whether the picture alone says which end of the board is row 0.
    saturated:
        Share of the bright pixels on the board that stand at the sensor's limit.
    """

    corners_px: FloatArray
    covariance_px2: FloatArray
    sigma_px: FloatArray
    blur_px: FloatArray
    contrast: FloatArray
    upside_down_known: bool
    saturated: float

    def __bool__(self) -> Literal[True]:
        return True

    @property
    def frame_blur_px(self) -> float:
        """Median blur of the frame's edges, pixels: the sharpness a frame check looks at."""
        return float(np.nanmedian(self.blur_px))

    @property
    def sharpness(self) -> float:
        """Steepest slope of a typical edge as a share of its step, 1/pixel; 1 is perfect.

        An edge of Gaussian blur s, seen by a pixel, rises by 1 / sqrt(2 pi (s^2 + 1/12)).
        """
        width = np.sqrt(self.frame_blur_px**2 + 1 / 12)
        return float(min(1.0, 1.0 / (np.sqrt(2 * np.pi) * width)))

    def reordered(self, order: NDArray[np.int64]) -> Detection:
        """The same corners under other names: new corner m is old corner `order[m]`."""
        return Detection(
            self.corners_px[order],
            self.covariance_px2[order],
            self.sigma_px[order],
            self.blur_px[order],
            self.contrast[order],
            self.upside_down_known,
            self.saturated,
        )
