"""The paper's method on whole recordings: scale factors, zones, law, then the fixed-alpha fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.baseline import as_solution, fit_subset, unfitted_solution
from calib.calibration.result import RobotReference, Solution
from calib.chain.optics import COLUMN
from calib.chain.rigid import from_vector
from calib.errors import CalibrationError
from calib.paper.fixed_alpha import FREE, algebraic_poses, held_optics, without_distortion
from calib.paper.focus_law import FocusLaw, FocusLawChoice, choose_focus_law, fit_focus_law
from calib.paper.scale_factors import ScaleFactor, scale_factor
from calib.paper.zones import Zones, find_zones
from calib.views import BoolArray, FloatArray, Views

PARALLEL_RAD = np.radians(6.0)
"""Views tilted less than this give scale factors; their tilt is accounted for all the same."""

TILTED_RAD = np.radians(45.0)
"""Where fewer than `ENOUGH` views are parallel, views up to this tilt are taken as well."""

ENOUGH = 8

_ROUNDS = 4


@dataclass(frozen=True)
class PaperResult:
    """The paper's sections 3.1 to 4.2 on one recording; see `Calibration` for the fields."""

    scale_factors: tuple[ScaleFactor, ...]
    focus_law: FocusLawChoice | None
    beta_law: FocusLaw | None
    zones: Zones | None
    solutions: dict[str, Solution]
    missing: dict[str, str]


def board_depth_m(views: Views, camera_from_board: FloatArray) -> FloatArray:
    """(N,) depth of the board's centre along the optical axis."""
    centre = views.board.corners_m.mean(axis=0)
    return np.asarray(camera_from_board[:, 2, :3] @ centre + camera_from_board[:, 2, 3])


def common_distance_sigma_m(views: Views, reference: RobotReference, which: BoolArray) -> float:
    """One sigma of the error that all distances share: that of both constant transforms."""
    flange = views.base_from_flange[which]
    here = board_depth_m(views, reference.camera_from_board(flange))
    step = 1e-6
    J = np.empty((len(here), 12))
    for k in range(12):
        nudge = np.zeros(12)
        nudge[k] = step
        other = replace(
            reference,
            flange_from_mounted=reference.flange_from_mounted @ from_vector(nudge[:6]),
            base_from_fixed=reference.base_from_fixed @ from_vector(nudge[6:]),
        )
        J[:, k] = (board_depth_m(views, other.camera_from_board(flange)) - here) / step
    variance = np.einsum("ij,jk,ik->i", J, reference.covariance, J)
    return float(np.sqrt(max(variance.mean(), 0.0)))


def run_paper_method(
    views: Views,
    used: BoolArray,
    weight: FloatArray,
    homographies: FloatArray,
    start: Solution,
    reference: RobotReference,
) -> PaperResult:
    """Scale factors of the near-parallel views, what they follow, and the fit that holds them.

    Distances come from the robot through the jointly solved transforms. The first round takes
    the principal point at the image's centre, as the paper does, and the baseline's distortion;
    the following ones take both from the fixed-alpha fit, so that neither the baseline's bias
    nor the lens's distortion is read as focus.
    """
    robot_poses = reference.camera_from_board(views.base_from_flange)
    distance = board_depth_m(views, robot_poses)
    part = used & views.has_pose & ~np.isin(views.frame, reference.outliers)
    chosen, note = _views_for_scale(part, robot_poses)
    common = common_distance_sigma_m(views, reference, chosen)
    model = start
    principal = ((views.width_px - 1) / 2, (views.height_px - 1) / 2)
    for _ in range(_ROUNDS):
        factors = _scale_factors(
            views, chosen, weight, model, distance, principal, reference.flange_sigma_m
        )
        alpha, beta = _held(factors, common, reference)
        solutions = _fixed_alpha(views, part, weight, homographies, distance, alpha.law, beta)
        model = solutions["fixed_alpha_mle"]
        principal = (model.values["u0_px"], model.values["v0_px"])
    zones, why = find_zones(*_columns(factors), alpha.choice)
    missing = {} if zones is not None else {"zones": why}
    if note:
        missing["parallel_views"] = note
    if alpha.choice is None:
        missing["focus_law"] = f"{len(factors)} near-parallel views; a law needs 5"
    reported = {
        name: _values_at(solution, alpha.law, beta, zones, factors, distance)
        for name, solution in solutions.items()
    }
    return PaperResult(factors, alpha.choice, beta, zones, reported, missing)


def _views_for_scale(part: BoolArray, robot_poses: FloatArray) -> tuple[BoolArray, str]:
    """Which views give scale factors, and a note where they are not the parallel ones."""
    tilt = np.arccos(np.clip(np.nan_to_num(robot_poses[:, 2, 2]), -1, 1))
    parallel: BoolArray = np.asarray(part & (tilt < PARALLEL_RAD))
    count = int(parallel.sum())
    if count >= ENOUGH:
        return parallel, ""
    tilted: BoolArray = np.asarray(part & (tilt < TILTED_RAD))
    if not tilted.any():
        raise CalibrationError(
            f"no view is tilted less than {np.degrees(TILTED_RAD):.0f} degrees against the board"
        )
    return tilted, (
        f"{count} views are parallel to the board within {np.degrees(PARALLEL_RAD):.0f} degrees;"
        f" scale factors come from all {int(tilted.sum())} tilted less than"
        f" {np.degrees(TILTED_RAD):.0f}, their tilt accounted for"
    )


