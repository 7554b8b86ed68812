"""The moves of a bootstrap: small first, larger as more is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain import rigid
from calib.views import FloatArray


@dataclass(frozen=True)
class ProbingView:
    """How the camera should see the board next, against a reference view.

    Attributes
    ----------
    name:
        As text for the operator.
    turn_deg:
        Of the board about its own centre: rotation vector along the camera's axes.
    shift:
        Of its centre along the camera's axes, as a share of its distance.
    """

    name: str
    turn_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def camera_from_board(
        self, reference: FloatArray, centre_m: FloatArray, share: float
    ) -> FloatArray:
        """(4, 4) from a reference view's (4, 4), at a share of the full displacement."""
        centre = reference[:3, :3] @ centre_m + reference[:3, 3]
        turn = rigid.compose(share * np.radians(self.turn_deg), np.zeros(3))
        goal = turn @ reference
        goal[:3, 3] += centre + share * centre[2] * np.array(self.shift) - turn[:3, :3] @ centre
        return goal


def off_the_middle_rad(first: FloatArray, centre_m: FloatArray) -> float:
    """Angle between the optical axis and the board's centre in a (4, 4) view."""
    x, y, z = first[:3, :3] @ centre_m + first[:3, 3]
    return float(np.arctan2(np.hypot(x, y), z))


def towards_the_middle(first: FloatArray, centre_m: FloatArray, share: float) -> FloatArray:
    """(4, 4) view with the board's centre a share of the way to the optical axis.

    Half of the way the camera turns, half it shifts, so that neither goes far.
    """
    centre = first[:3, :3] @ centre_m + first[:3, 3]
    axis = np.cross(centre, [0.0, 0.0, 1.0])
    axis /= max(float(np.linalg.norm(axis)), 1e-12)
    angle = 0.5 * share * off_the_middle_rad(first, centre_m)
    goal = rigid.compose(angle * axis, np.zeros(3)) @ first
    now = goal[:3, :3] @ centre_m + goal[:3, 3]
    goal[:2, 3] -= share * now[:2]
    return goal


PROBING_VIEWS = (
    ProbingView("turned a little", (0, 0, 6)),
    ProbingView("tilted a little", (6, 0, 0)),
    ProbingView("tilted a little to the side", (0, 6, 0)),
    ProbingView("nearer, turned back", (0, 0, -12), (0.0, 0.0, -0.1)),
    ProbingView("tilted back, to the right", (-12, 0, 4), (0.1, 0.0, 0.0)),
    ProbingView("tilted to the other side, down", (0, -12, -4), (0.0, 0.1, 0.0)),
    ProbingView("farther, turned", (0, 0, 15), (0.0, 0.0, 0.12)),
    ProbingView("tilted, to the left", (12, 8, 0), (-0.12, 0.0, 0.0)),
    ProbingView("tilted to the side, up", (-8, 12, 0), (0.0, -0.1, 0.05)),
    ProbingView("tilted twice, to a corner", (10, -12, 10), (0.1, 0.08, 0.0)),
    ProbingView("tilted twice, to the other corner", (-12, -8, -10), (-0.1, -0.08, 0.0)),
)
TO_THE_MIDDLE = "the board towards the middle"
OFF_THE_MIDDLE_RAD = float(np.radians(3.0))
"""Nearer than this the board is left where it is."""

SHARES = (1.0, 0.8, 0.6, 0.45, 0.3)
