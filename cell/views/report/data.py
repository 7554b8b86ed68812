"""What a report is made from: the two result files as dictionaries, and the arrays behind them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.discovery.laws.shape import LawShape
from calib.views import FloatArray, Views
from cell.storage.files.calibration_source import PREFERENCE

Image = NDArray[np.uint8]
Thumbnail = Callable[[int], Image | None]


def in_order(names: Iterable[str]) -> list[str]:
    """Names of solutions, the plainest first, unknown ones last."""
    rank = {name: -place for place, name in enumerate(PREFERENCE)}
    return sorted(names, key=lambda name: rank.get(name, 1))


@dataclass(frozen=True)
class SolutionPoses:
    """Where one solution, and where the robot, put the camera in each of N views.

    Attributes
    ----------
    board_from_camera:
        (N, 4, 4) computed from the pictures, metres; NaN for a view the solution did not use.
    board_from_camera_by_robot:
        (N, 4, 4) from the logged flange poses and the solved hand-eye and board poses, metres;
        None where no flange pose was logged.
    scale_px:
        (N, 2) alpha and beta the solution gives each view, pixels, where they move with focus.
    """

    board_from_camera: FloatArray
    board_from_camera_by_robot: FloatArray | None = None
    scale_px: FloatArray | None = None


@dataclass(frozen=True)
class Truth:
    """What the simulator knows and no recording does; N views.

    Attributes
    ----------
    board_from_camera:
        (N, 4, 4) true camera poses, metres.
    alpha_px, beta_px:
        (N,) true scale factors at each view's focus, pixels.
    effects:
        The effects that were in the simulated physics, as text.
    """

    board_from_camera: FloatArray | None = None
    alpha_px: FloatArray | None = None
    beta_px: FloatArray | None = None
    effects: tuple[str, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """What the diagnosis measured per view, before and after the effects it found; N views.

    Before is the plain model, after the final one. An error is the camera's pose by the picture
    against the one by the robot, in the camera frame by the robot: positive z is too close to
    the board.

    Attributes
    ----------
    before_px, after_px:
        (N, M, 2) corner residuals that no camera pose could absorb, pixels.
    shift_before_m, shift_after_m:
        (N, 3) error of the camera's position, metres.
    turn_before_rad, turn_after_rad:
        (N, 3) error of the camera's orientation as rotation vectors, radians.
    shift_without_m, turn_without_rad:
        The same errors by effect name, under the final model with that one effect left out and
        everything else as found; they show an effect bare, and take the place of before where
        they are given.
    cost_m:
        By effect name the RMS camera shift that leaving it out costs, when hand-eye and board
        poses are solved again, metres.
    alpha_px, alpha_sigma_px:
        (N,) scale factor of each view when the robot's depth is believed, and its one-sigma.
    board_offset_m:
        (M, 3) where the corners were found to be, less where the drawing has them, board frame.
    distance_m, gravity_in_camera, joints_rad:
        (N,) distance of the board's centre, (N, 3) unit vectors of gravity as the camera feels
        it, (N, J) joints, recovered where they were not logged.
    laws:
        Laws without a name, each over what it follows.
    """

    before_px: FloatArray | None = None
    after_px: FloatArray | None = None
    shift_before_m: FloatArray | None = None
    shift_after_m: FloatArray | None = None
    turn_before_rad: FloatArray | None = None
    turn_after_rad: FloatArray | None = None
    shift_without_m: Mapping[str, FloatArray] = field(default_factory=dict)
    turn_without_rad: Mapping[str, FloatArray] = field(default_factory=dict)
    cost_m: Mapping[str, float] = field(default_factory=dict)
    alpha_px: FloatArray | None = None
    alpha_sigma_px: FloatArray | None = None
    board_offset_m: FloatArray | None = None
    distance_m: FloatArray | None = None
    gravity_in_camera: FloatArray | None = None
    joints_rad: FloatArray | None = None
    laws: tuple[LawShape, ...] = ()


@dataclass(frozen=True)
class ReportData:
    """Everything a report may show; whatever is None or empty is named as missing.

    Attributes
    ----------
    views:
        The N views, rejected ones with detected corners included.
    recording:
        The content of recording.yaml.
    calibration, diagnosis:
        The content of calibration.json and diagnosis.json, or None.
    residuals_px:
        Per solution (N, M, 2) reprojection residuals, pixels, NaN where not used.
    poses:
        Per solution the camera's poses.
    evidence:
        The diagnosis's per-view measurements.
    truth:
        The simulator's truth.
    simulated:
        True when no real camera was involved; puts the banner on the page.
    thumbnail:
        Gives the picture of a frame (grey or BGR, 8 bit, any size), or None where there is none;
        called from several threads.
    skipped:
        What the run tried and gave up, with the reason: it never became a frame.
    made:
        How it was made: versions, plan hash, seed, dates; shown as a table.
    """

    views: Views
    recording: Mapping[str, Any]
    calibration: Mapping[str, Any] | None = None
    diagnosis: Mapping[str, Any] | None = None
    residuals_px: Mapping[str, FloatArray] = field(default_factory=dict)
    poses: Mapping[str, SolutionPoses] = field(default_factory=dict)
    evidence: Evidence | None = None
    truth: Truth | None = None
    simulated: bool = False
    thumbnail: Thumbnail | None = None
    skipped: Mapping[str, str] = field(default_factory=dict)
    made: Mapping[str, str] = field(default_factory=dict)

    @property
    def solutions(self) -> Mapping[str, Mapping[str, Any]]:
        """The solutions of calibration.json by name, plainest first; empty without any."""
        found = (self.calibration or {}).get("solutions") or {}
        return {name: found[name] for name in in_order(found)}

    def why_missing(self, name: str) -> str:
        """The reason calibration.json gives for what it could not know."""
        missing = (self.calibration or {}).get("missing") or {}
        return str(missing.get(name) or "no reason is given")

    @property
    def recommended(self) -> str | None:
        """The solution to use: the one that knows most of the chain."""
        return self.best_of(self.solutions)

    @staticmethod
    def best_of(names: Mapping[str, object]) -> str | None:
        """The first of `names` in the order of preference, or None."""
        return next((name for name in PREFERENCE if name in names), next(iter(names), None))
