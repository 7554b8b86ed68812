"""Arm: the joints give way under gravity."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    arm, views = state.arm, state.views
    if arm is None:
        return
    torques_Nm = state.once(
        "gravity_torques_Nm",
        lambda: arm.gravity_torques(views.joints_rad, views.payload_kg or 0.0),
    )
    state.joints_rad = state.joints_rad - values * torques_Nm


EFFECT = Effect(
    name="joint_compliance",
    link="arm",
    physics="The joints sag under the weight of arm and camera, each in proportion to its load.",
    equation="q_true = q_logged - rad_per_Nm * holding_torque(q)",
    source="Klimchik, Pashkevich, Chablat 2013 (virtual joint model, static load)",
    parameters=tuple(
        Parameter(f"rad_per_Nm_{j}", "rad/Nm", 2e-5, -1e-3, 1e-3, identifiable=1 < j < 6)
        for j in range(1, 7)
    ),
    act=_act,
    needs=("joints_rad",),
    confounded_with=("mount_flex", "joint_periodic_error"),
    remedy="Enter the true payload in the controller, or let the twin correct the flange pose.",
)
