"""Sensor: its rows are read one after another while the arm moves.

`reference` is the row, as a share of the height, whose exposure the logged pose belongs to.
"""

from __future__ import annotations

from calib.chain import rigid
from calib.chain.effect import Effect, Parameter
from calib.chain.optics import COLUMN
from calib.chain.walk import Walk
from calib.views import FloatArray


def _act(values: FloatArray, walk: Walk) -> None:
    first = COLUMN["sweep_x_m"]
    sweep = walk.board_sweep(1e-3) * (values[0] / 1e-3)
    walk.optics[:, first : first + 6] += sweep
    walk.column("height_px")[:] = walk.views.height_px
    moved = rigid.from_vector((0.5 - values[1]) * sweep)
    walk.camera_from_board = moved @ walk.camera_from_board


EFFECT = Effect(
    name="rolling_shutter",
    link="sensor",
    physics="The sensor's rows are exposed one after another while the arm moves.",
    equation="pixel += d(pixel)/dt * readout_s * (v / height - reference)",
    source="Hedborg, Forssen, Felsberg, Ringaby 2012",
    parameters=(
        Parameter("readout_s", "s", 0.02, -0.2, 0.2),
        Parameter("reference", "1", 0.5, 0.0, 1.0, role="setting"),
    ),
    act=_act,
    needs=("joints_rad", "joint_velocity_rad_s"),
    moving_only=True,
    confounded_with=("pose_time_lag",),
    candidates=lambda views: [{"reference": place} for place in (0.5, 0.0, 1.0)],
    remedy="Stop before each exposure, or use a camera with a global shutter.",
)
