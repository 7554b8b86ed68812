"""What each pose says about the cell, without any picture: one information matrix a pose.

The chain is linearised at a model as the fit does it, but at predicted corners. The flange's
scatter is integrated out pose by pose, so the matrices of several poses simply add; that is what
makes it cheap to ask what a plan can see, and what a pose more would bring.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain.effect import Present
from calib.chain.model import CellModel, kinematics_of, predict
from calib.solver.each_frame import each_frame
from calib.solver.elimination import solve_scaled
from calib.solver.noise import Noise
from calib.solver.unknowns import Unknown, amount_unknowns, dependence, unknowns_of
from calib.views import FloatArray, Views

_BATCH = 64
"""Poses at a time: their matrices in local columns are what takes memory."""


@dataclass(frozen=True)
class PoseInformation:
    """Information of N poses about the plain cell's numbers and some effects' amounts.

    Attributes
    ----------
    frames:
        (N, p, p) inverse covariance that each pose brings, at the noise given.
    unknowns:
        The p numbers: the cell's own (nuisance) first.
    owner:
        (p,) index of the effect that a number belongs to, -1 for nuisance.
    """

    frames: FloatArray
    unknowns: tuple[Unknown, ...]
    owner: NDArray[np.int64]

    def of(self, effect: int) -> NDArray[np.int64]:
        """Indices of an effect's amounts among the unknowns."""
        return np.flatnonzero(self.owner == effect)

    @property
    def nuisance(self) -> NDArray[np.int64]:
        """Indices of the cell's own numbers."""
        return np.flatnonzero(self.owner < 0)

    @property
    def total(self) -> FloatArray:
        """(p, p) of all poses together."""
        return np.asarray(self.frames.sum(axis=0))


def pose_information(
    model: CellModel, views: Views, effects: Sequence[Present], noise: Noise
) -> PoseInformation:
    """Work out what each pose says.

    Parameters
    ----------
    model:
        The cell; whatever it has is fitted too, as nuisance.
    views:
        The log of the poses. Corners are not looked at: those count that the cell would show
        inside the image.
    effects:
        Whose amounts are asked for; their values are where the chain is linearised.
    noise:
        Of corners and flange.
    """
    asked = model.with_effects((*model.effects, *effects))
    base = unknowns_of(model)
    unknowns = (*base, *amount_unknowns(asked, base))
    owner = np.full(len(unknowns), -1)
    owner[len(base) :] = [u.place[1] - len(model.effects) for u in unknowns[len(base) :]]
    batches = [
        _batch(asked, views.take(np.arange(at, min(at + _BATCH, len(views)))), unknowns, noise)
        for at in range(0, len(views), _BATCH)
    ]
    return PoseInformation(np.concatenate(batches), unknowns, owner)


def shown(model: CellModel, views: Views) -> Views:
    """The views with the corners that the cell would show inside the image."""
    corners = predict(model, views)
    size = np.array([views.width_px, views.height_px])
    inside = np.asarray(((corners > -0.5) & (corners < size - 0.5)).all(axis=2))
    if views.board.kind == "chessboard":
        inside &= inside.all(axis=1, keepdims=True)
    return replace(views, corners_px=np.where(inside[:, :, None], corners, np.nan))


def _batch(
    model: CellModel, views: Views, unknowns: tuple[Unknown, ...], noise: Noise
) -> FloatArray:
    views = shown(model, views)
    found = dependence(model, views, unknowns, kinematics=kinematics_of(views))
    still = np.zeros((len(views), 6))
    frames = each_frame(found, views.corners_px, views.seen / noise.corner_px**2, still)
    return frames.marginal(noise.flange_information)[:, :-1, :-1]


def project_out(
    information: FloatArray, kept: NDArray[np.int64], out: NDArray[np.int64]
) -> FloatArray:
    """(k, k) information about `kept` once everything in `out` is fitted as well."""
    cross = information[np.ix_(out, kept)]
    _, inverse, _ = solve_scaled(information[np.ix_(out, out)], np.zeros(len(out)))
    left = information[np.ix_(kept, kept)] - cross.T @ inverse @ cross
    return np.asarray(0.5 * (left + left.T))
