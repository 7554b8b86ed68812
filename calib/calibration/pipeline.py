"""From views to a calibration: baseline, robot, the paper's method, and the joint fit."""

from __future__ import annotations

import numpy as np

from calib.calibration.baseline import Baseline, fit_subset
from calib.calibration.cautions import cautions
from calib.calibration.cross_validation import CrossValidation, cross_validate
from calib.calibration.identifiability import Weakness, find_weaknesses
from calib.calibration.joint_lens import FURTHER_NAMES
from calib.calibration.lens_choice import NO_HOMOGRAPHY, chosen_lens
from calib.calibration.paper_method import PaperResult, board_depth_m, run_paper_method
from calib.calibration.result import VALUES, Calibration, PositionError, Solution
from calib.calibration.robot import RobotFit, fit_robot, hand_eye_of
from calib.calibration.shared import joint_covariance, joint_focus
from calib.calibration.uncertainty import UncertaintyMap, uncertainty_map
from calib.chain.model import Errors, evaluate
from calib.chain.optics import COLUMN
from calib.errors import CalibrationError
from calib.handeye import camera_position_error_m
from calib.solver.joint import JointFit
from calib.views import BoolArray, FloatArray, Views

_HARDLY = 0.1
"""A corner of less weight lies more than five sigma off."""

_PAPER_RESULTS = (
    "scale_factors",
    "zones",
    "focus_law",
    "fixed_alpha_algebraic",
    "fixed_alpha_mle",
)
_ROBOT_RESULTS = ("robot", "joint_ml", "cross_validation", *_PAPER_RESULTS)


def calibrate(views: Views) -> Calibration:
    """Calibrate the camera in every way the views allow.

    What the views do not allow stands in `missing` with the reason; without flange poses there
    is Zhang's calibration and nothing of the robot.

    Raises
    ------
    CalibrationError
        Not even Zhang's calibration is possible: fewer than three usable frames, or frames that
        do not fix the camera.
    """
    baseline, homographies = chosen_lens(views)
    solutions = {"zhang_mle": baseline.mle}
    if baseline.algebraic is not None:
        solutions["zhang_algebraic"] = baseline.algebraic
    missing = dict(baseline.missing)
    robot, fault = _robot(views, baseline, missing)
    paper = PaperResult((), None, None, None, {}, {})
    if robot is not None:
        paper = _paper(views, baseline, homographies, robot)
        solutions |= paper.solutions
        missing |= paper.missing
        if robot.joint is not None:
            solutions["joint_ml"] = joint_solution(views, baseline, robot, robot.joint)
    if "joint_ml" not in solutions:
        solutions["zhang_mle_no_skew"] = baseline.without_skew(views)
    reference = None if robot is None else robot.reference
    span_m = _distance_range_m(views, solutions.get("joint_ml", baseline.mle))
    cross_validation = _cross_validation(views, robot, span_m, missing)
    rejected = tuple(sorted(baseline.rejected, key=lambda r: r.frame))
    return Calibration(
        frame=views.frame,
        used=baseline.used,
        rejected=rejected,
        wrong=_wrong_corners(views, baseline, robot),
        solutions=solutions,
        scale_factors=paper.scale_factors,
        zones=paper.zones,
        focus_law=paper.focus_law,
        beta_law=paper.beta_law,
        robot=reference,
        position_error={} if robot is None else _position_errors(views, solutions, robot),
        missing=missing,
        image_size_px=(views.width_px, views.height_px),
        distance_range_m=span_m,
        supported_rad={n: s.supported_rad(views.board.corners_m) for n, s in solutions.items()},
        weaknesses=_weaknesses(views, robot),
        uncertainty=_uncertainty(views, robot, span_m),
        cross_validation=cross_validation,
        cautions=cautions(views, solutions, reference, fault, rejected, cross_validation),
    )


def _wrong_corners(views: Views, baseline: Baseline, robot: RobotFit | None) -> BoolArray:
    """(N, M) corners that a fit left out: Zhang's, or in its frames the joint one's weights."""
    wrong = baseline.weight == 0.0
    if robot is not None and robot.joint is not None:
        wrong[robot.taken] |= robot.joint.weight < _HARDLY
    return np.asarray(wrong & views.seen & baseline.used[:, None])


def _weaknesses(views: Views, robot: RobotFit | None) -> tuple[Weakness, ...]:
    if robot is None or robot.joint is None:
        return ()
    return find_weaknesses(robot.joint, views.take(robot.taken))


def _uncertainty(
    views: Views, robot: RobotFit | None, span_m: tuple[float, float]
) -> UncertaintyMap | None:
    if robot is None or robot.joint is None:
        return None
    return uncertainty_map(robot.joint, views, span_m)


