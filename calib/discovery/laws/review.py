"""Names against laws: a name stands only where no law without a name describes the data better."""

from __future__ import annotations

from calib.chain.empirical import UNNAMED
from calib.discovery.laws.contest import Tried, as_cell, fitted, promising
from calib.discovery.laws.cross_validation import CrossValidation
from calib.discovery.laws.frames import frame_blocks
from calib.discovery.locate import Cell
from calib.discovery.score import score_effects
from calib.discovery.search import Search, blank

_AS_GOOD = 0.8
"""A law whose score test promises this share of what the name's does is worth a fit."""

_FITTED = 2


def replaced_by_laws(search: Search) -> list[Cell]:
    """Put a law in the place of every name that it beats, price and all; the laws' cells."""
    cells = []
    for label in [p.effect.label for p in search.best.fit.model.effects]:
        present = next((p for p in search.best.fit.model.effects if p.effect.label == label), None)
        if present is None or present.effect.name == UNNAMED:
            continue
        _, without = search.missed(present)
        (score,) = score_effects(without, search.views, [blank(present)])
        laws = [
            law for law in promising(without, search, _FITTED) if law.gain > _AS_GOOD * score.gain
        ]
        tried = fitted(without, search, laws)
        if not tried or tried[0].trial.criterion > search.best.criterion:
            continue
        cells.append(_put_in(search, tried, label))
    return cells


def _put_in(search: Search, tried: list[Tried], label: str) -> Cell:
    cell = as_cell(tried[:1], search.best)
    search.steps = [s for s in search.steps if s.taken.effect.label != label]
    search.take_in(tried[0].candidate, tried[0].trial.fit)
    search.run()
    return cell


def drop_unsupported(search: Search) -> None:
    """Drop every effect, named or not, that frames left out of the fit are better without."""
    while search.best.fit.model.effects:
        fit = search.best.fit
        checked = CrossValidation(fit, frame_blocks(fit, search.views))
        worth = [checked.without(k).minus_two_log for k in range(len(fit.model.effects))]
        least = worth.index(min(worth))
        if worth[least] > 0.0:
            return
        search.leave_out(fit.model.effects[least])
