"""A law in words: its equation with numbers and units, what it is worth, and what rivals it has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.chain.effect import Present
from calib.chain.laws.arm_field import rms
from calib.chain.laws.law import Law, law_of
from calib.chain.laws.surface_field import surface_of
from calib.discovery.diagnosis import FoundLaw, Value
from calib.discovery.laws.arm_field import is_arm_field
from calib.solver.joint import JointFit
from calib.views import FloatArray


@dataclass(frozen=True)
class _Fitted:
    """A law of a fit, with its numbers' covariance; zero where a number was not fitted."""

    present: Present
    covariance: FloatArray

    def value(self, name: str) -> tuple[float, int]:
        """Return a number and its place."""
        at = [p.name for p in self.present.effect.parameters].index(name)
        return float(self.present.values[at]), at

    def plain(self, name: str) -> Value:
        """A number as it is."""
        value, at = self.value(name)
        unit = self.present.effect.parameters[at].unit
        return Value(value, float(np.sqrt(np.maximum(self.covariance[at, at], 0.0))), unit)

    def sigma_along(self, names: tuple[str, ...], slope: FloatArray) -> float:
        """Sigma of something that follows these numbers with that slope."""
        at = [self.value(name)[1] for name in names]
        part = self.covariance[np.ix_(at, at)]
        return float(np.sqrt(np.maximum(slope @ part @ slope, 0.0)))


def _fitted(twin: JointFit, index: int) -> _Fitted:
    present = twin.model.effects[index]
    covariance = np.zeros((len(present.values), len(present.values)))
    mine = [
        (k, u.place[2])
        for k, u in enumerate(twin.unknowns)
        if u.place[0] == "effect" and u.place[1] == index
    ]
    for k, at in mine:
        for j, other in mine:
            covariance[at, other] = twin.covariance[k, j]
    return _Fitted(present, covariance)


def found_law(
    twin: JointFit, index: int, holdout_gain_px: float, rivals: tuple[str, ...]
) -> FoundLaw:
    """What is known of the law that is effect `index` of the twin."""
    if is_arm_field(twin.model.effects[index]):
        return _found_field(twin.model.effects[index], holdout_gain_px)
    if surface_of(twin.model.effects[index]) is not None:
        return _found_surface(twin.model.effects[index], holdout_gain_px)
    fitted = _fitted(twin, index)
    law = law_of(fitted.present)
    swings = law.form.key == "periodic"
    return FoundLaw(
        form=law.form.name,
        equation=_equation(law, fitted.present.as_mapping()),
        covariates=tuple(covariate.name for covariate in law.covariates),
        parameters=_swinging(law, fitted) if swings else _as_they_are(law, fitted),
        holdout_gain_px=holdout_gain_px,
        rivals=rivals,
    )


def _found_field(present: Present, holdout_gain_px: float) -> FoundLaw:
    given, (size_m, size_rad) = present.as_mapping(), rms(present)
    along = str(present.effect.law).partition("/")[2]
    return FoundLaw(
        form="field",
        equation=f"{present.effect.equation}, over the {along}",
        covariates=(along,),
        parameters={
            "rms_m": Value(size_m, given["rms_sigma_m"], "m"),
            "rms_rad": Value(size_rad, given["rms_sigma_rad"], "rad"),
            "length_scale": Value(given["length_scale"], given["length_scale_sigma"], "rad"),
            "share_of_scatter": Value(given["share"], given["share_sigma"], "1"),
        },
        holdout_gain_px=holdout_gain_px,
        rivals=(),
    )


def _found_surface(present: Present, holdout_gain_px: float) -> FoundLaw:
    surface, given = surface_of(present), present.as_mapping()
    assert surface is not None
    return FoundLaw(
        form="field",
        equation=present.effect.equation,
        covariates=(surface.covariate,),
        parameters={
            f"{name}_{surface.unit}": Value(given[name], given[f"{name}_sigma"], surface.unit)
            for name in ("rms", "length_scale")
        },
        holdout_gain_px=holdout_gain_px,
        rivals=(),
    )


def _as_they_are(law: Law, fitted: _Fitted) -> dict[str, Value]:
    amounts = [p.name for p in fitted.present.effect.parameters if p.role == "amount"]
    numbers = [n.name for n in law.form.numbers if n.name != "from_end"]
    reported = {name: fitted.plain(name) for name in (*amounts, *numbers)}
    unit = law.covariates[0].unit
    return {k: Value(v.value, v.sigma, unit) if k in numbers else v for k, v in reported.items()}


def _swinging(law: Law, fitted: _Fitted) -> dict[str, Value]:
    """Amplitude and phase of each component, and how often it swings."""
    reported: dict[str, Value] = {}
    for k in law.components:
        component, unit, _ = law.site.components[k]
        names = (f"sin_{component}", f"cos_{component}")
        sine, cosine = (fitted.value(name)[0] for name in names)
        size = float(np.hypot(sine, cosine))
        along = np.array([sine, cosine]) / max(size, 1e-300)
        across = np.array([-cosine, sine]) / max(size, 1e-300) ** 2
        reported[f"amplitude_{component}"] = Value(size, fitted.sigma_along(names, along), unit)
        phase = float(np.arctan2(cosine, sine))
        reported[f"phase_rad_{component}"] = Value(phase, fitted.sigma_along(names, across), "rad")
    cycles = fitted.plain("cycles")
    if law.covariates[0].cyclic:
        reported["cycles_per_turn"] = Value(cycles.value, cycles.sigma, "1")
    else:
        period = 2.0 * np.pi / cycles.value
        unit = law.covariates[0].unit
        reported["period"] = Value(period, period * cycles.sigma / cycles.value, unit)
    return reported


def _equation(law: Law, values: Mapping[str, float]) -> str:
    names = [covariate.name for covariate in law.covariates]
    terms = law.form.terms(names, law.ranges, values)
    lines = []
    for k in law.components:
        component, unit, _ = law.site.components[k]
        parts = [
            f"{values[f'{function}_{component}']:+.4g} {term}"
            for (function, _), term in zip(law.form.functions, terms, strict=True)
        ]
        if law.constant:
            parts.append(f"{values[f'constant_term_{component}']:+.4g}")
        what = law.site.name if len(law.site.components) == 1 else f"{law.site.name}.{component}"
        lines.append(f"{what} = constant {' '.join(parts)} [{unit}]")
    units = ", ".join(f"{c.name} in {c.unit}" for c in law.covariates)
    return f"{'; '.join(lines)}, {units}"
