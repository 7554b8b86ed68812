"""How the scale factor moves with distance: Eq. 25 with its sign free, a thin lens, a constant.

`inverse_square`: alpha = alpha0 - k/d^2 (Eq. 25). `thin_lens`: alpha = alpha_inf d/(d - f), what a
lens focused by moving as a whole does (its sign is opposite to the paper's curve).
`constant`: alpha. Which one the data prefer is decided by AICc with a common unknown noise scale,
so that a scatter larger than the corners' own (the robot's) does not pass for physics.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib.errors import CalibrationError
from calib.views import FloatArray

DECISIVE_AICC = 6.0
"""AICc gain from which a law is taken over a simpler one: odds of 20 to 1."""


POOR_SCATTER = 3.0
"""Residuals over sigma from which no law on offer describes the lens, or the sigmas are wrong."""


@dataclass(frozen=True)
class Parameter:
    """A fitted value with its one-sigma and unit."""

    value: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class FocusLaw:
    """One law fitted to scale factors.

    Attributes
    ----------
    law:
        `constant`, `inverse_square` or `thin_lens`.
    parameters:
        By name.
    covariance:
        (P, P) in the order of `parameters`, the distances' common error included.
    aicc, bic:
        Information criteria; only differences mean something.
    scatter:
        Standard deviation of the weighted residuals: 1 where the given sigmas explain all.
    """

    law: str
    parameters: dict[str, Parameter]
    covariance: FloatArray
    aicc: float
    bic: float
    scatter: float

    def scale_px(self, distance_m: FloatArray | float) -> FloatArray:
        """Scale factor at the given distances, pixels."""
        values = np.array([p.value for p in self.parameters.values()])
        return law_scale_px(self.law, values, distance_m)

    def sigma_px(self, distance_m: FloatArray | float) -> FloatArray:
        """One sigma of `scale_px`, pixels."""
        values = np.array([p.value for p in self.parameters.values()])
        J = _SHAPES[self.law].jacobian(values, np.atleast_1d(np.asarray(distance_m, dtype=float)))
        return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", J, self.covariance, J)))


@dataclass(frozen=True)
class FocusLawChoice:
    """All laws that could be fitted, and which one the data prefer.

    Attributes
    ----------
    preferred:
        The simplest law no other one beats decisively.
    candidates:
        Every law fitted.
    gain_aicc:
        How far the preferred law beats the next simpler or rival one; positive.
    decisive:
        Whether that gain reaches `DECISIVE_AICC`.
    why:
        One sentence for the operator.
    """

    preferred: FocusLaw
    candidates: tuple[FocusLaw, ...]
    gain_aicc: float
    decisive: bool
    why: str


@dataclass(frozen=True)
class _Shape:
    names: tuple[str, ...]
    units: tuple[str, ...]
    start: Callable[[FloatArray, FloatArray], FloatArray]
    value: Callable[[FloatArray, FloatArray], FloatArray]
    jacobian: Callable[[FloatArray, FloatArray], FloatArray]


def _thin_jacobian(p: FloatArray, d: FloatArray) -> FloatArray:
    return np.stack([d / (d - p[1]), p[0] * d / (d - p[1]) ** 2], axis=-1)


_SHAPES: dict[str, _Shape] = {
    "constant": _Shape(
        ("alpha_px",),
        ("px",),
        lambda d, a: np.array([a.mean()]),
        lambda p, d: p[0] + 0 * d,
        lambda p, d: np.ones((*d.shape, 1)),
    ),
    "inverse_square": _Shape(
        ("alpha0_px", "k_px_m2"),
        ("px", "px m^2"),
        lambda d, a: np.array([a.mean(), 0.0]),
        lambda p, d: p[0] - p[1] / d**2,
        lambda p, d: np.stack([np.ones_like(d), -1 / d**2], axis=-1),
    ),
    "thin_lens": _Shape(
        ("alpha_inf_px", "f_m"),
        ("px", "m"),
        lambda d, a: np.array([a.mean(), 0.0]),
        lambda p, d: p[0] * d / (d - p[1]),
        _thin_jacobian,
    ),
}


LAWS: dict[str, tuple[str, ...]] = {law: shape.names for law, shape in _SHAPES.items()}
"""Names of every law's parameters, the scale factor far away first."""


def law_scale_px(law: str, values: FloatArray, distance_m: FloatArray | float) -> FloatArray:
    """Scale factor by one of `LAWS` with these parameter values, at these distances; pixels."""
    return _SHAPES[law].value(values, np.asarray(distance_m, dtype=float))


