"""A simulated cell as plain data, and the devices that live in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from calib.chain.kinematics import ArmKinematics, arm
from calib.chain.model import CellModel
from calib.views import Board, FloatArray, Mount
from sim.arm import Repeatability
from sim.noise import PlacedNoise
from sim.render import Sensor

Focus = Literal["auto", "manual", "motorised", "fixed"]


@dataclass(frozen=True)
class CameraSpec:
    """What stands in the camera's and the lens's data sheets.

    Attributes
    ----------
    width_px, height_px, pixel_size_m:
        The sensor; the pixel's side is None where the maker does not say.
    focus:
        `auto` and `motorised` lenses focus on command; `manual` and `fixed` ones refuse.
    focal_length_m, f_number:
        Of the lens; their ratio is the aperture that the defocus follows.
    lens_sigma_px:
        Blur at best focus, Gaussian sigma.
    focus_distance_m:
        Where the lens stands focused at first; the distance at the start pose where None.
    nearest_focus_m, focus_steps:
        Range of the focus drive: step 0 is the nearest focus, the last step is infinity, and
        steps are even in 1/distance.
    sensor:
        Light and noise.
    """

    width_px: int
    height_px: int
    focal_length_m: float
    f_number: float
    pixel_size_m: float | None = None
    focus: Focus = "auto"
    lens_sigma_px: float = 0.5
    focus_distance_m: float | None = None
    nearest_focus_m: float = 0.1
    focus_steps: int = 1023
    sensor: Sensor = field(default_factory=Sensor)

    @property
    def aperture_m(self) -> float:
        """Diameter of the entrance pupil."""
        return self.focal_length_m / self.f_number

    def focus_distance_at(self, step: float) -> float:
        """Distance (m) that the lens is focused at with the drive at a step of its range."""
        return self.nearest_focus_m / max(1.0 - step / self.focus_steps, 1e-6)


@dataclass(frozen=True)
class SimulatedCell:
    """The truth of one cell.

    Attributes
    ----------
    name, robot_model:
        What it is called; the arm's kinematic model.
    home_rad:
        (6,) joint angles the arm stands at first.
    board, mount:
        The target, and what rides on the flange.
    model:
        The chain: optics, hand-eye, board, and the effects that a plain model leaves out.
    camera:
        Data sheet of camera and lens.
    repeatability, corner_sigma_px:
        Scatter of the arm, and of corners where they are made without pictures.
    payload_kg:
        Mass at the flange, or None.
    seed:
        Of every random number in the cell.
    """

    name: str
    robot_model: str
    home_rad: FloatArray
    board: Board
    model: CellModel
    camera: CameraSpec
    mount: Mount = "eye_in_hand"
    repeatability: Repeatability = field(default_factory=Repeatability)
    corner_sigma_px: float = 0.0
    payload_kg: float | None = None
    seed: int = 0

    @property
    def kinematics(self) -> ArmKinematics:
        """The maker's kinematics of the arm; raises `UnknownArm`."""
        return arm(self.robot_model)

    def random(self, stream: int) -> np.random.Generator:
        """A generator of its own for each source of noise, so that one does not shift another."""
        return np.random.default_rng([self.seed, stream])

    def placed_noise(self, stream: int) -> PlacedNoise:
        """As `random`, for a source whose numbers do not depend on the order of what is done."""
        return PlacedNoise(self.seed, stream)


ARM_STREAM, SENSOR_STREAM, CORNER_STREAM = range(3)
