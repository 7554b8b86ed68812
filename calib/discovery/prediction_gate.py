"""The last gate: nothing that was found may predict frames worse than the plain cell does.

Likelihoods weigh a frame's pose errors by the noise that is left, so a term may be likely and
still move predicted corners the wrong way. Here every frame is predicted from its log alone by a
cell that was fitted without it, and compared in pixels with the plain cell's prediction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.chain.effect import Present
from calib.chain.empirical import UNNAMED
from calib.chain.model import CellModel, predict
from calib.discovery.laws.arm_field import is_arm_field, made_anew, refitted
from calib.discovery.laws.cross_validation import folds
from calib.discovery.residual_structure import ResidualStructure, what_is_left
from calib.discovery.search import Search
from calib.discovery.start import Fitter
from calib.solver.joint import JointFit
from calib.views import BoolArray, FloatArray, Views

_FOLDS = 4


@dataclass(frozen=True)
class Missed:
    """Squared prediction errors of frames that had no say in the fit, per corner (px^2).

    Attributes
    ----------
    left_out:
        Of the frames of the search, each predicted by a fit to the other blocks of frames.
    held_out:
        Of the frames that neither search nor fit has seen.
    """

    left_out: FloatArray
    held_out: FloatArray

    @property
    def rms_px(self) -> float:
        """RMS distance over all these frames."""
        every = np.concatenate([self.left_out, self.held_out])
        return float(np.sqrt(every.mean())) if len(every) else 0.0

    def worse_than(self, plain: Missed) -> bool:
        """Whether left-out frames are placed worse, or unseen ones worse by more than chance."""
        if self.left_out.sum() > plain.left_out.sum():
            return True
        more = self.held_out - plain.held_out
        if len(more) == 0:
            return False
        chance = float(more.std(ddof=1)) / np.sqrt(len(more)) if len(more) > 1 else 0.0
        return float(more.mean()) > chance


def missed_by(fit: JointFit, weight: FloatArray, views: Views, held: Views) -> Missed:
    """Predict blocks of frames by a fit to the others, and unseen frames; weights as given."""
    fold = folds(len(views)) % _FOLDS
    square = np.zeros(len(views))
    for k in np.unique(fold):
        out = fold == k
        square[out] = _square_px(_refitted(fit, weight, views, ~out), views.take(out))
    return Missed(square, _square_px(fit.model, held))


def _refitted(fit: JointFit, weight: FloatArray, views: Views, chosen: BoolArray) -> CellModel:
    """The cell fitted to some of the frames only; a field of the arm then stands on these only."""
    fitter = Fitter(views.take(chosen))
    field = next((p for p in fit.model.effects if is_arm_field(p)), None)
    rest = tuple(p for p in fit.model.effects if p is not field)
    own_error = fit.own_error[chosen]
    model = fit.model.with_effects(rest)
    part = fitter.fit(model, fit.noise, own_error, weight[chosen], fixed_noise=True)
    if field is None:
        return part.model
    return part.model.with_effects((*part.model.effects, made_anew(part, fitter.views, field)))


def _square_px(model: CellModel, views: Views) -> FloatArray:
    """(N,) mean squared distance of each frame's corners from where its log puts them."""
    if len(views) == 0:
        return np.zeros(0)
    square = np.nansum((views.corners_px - predict(model, views)) ** 2, axis=2) * views.seen
    return np.asarray(square.sum(axis=1) / np.maximum(views.seen.sum(axis=1), 1))


@dataclass(frozen=True)
class Dropped:
    """An effect that the frames of the fit asked for and other frames were better without."""

    present: Present
    with_px: float
    without_px: float

    def __str__(self) -> str:
        effect = self.present.effect
        what = effect.label if effect.name == UNNAMED else effect.name
        return (
            f"{what} fitted these frames but was dropped: with it, frames that had no say in the"
            f" fit are predicted {self.with_px:.2f} px off, the plain cell"
            f" {self.without_px:.2f} px"
        )


def drop_what_predicts_worse(
    structure: ResidualStructure, plain: JointFit, held: Views
) -> tuple[ResidualStructure, tuple[Dropped, ...]]:
    """Drop effects, the worst first, until no frames are predicted worse than by the plain cell.

    Parameters
    ----------
    structure:
        What was found.
    plain:
        The plain cell, fitted to the frames of the search.
    held:
        Frames that were kept from it all.
    """
    search, dropped = structure.search, []
    if not search.fitter.has_robot:
        return structure, ()
    while search.best.fit.model.effects:
        fit = search.best.fit
        of_plain = missed_by(plain, fit.weight, search.views, held)
        now = missed_by(fit, fit.weight, search.views, held)
        if not now.worse_than(of_plain):
            break
        worst = _worst(search, fit, held)
        dropped.append(Dropped(worst, now.rms_px, of_plain.rms_px))
        search.leave_out(worst)
        search.go_on_from(refitted(search.fitter, search.best.fit))
    return (_judged_anew(structure), tuple(dropped)) if dropped else (structure, ())


def _worst(search: Search, fit: JointFit, held: Views) -> Present:
    """The effect without which other frames are predicted best."""
    rms_px = [
        missed_by(search.missed(p)[1], fit.weight, search.views, held).rms_px
        for p in fit.model.effects
    ]
    return fit.model.effects[int(np.argmin(rms_px))]


def _judged_anew(structure: ResidualStructure) -> ResidualStructure:
    """What is unexplained once effects were dropped: the terms that stay, or what sounds now."""
    search = structure.search
    present = {p.effect.label for p in search.best.fit.model.effects}
    kept = [c for c in structure.cells if c.law is None or c.law.effect.label in present]
    left = None if kept else what_is_left(search)
    return ResidualStructure(search, tuple(kept) if left is None else (left,))
