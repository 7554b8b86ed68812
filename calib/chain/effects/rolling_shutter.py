"""Sensor: its rows are read one after another while the arm moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from calib.chain.effect import Effect, Parameter
from calib.chain.optics import COLUMN
from calib.chain.state import ChainState
from calib.views import FloatArray, Views


def _act(values: FloatArray, state: ChainState) -> None:
    first = COLUMN["sweep_x_m"]
    state.optics[:, first : first + 6] += values[0] * state.board_velocity()
    state.column("height_px")[:] = state.views.height_px
    state.column("pose_row")[:] = values[1] - 0.5


def _candidates(_: Views) -> Sequence[Mapping[str, float]]:
    """The pose is that of the middle row, or was logged as the first or the last was read."""
    return [{"pose_at_row": share} for share in (0.5, 0.0, 1.0)]


EFFECT = Effect(
    name="rolling_shutter",
    link="sensor",
    physics="The sensor's rows are exposed one after another while the arm moves.",
    equation=(
        "a corner is seen where it is readout_s * (v / height - pose_at_row) later, v its row there"
    ),
    source="Hedborg, Forssen, Felsberg, Ringaby 2012",
    parameters=(
        Parameter("readout_s", "s", 0.02, -0.2, 0.2),
        Parameter("pose_at_row", "1", 0.5, 0.0, 1.0, role="setting"),
    ),
    act=_act,
    candidates=_candidates,
    needs=("joints_rad", "joint_velocity_rad_s"),
    moving_only=True,
    confounded_with=("pose_time_lag",),
    remedy="Stop before each exposure, or use a camera with a global shutter.",
)
