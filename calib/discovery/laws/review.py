"""Names against laws: a name stands only where no law without a name describes the data better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.chain.effect import Present
from calib.chain.effects import catalogue
from calib.chain.empirical import UNNAMED
from calib.discovery.laws.contest import (
    Tried,
    along_its_own,
    as_cell,
    fitted,
    in_words,
    promising,
    shortest_first,
)
from calib.discovery.laws.cross_validation import CrossValidation
from calib.discovery.laws.frames import frame_blocks
from calib.discovery.locate import Cell
from calib.discovery.score import Score, bic, conditional, extended, group_score, score_effects
from calib.discovery.search import DEMAND, UNDECIDED, Search, blank
from calib.solver.joint import JointFit
from calib.views import Views

_AS_GOOD = 0.8
"""A law whose score test promises this share of what the name's does is worth a fit."""

_FITTED = 2


def replaced_by_laws(search: Search) -> list[Cell]:
    """Put a law in the place of every name that it beats; the laws' cells."""
    cells = []
    for label in [p.effect.label for p in search.best.fit.model.effects]:
        present = next((p for p in search.best.fit.model.effects if p.effect.label == label), None)
        if present is None or present.effect.name == UNNAMED:
            continue
        missed, without = search.missed(present)
        (score,) = score_effects(without, search.views, [blank(present)])
        laws = [
            law
            for law in promising(without, search, _FITTED)
            if law.gain > _AS_GOOD * score.gain and not along_its_own(present.effect, law.law)
        ]
        base = search.best.criterion + missed
        laws_fitted = fitted(without, search, laws)
        tried = [(one, _behind(one, base, search.best.criterion)) for one in laws_fitted]
        better = [one for one, behind in tried if behind < 0.0]
        search.rival_laws[label] = tuple(
            (in_words(one), behind) for one, behind in tried if 0.0 <= behind < UNDECIDED
        )
        if better:
            cells.append(_put_in(search, shortest_first(better), label))
    return cells


def _behind(law: Tried, without: float, with_name: float) -> float:
    """By how much a law is worse than a name, both against the criterion without either.

    A law that is beyond chance by itself, at the price of all among which it was picked, is no fit
    to noise: against the name it pays for the fifty or so (`DEMAND` is twice the logarithm of
    that) that do about the same as the name does.
    """
    reached = law.trial.criterion
    if without - reached >= DEMAND:
        reached += min(0.0, DEMAND - 2.0 * law.found.choices)
    return reached - with_name


def _put_in(search: Search, tried: list[Tried], label: str) -> Cell:
    cell = as_cell(tried[:1], search.best)
    search.steps = [s for s in search.steps if s.taken.effect.label != label]
    search.take_in(tried[0].candidate, tried[0].trial.fit)
    search.run()
    return cell


_KINEMATIC = ("link_geometry", "joint_zero_offset")


def drop_beside_kinematics(search: Search) -> None:
    """Drop names that are not demanded once all the arm's kinematic numbers may be a little off.

    A controller's factory calibration moves every length, twist and offset; of these the search
    frees but the few that it sees, and what the others leave looks like a scale, or a slip.
    """
    if not any(p.effect.name in _KINEMATIC for p in search.best.fit.model.effects):
        return
    dropped = False
    for present in search.best.fit.model.effects:
        if present.effect.name in _KINEMATIC or present.effect.seen_without_robot:
            continue
        _, without = search.missed(present)
        score = _beside_kinematics(without, search.views, blank(present))
        if bic(score.gain, score.columns, search.views) < DEMAND:
            search.leave_out(present)
            dropped = True
    if dropped:
        _free_kinematics(search)


def _free_kinematics(search: Search) -> None:
    """Free every kinematic number of those named, where left-out frames are better for it."""
    fit = search.best.fit
    freed = tuple(
        replace(p, held=frozenset()) if p.effect.name in _KINEMATIC else p
        for p in fit.model.effects
    )
    whole = search.fitter.with_effects(fit, freed)
    more = {
        (k, place)
        for k, (before, after) in enumerate(zip(fit.model.effects, freed, strict=True))
        for place in set(after.free) - set(before.free)
    }
    checked = CrossValidation(whole, frame_blocks(whole, search.views))
    if checked.without_numbers(more).supported:
        search.go_on_from(whole)


def _beside_kinematics(fit: JointFit, views: Views, present: Present) -> Score:
    """What an effect would gain beside every kinematic number of the arm, freed."""
    known = {p.effect.label: set(p.free) for p in fit.model.effects}
    background = [
        Present(effect, effect.values({}), frozenset(known.get(effect.label, ())))
        for effect in catalogue()
        if effect.name in _KINEMATIC
    ]
    equations, _, unknowns, _ = extended(fit, views, (present, *background))
    first = len(fit.model.effects)
    mine = np.array([k for k, u in enumerate(unknowns) if u.place[:2] == ("effect", first)])
    information, gradient = conditional(equations, fit, mine)
    return group_score(information, gradient, views)


def drop_unsupported(search: Search, *, beside_field: bool = False) -> None:
    """Drop every effect, named or not, that frames left out of the fit are better without.

    `beside_field`: a field of shifts is left, whose edges a lens effect fits without being there;
    its name then has to place the left-out corners better, too.
    """
    while fitted := [k for k, p in enumerate(search.best.fit.model.effects) if p.free]:
        fit = search.best.fit
        checked = CrossValidation(fit, frame_blocks(fit, search.views))
        effects = [fit.model.effects[k] for k in fitted]
        worth = [checked.without(k) for k in fitted]
        wanted = [
            (w.supports_a_law if p.effect.name == UNNAMED else w.supported)
            and not (beside_field and _in_camera(p) and w.gain_px <= 0.0)
            for w, p in zip(worth, effects, strict=True)
        ]
        if all(wanted):
            return
        least = min(
            (k for k, is_wanted in enumerate(wanted) if not is_wanted),
            key=lambda k: worth[k].minus_two_log,
        )
        search.leave_out(effects[least])


def _in_camera(present: Present) -> bool:
    return present.effect.link in ("lens", "sensor") and present.effect.seen_without_robot
