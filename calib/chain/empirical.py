"""An effect without a name: some place of the chain follows some covariate along a smooth curve.

It carries what no known physics explains, so that the twin still predicts, and it is what the
locating tests are made of (varying-coefficient score tests).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from calib.chain import rigid
from calib.chain.covariates import CONSTANT, Covariate, covariate_named
from calib.chain.effect import Effect, Link, Parameter, Present
from calib.chain.state import ChainState
from calib.views import FloatArray, Views

UNNAMED = "empirical"
"""What every effect without a name is called."""

LEGENDRE_TERMS = 4
HARMONICS = 3
FINE = 3
"""How many times as many functions a finer curve has."""


@dataclass(frozen=True)
class Site:
    """A place in the chain whose constant might not be one.

    Attributes
    ----------
    name, link:
        What it is called, and the link it belongs to.
    acts_in:
        The link at whose turn it acts.
    components:
        (name, unit, typical size) of each number.
    shift:
        Applies (N, D) amounts to the state.
    """

    name: str
    link: Link
    acts_in: Link
    components: tuple[tuple[str, str, float], ...]
    shift: Callable[[FloatArray, ChainState], None]


def _joint(index: int) -> Site:
    def shift(amount: FloatArray, state: ChainState) -> None:
        state.joints_rad = state.joints_rad.copy()
        state.joints_rad[:, index] += amount[:, 0]

    name = f"joint_{index + 1}"
    return Site(name, "arm", "arm", ((name, "rad", 3e-4),), shift)


def _flange(amount: FloatArray, state: ChainState) -> None:
    state.base_from_flange = state.base_from_flange @ rigid.from_vector(amount)


def _base(amount: FloatArray, state: ChainState) -> None:
    state.base_from_flange = rigid.from_vector(amount) @ state.base_from_flange


def _mounted(amount: FloatArray, state: ChainState) -> None:
    state.flange_from_mounted = state.flange_from_mounted @ rigid.from_vector(amount)


def _fixed(amount: FloatArray, state: ChainState) -> None:
    state.base_from_fixed = state.base_from_fixed @ rigid.from_vector(amount)


def _focal(amount: FloatArray, state: ChainState) -> None:
    state.column("alpha_px")[:] *= 1.0 + amount[:, 0]
    state.column("beta_px")[:] *= 1.0 + amount[:, 0]


def _principal(amount: FloatArray, state: ChainState) -> None:
    state.column("u0_px")[:] += amount[:, 0]
    state.column("v0_px")[:] += amount[:, 1]


def _radial(amount: FloatArray, state: ChainState) -> None:
    state.column("k1")[:] += amount[:, 0]


_RIGID = tuple(
    [(f"{axis}_m", "m", 3e-4) for axis in "xyz"] + [(f"r{axis}_rad", "rad", 3e-4) for axis in "xyz"]
)
SITES: tuple[Site, ...] = (
    *(_joint(k) for k in range(6)),
    Site("flange_pose", "arm", "mount", _RIGID, _flange),
    Site("base_pose", "arm", "mount", _RIGID, _base),
    Site("mounted_pose", "mount", "mount", _RIGID, _mounted),
    Site("fixed_pose", "board", "board", _RIGID, _fixed),
    Site("focal_length", "lens", "lens", (("relative", "1", 1e-3),), _focal),
    Site("principal_point", "lens", "lens", (("u_px", "px", 1.0), ("v_px", "px", 1.0)), _principal),
    Site("radial_distortion", "lens", "lens", (("k1", "1", 1e-3),), _radial),
)


def site_named(name: str) -> Site:
    """Return the site of that name; raises KeyError."""
    return {site.name: site for site in SITES}[name]


def _goes_round(covariate: Covariate, low: float, high: float) -> bool:
    return covariate.cyclic and high - low > np.pi


def basis(
    covariate: Covariate, value: FloatArray, low: float, high: float, times: int = 1
) -> FloatArray:
    """(N, B) smooth functions of the covariate, without the constant; zero where it is NaN.

    `times` as many as are needed for a smooth curve.
    """
    known = np.asarray(np.isfinite(value).all(axis=1) if value.ndim == 2 else np.isfinite(value))
    safe = np.where(np.isfinite(value), value, 0.0)
    if value.ndim == 2:
        return np.asarray(safe * known[:, None])
    if covariate.two_sided:
        return np.asarray(safe * known)[:, None]
    if _goes_round(covariate, low, high):
        waves = [f(k * safe) for k in range(1, times * HARMONICS + 1) for f in (np.sin, np.cos)]
        return np.asarray(np.stack(waves, axis=1) * known[:, None])
    beyond = 1.2 if times == 1 else 1.0  # higher powers run away outside of what was seen
    unit = np.clip(2.0 * (safe - low) / max(high - low, 1e-12) - 1.0, -beyond, beyond)
    return np.asarray(legvander(unit, times * LEGENDRE_TERMS)[:, 1:] * known[:, None])


def wave(value: FloatArray, period: float) -> FloatArray:
    """(N, 2) sine and cosine of that period; zero where the value is NaN."""
    phase = 2.0 * np.pi * np.nan_to_num(value) / period
    known = np.isfinite(value)[:, None]
    return np.asarray(np.stack([np.sin(phase), np.cos(phase)], axis=1) * known)


@dataclass(frozen=True)
class Curve:
    """Which site follows which covariate, and over what range or with what period.

    A fine curve can have a kink or a narrow bump.
    """

    site: Site
    covariate: Covariate
    low: float
    high: float
    period: float | None = None
    fine: bool = False

    @property
    def can_be_finer(self) -> bool:
        """Whether there is a finer curve of the same site and covariate."""
        stiff = self.covariate.two_sided or self.covariate.name == "gravity"
        return not (self.fine or stiff or self.period is not None)

    def functions(self, state: ChainState) -> FloatArray:
        """(N, B) of the curve's functions."""
        value = self.covariate.of(state)
        if self.period is not None:
            return wave(value, self.period)
        return basis(self.covariate, value, self.low, self.high, FINE if self.fine else 1)

    def carried(self, state: ChainState) -> FloatArray:
        """(N, B) of the functions that carry the curve in a cell.

        A joint between the first and the last has a constant of its own that neither mount nor
        board absorbs: a curve that only starts at some angle has one, too.
        """
        functions = self.functions(state)
        if not self.has_own_constant:
            return functions
        return np.concatenate([functions, np.ones((len(functions), 1))], axis=1)

    @property
    def has_own_constant(self) -> bool:
        """Whether the last of the functions that carry it is a constant."""
        return self.site.name in INNER_JOINTS and self.covariate is not CONSTANT

    def usual(self, function: int, functions: int) -> float:
        """How large an amount of one of the functions usually is, as a share of the first one's.

        Those that only a fine curve has fall off with the square of their order, as a kink's do:
        where no frame is they would swing.
        """
        if self.has_own_constant and function == functions - 1:
            return 1.0
        waves = _goes_round(self.covariate, self.low, self.high)
        order, smooth = (function // 2, HARMONICS) if waves else (function, LEGENDRE_TERMS)
        return 1.0 if not self.fine or order < smooth else (1.0 + order) ** -2.0


INNER_JOINTS = ("joint_2", "joint_3", "joint_4", "joint_5")


def empirical(curve: Curve, functions: int) -> Effect:
    """An effect by which the site follows the covariate along that many functions."""
    site = curve.site
    amount_count = functions * len(site.components)

    def act(values: FloatArray, state: ChainState) -> None:
        coefficients = values[:amount_count]
        if not coefficients.any():
            return
        amounts = curve.carried(state) @ coefficients.reshape(functions, len(site.components))
        site.shift(amounts, state)

    return Effect(
        name=UNNAMED,
        law=f"{site.name}/{curve.covariate.name}",
        link=site.acts_in,
        looks_ahead=site.acts_in == "arm",
        physics=(
            f"Something that no known effect accounts for moves the {site.name.replace('_', ' ')}"
            f" with the {curve.covariate.name.replace('_', ' ')}."
        ),
        equation=f"{site.name} = constant + curve({curve.covariate.name})",
        source="varying-coefficient model (Hastie, Tibshirani 1993)",
        parameters=(
            *(
                Parameter(f"c{b}_{name}", unit, typical * curve.usual(b, functions), -1e3, 1e3)
                for b in range(functions)
                for name, unit, typical in site.components
            ),
            Parameter("low", curve.covariate.unit, curve.low, -1e9, 1e9, role="setting"),
            Parameter("high", curve.covariate.unit, curve.high, -1e9, 1e9, role="setting"),
            Parameter("period", "s", curve.period or 0.0, 0.0, 1e9, role="setting"),
            Parameter("fine", "1", float(curve.fine), 0.0, 1.0, role="setting"),
        ),
        act=act,
        separable=False,
        remedy="Find out what changes with it; until then the twin carries the curve.",
    )


def empirical_from(law: str, given: Mapping[str, float]) -> Present:
    """Return the curve that a file states: law `site/covariate`, range, period, coefficients.

    Raises
    ------
    KeyError
        For an unknown site, covariate or coefficient.
    """
    site_name, _, covariate_name = law.partition("/")
    site, covariate = site_named(site_name), covariate_named(covariate_name)
    period = given.get("period", 0.0)
    curve = Curve(
        site,
        covariate,
        given.get("low", 0.0),
        given.get("high", 0.0),
        period if period else None,
        bool(given.get("fine", 0.0)),
    )
    functions = 1 + max(int(k[1:].split("_")[0]) for k in given if k[0] == "c")
    effect = empirical(curve, functions)
    return Present(effect, effect.values(given))


def span(values: FloatArray) -> tuple[float, float]:
    """Range of the finite values; (0, 0) where there are none."""
    finite = values[np.isfinite(values)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)


def present_curve(curve: Curve, state: ChainState) -> Present:
    """The curve as an effect with all amounts zero, sized for these frames."""
    effect = empirical(curve, curve.carried(state).shape[1])
    return Present(effect, effect.values({}))


def site_columns(views: Views) -> tuple[Site, ...]:
    """The sites that this recording can move: joints only where they were logged."""
    joints = np.isfinite(views.joints_rad).any() and views.robot_model is not None
    return tuple(s for s in SITES if joints or not s.name.startswith("joint_"))
