"""What the pictures say of a lens law by themselves, whatever the arm says."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.calibration.result import VALUES
from calib.chain.model import CellModel, Errors, evaluate
from calib.solver.free_poses import fit_free_poses
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views


@dataclass(frozen=True)
class PictureEvidence:
    """Chi-squares of the pictures alone, each frame's pose and the camera's constants free.

    Attributes
    ----------
    gain:
        What the law, with the amount that arm and pictures together gave it, is better than none.
    deviation:
        What that amount is worse than the amount that the pictures would choose: one degree of
        freedom, so above nine the pictures contradict it by more than three sigmas. A gain below
        zero alone contradicts nothing: where the pictures know the amount to a third of itself,
        chance makes it -4 in one true law of fifty.
    """

    gain: float
    deviation: float


def picture_evidence(still: JointFit, moving: JointFit, views: Views) -> PictureEvidence:
    """Hold the law in `moving` against the pictures.

    Parameters
    ----------
    still, moving:
        The joint fits without and with the law (its last effect), of the same views; corner
        weights and noise are those of `still`.
    """
    half = _scaled(moving.model, 0.5)
    none, middle, whole = (
        _cost(fit, model, still, views)
        for fit, model in ((still, still.model), (moving, half), (moving, moving.model))
    )
    # A parabola over the amount: the law is a small shift of the focal length, so linear in it
    bend = 2.0 * (none + whole - 2.0 * middle)
    slope = whole - none - bend
    best = none - slope**2 / (4.0 * bend) if bend > 0 else min(none, whole)
    return PictureEvidence(none - whole, whole - best)


def _scaled(model: CellModel, factor: float) -> CellModel:
    *others, law = model.effects
    amounts = np.array([p.role == "amount" for p in law.effect.parameters])
    return replace(
        model,
        effects=(*others, replace(law, values=np.where(amounts, factor, 1.0) * law.values)),
    )


def _cost(fit: JointFit, model: CellModel, still: JointFit, views: Views) -> float:
    """-2 log likelihood of the pictures: poses and camera free, the law's shape held."""
    state = evaluate(model, views, errors=Errors(fit.flange_error))
    free = fit_free_poses(
        state.optics,
        state.camera_from_board,
        state.points_m,
        views.corners_px,
        VALUES,
        weight=still.weight,
    )
    square: FloatArray = np.nansum(free.residual_px**2, axis=2) * still.weight
    return float(square.sum()) / still.noise.corner_px**2
