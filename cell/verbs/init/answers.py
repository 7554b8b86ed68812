"""What a cell file needs to know of a bench, with what is taken where nothing is said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from calib.views import Mount

HOMES_DEG: Mapping[str, tuple[float, ...]] = {
    "ur": (0.0, -90.0, -100.0, -80.0, 90.0, 0.0),
    "irb": (0.0, 0.0, 10.0, 0.0, 80.0, 0.0),
}
"""A posture with the flange facing down and room around it, by the first letters of the model."""


@dataclass(frozen=True)
class Answers:
    """One bench.

    Attributes
    ----------
    robot, camera:
        Drivers as a cell file names them; `sim` for a dry run alone.
    model, robot_address, camera_address:
        The arm's model; names or IP addresses, None for `sim`.
    camera_model, width, height, pixel_size_um, focal_length_mm, focus:
        As its data sheet and the lens' barrel say.
    board:
        In the words of a cell file.
    camera_at:
        x, y, z (m), roll, pitch, yaw (degrees) of the camera (or board) on the flange.
    board_at:
        The same of the board (or camera) in the base; None: where the camera sees it from home.
    home_deg, distances_m:
        Posture to plan around; nearest and farthest distance of the board.
    """

    board: Mapping[str, Any]
    name: str = "my-cell"
    robot: Literal["sim", "ur", "abb"] = "sim"
    model: str = "ur5e"
    robot_address: str | None = None
    camera: Literal["sim", "gige", "genicam", "robotiq"] = "sim"
    camera_address: str | None = None
    camera_model: str | None = None
    width: int = 2448
    height: int = 2048
    pixel_size_um: float = 3.45
    focal_length_mm: float = 12.0
    focus: Literal["auto", "manual", "motorised", "fixed"] = "fixed"
    mount: Mount = "eye_in_hand"
    camera_at: tuple[float, ...] = (0.0, 0.05, 0.05, 0.0, 0.0, 0.0)
    board_at: tuple[float, ...] | None = None
    home_deg: tuple[float, ...] | None = None
    distances_m: tuple[float, float] | None = None
