"""Zones 1, 2, 3 of the scale factor over distance (paper, section 4.1), found from the data.

Zone 1: the focal length moves with distance. Zone 2: it stands still; it begins at what the paper
calls the hyperfocal distance (in optics the word means a blur limit, which lies far beyond).
Zone 3: the board is too small in the image for its scale factor to be worth anything.

Near limit: where a curve with a corner in it beats every smooth law, its corner with its profile
interval. Where a smooth law wins there is no corner to find, and the limit is the distance from
which the law stays within `TOLERANCE` of its value at infinity. Far limit: from where one view's
own error exceeds that tolerance, or its scatter jumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.paper.focus_law import DECISIVE_AICC, FocusLawChoice, information_criteria
from calib.views import FloatArray

TOLERANCE = 1e-3
"""Relative change of scale that counts as none: one pixel, 1000 pixels from the axis."""

_VIEWS_NEEDED = 6
_SIDE = 3
_SCATTER_GAIN = 10.0


@dataclass(frozen=True)
class Zones:
    """Where the focal length stands still, and at what value.

    Attributes
    ----------
    near_limit_m, near_sigma_m:
        Where zone 2 begins; the sigma is None where the limit is no change point.
    far_limit_m:
        Where zone 3 begins.
    near_is_bound, far_is_bound:
        True where the limit is only the nearest or farthest view: the zone reaches at least there.
    alpha_px, alpha_sigma_px, beta_px, beta_sigma_px:
        Weighted mean over zone 2.
    method:
        `change_point`, `tolerance` or `constant`.
    why:
        One sentence for the operator.
    """

    near_limit_m: float
    near_sigma_m: float | None
    far_limit_m: float
    near_is_bound: bool
    far_is_bound: bool
    alpha_px: float
    alpha_sigma_px: float
    beta_px: float
    beta_sigma_px: float
    method: str
    why: str


@dataclass(frozen=True)
class _Near:
    limit_m: float
    sigma_m: float | None
    bound: bool
    method: str
    why: str
    residual: FloatArray


def find_zones(
    distance_m: FloatArray,
    alpha_px: FloatArray,
    alpha_sigma_px: FloatArray,
    beta_px: FloatArray,
    beta_sigma_px: FloatArray,
    choice: FocusLawChoice | None,
) -> tuple[Zones | None, str]:
    """The zones, or None; with the reason either way.

    Parameters
    ----------
    distance_m, alpha_px, alpha_sigma_px, beta_px, beta_sigma_px:
        (N,) scale factors of the near-parallel views.
    choice:
        The laws fitted to alpha, from `choose_focus_law`.
    """
    if len(distance_m) < _VIEWS_NEEDED or choice is None:
        return None, f"{len(distance_m)} near-parallel views; zones need {_VIEWS_NEEDED}"
    order = np.argsort(distance_m)
    d, a, s = distance_m[order], alpha_px[order], alpha_sigma_px[order]
    near = _near_limit(d, a, s, choice)
    if near.limit_m > d[-1]:
        return None, near.why
    far_m, far_is_bound = _far_limit(d, near.residual, s / a)
    inside = (d >= near.limit_m) & (d <= far_m)
    if not inside.any():
        return None, f"every view's own error exceeds {TOLERANCE:.1%}: all lie in zone 3"
    alpha, alpha_sigma = _mean(a[inside], s[inside])
    beta, beta_sigma = _mean(beta_px[order][inside], beta_sigma_px[order][inside])
    zones = Zones(
        near_limit_m=near.limit_m,
        near_sigma_m=near.sigma_m,
        far_limit_m=far_m,
        near_is_bound=near.bound,
        far_is_bound=far_is_bound,
        alpha_px=alpha,
        alpha_sigma_px=alpha_sigma,
        beta_px=beta,
        beta_sigma_px=beta_sigma,
        method=near.method,
        why=near.why,
    )
    return zones, near.why


def _mean(value: FloatArray, sigma: FloatArray) -> tuple[float, float]:
    weight = 1 / sigma**2
    mean = float((weight * value).sum() / weight.sum())
    scatter = ((value - mean) ** 2 * weight).sum() / max(len(value) - 1, 1)
    return mean, float(np.sqrt(max(scatter, 1.0) / weight.sum()))


def _near_limit(d: FloatArray, a: FloatArray, s: FloatArray, choice: FocusLawChoice) -> _Near:
    corner_m, sigma_m, aicc, residual = _change_point(d, a, s)
    rival = min(c.aicc for c in choice.candidates)
    if aicc < rival - DECISIVE_AICC:
        gain = rival - aicc
        why = f"a corner at {corner_m:.3f} m beats every smooth law by {gain:.1f} AICc"
        return _Near(corner_m, sigma_m, False, "change_point", why, residual)
    law = choice.preferred
    residual = (a - law.scale_px(d)) / s
    if law.law == "constant":
        why = "the scale factor stands still over all distances seen"
        return _Near(float(d[0]), None, True, "constant", why, residual)
    limit = _tolerance_distance(choice)
    why = f"no corner in the curve; {law.law} stays within {TOLERANCE:.1%} from {limit:.2f} m on"
    if limit > d[-1]:
        why += f", beyond the farthest view at {d[-1]:.2f} m: every view lies in zone 1"
    return _Near(max(limit, float(d[0])), None, limit < d[0], "tolerance", why, residual)


def _tolerance_distance(choice: FocusLawChoice) -> float:
    """Distance where the preferred law departs from infinity by `TOLERANCE`."""
    p = [parameter.value for parameter in choice.preferred.parameters.values()]
    if choice.preferred.law == "inverse_square":
        return float(np.sqrt(abs(p[1]) / (TOLERANCE * p[0])))
    return float(abs(p[1]) * (1 + 1 / TOLERANCE))


def _change_point(
    d: FloatArray, a: FloatArray, s: FloatArray
) -> tuple[float, float, float, FloatArray]:
    """Corner of alpha2 - k max(0, 1/d^2 - 1/corner^2): where, sigma, AICc, weighted residuals."""
    corners = np.linspace(d[_SIDE - 1], d[-_SIDE], 400)
    fits = [_corner_fit(c, d, a, s) for c in corners]
    cost = np.array([(r**2).sum() for r in fits])
    best = int(cost.argmin())
    aicc, _ = information_criteria(fits[best], s, 3)
    scale = max(cost[best] / max(len(d) - 3, 1), 1e-12)
    likely = corners[cost <= cost[best] + scale]
    grid = corners[1] - corners[0]
    sigma = max(float(likely[-1] - likely[0]) / 2, float(grid))
    return float(corners[best]), sigma, aicc, fits[best]


def _corner_fit(corner: float, d: FloatArray, a: FloatArray, s: FloatArray) -> FloatArray:
    bend = np.maximum(0, 1 / d**2 - 1 / corner**2)
    J = np.stack([np.ones_like(d), -bend], axis=1) / s[:, None]
    p = np.linalg.lstsq(J, a / s, rcond=None)[0]
    return np.asarray(a / s - J @ p)


def _far_limit(
    d: FloatArray, residual: FloatArray, relative_sigma: FloatArray
) -> tuple[float, bool]:
    limits = [x for x in (_sigma_limit(d, relative_sigma), _scatter_limit(d, residual)) if x]
    inside = [x for x in limits if x < d[-1]]
    return (min(inside), False) if inside else (float(d[-1]), True)


def _sigma_limit(d: FloatArray, relative_sigma: FloatArray) -> float | None:
    """Where the sigma, a power of the distance, crosses the tolerance."""
    slope, level = np.polyfit(np.log(d), np.log(relative_sigma), 1)
    if slope < 0.1:
        return None
    return float(np.exp(min((np.log(TOLERANCE) - level) / slope, 20.0)))


def _scatter_limit(d: FloatArray, residual: FloatArray) -> float | None:
    """Where the weighted residuals' variance jumps up, by likelihood ratio."""
    n, square = len(d), residual**2 + 1e-12
    whole = n * np.log(square.mean())
    best, where = _SCATTER_GAIN, None
    for cut in range(_SIDE, n - _SIDE + 1):
        near, far = square[:cut].mean(), square[cut:].mean()
        gain = whole - cut * np.log(near) - (n - cut) * np.log(far)
        if far > near and gain > best:
            best, where = gain, float((d[cut - 1] + d[cut]) / 2)
    return where
