"""From a recording to a diagnosis: locate, name, model, prove."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.chain.effect import Present
from calib.chain.empirical import UNNAMED
from calib.chain.model import evaluate, kinematics_of
from calib.discovery.ambiguity import ambiguities, ambiguous_mixups
from calib.discovery.candidates import unseen
from calib.discovery.diagnosis import (
    Diagnosis,
    Mismatch,
    NamedEffect,
    Unexplained,
    Value,
    Verdict,
)
from calib.discovery.history import with_history
from calib.discovery.laws.arm_field import is_arm_field, refitted, scatters_too_much
from calib.discovery.laws.contest import begin_with_law, law_leads
from calib.discovery.laws.found_law import found_law
from calib.discovery.laws.surface_field import field_leads, fields_anew
from calib.discovery.locate import Cell, locate
from calib.discovery.log_consistency.branches import choose_branches, with_branches
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_repair import LogRepair, repair_log
from calib.discovery.pictures import blur_notes, fit_blur
from calib.discovery.prediction_gate import Dropped, drop_what_predicts_worse
from calib.discovery.prove import held_out, prediction_rms_px, prove
from calib.discovery.rejections import LostFrames, lost_frames
from calib.discovery.residual_structure import ResidualStructure, find_residual_structure
from calib.discovery.scatter import scattered
from calib.discovery.search import UNDECIDED, Search
from calib.discovery.split import split_misfit
from calib.discovery.start import Fitter, fit_start
from calib.distributions import chi2_tail
from calib.solver.joint import JointFit, frame_errors
from calib.solver.noise import Noise, profile
from calib.views import BoolArray, Views

_MISMATCHES_SHOWN = 8
_WORTH_REPORTING = 1e-3


def diagnose(
    views: Views, *, log: Views | None = None, forced: Sequence[Present] | None = None
) -> Diagnosis:
    """Diagnose a recording.

    Parameters
    ----------
    views:
        Its frames.
    log:
        Further rows of the robot's log (frames to predict), among which a frame's true pose may
        stand when rows were mixed up.
    forced:
        Effects to take as they are named, in place of the search.

    Raises
    ------
    CalibrationError
        When the recording cannot even be calibrated.
    """
    views, log = with_history(views, views if log is None else log)
    repaired = repair_log(views, log)
    repaired, branch_price = _with_branches(repaired)
    held = held_out(len(repaired.views))
    fitter = Fitter(repaired.views.take(~held), repaired.has_robot)
    start = fit_start(fitter, repaired.free, ~held, repaired.known)
    before = fitter.with_effects(start, ()) if repaired.known else start
    search = Search(start, fitter, branch_price)
    if forced is None:
        structure = _searched(search, start)
    else:
        search.force(forced)
        structure = ResidualStructure(search, ())
    dropped: tuple[Dropped, ...] = ()
    if forced is None:
        unseen_views = repaired.views.take(held)
        structure, dropped = drop_what_predicts_worse(structure, before, unseen_views)
    found = _diagnosis(repaired, held, before, structure)
    found = replace(found, notes=(*found.notes, *map(str, dropped)))
    return _with_lost_frames(found, lost_frames(repaired.rejected, views.frame))


def _with_lost_frames(found: Diagnosis, lost: LostFrames | None) -> Diagnosis:
    """Let frames that contradict the others be the first thing that is unexplained."""
    if lost is None:
        return found
    frames = Unexplained("bookkeeping", "frames", "order", lost.where, lost.p_value, None)
    return replace(found, verdict="unexplained", unexplained_all=(frames, *found.unexplained_all))


def _searched(search: Search, before: JointFit) -> ResidualStructure:
    """Search; and once more with a focal length that scatters by chance, where it does."""
    search.run()
    structure = _or_laws_first(find_residual_structure(search), before)
    structure = _or_field_first(structure, before)
    scatter = scattered(structure)
    if scatter is None:
        return structure
    noise = replace(before.noise, focal=scatter.relative)
    start = search.fitter.fit(before.model, noise, before.own_error)
    again = Search(start, search.fitter, search.branch_price)
    again.run()
    return find_residual_structure(again, (scatter.cell,))


_MOST_OF_IT = 0.5
"""Of what the names gain: a law that does less leaves most of it to them again."""

_FAR_BEHIND = 60.0
"""A search begun with a law is given up where it is behind by this much: what is left after it, and
a field that makes names needless, gained less."""


def _or_laws_first(structure: ResidualStructure, before: JointFit) -> ResidualStructure:
    """The same search begun with a law, where that says the same with fewer names, or says more.

    What no name fits may be soaked up by two or three, none of which a law could replace alone.
    """
    search = structure.search
    names = len(_names(search))
    again = Search(before, search.fitter, search.branch_price)
    if names == 0 or (names == 1 and not law_leads(again)):
        return structure
    gained = again.best.criterion - search.best.criterion
    begun = begin_with_law(again, _MOST_OF_IT * gained)
    if begun is None or again.best.criterion > search.best.criterion + _FAR_BEHIND:
        return structure
    other = find_residual_structure(again, begun=(begun,))
    shorter = len(other.search.best.fit.model.effects) < len(search.best.fit.model.effects)
    fewer = shorter and len(_names(other.search)) < names
    better = other.search.like_for_like() < search.like_for_like() - (0.0 if fewer else UNDECIDED)
    return other if better else structure


def _names(search: Search) -> list[str]:
    return [p.effect.name for p in search.best.fit.model.effects if p.effect.name != UNNAMED]


def _or_field_first(structure: ResidualStructure, before: JointFit) -> ResidualStructure:
    """The same search begun with a field where one beats every single name in the plain cell.

    A dent in the picture is soaked up by several lens terms and bends the poses besides.
    """
    search = structure.search
    if not any(step.taken.effect.seen_without_robot for step in search.steps):
        return structure
    again = Search(before, search.fitter, search.branch_price)
    cell = field_leads(again)
    if cell is None:
        return structure
    again.run()
    again.drop_beside_field(cell.site, cell.score.gain)
    other = find_residual_structure(again, begun=(cell,))
    better = other.search.like_for_like() < search.like_for_like() - UNDECIDED
    return other if better else structure


def _with_branches(repaired: LogRepair) -> tuple[LogRepair, float]:
    """Choose the arm's branches where joints were not logged; and the price of the choice."""
    views = repaired.views
    kinematics = kinematics_of(views)
    if repaired.joints_logged or not repaired.has_robot or kinematics is None:
        return repaired, 0.0
    every = np.ones(len(views), dtype=bool)
    chosen = choose_branches(
        fit_start(Fitter(views), repaired.free, every, repaired.known), views, kinematics
    )
    mended = replace(
        repaired,
        views=with_branches(views, chosen, views.frame),
        log=with_branches(repaired.log, chosen, views.frame),
    )
    return mended, chosen.price


