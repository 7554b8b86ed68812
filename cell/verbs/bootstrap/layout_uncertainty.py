"""How far a cell file's layout may be off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.calibration.roughly_known import GuessSigma

_BOUND_SIGMA = 2.0
"""A bound that somebody states is taken for two sigmas along each axis."""


@dataclass(frozen=True)
class LayoutUncertainty:
    """Bounds of what `layout` says.

    Attributes
    ----------
    mount_m, mount_rad:
        Of `layout.mounted`.
    fixed_m:
        Of the position in `layout.fixed`.
    alpha_share:
        Of the scale factor, as a share of it.
    reach_m:
        How far the camera or the board may be from the flange's centre, where there is no layout.
    """

    mount_m: float = 0.05
    mount_rad: float = float(np.radians(10.0))
    fixed_m: float = 0.2
    alpha_share: float = 0.2
    reach_m: float = 0.15

    @property
    def prior_sigma(self) -> GuessSigma:
        """As the one-sigma widths of a prior."""
        return GuessSigma(
            self.mount_m / _BOUND_SIGMA,
            self.mount_rad / _BOUND_SIGMA,
            self.alpha_share / _BOUND_SIGMA,
        )
