"""What the effects of a machine that warms up share: a curve that rises and levels off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Parameter
from calib.views import FloatArray, Views

TIME_CONSTANT = Parameter("tau_s", "s", 900.0, 20.0, 2e4, role="shape")
START = Parameter("start_s", "s", 0.0, -1e12, 1e12, role="setting")
"""The log's clock when the machine was cold; other frames of a run are predicted with it."""


def warmth(tau_s: float, start_s: float, views: Views) -> FloatArray:
    """(N,) how far the machine has warmed, zero at the start, one in the end."""
    elapsed = np.nan_to_num(views.t_s - start_s)
    return np.asarray(1.0 - np.exp(-elapsed / max(tau_s, 1e-3)))


def warming_candidates(views: Views) -> Sequence[Mapping[str, float]]:
    """Time constants from a tenth of the run to three times its length, from its first frame."""
    start = float(np.nanmin(views.t_s))
    span = float(np.nanmax(views.t_s)) - start
    return [{"tau_s": span * share, "start_s": start} for share in (0.1, 0.3, 1.0, 3.0)]