@dataclass(frozen=True)
class _Fits:
    """The plain cell and the final one: fitted without the held-out frames, and to all."""

    before: JointFit
    after: JointFit
    twin: JointFit
    plain: JointFit


def _diagnosis(
    repaired: LogRepair, held: BoolArray, before: JointFit, structure: ResidualStructure
) -> Diagnosis:
    search = structure.search
    after = search.best.fit
    everything = Fitter(repaired.views, repaired.has_robot)
    twin = _with_field_anew(everything, _restarted(after, len(repaired.views), held))
    plain = everything.fit(before.model, before.noise)
    judge = _judge(plain.noise, twin.noise)
    fits = _Fits(before, after, twin, plain)
    held_views = repaired.views.take(held)
    proof = prove(before, after, held_views)
    named = tuple(_mixup(mixup) for mixup in repaired.mixups) + _named(
        fits, held_views, search.fitter
    )
    return Diagnosis(
        verdict=_verdict(named, structure),
        effects=named,
        ambiguous_with=(*ambiguous_mixups(repaired.mixups), *ambiguities(search)),
        unexplained_all=_unexplained(structure, fits, held_views, search.fitter),
        mismatch=_mismatches(fits, everything),
        split=(split_misfit(plain, judge), split_misfit(twin, judge)),
        proof=proof,
        plain=plain,
        twin=twin,
        views=repaired.views,
        log=repaired.log,
        rejected=repaired.rejected,
        notes=(
            *repaired.notes,
            *_scatter(twin, repaired.has_robot),
            *_pictures(twin, repaired.views),
            *_unseen(repaired.views),
        ),
    )


def _with_field_anew(everything: Fitter, start: JointFit) -> JointFit:
    """Fit to all frames; a field of the arm is then one of all frames, too."""
    if any(is_arm_field(p) for p in start.model.effects):
        return refitted(everything, start)
    return fields_anew(everything, everything.settled(start))


def _restarted(fit: JointFit, frames: int, held: BoolArray) -> JointFit:
    """The fit with room for the frames that were held out."""
    error = np.zeros((frames, fit.own_error.shape[1]))
    error[~held] = fit.own_error
    return replace(fit, own_error=error)


def _verdict(named: Sequence[NamedEffect], structure: ResidualStructure) -> Verdict:
    if structure.cells:
        return "unexplained"
    return "explained" if named else "consistent"


def _mixup(mixup: Mixup) -> NamedEffect:
    return NamedEffect(
        name=mixup.name,
        link="bookkeeping",
        law=None,
        physics=mixup.physics,
        remedy=mixup.remedy,
        parameters={k: Value(v, 0.0, unit) for k, (v, unit) in mixup.parameters.items()},
        p_value=0.0,
        holdout_gain_px=0.0,
    )


