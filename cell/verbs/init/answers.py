"""What a cell file needs to know of a bench, with what is used where nothing is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from calib.mount import Mount

HOMES_DEG: Mapping[str, tuple[tuple[float, ...], ...]] = {
    "ur": ((0.0, -90.0, -100.0, -80.0, 90.0, 0.0), (0.0, -90.0, -60.0, -120.0, 90.0, 0.0)),
    "irb": ((0.0, 0.0, 10.0, 0.0, 80.0, 0.0), (0.0, 0.0, -10.0, 0.0, 100.0, 0.0)),
}
"""Postures with the flange facing down and room around it, the lower one first, by the first
letters of the model."""

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
        x, y, z (m), roll, pitch, yaw (degrees) of the camera (or board) on the flange.
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
    camera_at: tuple[float, ...] = (0.0, 0.05, 0.05, 0.0, 0.0, 0.0)
    board_at: tuple[float, ...] | None = None
    home_deg: tuple[float, ...] | None = None
    distances_m: tuple[float, float] | None = None
    workspace: tuple[float, ...] | None = None
    no_workspace_because: str | None = None
    keep_out: Mapping[str, tuple[float, ...]] | None = None
