"""Which effects could be there: the catalogue, less what was not logged, with shapes to try."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.chain.effect import Effect, Present
from calib.chain.effects import catalogue
from calib.chain.model import CellModel
from calib.views import Views

_MANY_SHAPES = 16


@dataclass(frozen=True)
class Candidate:
    """An effect with the shape and settings to try, and how many such were tried.

    `choices` counts the shapes, and the sets of amounts, among which the best was picked: the
    pick has its price.
    """

    present: Present
    choices: float

    @property
    def effect(self) -> Effect:
        """The effect of the catalogue."""
        return self.present.effect


def unseen(views: Views) -> dict[str, str]:
    """Effects that this recording could not show, and why."""
    reasons = {effect.name: effect.missing(views) for effect in catalogue()}
    return {name: reason for name, reason in reasons.items() if reason is not None}


def candidates(model: CellModel, views: Views) -> Iterator[Candidate]:
    """Every effect that is not in the model yet and that the recording could show."""
    present = {p.effect.name for p in model.effects}
    yield from (Candidate(rest, 1.0) for rest in map(_held_back, model.effects) if rest.free)
    for effect in catalogue():
        if effect.missing(views) is not None or effect.name in present:
            continue
        shapes = list(effect.candidates(views))
        if len(shapes) > _MANY_SHAPES:
            picked = np.unique(np.linspace(0, len(shapes) - 1, _MANY_SHAPES).round().astype(int))
            tried = [shapes[k] for k in picked]
        else:
            tried = shapes
        for shape in tried:
            yield Candidate(Present(effect, effect.values(shape)), len(shapes))


def _held_back(present: Present) -> Present:
    """The amounts of an effect in the model that are held there, and only those, at zero."""
    effect = present.effect
    values = np.where([p.role == "amount" for p in effect.parameters], 0.0, present.values)
    return Present(effect, values, frozenset(present.free))


def joined(effects: Sequence[Present], more: Present) -> tuple[Present, ...]:
    """The effects with one more; or, where it is there already, with its further amounts freed."""
    if all(p.effect.label != more.effect.label for p in effects):
        return (*effects, more)
    return tuple(
        replace(p, held=p.held & more.held) if p.effect.label == more.effect.label else p
        for p in effects
    )


def finer(candidate: Candidate, views: Views) -> list[Candidate]:
    """Return the shapes near one of a coarse scan, itself included."""
    effect = candidate.effect
    shapes = list(effect.candidates(views))
    if len(shapes) <= _MANY_SHAPES or candidate.choices == 1.0:
        return [candidate]
    values = [effect.values(shape) for shape in shapes]
    distance = [float(np.abs(v - candidate.present.values).sum()) for v in values]
    near = np.argsort(distance)[: 2 * len(shapes) // _MANY_SHAPES + 3]
    return [Candidate(Present(effect, values[k]), len(shapes)) for k in near]
