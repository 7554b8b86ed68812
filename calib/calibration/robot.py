"""The robot's side: both constant transforms, from one fit of robot, lens and pictures together.

Hand-eye from the poses of a wrong camera model takes up part of that model's error (a constant
part along the axis all of it). So the common yardstick is the joint fit, whose lens may move with
distance and whose robot may scatter; it is solved once and every solution is held against it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.held_out_check import cleared
from calib.calibration.joint_lens import with_deserved_terms
from calib.calibration.picture_evidence import picture_evidence
from calib.calibration.result import RobotReference
from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.chain.optics import COLUMN
from calib.errors import CalibrationError
from calib.handeye import HandEye, solve_hand_eye
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import unknowns_of
from calib.views import BoolArray, FloatArray, Views

DECISIVE_AIC = 30.0
"""Far above chance: an arm with errors of its own bends the joint fit by some tens."""

THREE_SIGMAS = 9.0
"""Of the pictures' chi-square, for a law with nothing free in it."""

REPEATABLE_M, REPEATABLE_RAD = 1e-4, 5e-4
"""What data sheets promise: an arm whose scatter is below both has no errors worth a law."""

_ALPHA_RANGE = 1.3
_ROUNDING = 1e-9
_FOCUS_LAWS = ("inverse_square", "thin_lens")
_POSE = tuple(
    f"{frame}.{axis}"
    for frame in ("flange_from_mounted", "base_from_fixed")
    for axis in ("x", "y", "z", "rx", "ry", "rz")
)


@dataclass(frozen=True)
class RobotFit:
    """The reference, and the joint fit it came from (None where only hand-eye worked).

    `views` are those that took part, in the joint fit's order; `taken` (N,) says which.
    """

    reference: RobotReference
    joint: JointFit | None
    taken: BoolArray


def fit_robot(
    views: Views,
    used: BoolArray,
    weight: FloatArray,
    optics: FloatArray,
    camera_from_board: FloatArray,
    sigma_px: float,
) -> RobotFit:
    """Solve hand-eye, then everything together with and without a lens that moves.

    Parameters
    ----------
    views, used, weight:
        The views, (N,) which count, (N, M) corner weights.
    optics, camera_from_board:
        (K,) and (N, 4, 4) of the baseline.
    sigma_px:
        Its corner noise.

    Raises
    ------
    CalibrationError
        No poses, too few, or motions that do not fix the transforms.
    """
    hand = hand_eye_of(views, used, camera_from_board)
    taken = hand.used
    corners = np.where(weight[..., None] > 0, views.corners_px, np.nan)
    counted = replace(views, corners_px=corners)
    chosen = counted.take(taken)
    outliers = _left_out(views, used, taken)
    noise = Noise(sigma_px, max(hand.rms_m / 3, 1e-6), max(hand.rms_rad / 3, 1e-6))
    plain = CellModel(_without_skew(optics), hand.flange_from_mounted, hand.base_from_fixed)
    try:
        law, joint, gain = _best_lens(plain, chosen, noise)
        back = cleared(joint.model, counted, taken, used & views.has_pose & ~taken)
        if back.any():
            joint = _fit(joint.model, counted.take(taken | back), joint.noise)
        joint = with_deserved_terms(joint, counted.take(taken | back))
    except np.linalg.LinAlgError:
        return RobotFit(_from_hand_eye(hand, sigma_px, outliers), None, taken)
    if not _plausible(joint, plain):
        return RobotFit(_from_hand_eye(hand, sigma_px, outliers), None, taken)
    taken = taken | back
    places = [[u.name for u in joint.unknowns].index(name) for name in _POSE]
    reference = RobotReference(
        mount=views.mount,
        flange_from_mounted=joint.model.flange_from_mounted,
        base_from_fixed=joint.model.base_from_fixed,
        covariance=joint.covariance[np.ix_(places, places)],
        flange_sigma_m=joint.noise.flange_m,
        flange_sigma_rad=joint.noise.flange_rad,
        corner_sigma_px=joint.noise.corner_px,
        law=law,
        gain_aic=gain,
        outliers=_left_out(views, used, taken),
        source="joint",
    )
    return RobotFit(reference, joint, taken)


