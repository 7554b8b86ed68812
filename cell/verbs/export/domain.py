"""How far from the axis a distortion polynomial holds.

Where it folds, two lines of sight share a pixel, and the pixels beyond have none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cell.verbs.export.camera import Camera

_WIDEST_RAD = np.radians(85.0)
_STEPS = 5000


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

    Radius r of the undistorted point to r (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
    must grow with r up to the farthest corner; the small other terms are not looked at.
    """
    if camera.image_size_px is None:
        return None
    k1, k2, _, _, k3, k4, k5, k6, *_ = camera.distortion
    angle = np.linspace(0.0, _WIDEST_RAD, _STEPS)
    r = np.tan(angle)
    above = np.polynomial.polynomial.polyval(r**2, (1.0, k1, k2, k3))
    below = np.polynomial.polynomial.polyval(r**2, (1.0, k4, k5, k6))
    with np.errstate(divide="ignore"):
        distorted = r * above / below
    ends = (np.diff(distorted) <= 0) | (below[1:] <= 0)
    farthest = _farthest_corner(camera)
    fold = int(ends.argmax())
    if not ends.any() or distorted[fold] >= farthest:
        return None
    share = float(distorted[fold]) / farthest
    return Domain(float(distorted[fold]) * camera.alpha_px, float(angle[fold]), share)


def _farthest_corner(camera: Camera) -> float:
    """Distance of the picture's farthest corner from the principal point, in focal lengths."""
    assert camera.image_size_px is not None
    width, height = camera.image_size_px
    across = max(camera.u0_px + 0.5, width - 0.5 - camera.u0_px) / camera.alpha_px
    down = max(camera.v0_px + 0.5, height - 0.5 - camera.v0_px) / camera.beta_px
    return float(np.hypot(across, down))
