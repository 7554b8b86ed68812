"""Detector: bright areas grow with exposure and gain, and the marks move apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.projection import project
from calib.chain.state import ChainState
from calib.views import FloatArray, Views

_GAIN = "gain_db"


def _act(values: FloatArray, state: ChainState) -> None:
    longer_s = np.nan_to_num(state.views.exposure_s - values[1])
    more_dB = np.nan_to_num(state.views.logged(_GAIN) - values[3])
    middle = state.points_m.mean(axis=0)
    farthest_m = float(np.linalg.norm(state.points_m - middle, axis=1).max())
    farthest_px = state.column("alpha_px") * farthest_m / state.distance_m
    growth = 1.0 + (values[0] * longer_s + values[2] * more_dB) / farthest_px
    centre = project(state.optics, state.camera_from_board, middle[None])[:, 0]
    for name in ("alpha_px", "beta_px", "skew_px"):
        state.column(name)[:] *= growth
    for axis, name in enumerate(("u0_px", "v0_px")):
        column = state.column(name)
        column[:] = centre[:, axis] + growth * (column - centre[:, axis])


def _candidates(views: Views) -> Sequence[Mapping[str, float]]:
    return ({"at_exposure_s": _mean(views.exposure_s), "at_gain_dB": _mean(views.logged(_GAIN))},)


def _mean(column: FloatArray) -> float:
    """Of what was logged; zero where nothing was, and no frame is brighter for it."""
    known = column[np.isfinite(column)]
    return float(known.mean()) if len(known) else 0.0


EFFECT = Effect(
    name="exposure_bias",
    link="detector",
    physics=(
        "Bright areas grow in the picture with exposure and gain, so the marks that are found move"
        " away from the board's middle."
    ),
    equation=(
        "a mark moves outward by (px_per_s * (exposure_s - at_exposure_s) + px_per_dB * (gain_db -"
        " at_gain_dB)) * r, r its distance in the picture from the board's middle over that of a"
        " farthest mark seen squarely"
    ),
    source=(
        "blooming and threshold bias of bright targets against exposure: Shortis, Clarke, Short"
        " 1994 (target image location); Clarke, Fryer 1998, sec. 4; gain brightens as exposure does"
        " (EMVA 1288, 4.0, sec. 2)"
    ),
    parameters=(
        Parameter("px_per_s", "px/s", 30.0, -1e5, 1e5),
        Parameter("at_exposure_s", "s", 0.01, 0.0, 100.0, role="setting"),
        Parameter("px_per_dB", "px/dB", 0.05, -50.0, 50.0),
        Parameter("at_gain_dB", "dB", 0.0, -100.0, 200.0, role="setting"),
    ),
    act=_act,
    varies=("exposure_s", _GAIN),
    confounded_with=("focus_breathing",),
    remedy=(
        "Keep exposure and gain the same in all frames, and expose so that white stays below 80 %"
        " of full scale."
    ),
    candidates=_candidates,
)
