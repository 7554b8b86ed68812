"""How far from the axis a distortion polynomial holds.

Where it folds, two lines of sight share a pixel, and the pixels beyond have none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.domain import distorted_radius, invertible_rad
from cell.verbs.export.camera import Camera


@dataclass(frozen=True)
class Domain:
    """The circle inside which a camera holds.

    Attributes
    ----------
    radius_px:
        Around the principal point.
    angle_rad:
        Of the line of sight there with the axis.
    share:
        Of the way from the principal point to the picture's farthest corner.
    """

    radius_px: float
    angle_rad: float
    share: float

    @property
    def description(self) -> str:
        """For a warning and a file's comment."""
        return (
            f"its distortion folds {self.radius_px:.0f} px from the principal point"
            f" ({100 * self.share:.0f} % of the way to the farthest corner,"
            f" {np.degrees(self.angle_rad):.0f} degrees off the axis): it holds inside that circle"
            " only, and pixels beyond have no line of sight"
        )


def domain_of(camera: Camera) -> Domain | None:
    """Where the radial distortion folds inside the picture, or None where it does not.

    The distance from the principal point must grow with the angle off the axis up to the farthest
    corner; the small other terms are not looked at.
    """
    if camera.image_size_px is None:
        return None
    angle = invertible_rad(camera.optics)
    fold = float(distorted_radius(camera.optics, np.array([angle]))[0])
    farthest = _farthest_corner(camera)
    return None if fold >= farthest else Domain(fold * camera.alpha_px, angle, fold / farthest)


def _farthest_corner(camera: Camera) -> float:
    """Distance of the picture's farthest corner from the principal point, in focal lengths."""
    assert camera.image_size_px is not None
    width, height = camera.image_size_px
    across = max(camera.u0_px + 0.5, width - 0.5 - camera.u0_px) / camera.alpha_px
    down = max(camera.v0_px + 0.5, height - 0.5 - camera.v0_px) / camera.beta_px
    return float(np.hypot(across, down))