def _scale_factors(
    views: Views,
    chosen: BoolArray,
    weight: FloatArray,
    model: Solution,
    distance: FloatArray,
    principal: tuple[float, float],
    flange_sigma_m: float,
) -> tuple[ScaleFactor, ...]:
    rows = np.flatnonzero(chosen & np.isfinite(model.optics[:, 0]))
    ideal = without_distortion(
        np.where(weight[..., None] > 0, views.corners_px, np.nan)[rows],
        model.optics[rows],
        model.camera_from_board[rows],
        views.board.corners_m,
    )
    found = []
    for i, corners in zip(rows, ideal, strict=True):
        try:
            found.append(
                scale_factor(
                    views.board.corners_m[:, :2],
                    corners,
                    float(distance[i]),
                    principal,
                    frame=int(views.frame[i]),
                    distance_sigma_m=flange_sigma_m,
                )
            )
        except CalibrationError:
            continue
    if not found:
        raise CalibrationError("no near-parallel view gives a scale factor")
    return tuple(found)


def _columns(
    factors: tuple[ScaleFactor, ...],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    table = np.array(
        [(f.distance_m, f.alpha_px, f.alpha_sigma_px, f.beta_px, f.beta_sigma_px) for f in factors]
    )
    return table[:, 0], table[:, 1], table[:, 2], table[:, 3], table[:, 4]


@dataclass(frozen=True)
class _Alpha:
    law: FocusLaw
    choice: FocusLawChoice | None


def _held(
    factors: tuple[ScaleFactor, ...], common_sigma_m: float, reference: RobotReference
) -> tuple[_Alpha, FocusLaw]:
    """Laws of alpha and beta: the preferred one of alpha, and the same for beta."""
    d, alpha, alpha_sigma, beta, beta_sigma = _columns(factors)
    per_metre = np.array([f.alpha_per_distance_px_m for f in factors])
    choice = choose_focus_law(
        d, alpha, alpha_sigma, per_distance_px_m=per_metre, common_distance_sigma_m=common_sigma_m
    )
    choice = None if choice is None else _confirmed(choice, reference)
    name = "constant" if choice is None else choice.preferred.law
    law = choice.preferred if choice is not None else _mean_law(d, alpha, alpha_sigma)
    if name == "constant":
        return _Alpha(law, choice), _mean_law(d, beta, beta_sigma)
    beta_per_metre = np.array([f.beta_per_distance_px_m for f in factors])
    beta_law = fit_focus_law(
        name,
        d,
        beta,
        beta_sigma,
        per_distance_px_m=beta_per_metre,
        common_distance_sigma_m=common_sigma_m,
    )
    return _Alpha(law, choice), beta_law


def _confirmed(choice: FocusLawChoice, reference: RobotReference) -> FocusLawChoice:
    """Ask the joint fit of pictures and robot where the scale factors alone are poor evidence.

    They inherit every error of the arm's distances. So a lens that the joint fit knows to stand
    still is taken to stand still, and between two laws that fit alike its choice counts.
    """
    preferred = choice.preferred.law
    if preferred == "constant" or reference.source != "joint" or reference.law == preferred:
        return choice
    if reference.law is not None and choice.decisive:
        return choice
    instead = reference.law or "constant"
    found = next((c for c in choice.candidates if c.law == instead), choice.preferred)
    why = f"{choice.why}; the joint fit of pictures and robot gains {reference.gain_aic:.1f} AIC by"
    why += " a moving lens" + (f", and by {instead} most" if reference.law else ": too little")
    return replace(choice, preferred=found, decisive=False, why=why)


def _mean_law(d: FloatArray, scale: FloatArray, sigma: FloatArray) -> FocusLaw:
    """A constant from however few views there are."""
    if len(np.unique(np.round(d, 6))) >= 2:
        return fit_focus_law("constant", d, scale, sigma)
    twice = np.concatenate([d, d * 1.001])
    return fit_focus_law("constant", twice, np.tile(scale, 2), np.tile(sigma, 2))


def _fixed_alpha(
    views: Views,
    part: BoolArray,
    weight: FloatArray,
    homographies: FloatArray,
    distance: FloatArray,
    alpha: FocusLaw,
    beta: FocusLaw,
) -> dict[str, Solution]:
    optics = held_optics(
        alpha.scale_px(distance[part]),
        beta.scale_px(distance[part]),
        views.width_px,
        views.height_px,
    )
    poses = algebraic_poses(optics, homographies[part])
    everywhere = np.zeros((len(views), optics.shape[1]))
    everywhere[part] = optics
    start = np.full((len(views), 4, 4), np.nan)
    start[part] = poses
    fit = fit_subset(views, part, everywhere, start, weight, FREE)
    return {
        "fixed_alpha_algebraic": unfitted_solution(views, part, weight, optics, poses),
        "fixed_alpha_mle": as_solution(fit, weight, FREE),
    }


def _values_at(
    solution: Solution,
    alpha: FocusLaw,
    beta: FocusLaw,
    zones: Zones | None,
    factors: tuple[ScaleFactor, ...],
    distance: FloatArray,
) -> Solution:
    """Alpha and beta of the table: of zone 2 where it is known, else at the median distance."""
    sigma = dict(solution.sigma)
    if zones is not None:
        at = None
        reported = {"alpha_px": zones.alpha_px, "beta_px": zones.beta_px}
        sigma |= {"alpha_px": zones.alpha_sigma_px, "beta_px": zones.beta_sigma_px}
    else:
        at = float(np.median(distance[np.isfinite(solution.optics[:, COLUMN["alpha_px"]])]))
        reported = {"alpha_px": float(alpha.scale_px(at)), "beta_px": float(beta.scale_px(at))}
        sigma |= {
            "alpha_px": float(alpha.sigma_px(at)[0]),
            "beta_px": float(beta.sigma_px(at)[0]),
        }
    return replace(solution, values={**solution.values, **reported}, sigma=sigma, at_distance_m=at)