def _cross_validation(
    views: Views, robot: RobotFit | None, span_m: tuple[float, float], missing: dict[str, str]
) -> CrossValidation | None:
    if robot is None:
        return None
    try:
        if robot.joint is None:
            raise CalibrationError("the joint fit with the robot failed; hand-eye alone is known")
        return cross_validate(robot.joint, views.take(robot.taken), span_m)
    except CalibrationError as error:
        missing["cross_validation"] = str(error)
        return None


def _distance_range_m(views: Views, solution: Solution) -> tuple[float, float]:
    depth = board_depth_m(views, solution.camera_from_board)
    return float(np.nanmin(depth)), float(np.nanmax(depth))


def robot_after(views: Views, baseline: Baseline) -> RobotFit:
    """The robot's side, begun from a baseline; raises `CalibrationError` as `fit_robot` does."""
    first = baseline.mle.optics[np.flatnonzero(baseline.used)[0]]
    residual = baseline.mle.residual_px
    sigma_px = max(float(np.nanmedian(np.abs(residual))) / 0.6745, 1e-4)
    return fit_robot(
        views, baseline.used, baseline.weight, first, baseline.mle.camera_from_board, sigma_px
    )


def _robot(
    views: Views, baseline: Baseline, missing: dict[str, str]
) -> tuple[RobotFit | None, CalibrationError | None]:
    try:
        return robot_after(views, baseline), None
    except CalibrationError as error:
        missing |= dict.fromkeys(_ROBOT_RESULTS, str(error))
        return None, error


def _paper(
    views: Views, baseline: Baseline, homographies: FloatArray | None, robot: RobotFit
) -> PaperResult:
    if homographies is None:
        return PaperResult((), None, None, None, {}, dict.fromkeys(_PAPER_RESULTS, NO_HOMOGRAPHY))
    try:
        return run_paper_method(
            views, baseline.used, baseline.weight, homographies, baseline.mle, robot.reference
        )
    except CalibrationError as error:
        return PaperResult((), None, None, None, {}, dict.fromkeys(_PAPER_RESULTS, str(error)))


def joint_solution(views: Views, baseline: Baseline, robot: RobotFit, joint: JointFit) -> Solution:
    """The joint fit's camera, with each frame's pose from its picture alone.

    Poses that the robot had a say in would agree with the robot by construction.
    """
    state = evaluate(joint.model, views.take(robot.taken), errors=Errors(joint.flange_error))
    optics = np.zeros((len(views), state.optics.shape[1]))
    optics[robot.taken] = state.optics
    start = np.full((len(views), 4, 4), np.nan)
    start[robot.taken] = state.camera_from_board
    weight = baseline.weight.copy()
    weight[robot.taken] *= joint.weight >= _HARDLY
    fit = fit_subset(views, robot.taken, optics, start, weight, ())
    at = float(np.median(board_depth_m(views, fit.camera_from_board)[robot.taken]))
    law = robot.reference.law
    middle = np.argmin(np.abs(state.distance_m - at))
    further = [u.name for u in joint.unknowns if u.name in FURTHER_NAMES]
    return Solution(
        optics=fit.optics,
        camera_from_board=fit.camera_from_board,
        residual_px=np.where(weight[..., None] > 0, fit.residual_px, np.nan),
        values={name: float(state.optics[middle, COLUMN[name]]) for name in (*VALUES, *further)},
        sigma={u.name: joint.sigma(u.name) for u in joint.unknowns if u.name in COLUMN},
        at_distance_m=None if law is None else float(state.distance_m[middle]),
        focus=joint_focus(joint, law),
        covariance=joint_covariance(joint, law),
    )


def _position_errors(
    views: Views, solutions: dict[str, Solution], robot: RobotFit
) -> dict[str, PositionError]:
    by_robot = robot.reference.camera_from_board(views.base_from_flange)
    by_robot[~robot.taken] = np.nan
    return {name: _position_error(views, s, robot, by_robot) for name, s in solutions.items()}


def _position_error(
    views: Views, solution: Solution, robot: RobotFit, by_robot: FloatArray
) -> PositionError:
    common = camera_position_error_m(solution.camera_from_board, by_robot)
    try:
        own = hand_eye_of(views, robot.taken, solution.camera_from_board)
    except CalibrationError:
        return PositionError(common, None, None)
    again = own.camera_from_board(views.base_from_flange)
    again[~robot.taken] = np.nan
    return PositionError(common, camera_position_error_m(solution.camera_from_board, again), own)
