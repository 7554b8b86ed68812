"""A cell that is only roughly known: the guess is a prior of the joint fit of its first few views.

One view already ties the fixed part to the mounted one; every further view narrows both, and the
lens. What is not known yet keeps the width it was given with, so that the covariance of even one
view says honestly where the board may appear next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib.chain import rigid
from calib.chain.effects import make_effect
from calib.chain.model import CellModel, evaluate
from calib.chain.optics import COLUMN, optics_row
from calib.paper.extrinsics import board_poses
from calib.paper.homography import fit_homography
from calib.paper.zhang import camera_matrix
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import moved, unknowns_of
from calib.views import FloatArray, Views

_CENTRE_SHARE = 0.03
_RADIAL = {"k1": 0.1, "k2": 0.2}
_BREATHING_SHARE = 0.03
"""Of the scale factor at the first view's distance: thin lenses and the paper's reach that."""

_USUAL_NOISE = Noise(corner_px=0.5, flange_m=5e-4, flange_rad=5e-4)
"""Until the frames can show: a lens with terms of its own, an arm that was never calibrated."""

FRAMES_FOR_NOISE = 8
_STEP_SIGMA = 0.3


@dataclass(frozen=True)
class GuessSigma:
    """How far a guess may be off, one sigma.

    Attributes
    ----------
    mounted_m, mounted_rad:
        Of what sits on the flange, per axis.
    alpha_share:
        Of the scale factor, as a share of it.
    """

    mounted_m: float
    mounted_rad: float
    alpha_share: float


def board_in_view(views: Views, alpha_px: float) -> FloatArray:
    """(4, 4) camera_from_board of the first view by a pinhole of that scale factor.

    Raises
    ------
    CalibrationError
        The corners fix no homography.
    """
    homography = fit_homography(views.board.corners_m[:, :2], views.corners_px[0]).matrix
    return np.asarray(board_poses(homography[None], camera_matrix(_pinhole(views, alpha_px)))[0])


def _pinhole(views: Views, alpha_px: float) -> FloatArray:
    return optics_row(
        alpha_px=alpha_px,
        beta_px=alpha_px,
        u0_px=0.5 * (views.width_px - 1),
        v0_px=0.5 * (views.height_px - 1),
        height_px=views.height_px,
    )


def guess_from_one_view(
    views: Views, flange_from_mounted: FloatArray, alpha_px: float, *, refocuses: bool
) -> CellModel:
    """A pinhole cell whose fixed part is where the first view shows it.

    Parameters
    ----------
    views:
        The first has corners and a pose.
    flange_from_mounted, alpha_px:
        (4, 4) and the scale factor, as stated.
    refocuses:
        Whether the lens moves to focus; its focal length then follows the distance.

    Raises
    ------
    CalibrationError
        The corners fix no homography.
    """
    camera_from_board = board_in_view(views, alpha_px)
    in_hand = views.mount == "eye_in_hand"
    middle = camera_from_board if in_hand else rigid.inverse(camera_from_board)
    law = [make_effect("focus_breathing", {"law": "inverse_square"})] if refocuses else []
    return CellModel(
        optics=_pinhole(views, alpha_px),
        flange_from_mounted=flange_from_mounted,
        base_from_fixed=views.base_from_flange[0] @ flange_from_mounted @ middle,
        effects=tuple(law),
    )


def fit_roughly_known(views: Views, guess: CellModel, prior_sigma: GuessSigma) -> JointFit:
    """The joint fit of N >= 1 views about a guess.

    The noise levels are estimated from `FRAMES_FOR_NOISE` views on.
    """
    sigma = _prior_sigma(guess, views, prior_sigma)
    unknowns = tuple(replace(u, prior_sigma=sigma.get(u.name, np.inf)) for u in unknowns_of(guess))
    reported = len(views) >= FRAMES_FOR_NOISE
    return fit_joint(guess, views, unknowns, _USUAL_NOISE, fixed_noise=not reported, about=guess)


def _prior_sigma(guess: CellModel, views: Views, prior_sigma: GuessSigma) -> dict[str, float]:
    """One sigma by the unknown's name, for those that are not free."""
    alpha_px = float(guess.optics[COLUMN["alpha_px"]])
    sigma = {
        "alpha_px": prior_sigma.alpha_share * alpha_px,
        "beta_px": prior_sigma.alpha_share * alpha_px,
        "u0_px": _CENTRE_SHARE * views.width_px,
        "v0_px": _CENTRE_SHARE * views.width_px,
        **_RADIAL,
    }
    sigma |= {f"flange_from_mounted.{axis}": prior_sigma.mounted_m for axis in "xyz"}
    sigma |= {f"flange_from_mounted.r{axis}": prior_sigma.mounted_rad for axis in "xyz"}
    distance_m = float(evaluate(guess, views).distance_m[0])
    breathing = _BREATHING_SHARE * alpha_px * distance_m**2
    return sigma | {f"{e.effect.label}.k_px_m2": breathing for e in guess.effects}


def with_sigma(
    fit: JointFit, quantity: Callable[[CellModel], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """A quantity of the fitted cell and its one sigma, both of its shape (ISO/IEC Guide 98-3)."""
    value = quantity(fit.model)
    variance = np.zeros_like(value)
    values, vectors = np.linalg.eigh(fit.covariance)
    for square, direction in zip(values, vectors.T, strict=True):
        step = _STEP_SIGMA * np.sqrt(max(square, 0.0)) * direction
        ahead, behind = (quantity(moved(fit.model, fit.unknowns, s)) for s in (step, -step))
        variance += ((ahead - behind) / (2 * _STEP_SIGMA)) ** 2
    return value, np.sqrt(variance)
