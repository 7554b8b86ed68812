"""Lens: the focal length follows the focus along some smooth curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray, Views

_NODES = 6


def _act(values: FloatArray, state: ChainState) -> None:
    from scipy.interpolate import CubicSpline  # half a second that no other effect needs

    near_m, far_m = values[_NODES - 1], values[_NODES]
    at = np.linspace(0.0, 1.0, _NODES)
    curve = CubicSpline(at, np.concatenate([values[: _NODES - 1], [0.0]]), bc_type="natural")
    inverse = np.clip(1.0 / state.focused_m, 0.7 / far_m, 1.4 / near_m)
    where = (1.0 / near_m - inverse) / (1.0 / near_m - 1.0 / far_m)
    inside = np.clip(where, 0.0, 1.0)
    growth = 1.0 + curve(inside) + curve(inside, 1) * (where - inside)
    state.column("alpha_px")[:] *= growth
    state.column("beta_px")[:] *= growth


_SPANS_M = (
    (0.3, 1.2),
    (0.2, 0.8),
    (0.12, 0.5),
    (0.12, 0.3),
    (0.2, 0.5),
    (0.3, 0.75),
    (0.5, 1.25),
    (0.5, 2.0),
    (1.0, 2.5),
    (1.0, 4.0),
)


_BEND = 3e-3
"""What the curve bends by from node to node, one sigma: a lens of 50 mm 1e-3, one of 25 mm less
than 2e-4; the node of a stretch that no frame saw follows its neighbours."""


def _roughness() -> tuple[tuple[float, ...], ...]:
    """Second differences of the nodes, the last of which is zero."""
    second = np.diff(np.eye(_NODES), n=2, axis=0)[:, : _NODES - 1] / _BEND
    return tuple((*map(float, row), 0.0, 0.0) for row in second)


def _candidates(views: Views) -> Sequence[Mapping[str, float]]:
    return [{"near_m": near, "far_m": far} for near, far in _SPANS_M]


EFFECT = Effect(
    name="focus_breathing",
    law="free",
    link="lens",
    physics="The lens moves to focus, so its focal length depends on the distance of the board.",
    equation="alpha = alpha_far * (1 + natural cubic spline in 1/d, 6 nodes, straight beyond)",
    source="focus tables of cine lenses; Willson 1994 (parameters against motor position)",
    parameters=(
        *(Parameter(f"node_{i}", "1", 0.01, -0.5, 0.5) for i in range(1, _NODES)),
        Parameter("near_m", "m", 0.3, 0.01, 10.0, role="setting"),
        Parameter("far_m", "m", 1.2, 0.02, 100.0, role="setting"),
    ),
    act=_act,
    confounded_with=("thermal_focal_drift",),
    acts_along=(("focal_length", "distance"),),
    remedy="Lock the focus, or use the focal length of each distance (the twin has it).",
    candidates=_candidates,
    separable=False,
    roughness=_roughness(),
)
