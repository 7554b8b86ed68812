"""Detector: bright areas grow with the exposure, and the board's marks move apart with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.projection import project
from calib.chain.state import ChainState
from calib.views import FloatArray, Views


def _act(values: FloatArray, state: ChainState) -> None:
    longer_s = np.nan_to_num(state.views.exposure_s - values[1])
    middle = state.points_m.mean(axis=0)
    farthest_m = float(np.linalg.norm(state.points_m - middle, axis=1).max())
    farthest_px = state.column("alpha_px") * farthest_m / state.distance_m
    growth = 1.0 + values[0] * longer_s / farthest_px
    centre = project(state.optics, state.camera_from_board, middle[None])[:, 0]
    for name in ("alpha_px", "beta_px", "skew_px"):
        state.column(name)[:] *= growth
    for axis, name in enumerate(("u0_px", "v0_px")):
        column = state.column(name)
        column[:] = centre[:, axis] + growth * (column - centre[:, axis])


def _candidates(views: Views) -> Sequence[Mapping[str, float]]:
    return ({"at_exposure_s": float(np.nanmean(views.exposure_s))},)


EFFECT = Effect(
    name="exposure_bias",
    link="detector",
    physics=(
        "Bright areas grow in the picture with the exposure, so the marks that are found move away"
        " from the board's middle."
    ),
    equation=(
        "a mark moves outward by px_per_s * (exposure_s - at_exposure_s) * r, r its distance in the"
        " picture from the board's middle over that of a farthest mark seen squarely"
    ),
    source=(
        "blooming and threshold bias of bright targets against exposure: Shortis, Clarke, Short"
        " 1994 (target image location); Clarke, Fryer 1998, sec. 4"
    ),
    parameters=(
        Parameter("px_per_s", "px/s", 30.0, -1e5, 1e5),
        Parameter("at_exposure_s", "s", 0.01, 0.0, 100.0, role="setting"),
    ),
    act=_act,
    needs=("exposure_s",),
    needs_variation=("exposure_s",),
    confounded_with=("focus_breathing",),
    remedy=(
        "Keep exposure and gain the same in all frames, and expose so that white stays below 80 %"
        " of full scale."
    ),
    candidates=_candidates,
)
