"""The shape of a law over what it follows, with what every single frame says of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.empirical import UNNAMED
from calib.chain.laws import forms
from calib.chain.laws.law import Law, functions_of, law_of
from calib.discovery.laws.frames import FrameBlocks, frame_blocks
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views

_POINTS = 121


@dataclass(frozen=True)
class LawShape:
    """A law's strongest component over its covariate.

    Attributes
    ----------
    site, covariate:
        Of the law, as a diagnosis names them.
    axis, component:
        What is drawn along x and y, with its unit.
    at, by_frame, by_frame_sigma:
        (N,) the covariate in each frame, what that frame alone says of the component with all else
        as it is fitted, and one sigma of it.
    grid, value, sigma:
        (P,) the law and its one-sigma band.
    """

    site: str
    covariate: str
    axis: str
    component: str
    at: FloatArray
    by_frame: FloatArray
    by_frame_sigma: FloatArray
    grid: FloatArray
    value: FloatArray
    sigma: FloatArray


def law_shapes(fit: JointFit, views: Views) -> tuple[LawShape, ...]:
    """The shapes of the fit's laws along one covariate, in the order of its effects."""
    keys = {form.key for form in forms()}
    laws = [
        index
        for index, present in enumerate(fit.model.effects)
        if present.effect.name == UNNAMED and str(present.effect.law).partition(":")[0] in keys
    ]
    if not laws:
        return ()
    blocks = frame_blocks(fit, views)
    shapes = (_shape(fit, index, blocks) for index in laws)
    return tuple(shape for shape in shapes if shape is not None)


def _shape(fit: JointFit, index: int, blocks: FrameBlocks) -> LawShape | None:
    present = fit.model.effects[index]
    law = law_of(present)
    if len(law.covariates) != 1:
        return None
    amounts = sum(p.role == "amount" for p in present.effect.parameters)
    coefficients = present.values[:amounts].reshape(-1, len(law.components))
    at = law.covariates[0].of(blocks.state)
    of_frames = _functions(law, at) @ coefficients
    typical = np.array([law.site.components[k][2] for k in law.components])
    strongest = int(np.argmax(np.ptp(of_frames, axis=0) / typical))
    which = law.components[strongest]
    grid = np.linspace(law.ranges[0].low, law.ranges[0].high, _POINTS)
    functions = _functions(law, grid)
    name, unit, _ = law.site.components[which]
    by_frame, by_frame_sigma = _by_frame(law, which, blocks)
    covariance = _covariance(fit, index, strongest, coefficients.shape)
    return LawShape(
        site=law.site.name,
        covariate=law.covariates[0].name,
        axis=f"{law.covariates[0].name} [{law.covariates[0].unit}]",
        component=f"{law.site.name} {name} [{unit}]",
        at=at,
        by_frame=of_frames[:, strongest] + by_frame,
        by_frame_sigma=by_frame_sigma,
        grid=grid,
        value=functions @ coefficients[:, strongest],
        sigma=np.sqrt(np.maximum(np.einsum("pf,fg,pg->p", functions, covariance, functions), 0.0)),
    )


def _functions(law: Law, value: FloatArray) -> FloatArray:
    functions = functions_of(law.form, [value], law.ranges, dict(law.numbers))
    if not law.constant:
        return functions
    return np.concatenate([functions, np.ones((len(functions), 1))], axis=1)


def _by_frame(law: Law, component: int, blocks: FrameBlocks) -> tuple[FloatArray, FloatArray]:
    """What each frame alone would add to the component, and one sigma of it."""
    place = next(
        k for k, c in enumerate(blocks.components) if (c.site, c.index) == (law.site, component)
    )
    at = blocks.shared + place
    information = np.maximum(blocks.information[:, at, at], 1e-300)
    typical = blocks.components[place].typical
    return typical * blocks.gradient[:, at] / information, typical / np.sqrt(information)


def _covariance(fit: JointFit, index: int, column: int, shape: tuple[int, ...]) -> FloatArray:
    """(F, F) of the component's coefficients; zero where one was not fitted."""
    known = {u.place[2]: k for k, u in enumerate(fit.unknowns) if u.place[:2] == ("effect", index)}
    covariance = np.zeros((shape[0], shape[0]))
    for f in range(shape[0]):
        for g in range(shape[0]):
            first, other = known.get(f * shape[1] + column), known.get(g * shape[1] + column)
            if first is not None and other is not None:
                covariance[f, g] = fit.covariance[first, other]
    return covariance
