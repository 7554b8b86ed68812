"""What a calibration says, as frozen dataclasses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from calib.calibration.caution import Caution
from calib.calibration.cross_validation import CrossValidation
from calib.calibration.identifiability import Weakness
from calib.calibration.uncertainty import UncertaintyMap
from calib.chain.domain import invertible_rad, off_axis_rad
from calib.chain.optics import COLUMN
from calib.handeye import HandEye, chain
from calib.notebook import Row, Shown, axes_of
from calib.paper.focus_law import FocusLaw, FocusLawChoice, Parameter
from calib.paper.scale_factors import ScaleFactor
from calib.paper.zones import Zones
from calib.views import BoolArray, FloatArray, Mount

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VALUES = ("alpha_px", "beta_px", "u0_px", "v0_px", "skew_px", "k1", "k2")
"""The numbers every solution has, in the order of the paper's Table 2."""


@dataclass(frozen=True)
class Rejection:
    """A frame left out, and why."""

    frame: int
    reason: str


@dataclass(frozen=True)
class Statistics:
    """Mean, spread and root mean square of position errors, metres, in the true camera's frame."""

    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    rms: float

    @classmethod
    def of(cls, error_m: FloatArray) -> Statistics:
        """From (N, 3) errors; rows with NaN are left out."""
        e = error_m[np.isfinite(error_m).all(axis=1)]
        mean, std = e.mean(axis=0), e.std(axis=0)
        return cls(
            (float(mean[0]), float(mean[1]), float(mean[2])),
            (float(std[0]), float(std[1]), float(std[2])),
            float(np.sqrt((e**2).sum(axis=1).mean())),
        )


@dataclass(frozen=True)
class Covariance:
    """(p, p) covariance of a fit's shared numbers, by name, in their own units."""

    names: tuple[str, ...]
    matrix: FloatArray


@dataclass(frozen=True)
class Focus:
    """How one solution's focal lengths follow the distance.

    Attributes
    ----------
    law:
        `inverse_square` or `thin_lens`, as in `calib.paper.focus_law`.
    parameters:
        `alpha0_px`, `beta0_px`, `k_px_m2`, or `alpha_inf_px`, `beta_inf_px`, `f_m`; beta moves
        by the same share as alpha.
    """

    law: str
    parameters: Mapping[str, Parameter]


@dataclass(frozen=True)
class Solution:
    """One camera model with the poses it gives.

    Attributes
    ----------
    optics, camera_from_board:
        (N, K), (N, 4, 4) of every view; NaN for a view that was rejected.
    residual_px:
        (N, M, 2) detected minus predicted; NaN where not used.
    sigma:
        One-sigma by name, of the numbers that were fitted.
    at_distance_m:
        Distance at which alpha and beta are given where they move, else None.
    values:
        The numbers of `VALUES`, and further distortion terms that the fit freed (`p1`, `p2`, `k3`).
    focus:
        How alpha and beta move with distance where this fit determines it itself, else None.
    covariance:
        Of the numbers that were fitted together, or None.
    """

    optics: FloatArray
    camera_from_board: FloatArray
    residual_px: FloatArray
    values: Mapping[str, float]
    sigma: Mapping[str, float]
    at_distance_m: float | None = None
    focus: Focus | None = None
    covariance: Covariance | None = None

    @property
    def wide(self) -> bool:
        """Whether the image is an equidistant one, as wide lenses make it."""
        return bool(np.nanmax(self.optics[:, COLUMN["equidistant"]]))

    @property
    def invertible_rad(self) -> float:
        """Angle off the axis up to which every direction has a pixel of its own."""
        return invertible_rad(self.optics[np.flatnonzero(np.isfinite(self.optics[:, 0]))[0]])

    def supported_rad(self, board_m: FloatArray) -> float:
        """Angle off the axis of the farthest corner that was used, of (M, 3) on the board."""
        pose = self.camera_from_board
        seen = off_axis_rad(board_m @ np.swapaxes(pose[:, :3, :3], 1, 2) + pose[:, None, :3, 3])
        return float(seen[np.isfinite(self.residual_px).all(axis=2)].max())

    @property
    def projection(self) -> str:
        """The ideal image's name in files."""
        return "equidistant" if self.wide else "perspective"

    @property
    def reprojection_px(self) -> dict[str, float]:
        """Signed mean, median and spread of the components (Table 1); rms per corner."""
        r = self.residual_px[np.isfinite(self.residual_px)]
        return {
            "mean": float(r.mean()),
            "median": float(np.median(r)),
            "std": float(r.std()),
            "rms": float(np.sqrt(2 * (r**2).mean())),
        }


@dataclass(frozen=True)
class RobotReference:
    """Both constant transforms of the robot's chain, from one fit of everything together.

    Attributes
    ----------
    mount, flange_from_mounted, base_from_fixed:
        See `calib.handeye.HandEye`.
    covariance:
        (12, 12) of the increments on the right of both.
    flange_sigma_m, flange_sigma_rad, corner_sigma_px:
        Noise levels that the fit estimated.
    law:
        Label of the focus effect the fit preferred, or None for a lens that keeps still.
    gain_aic:
        How much that law gains over a lens that keeps still.
    outliers:
        Frames whose logged pose disagrees with their picture.
    source:
        `joint` or, where the joint fit failed, `hand_eye`.
    """

    mount: Mount
    flange_from_mounted: FloatArray
    base_from_fixed: FloatArray
    covariance: FloatArray
    flange_sigma_m: float
    flange_sigma_rad: float
    corner_sigma_px: float
    law: str | None
    gain_aic: float
    outliers: tuple[int, ...]
    source: str

    def camera_from_board(self, base_from_flange: FloatArray) -> FloatArray:
        """(N, 4, 4) where the robot says the board is."""
        return chain(self.mount, self.flange_from_mounted, base_from_flange, self.base_from_fixed)


