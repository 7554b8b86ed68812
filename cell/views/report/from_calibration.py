"""The report's arrays out of a calibration, so that whoever calibrates need not know them."""

from __future__ import annotations

from calib.calibration import Calibration, Solution
from calib.chain.optics import COLUMN
from calib.chain.rigid import inverse
from calib.views import FloatArray, Views
from cell.views.report.data import SolutionPoses


def solution_poses(calibration: Calibration, views: Views) -> dict[str, SolutionPoses]:
    """Camera poses of every solution, beside the robot's, for the N views calibrated from.

    The robot's are the common yardstick of the joint fit, the same for every solution; None
    where nothing of the robot is known.
    """
    by_robot = None
    if calibration.robot is not None:
        by_robot = inverse(calibration.robot.camera_from_board(views.base_from_flange))
    return {
        name: SolutionPoses(inverse(solution.camera_from_board), by_robot, _moving_scale(solution))
        for name, solution in calibration.solutions.items()
    }


def _moving_scale(solution: Solution) -> FloatArray | None:
    """(N, 2) alpha and beta of each view, where they are not the same in all."""
    if solution.at_distance_m is None:
        return None
    return solution.optics[:, [COLUMN["alpha_px"], COLUMN["beta_px"]]]


def solution_residuals(calibration: Calibration) -> dict[str, FloatArray]:
    """(N, M, 2) residuals of every solution, pixels."""
    return {name: solution.residual_px for name, solution in calibration.solutions.items()}
