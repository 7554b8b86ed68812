"""How well the scale factor is known over a range of distances, while frames still come.

The joint fit of a whole calibration and nothing else of it. Where the lens focuses anew for every
frame, the law of its focus is free even if the frames so far do not demand it: with few frames a
lens that moves passes for one that stands still, and the sigma of a constant would be believed at
distances that nobody has seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.lens_choice import chosen_baseline
from calib.calibration.pipeline import robot_after
from calib.calibration.uncertainty import focal_length_sigma_px, optics_at
from calib.chain.effects import make_effect
from calib.chain.optics import COLUMN
from calib.errors import CalibrationError
from calib.handeye import chain
from calib.solver.joint import JointFit, fit_joint
from calib.solver.unknowns import unknowns_of
from calib.views import BoolArray, FloatArray, Views

_LAW = "inverse_square"
_STEP_SIGMA = 0.1


@dataclass(frozen=True)
class RunningFit:
    """The joint fit of the frames so far.

    Attributes
    ----------
    joint:
        The fit.
    taken:
        (N,) which views took part.
    views:
        All of them.
    """

    joint: JointFit
    taken: BoolArray
    views: Views

    def camera_from_board(self, base_from_flange: FloatArray) -> FloatArray:
        """(V, 4, 4) where the fitted cell sees the board from flange poses."""
        model = self.joint.model
        return chain(
            self.views.mount, model.flange_from_mounted, base_from_flange, model.base_from_fixed
        )

    def alpha_over(self, distance_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(D,) scale factors of the lens focused at those distances, and their one sigma, px.

        The fit's whole covariance, carried to first order.
        """
        at = COLUMN["alpha_px"]
        alpha = [optics_at(self.joint.model, self.views, float(d))[at] for d in distance_m]
        return np.array(alpha), focal_length_sigma_px(self.joint, self.views, distance_m)


def fit_so_far(views: Views, *, lens_moves: bool) -> RunningFit:
    """Fit what is there.

    Parameters
    ----------
    views:
        At least three frames.
    lens_moves:
        Whether the lens focuses anew for every frame.

    Raises
    ------
    CalibrationError
        The frames do not fix camera and robot yet; the message says what is missing.
    """
    baseline = chosen_baseline(views)
    robot = robot_after(views, baseline)
    joint = robot.joint
    if joint is None:
        raise CalibrationError("the frames do not fix camera and robot together yet")
    if lens_moves and robot.reference.law is None:
        joint = _with_law(joint, views, robot.taken, baseline.weight)
    return RunningFit(joint, robot.taken, views)


def _with_law(joint: JointFit, views: Views, taken: BoolArray, weight: FloatArray) -> JointFit:
    corners = np.where(weight[..., None] > 0, views.corners_px, np.nan)
    counted = replace(views, corners_px=corners).take(taken)
    model = joint.model.with_effects([make_effect("focus_breathing", {"law": _LAW})])
    try:
        return fit_joint(model, counted, unknowns_of(model), joint.noise)
    except np.linalg.LinAlgError:
        raise CalibrationError("the frames leave open how the focal length moves") from None