def _named(fits: _Fits, held: Views, fitter: Fitter) -> tuple[NamedEffect, ...]:
    """Every named effect of the final cell, with what its absence would cost."""
    named = []
    effects = fits.after.model.effects
    for index, present in enumerate(effects):
        if present.effect.name == UNNAMED:
            continue
        without, lost = _missed(fits, index, held, fitter)
        gain = without.minus_two_log - fits.after.minus_two_log
        columns = fits.after.parameters - without.parameters
        effect = present.effect
        named.append(
            NamedEffect(
                name=effect.name,
                link=effect.link,
                law=effect.law,
                physics=effect.physics,
                remedy=effect.remedy,
                parameters=_values(fits.twin, index),
                p_value=chi2_tail(gain, max(columns, 1)),
                holdout_gain_px=lost,
            )
        )
    return tuple(named)


def _values(twin: JointFit, index: int) -> dict[str, Value]:
    present = twin.model.effects[index]
    sigma = {
        u.place[2]: float(np.sqrt(twin.covariance[k, k]))
        for k, u in enumerate(twin.unknowns)
        if u.place[0] == "effect" and u.place[1] == index
    }
    return {
        p.name: Value(float(v), sigma.get(k, 0.0), p.unit)
        for k, (p, v) in enumerate(zip(present.effect.parameters, present.values, strict=True))
        if p.role != "amount" or k in present.free
    }


def _unexplained(
    structure: ResidualStructure, fits: _Fits, held: Views, fitter: Fitter
) -> tuple[Unexplained, ...]:
    """Every term without a name, with its law where there is one."""
    labels = [present.effect.label for present in fits.after.model.effects]
    reported = []
    for cell in structure.cells:
        law = None
        if cell.law is not None:
            index = labels.index(cell.law.effect.label)
            lost = _missed(fits, index, held, fitter)[1]
            law = found_law(fits.twin, index, lost, cell.rivals)
        reported.append(
            Unexplained(cell.link, cell.site, cell.covariate, cell.where, cell.p_value, law)
        )
    return tuple(reported)


def _missed(fits: _Fits, index: int, held: Views, fitter: Fitter) -> tuple[JointFit, float]:
    """The final cell refitted without one effect, and how much worse it predicts (px)."""
    effects = fits.after.model.effects
    without = fitter.with_effects(fits.after, effects[:index] + effects[index + 1 :])
    if not len(held):
        return without, float("nan")
    worse = prediction_rms_px(without.model, held) - prediction_rms_px(fits.after.model, held)
    return without, worse


def _mismatches(fits: _Fits, fitter: Fitter) -> tuple[Mismatch, ...]:
    """Where the plain cell misses, judged by the noise that the final cell leaves."""
    judged = replace(fits.plain, noise=_judge(fits.plain.noise, fits.twin.noise))
    cells = [c for c in locate(judged, fitter.views) if c.p_value < _WORTH_REPORTING]
    excess = _excess(judged)
    reported: list[Cell] = []
    for cell in sorted(cells, key=lambda c: -c.score.gain):
        if all((cell.site, cell.covariate) != (t.site, t.covariate) for t in reported):
            reported.append(cell)
    return tuple(
        Mismatch(
            link=c.link,
            site=c.site,
            covariate=c.covariate,
            where=c.where,
            share_of_excess=min(1.0, c.score.gain / excess),
            p_value=c.p_value,
        )
        for c in reported[:_MISMATCHES_SHOWN]
    )


def _judge(before: Noise, after: Noise) -> Noise:
    return Noise(
        min(before.corner_px, after.corner_px),
        min(before.flange_m, after.flange_m),
        min(before.flange_rad, after.flange_rad),
        after.print_m if before.print_m > 0.0 else 0.0,
    )


def _excess(fit: JointFit) -> float:
    """Squared misfit, in units of the noise, above what noise alone makes."""
    square = profile(fit.equations, fit.noise).square_sum
    return max(square - (fit.equations.observations - fit.parameters), 1.0)


def _scatter(twin: JointFit, has_robot: bool) -> tuple[str, ...]:
    noise = twin.noise
    carried = any(is_arm_field(present) for present in twin.model.effects)
    if not has_robot or carried or not scatters_too_much(twin):
        return ()
    return (
        f"the arm's poses scatter by {1e3 * noise.flange_m:.2f} mm and"
        f" {1e3 * noise.flange_rad:.2f} mrad per axis, more than an industrial arm does about a"
        " pose it returns to (ISO 9283: 0.01 to 0.1 mm); nothing says what these errors follow."
        " More frames, closer to each other, would",
    )


def _pictures(twin: JointFit, views: Views) -> tuple[str, ...]:
    state = evaluate(twin.model, views, errors=frame_errors(twin.own_error))
    return blur_notes(fit_blur(views.blur_px, state.distance_m))


def _unseen(views: Views) -> tuple[str, ...]:
    reasons: dict[str, list[str]] = {}
    for name, why in unseen(views).items():
        reasons.setdefault(why, []).append(name)
    return tuple(f"could not be seen ({why}): {', '.join(n)}" for why, n in reasons.items())
