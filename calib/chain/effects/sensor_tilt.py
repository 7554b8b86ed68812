"""Sensor: it does not stand square to the optical axis."""

from __future__ import annotations

from calib.chain.effect import Effect, Parameter
from calib.chain.state import ChainState
from calib.views import FloatArray


def _act(values: FloatArray, state: ChainState) -> None:
    state.column("tilt_x_rad")[:] += values[0]
    state.column("tilt_y_rad")[:] += values[1]


EFFECT = Effect(
    name="sensor_tilt",
    link="sensor",
    physics="The sensor is tilted against the lens.",
    equation="tilted-sensor homography with angles tilt_x_rad, tilt_y_rad",
    source="Scheimpflug model as in OpenCV's calib3d documentation (Louhichi et al. 2007)",
    parameters=(
        Parameter("tilt_x_rad", "rad", 5e-3, -0.09, 0.09),
        Parameter("tilt_y_rad", "rad", 5e-3, -0.09, 0.09),
    ),
    act=_act,
    seen_without_robot=True,
    confounded_with=("decentering",),
    remedy="Use a calibration with tilt terms, or have the sensor's seat checked.",
)
