"""What a bootstrap found, as numbers with their uncertainties and as a cell file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.calibration.roughly_known import FRAMES_FOR_NOISE, with_sigma
from calib.chain.model import CellModel, evaluate
from calib.views import FloatArray
from cell.errors import BadAnswer
from cell.storage.files.cell_file import CellFile, Layout
from cell.storage.files.parts import Pose
from cell.verbs.bootstrap.estimate import Knowledge

_GOOD_M = 0.01
_GOOD_RAD = float(np.radians(1.0))
_GOOD_ALPHA_SHARE = 0.05


@dataclass(frozen=True)
class Found:
    """The cell's geometry, each with one sigma.

    Attributes
    ----------
    flange_from_mounted, base_from_fixed:
        (4, 4).
    mounted_sigma_m, mounted_sigma_rad, fixed_sigma_m, fixed_sigma_rad:
        (3,) of increments in the second-named frame.
    alpha_px, alpha_sigma_px:
        At the distances seen.
    frames, rms_px:
        How many were fitted, and how well.
    layout:
        What it began with.
    """

    flange_from_mounted: FloatArray
    base_from_fixed: FloatArray
    mounted_sigma_m: FloatArray
    mounted_sigma_rad: FloatArray
    fixed_sigma_m: FloatArray
    fixed_sigma_rad: FloatArray
    alpha_px: float
    alpha_sigma_px: float
    frames: int
    rms_px: float
    layout: Layout

    @classmethod
    def of(cls, known: Knowledge, layout: Layout) -> Found:
        """From the fit of the last frame, and the layout it began with."""
        fit, views = known.fit, known.views

        def alpha(model: CellModel) -> FloatArray:
            return np.array(evaluate(model, views).optics[:, 0].mean())

        alpha_px, alpha_sigma_px = with_sigma(fit, alpha)
        mounted, fixed = (
            np.array([fit.sigma(f"{frame}.{axis}") for axis in ("x", "y", "z", "rx", "ry", "rz")])
            for frame in ("flange_from_mounted", "base_from_fixed")
        )
        return cls(
            fit.model.flange_from_mounted,
            fit.model.base_from_fixed,
            mounted[:3],
            mounted[3:],
            fixed[:3],
            fixed[3:],
            float(alpha_px),
            float(alpha_sigma_px),
            len(views),
            float(np.sqrt(np.nanmean(np.sum(fit.residual_px**2, axis=2)))),
            layout,
        )

    def check_good(self, refusal: str) -> None:
        """Raise `BadAnswer` where this is not enough to plan with; `refusal` may be why."""
        sigma_m = float(max(self.mounted_sigma_m.max(), self.fixed_sigma_m.max()))
        sigma_rad = float(max(self.mounted_sigma_rad.max(), self.fixed_sigma_rad.max()))
        share = self.alpha_sigma_px / self.alpha_px
        good = sigma_m < _GOOD_M and sigma_rad < _GOOD_RAD and share < _GOOD_ALPHA_SHARE
        if self.frames >= FRAMES_FOR_NOISE and good:
            return
        raise BadAnswer(
            f"{self.frames} frames leave the place of camera and board open by"
            f" {1e3 * sigma_m:.0f} mm and {np.degrees(sigma_rad):.1f}°, the scale factor by"
            f" {share:.0%}. Start where the board is in the middle of the picture and fills about"
            " half of it, with 150 mm of room around the arm."
            + (f" The last move that was left out or made smaller: {refusal}" if refusal else "")
        )

    def in_cell(self, cell: CellFile) -> CellFile:
        """The cell with its layout replaced by what was found."""
        found = {
            "mounted": _pose(self.flange_from_mounted),
            "fixed": _pose(self.base_from_fixed),
            "alpha_px": round(self.alpha_px, 1),
        }
        return cell.model_copy(update={"layout": self.layout.model_copy(update=found)})

    def as_mapping(self) -> dict[str, Any]:
        """Plain data, units in the keys."""
        return {
            "frames": self.frames,
            "rms_px": round(self.rms_px, 3),
            "alpha_px": round(self.alpha_px, 1),
            "alpha_sigma_px": round(self.alpha_sigma_px, 1),
            "mounted": _with_sigmas(
                self.flange_from_mounted, self.mounted_sigma_m, self.mounted_sigma_rad
            ),
            "fixed": _with_sigmas(self.base_from_fixed, self.fixed_sigma_m, self.fixed_sigma_rad),
        }

    def lines(self) -> list[str]:
        """As text, one fact a line."""
        places = (
            ("layout.mounted", self.flange_from_mounted, self.mounted_sigma_m,
             self.mounted_sigma_rad),
            ("layout.fixed", self.base_from_fixed, self.fixed_sigma_m, self.fixed_sigma_rad),
        )  # fmt: skip
        rows = [
            f"{name}: {_mm(pose[:3, 3])} mm, known to {_mm(sigma_m)} mm and"
            f" {np.degrees(sigma_rad).max():.2f} deg (one sigma)"
            for name, pose, sigma_m, sigma_rad in places
        ]
        return [
            *rows,
            f"layout.alpha_px: {self.alpha_px:.1f}, known to {self.alpha_sigma_px:.1f} px",
            f"{self.frames} frames, rms {self.rms_px:.2f} px",
        ]


def _pose(a_from_b: FloatArray) -> Pose:
    return Pose.of(RigidTransform.from_matrix(a_from_b))


def _with_sigmas(
    a_from_b: FloatArray, sigma_m: FloatArray, sigma_rad: FloatArray
) -> dict[str, Any]:
    pose = _pose(a_from_b)
    return {
        "p_m": list(pose.p_m),
        "q_xyzw": list(pose.q_xyzw or ()),
        "sigma_p_m": [round(s, 6) for s in sigma_m.tolist()],
        "sigma_r_rad": [round(s, 6) for s in sigma_rad.tolist()],
    }


def _mm(values_m: FloatArray) -> str:
    return "(" + ", ".join(f"{1e3 * value:.1f}" for value in values_m.tolist()) + ")"
