"""What a mix-up in the log is, and how it is mended."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from calib.views import Views


@dataclass(frozen=True)
class Mixup:
    """A mix-up that was found.

    Attributes
    ----------
    name:
        In the contract's words.
    physics, remedy:
        Plain sentences for the operator.
    mend:
        Views with a log as it should have been. May return fewer frames (those whose true pose
        is in no row of the log are left out) when `given_neighbours` lacks them.
    parameters:
        Name to (value, unit).
    evidence:
        Miss of the loop before and after, as (radians, metres) pairs.
    alike:
        Names of physics, or keys of the recording, that would look the same.
    apart:
        What would distinguish them.
    """

    name: str
    physics: str
    remedy: str
    mend: Callable[[Views, Views], Views]
    parameters: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    evidence: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))
    alike: tuple[str, ...] = ()
    apart: str = ""


ROBOT_COLUMNS = (
    "base_from_flange",
    "joints_rad",
    "joint_velocity_rad_s",
    "approach_joints_rad",
)
"""What a robot's row of the log holds; it moves as a whole when rows were mixed up."""
