"""One shot: an image and the arm's poses around it, tied by time, and its line in the log."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from calib.detection import Detection
from cell.storage.files.plan_file import Checks, View
from cell.storage.recording import FrameRecord, PoseRecord
from drivers.arm import ArmState, Motion
from drivers.camera import Frame

_CAMERA_COLUMNS = (
    "exposure_s",
    "gain_db",
    "focus_position",
    "focus_distance_m",
    "temperature_c",
)


@dataclass(frozen=True)
class Shot:
    """What one trigger gave.

    Attributes
    ----------
    index:
        The plan's view, and the frame's number.
    frame:
        The image.
    states:
        The arm's readings from before the trigger to after the frame came, oldest first.
    came_from_rad:
        Joint angles the move started from.
    """

    index: int
    frame: Frame
    states: tuple[ArmState, ...]
    came_from_rad: tuple[float, ...]

    def pose_fault(self, checks: Checks) -> str | None:
        """Why image and pose do not belong together, or None."""
        first, last = self.states[0], self.states[-1]
        if any(state.motion is not Motion.STEADY for state in self.states):
            return "the arm moved during the exposure"
        if not first.host_t_s <= self.frame.host_t_s <= last.host_t_s:
            return (
                f"the frame's time {self.frame.host_t_s:.3f} s lies outside the time the arm stood"
                f" still, {first.host_t_s:.3f}..{last.host_t_s:.3f} s"
            )
        between = first.base_from_flange.inv() * last.base_from_flange
        moved_m = float((between.translation**2).sum() ** 0.5)
        turned_rad = float(between.rotation.magnitude())
        if moved_m > checks.pose_agrees_m or turned_rad > checks.pose_agrees_rad:
            return (
                f"the poses before and after the exposure differ by {1e3 * moved_m:.3f} mm and"
                f" {1e3 * turned_rad:.3f} mrad"
            )
        return None

    @property
    def state(self) -> ArmState:
        """The reading nearest in time to the middle of the exposure."""
        return min(self.states, key=lambda state: abs(state.host_t_s - self.frame.host_t_s))

    def record(self, view: View, started_s: float, detection: Detection | None) -> FrameRecord:
        """The frame's line; `started_s` is the host time at which the recording's clock is 0."""
        state = self.state
        values: dict[str, Any] = {
            "frame": self.index,
            "t_s": round(self.frame.host_t_s - started_s, 6),
            "base_from_flange": PoseRecord.of(state.base_from_flange),
            "joints_rad": state.joints_rad,
            "joint_velocity_rad_s": state.joint_velocity_rad_s,
            "approach_joints_rad": self.came_from_rad,
            "view": view.name,
            "station": view.station,
        }
        values |= {name: getattr(self.frame, name) for name in _CAMERA_COLUMNS}
        if detection is not None:
            values["sharpness"] = round(detection.sharpness, 4)
        values["clocks"] = {
            "frame_host_s": self.frame.host_t_s,
            "frame_device_s": self.frame.device_t_s,
            "pose_host_s": state.host_t_s,
            "pose_controller_s": state.controller_t_s,
            "read_until_host_s": self.states[-1].host_t_s,
        }
        values["arm_raw"] = _plain(state.raw)
        values["camera_raw"] = _plain(self.frame.raw)
        kept = {name: value for name, value in values.items() if value not in (None, {})}
        return FrameRecord.model_validate(kept)


def _plain(raw: dict[str, Any]) -> Any:
    return json.loads(json.dumps(raw, default=str))
