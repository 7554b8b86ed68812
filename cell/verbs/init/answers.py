"""What a cell file needs to know of a bench, with what is used where nothing is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from calib.mount import Mount

HOMES_DEG: Mapping[str, tuple[tuple[float, ...], ...]] = {
    "ur": ((0.0, -90.0, -100.0, -80.0, 90.0, 0.0), (0.0, -90.0, -60.0, -120.0, 90.0, 0.0)),
    "irb1200": ((0.0, 20.0, -20.0, 0.0, 90.0, 0.0), (0.0, 0.0, -10.0, 0.0, 100.0, 0.0)),
    "irb": ((0.0, 0.0, 10.0, 0.0, 80.0, 0.0), (0.0, 0.0, -10.0, 0.0, 100.0, 0.0)),
}
"""Postures with the flange facing down and room around it, the lower one first, by the first
letters of the model; the first that fits counts. The volumes of an IRB 1200's upper arm and wrist
come within its clearance where joint 3 is bent as far down as in the other arms' postures."""

_FLANGE = (0.0, 0.05, 0.05, 0.0, 0.0, 0.0)
_OUT = (0.0, 0.05, 0.15, 0.0, 0.0, 0.0)
_MOUNTED: Mapping[Mount, Mapping[str, tuple[float, ...]]] = {
    "eye_in_hand": {"irb1200": _OUT, "": _FLANGE},
    "eye_to_hand": {"irb1200": _OUT, "irb120": (*_FLANGE[:5], 180.0), "": _FLANGE},
}
"""Usual place of camera or board on the flange by the first letters of the model. An IRB 1200's
forearm is as thick as its short wrist is long: a camera at the flange would come within 4 mm of it
at home. On an IRB 120 a board must hang away from the arm, or it strikes the upper arm."""

RobotDriver = Literal["sim", "ur", "abb"]
CameraDriver = Literal["sim", "gige", "genicam", "robotiq"]
Focus = Literal["auto", "manual", "motorised", "fixed"]


@dataclass(frozen=True)
class Answers:
    """One bench.

    Attributes
    ----------
    robot, camera:
        Drivers as a cell file names them; `sim` for a dry run alone.
    model, robot_address, camera_address:
        The arm's model; names or IP addresses, None for `sim`.
    payload_kg:
        Mass of camera and bracket.
    size_px, pixel_size_um, focal_length_mm, focus:
        As the camera's data sheet and the lens' barrel give them.
    board:
        In the words of a cell file.
    camera_at:
        x, y, z (m), roll, pitch, yaw (degrees) of the camera (or board) on the flange; None: where
        it has room on this arm.
    board_at:
        The same of the board (or camera) in the base; None: where the camera sees it from home.
    home_deg, distances_m:
        Posture to plan around; nearest and farthest distance of the board.
    workspace, no_workspace_because:
        Two opposite corners of the box that the arm stays inside, in the base (m); or why it
        needs none.
    keep_out:
        Boxes by their name; () where there is nothing, None where nobody has looked.
    """

    board: Mapping[str, Any]
    name: str = "my-cell"
    robot: RobotDriver = "sim"
    model: str = "ur5e"
    robot_address: str | None = None
    payload_kg: float = 0.0
    camera: CameraDriver = "sim"
    camera_address: str | None = None
    size_px: tuple[int, int] = (2448, 2048)
    pixel_size_um: float = 3.45
    focal_length_mm: float = 12.0
    focus: Focus = "fixed"
    mount: Mount = "eye_in_hand"
    camera_at: tuple[float, ...] | None = None
    board_at: tuple[float, ...] | None = None
    home_deg: tuple[float, ...] | None = None
    distances_m: tuple[float, float] | None = None
    workspace: tuple[float, ...] | None = None
    no_workspace_because: str | None = None
    keep_out: Mapping[str, tuple[float, ...]] | None = None

    @property
    def mounted(self) -> tuple[float, ...]:
        """`camera_at`, or the usual place on this arm."""
        if self.camera_at is not None:
            return self.camera_at
        usual = _MOUNTED[self.mount]
        return next(at for letters, at in usual.items() if self.model.startswith(letters))