@dataclass(frozen=True)
class PositionError:
    """Camera position of one solution against the robot, (N, 3) metres, camera frame, z forward.

    Attributes
    ----------
    common:
        Against the transforms of the joint fit: the same yardstick for every solution.
    own:
        Against transforms solved anew from this solution's poses alone. A constant part of the
        error disappears in them, so this is always the kinder number.
    hand_eye:
        Those transforms, or None where they could not be solved.
    """

    common: FloatArray
    own: FloatArray | None
    hand_eye: HandEye | None


@dataclass(frozen=True, repr=False)
class Calibration(Shown):
    """Everything a calibration found.

    Attributes
    ----------
    frame, used:
        (N,) frame numbers and which of them take part.
    rejected:
        The others, with reasons.
    wrong:
        (N, M) corners of used frames that lie far off and were left out.
    solutions:
        By name; a name that could not be computed is in `missing`, with the reason.
    scale_factors, zones, focus_law, beta_law:
        The paper's sections 3.1 and 4.1; None or empty with a reason in `missing`.
    robot, position_error:
        The robot's side, and every solution's camera positions against it.
    missing:
        What could not be known, by name, and why.
    image_size_px:
        (width, height).
    distance_range_m:
        Nearest and farthest depth of the board's centre in the frames used.
    supported_rad:
        Of every solution, the angle off the axis of the farthest corner used.
    weaknesses:
        What the views of the joint fit cannot separate, and which views would.
    uncertainty:
        Of the joint fit's camera over image and distance; None without a joint fit.
    cross_validation:
        The joint fit without some of its frames; None with a reason in `missing`.
    cautions:
        What is known to be wrong or undetermined, with the way to mend it.
    """

    frame: np.ndarray[tuple[int], np.dtype[np.int64]]
    used: BoolArray
    rejected: tuple[Rejection, ...]
    wrong: BoolArray
    solutions: Mapping[str, Solution]
    scale_factors: tuple[ScaleFactor, ...]
    zones: Zones | None
    focus_law: FocusLawChoice | None
    beta_law: FocusLaw | None
    robot: RobotReference | None
    position_error: Mapping[str, PositionError]
    missing: Mapping[str, str]
    image_size_px: tuple[int, int]
    distance_range_m: tuple[float, float]
    supported_rad: Mapping[str, float]
    weaknesses: tuple[Weakness, ...] = ()
    uncertainty: UncertaintyMap | None = None
    cross_validation: CrossValidation | None = None
    cautions: tuple[Caution, ...] = ()

    @property
    def best(self) -> str:
        """Name of the solution to use: that with the robot, where there is one."""
        return next(n for n in ("joint_ml", "zhang_mle", *self.solutions) if n in self.solutions)

    def headline(self) -> tuple[str, ...]:
        """What matters, a line each."""
        near, far = self.distance_range_m
        name = self.best
        best = self.solutions[name]
        alpha, sigma = best.values["alpha_px"], best.sigma.get("alpha_px", np.nan)
        law = "" if best.focus is None else f", focus law {best.focus.law}"
        at = "" if best.at_distance_m is None else f" at {best.at_distance_m:.2f} m"
        against = self.position_error.get(name)
        robot = (
            ""
            if against is None
            else f"; cameras against the robot {1e3 * Statistics.of(against.common).rms:.2f} mm rms"
        )
        return (
            f"Calibration: {int(self.used.sum())} of {len(self.frame)} frames, {near:.2f} to"
            f" {far:.2f} m",
            f"{name}: alpha {alpha:.2f} ± {sigma:.2g} px{at}{law}",
            f"reprojection {best.reprojection_px['rms']:.3f} px rms{robot}",
            *(f"warning: {caution.what}" for caution in self.cautions),
        )

    def rows(self) -> list[Row]:
        """One row for each solution: its numbers, their sigma, its errors."""
        rows: list[Row] = []
        for name, solution in self.solutions.items():
            against = self.position_error.get(name)
            rows.append(
                {"solution": name}
                | {key: solution.values.get(key) for key in VALUES}
                | {f"sigma_{key}": solution.sigma.get(key) for key in VALUES}
                | {
                    "reprojection_rms_px": solution.reprojection_px["rms"],
                    "camera_rms_m": None if against is None else Statistics.of(against.common).rms,
                }
            )
        return rows

    def plot(self) -> Figure:
        """Residuals of the best solution, and their RMS in each frame over distance."""
        solution = self.solutions[self.best]
        figure, (image, distance) = axes_of(2)
        off = np.linalg.norm(solution.residual_px, axis=2)
        seen = np.isfinite(off)
        where = solution.residual_px[seen]
        image.scatter(where[:, 0], where[:, 1], s=2)
        image.set(xlabel="residual along u (px)", ylabel="along v (px)", aspect="equal")
        used = seen.any(axis=1)
        rms = np.sqrt(np.nanmean(off[used] ** 2, axis=1))
        far = np.linalg.norm(solution.camera_from_board[used, :3, 3], axis=1)
        distance.plot(far, rms, "o")
        distance.set(xlabel="distance of the board's origin (m)", ylabel="RMS of a frame (px)")
        figure.suptitle(f"{self.best}: seen minus predicted")
        return figure
