"""What effects of warmth share: a curve that rises and levels off, or the logged temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Parameter
from calib.views import FloatArray, Views

TIME_CONSTANT = Parameter("tau_s", "s", 900.0, 20.0, 2e4, role="shape")
START = Parameter("start_s", "s", 0.0, -1e12, 1e12, role="setting")
"""The log's clock when the machine was cold; other frames of a run are predicted with it."""


AT_TEMPERATURE = Parameter("at_temperature_c", "degC", 25.0, -100.0, 200.0, role="setting")
"""Where nothing has grown: the mean of the run it was found in."""


def warmth(tau_s: float, start_s: float, views: Views) -> FloatArray:
    """(N,) how far the machine has warmed, zero at the start, one in the end."""
    elapsed = np.nan_to_num(views.t_s - start_s)
    return np.asarray(1.0 - np.exp(-elapsed / max(tau_s, 1e-3)))


def warming_candidates(views: Views) -> Sequence[Mapping[str, float]]:
    """Time constants from a tenth of the run to three times its length, from its first frame."""
    start = float(np.nanmin(views.t_s))
    span = float(np.nanmax(views.t_s)) - start
    return [{"tau_s": span * share, "start_s": start} for share in (0.1, 0.3, 1.0, 3.0)]


def temperature_rise(at_temperature_c: float, views: Views) -> FloatArray:
    """(N,) kelvins above that temperature, by the log; zero where it says nothing."""
    return np.nan_to_num(views.temperature_c - at_temperature_c)


def temperature_candidates(views: Views) -> Sequence[Mapping[str, float]]:
    """The run's mean temperature as the one where nothing has grown."""
    return ({"at_temperature_c": float(np.nanmean(views.temperature_c))},)