def fit_focus_law(
    law: str,
    distance_m: FloatArray,
    scale_px: FloatArray,
    sigma_px: FloatArray,
    *,
    per_distance_px_m: FloatArray | None = None,
    common_distance_sigma_m: float = 0.0,
) -> FocusLaw:
    """Weighted least-squares fit of one law.

    Parameters
    ----------
    law:
        One of `constant`, `inverse_square`, `thin_lens`.
    distance_m, scale_px, sigma_px:
        (N,) distances, scale factors and their independent one-sigma.
    per_distance_px_m, common_distance_sigma_m:
        (N,) change of each scale factor by a metre of offset common to all distances, and that
        offset's one-sigma: it widens the parameters' sigma, it does not move them.

    Raises
    ------
    CalibrationError
        Fewer distances than the law has parameters plus one.
    """
    shape = _SHAPES[law]
    count = len(shape.names)
    if len(np.unique(np.round(distance_m, 6))) < count + 1:
        raise CalibrationError(
            f"the {law} law needs {count + 1} distances, there are {len(distance_m)} views"
        )
    p = shape.start(distance_m, scale_px)
    for _ in range(30):
        J = shape.jacobian(p, distance_m) / sigma_px[:, None]
        residual = (scale_px - shape.value(p, distance_m)) / sigma_px
        step = np.linalg.lstsq(J, residual, rcond=None)[0]
        p = p + step
        if np.abs(step / (np.abs(p) + 1e-9)).max() < 1e-12:
            break
    residual = (scale_px - shape.value(p, distance_m)) / sigma_px
    J = shape.jacobian(p, distance_m) / sigma_px[:, None]
    gain = np.linalg.pinv(J)
    scatter = float(np.sqrt((residual**2).sum() / (len(residual) - count)))
    covariance = gain @ gain.T * max(scatter, 1e-12) ** 2
    if per_distance_px_m is not None:
        common = gain @ (per_distance_px_m / sigma_px) * common_distance_sigma_m
        covariance = covariance + np.outer(common, common)
    sigma = np.sqrt(np.diag(covariance))
    parameters = {
        name: Parameter(float(v), float(s), unit)
        for name, v, s, unit in zip(shape.names, p, sigma, shape.units, strict=True)
    }
    aicc, bic = information_criteria(residual, sigma_px, count)
    return FocusLaw(law, parameters, covariance, aicc, bic, scatter)


def information_criteria(
    residual: FloatArray, sigma_px: FloatArray, count: int
) -> tuple[float, float]:
    """AICc and BIC of a weighted fit with unknown noise scale (Hurvich and Tsai 1989).

    Parameters
    ----------
    residual, sigma_px:
        (N,) residuals over sigma, and the sigma.
    count:
        Fitted parameters, the noise scale not counted.
    """
    n, k = len(residual), count + 1
    floor = n * (1e-6) ** 2
    minus_two_log = n * np.log(((residual**2).sum() + floor) / n) + 2 * np.log(sigma_px).sum()
    correction = 2 * k * (k + 1) / (n - k - 1) if n > k + 1 else np.inf
    return float(minus_two_log + 2 * k + correction), float(minus_two_log + k * np.log(n))


def choose_focus_law(
    distance_m: FloatArray,
    scale_px: FloatArray,
    sigma_px: FloatArray,
    *,
    per_distance_px_m: FloatArray | None = None,
    common_distance_sigma_m: float = 0.0,
) -> FocusLawChoice | None:
    """Fit every law and say which the data prefer; None where there are fewer than five views.

    A law with distance in it replaces the constant only when it beats it by `DECISIVE_AICC`;
    between the two of them the lower AICc wins, and `decisive` says whether by enough.
    """
    if len(distance_m) < 5:
        return None
    fitted: dict[str, FocusLaw] = {}
    for law in _SHAPES:
        try:
            fitted[law] = fit_focus_law(
                law,
                distance_m,
                scale_px,
                sigma_px,
                per_distance_px_m=per_distance_px_m,
                common_distance_sigma_m=common_distance_sigma_m,
            )
        except CalibrationError:
            continue
    if "constant" not in fitted:
        return None
    choice = _prefer(tuple(fitted.values()))
    if choice.preferred.scatter <= POOR_SCATTER:
        return choice
    poor = f"; yet the points scatter by {choice.preferred.scatter:.1f} sigma about it: none fits"
    return replace(choice, decisive=False, why=choice.why + poor)


def _prefer(candidates: tuple[FocusLaw, ...]) -> FocusLawChoice:
    constant, *moving = sorted(candidates, key=lambda c: (c.law != "constant", c.aicc))
    if not moving:
        return FocusLawChoice(constant, candidates, 0.0, False, "only a constant could be fitted")
    best = moving[0]
    over_constant = constant.aicc - best.aicc
    if over_constant < DECISIVE_AICC:
        why = (
            f"no law that moves with distance beats a constant by more than {over_constant:.1f}"
            " AICc"
        )
        return FocusLawChoice(constant, candidates, -over_constant, over_constant < 0, why)
    rival = min((c.aicc for c in moving[1:]), default=np.inf) - best.aicc
    gain = float(min(over_constant, rival))
    other = moving[1].law if len(moving) > 1 else "constant"
    why = f"{best.law} beats constant by {over_constant:.1f} and {other} by {rival:.1f} AICc"
    return FocusLawChoice(best, candidates, gain, gain >= DECISIVE_AICC, why)