def _left_out(views: Views, used: BoolArray, taken: BoolArray) -> tuple[int, ...]:
    return tuple(int(f) for f in views.frame[used & views.has_pose & ~taken])


def hand_eye_of(views: Views, used: BoolArray, camera_from_board: FloatArray) -> HandEye:
    """Hand-eye from one solution's poses; raises `CalibrationError`."""
    if not views.has_pose.any():
        raise CalibrationError(
            "no frame has a logged flange pose: without them nothing is known of hand-eye,"
            " distances and true camera positions"
        )
    poses = np.where(used[:, None, None], camera_from_board, np.nan)
    centre = views.board.corners_m.mean(axis=0)
    return solve_hand_eye(poses, views.base_from_flange, views.mount, centre)


def _plausible(joint: JointFit, plain: CellModel) -> bool:
    """Whether the joint fit stayed near the pictures' own answer, whatever the robot's ask."""
    alpha = COLUMN["alpha_px"]
    ratio = joint.model.optics[alpha] / plain.optics[alpha]
    return 1 / _ALPHA_RANGE < ratio < _ALPHA_RANGE and _is_covariance(joint.covariance)


def _is_covariance(matrix: FloatArray) -> bool:
    """Whether no direction has a variance below zero: a fit that came to rest has none."""
    variance = np.diag(matrix)
    if not (np.isfinite(matrix).all() and (variance > 0).all()):
        return False
    scale = 1.0 / np.sqrt(variance)
    return bool(np.linalg.eigvalsh(matrix * scale[:, None] * scale).min() > -_ROUNDING)


def _without_skew(optics: FloatArray) -> FloatArray:
    row = optics.copy()
    row[COLUMN["skew_px"]] = 0.0
    return row


def _best_lens(plain: CellModel, views: Views, noise: Noise) -> tuple[str | None, JointFit, float]:
    """The joint fit with the lens law the data prefer, and its gain in AIC over none.

    An arm that is off bends the joint fit, too, and a law that bends likewise then gains. The
    pictures know nothing of the arm: with free poses, they must bear the law out by themselves,
    or, where the arm keeps to its repeatability, at least not contradict its amount.
    """
    still = _fit(plain, views, noise)
    best: tuple[str | None, JointFit] = (None, still)
    for law in _FOCUS_LAWS:
        effect = make_effect("focus_breathing", {"law": law})
        moving = _fit(still.model.with_effects([effect]), views, still.noise)
        if _aic(moving) < _aic(best[1]) and _confirmed(still, moving, views):
            best = (law, moving)
    gain = _aic(still) - _aic(best[1])
    return (*best, gain) if gain >= DECISIVE_AIC else (None, still, gain)


def _confirmed(still: JointFit, moving: JointFit, views: Views) -> bool:
    pictures = picture_evidence(still, moving, views)
    by_themselves = pictures.gain > THREE_SIGMAS
    return by_themselves or (_arm_is_true(moving) and pictures.deviation < THREE_SIGMAS)


def _fit(model: CellModel, views: Views, noise: Noise) -> JointFit:
    return fit_joint(model, views, unknowns_of(model), noise)


def _arm_is_true(fit: JointFit) -> bool:
    noise = fit.noise
    return noise.flange_m < REPEATABLE_M and noise.flange_rad < REPEATABLE_RAD


def _aic(fit: JointFit) -> float:
    return fit.minus_two_log + 2 * fit.parameters


def _from_hand_eye(hand: HandEye, sigma_px: float, outliers: tuple[int, ...]) -> RobotReference:
    return RobotReference(
        mount=hand.mount,
        flange_from_mounted=hand.flange_from_mounted,
        base_from_fixed=hand.base_from_fixed,
        covariance=hand.covariance,
        flange_sigma_m=hand.rms_m,
        flange_sigma_rad=hand.rms_rad,
        corner_sigma_px=sigma_px,
        law=None,
        gain_aic=0.0,
        outliers=outliers,
        source="hand_eye",
    )
