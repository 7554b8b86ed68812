"""Clock: the logged pose is older or younger than the exposure."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.joints_rad = state.joints_rad + state.views.joint_velocity_rad_s * values[0]


EFFECT = Effect(
    name="pose_time_lag",
    link="clock",
    physics="The exposure happens later (or, if negative, earlier) than the pose that was logged.",
    equation="q_true = q_logged + lag_s * dq/dt",
    source="Furgale, Rehder, Siegwart 2013 (temporal offset as a calibration parameter)",
    parameters=(Parameter("lag_s", "s", 0.01, -0.5, 0.5),),
    act=_act,
    needs=("joints_rad", "joint_velocity_rad_s"),
    moving_only=True,
    confounded_with=("rolling_shutter",),
    remedy="Stop before each exposure, or enter the lag so that poses are read at the exposure.",
)
