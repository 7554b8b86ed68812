"""Lens: from one frame on the pictures are of another focal length and principal point."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.chain.steps import after, step_candidates
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    stepped = after(values[3], state.views)[:, 0]
    for name in ("alpha_px", "beta_px"):
        state.column(name)[:] *= 1.0 + stepped * values[0]
    state.column("u0_px")[:] += stepped * values[1]
    state.column("v0_px")[:] += stepped * values[2]


EFFECT = Effect(
    name="optics_step",
    link="lens",
    physics=(
        "From one frame on the pictures have another focal length or principal point: the focus"
        " ring was bumped, or the camera's region or binning was changed."
    ),
    equation=(
        "alpha, beta = before * (1 + relative), u0 = before + u_px, v0 = before + v_px"
        " from frame `at_frame` on"
    ),
    source=(
        "change-point model, as for datum shifts in deformation surveys (Caspary 2000); sizes of a"
        " bump in Shortis, Robson, Beyer 1998, of binning and regions in GenICam SFNC 2.7, ch. 4"
    ),
    # a bump moves the focus by thousandths, binning halves the picture: the prior spans both
    parameters=(
        Parameter("relative", "1", 2e-3, -0.95, 7.0, prior_sigma=1.0),
        Parameter("u_px", "px", 3.0, -1e4, 1e4, prior_sigma=2e3),
        Parameter("v_px", "px", 3.0, -1e4, 1e4, prior_sigma=2e3),
        Parameter("at_frame", "frame", 0.0, 0.0, 1e9, role="setting"),
    ),
    act=_act,
    confounded_with=("mount_slip", "thermal_focal_drift"),
    remedy=(
        "Lock the focus ring and the camera's settings, and repeat the run: frames before and after"
        " are of two cameras."
    ),
    candidates=step_candidates,
)
