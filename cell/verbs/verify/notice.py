"""How small a change of the camera these views would have shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.model import evaluate, predict
from calib.chain.optics import COLUMN
from calib.chain.rigid import inverse
from calib.distributions import noncentrality
from calib.solver.free_poses import fit_free_poses
from calib.solver.unknowns import moved
from calib.views import FloatArray
from cell.verbs.verify.change import Change
from cell.verbs.verify.judge import SIGNIFICANT, Judgement
from cell.verbs.verify.misfit import Misfit
from cell.verbs.verify.old_cell import OldCell
from cell.views.report.geometry import workpiece_error_m

POWER = 0.9


@dataclass(frozen=True)
class Noticeable:
    """Changes that would be noticed nine times in ten, whatever else changed with them.

    Attributes
    ----------
    shift_m, turn_rad:
        Of the camera on its mount, in the direction seen worst.
    alpha_share:
        Of the focal length, as a share of it.
    workpiece_m:
        RMS error at the work piece that such a change makes, where it is largest.
    """

    shift_m: float
    turn_rad: float
    alpha_share: float
    workpiece_m: float


def noticeable(old: OldCell, found: Judgement, misfit: Misfit) -> Noticeable:
    """What the views of a judgement could have shown."""
    both = found.both
    camera = np.flatnonzero(~np.isin(both.at, old.group("board")))
    factor = _factor(len(camera))
    mount = np.flatnonzero(np.isin(both.at, old.group("mount")))
    alpha = next(k for k, at in enumerate(both.at) if old.unknowns[at].name == "alpha_px")
    alpha_px = float(old.model.optics[COLUMN["alpha_px"]])
    return Noticeable(
        shift_m=factor * _worst(both, mount[:3]),
        turn_rad=factor * _worst(both, mount[3:]),
        alpha_share=factor * _worst(both, np.array([alpha])) / alpha_px,
        workpiece_m=factor * float(_workpiece_m(old, both, camera, found, misfit).max()),
    )


def _factor(degrees: int) -> float:
    """How many sigmas a change must be to be noticed with probability `POWER`."""
    return float(np.sqrt(noncentrality(degrees, SIGNIFICANT, POWER)))


def _worst(both: Change, at: np.ndarray[tuple[int], np.dtype[np.int64]]) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(both.covariance[np.ix_(at, at)])[-1]))


def _workpiece_m(
    old: OldCell,
    both: Change,
    camera: np.ndarray[tuple[int], np.dtype[np.int64]],
    found: Judgement,
    misfit: Misfit,
) -> FloatArray:
    """(N,) one sigma, by frame, of the error that an unnoticed change makes."""
    views, model = found.views, misfit.model
    state = evaluate(model, views)
    covariance = both.covariance[np.ix_(camera, camera)]
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    square = np.zeros(len(views))
    for value, vector in zip(values, vectors.T, strict=True):
        step = np.zeros(len(old.unknowns))
        step[both.at[camera]] = scale * vector * np.sqrt(max(value, 0.0))
        pixels = predict(moved(model, old.unknowns, step), views)
        by_picture = fit_free_poses(
            state.optics, state.camera_from_board, state.points_m, pixels, ()
        ).camera_from_board
        off = workpiece_error_m(inverse(by_picture), inverse(state.camera_from_board), views.board)
        square += off**2
    return np.sqrt(square)
