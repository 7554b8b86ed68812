"""How long a run will take, as far as arm, lens and plan state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from calib.views import FloatArray
from cell.sequencer.guard import Guard
from cell.storage.files.plan_file import PlanFile
from sim.arm import ACCELERATION_RAD_S2, SETTLE_S
from sim.camera import FOCUSING_S
from sim.motion import plan_move

_USUAL_EXPOSURE_S = 0.01
"""Where the plan leaves it to the camera."""


@dataclass(frozen=True)
class Duration:
    """Seconds of a run: moving, until arm and plan call it still, focusing, exposing."""

    motion_s: float
    settle_s: float
    focus_s: float
    exposure_s: float

    @property
    def whole_s(self) -> float:
        """All together; reading pictures out and a device's own delays come on top."""
        return self.motion_s + self.settle_s + self.focus_s + self.exposure_s


def duration_of(
    plan: PlanFile, guard: Guard, home_rad: FloatArray, joints_rad: Sequence[FloatArray]
) -> Duration:
    """Duration of a run that starts at home.

    Parameters
    ----------
    plan, guard:
        Speeds, standstill, focus and exposure.
    home_rad, joints_rad:
        (6,) where the arm starts, and (N, 6) its views in order.
    """
    n = len(joints_rad)
    moves = pairwise([home_rad, *joints_rad])
    return Duration(
        motion_s=sum(move_s(guard, here, there) for here, there in moves),
        settle_s=n * (SETTLE_S + plan.settle.still_s),
        focus_s=n * FOCUSING_S if plan.exposure.focus == "auto" else 0.0,
        exposure_s=n * (plan.exposure.exposure_s or _USUAL_EXPOSURE_S),
    )


def move_s(guard: Guard, here: FloatArray, there: FloatArray) -> float:
    """Seconds of one move at the plan's speeds; raises `SafetyError` where it is not allowed."""
    target = guard.target(here, there, "between two views")
    move = plan_move(
        guard.kinematics,
        here,
        there,
        0.0,
        flange_speed_m_s=target.tcp_speed_m_s,
        joint_speed_rad_s=target.joint_speed_rad_s,
        acceleration_rad_s2=ACCELERATION_RAD_S2,
    )
    return float(move.profile.duration_s) if np.any(here != there) else 0.0
