"""What is left when the known physics has been put in: nothing, or something without a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from calib.chain.empirical import present_curve
from calib.chain.model import evaluate
from calib.discovery.laws.arm_field import with_arm_field
from calib.discovery.laws.contest import as_cell, demanded
from calib.discovery.laws.review import drop_beside_kinematics, drop_unsupported, replaced_by_laws
from calib.discovery.laws.surface_field import SurfaceField, demanded_field, put_in
from calib.discovery.locate import Cell, locate
from calib.discovery.search import Search
from calib.discovery.spread import stands_out
from calib.distributions import chi2_tail
from calib.views import Views

ALARM = 2e-3
"""Chance of a false alarm over all cells that are tested."""

_LAW_SHARE = 0.03
"""A remainder in the link of a named effect that is this small a part of it is its law's shape."""

_SHAPE_SHARE = 0.2
"""The same where it follows the very covariate that the effect acts along."""

_REMAINDER = 0.05
"""A term without a name that gains less than this share of those before is what they left over."""

_MOST_CURVES = 3


@dataclass(frozen=True)
class ResidualStructure:
    """The search with unnamed curves put in where they were needed, and the cells that asked."""

    search: Search
    cells: tuple[Cell, ...]


def alarms(cells: list[Cell]) -> list[Cell]:
    """The cells that are more than chance among all those tested, the most significant first."""
    return [cell for cell in cells if cell.p_value * len(cells) < ALARM]


def is_shape_of_law(cell: Cell, search: Search) -> bool:
    """Whether the remainder is but a small part of an effect that is named in the same link."""
    place = (cell.site, cell.covariate)
    return any(
        cell.score.gain
        < step.demand * (_SHAPE_SHARE if place in step.taken.effect.acts_along else _LAW_SHARE)
        for step in search.steps
        if step.taken.effect.link == cell.link
    )


def what_is_left(search: Search) -> Cell | None:
    """The most significant cell that is more than chance and no named effect's shape, if any."""
    fit, views = search.best.fit, search.views
    cells = locate(fit, views, periods=False)
    least = ALARM / max(len(cells), 1)
    return next(
        (
            cell
            for cell in alarms(cells)
            if not is_shape_of_law(cell, search) and stands_out(fit, views, cell, least)
        ),
        None,
    )


def find_residual_structure(
    search: Search, known: tuple[Cell, ...] = (), begun: Sequence[Cell] = ()
) -> ResidualStructure:
    """Test what is left; carry it by unnamed curves and see which names are still needed then.

    `known` is what is known to be left already, `begun` what is carried already.
    """
    found = [*begun, *_carried(search)]
    replacing = replaced_by_laws(search)
    if replacing:
        found += replacing + _carried(search)
    search.drop_on_joints({cell.site for cell in found})
    search.drop_beside_curves()
    drop_beside_kinematics(search)
    drop_unsupported(search, beside_field=any(cell.is_field for cell in found))
    found = _as_they_stand(search, found)
    found += with_arm_field(search)
    present = {p.effect.label for p in search.best.fit.model.effects}
    kept = [cell for cell in found if cell.law is None or cell.law.effect.label in present]
    return ResidualStructure(search, known + tuple(kept))


def _as_they_stand(search: Search, found: Sequence[Cell]) -> list[Cell]:
    """The cells with what their laws gain now; a law that would not be taken now is dropped.

    A law that took the place of a name was judged beside others.
    """
    labels = {cell.law.effect.label for cell in found if cell.law is not None and cell.law.free}
    gains = search.drop_undemanded(labels)
    judged = []
    for cell in found:
        label = "" if cell.law is None else cell.law.effect.label
        if label in gains:
            gain = gains[label]
            score = replace(cell.score, gain=gain, p_value=chi2_tail(gain, cell.score.columns))
            cell = replace(cell, score=score)
        judged.append(cell)
    return judged


def _carried(search: Search) -> list[Cell]:
    """Carry what is left by laws and curves, one after the other, until nothing is."""
    found: list[Cell] = []
    views = search.views
    for _ in range(_MOST_CURVES):
        known = sum(cell.score.gain for cell in found)
        law = _field_or_law(search, _REMAINDER * known)
        if law is not None:
            found.append(law)
            continue
        cell = what_is_left(search)
        if cell is None or cell.score.gain < _REMAINDER * known:
            break
        found.append(cell)
        if cell.is_field:
            search.drop_beside_field(cell.site, cell.score.gain)
            break
        if not (_carried_finer(search, found, views) or _carry(search, cell, views)):
            break
    return found


def _field_or_law(search: Search, least: float) -> Cell | None:
    """Take in the field or the law that is demanded more, and see which names are still needed.

    What gains less than `least` is what those before it have left of their own.
    """
    field, before = demanded_field(search), search.best
    reported = demanded(search)
    law = as_cell(reported, before) if reported else None
    if field is not None and (law is None or field[0].gain > law.score.gain):
        return _carry_field(search, *field, least)
    if law is None or law.score.gain < least or is_shape_of_law(law, search):
        return None
    search.take_in(reported[0].candidate, reported[0].trial.fit)
    search.run()
    return law


def _carry_field(search: Search, field: SurfaceField, cell: Cell, least: float) -> Cell | None:
    """Carry a field, and see which names are still needed beside it."""
    if field.gain < least or is_shape_of_law(cell, search):
        return None
    search.drop_beside_field(cell.site, cell.score.gain)
    put_in(search, field)
    search.run()
    search.drop_beside_field(cell.site, cell.score.gain)
    return cell


def _carried_finer(search: Search, found: list[Cell], views: Views) -> bool:
    """Whether a finer curve in place of one that is there takes up the last cell of the same site.

    A kink leaves a remainder of a smooth curve, which follows whatever resembles it by chance.
    """
    site = found[-1].site
    for known in found[:-1]:
        if known.site != site or known.curve is None or not known.curve.can_be_finer:
            continue
        state = evaluate(search.best.fit.model, views)
        finer = replace(known.curve, fine=True)
        smooth = present_curve(known.curve, state)
        if search.put_in(present_curve(finer, state), known.tried, instead_of=smooth):
            found[found.index(known)] = replace(known, curve=finer)
            del found[-1]
            search.run()
            return True
    return False


def _carry(search: Search, cell: Cell, views: Views) -> bool:
    assert cell.curve is not None
    state = evaluate(search.best.fit.model, views)
    if not search.put_in(present_curve(cell.curve, state), choices=cell.tried):
        return False
    search.run()
    return True
