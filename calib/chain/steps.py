"""What the effects that happen once share: six numbers, and the frame from which they hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Parameter
from calib.views import FloatArray, Views

SIX = (
    *(Parameter(f"{axis}_m", "m", 5e-4, -0.1, 0.1) for axis in "xyz"),
    *(Parameter(f"r{axis}_rad", "rad", 5e-4, -0.2, 0.2) for axis in "xyz"),
)
"""A small rigid increment: translation in metres, rotation vector in radians."""

_FEWEST_ON_ONE_SIDE = 4


def after(at_frame: float, views: Views) -> FloatArray:
    """(N, 1) one from that frame on, zero before."""
    return (views.frame >= at_frame).astype(np.float64)[:, None]


def step_candidates(views: Views) -> Sequence[Mapping[str, float]]:
    """Every frame with enough frames on both sides to hold six numbers."""
    order = np.sort(views.frame)
    inner = order[_FEWEST_ON_ONE_SIDE : len(order) - _FEWEST_ON_ONE_SIDE + 1]
    return [{"at_frame": float(frame)} for frame in inner]
