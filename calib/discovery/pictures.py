"""What the pictures themselves say of the focus: how the edges' blur follows the distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.views import FloatArray

_FEWEST = 8
_CLEAR = 10.0
"""The blur must follow the distance with this much likelihood (in -2 log) to be reported."""


@dataclass(frozen=True)
class BlurCurve:
    """Blur against distance: blur^2 = best^2 + (slope * (1/d - 1/focus))^2.

    Attributes
    ----------
    best_px:
        Blur where the lens is focused (Gaussian sigma).
    slope_px_m:
        Growth with the inverse distance: the circle of confusion of a thin lens.
    focus_m:
        Where the lens stands focused.
    gain:
        Drop of -2 log likelihood against one blur for all distances.
    """

    best_px: float
    slope_px_m: float
    focus_m: float
    gain: float

    @property
    def stands_still(self) -> bool:
        """True when the blur shows a focus that did not follow the board."""
        return self.gain > _CLEAR and self.slope_px_m > 0.0


def fit_blur(blur_px: FloatArray, distance_m: FloatArray) -> BlurCurve | None:
    """Fit the defocus of a lens that stands still; None with fewer than eight frames.

    Source: thin-lens circle of confusion, proportional to |1/d - 1/focus| (Pentland 1987).
    """
    from scipy.optimize import least_squares  # many a verb never needs it

    known = np.isfinite(blur_px) & np.isfinite(distance_m) & (distance_m > 0.0)
    if known.sum() < _FEWEST:
        return None
    blur, inverse = blur_px[known], 1.0 / distance_m[known]

    def miss(p: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(p[0], p[1] * (inverse - p[2])) - blur)

    best = min(
        (
            least_squares(
                miss,
                [
                    max(float(blur.min()), 1e-3),
                    float(np.ptp(blur) / max(np.ptp(inverse), 1e-9)),
                    at,
                ],
                loss="soft_l1",
                f_scale=0.1,
            )
            for at in np.quantile(inverse, [0.1, 0.5, 0.9])
        ),
        key=lambda found: found.cost,
    )
    spread = float(np.mean((blur - np.median(blur)) ** 2))
    left = max(float(np.mean(miss(best.x) ** 2)), 1e-12)
    gain = len(blur) * float(np.log(max(spread, 1e-12) / left)) - 2.0 * float(np.log(len(blur)))
    return BlurCurve(
        float(abs(best.x[0])), float(abs(best.x[1])), float(1.0 / max(best.x[2], 1e-6)), gain
    )


def blur_notes(curve: BlurCurve | None) -> tuple[str, ...]:
    """A sentence about the blur, where pictures were seen."""
    if curve is None:
        return ()
    if curve.stands_still:
        return (
            f"edge blur grows away from {curve.focus_m:.2f} m ({curve.best_px:.2f} px at its best):"
            " the focus itself did not follow the board",
        )
    return (f"edge blur is the same at all distances ({curve.best_px:.2f} px)",)
