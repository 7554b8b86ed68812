"""What a plan would reveal, how small, and what it could not distinguish.

Baarda's minimal detectable bias and its companion for naming (Zaminpardaz, Teunissen 2019,
DIA-datasnooping): an effect of size s adds s^2 N to the test's noncentrality, N being its
information with all else projected out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.chain.effect import Effect, Present
from calib.chain.effects import catalogue
from calib.chain.model import CellModel
from calib.discovery.ambiguity import experiment
from calib.discovery.candidates import unseen
from calib.distributions import noncentrality
from calib.solver.noise import Noise
from calib.solver.pose_information import PoseInformation, pose_information, project_out
from calib.views import FloatArray, Views

FALSE_ALARM = 0.05
"""Of the whole catalogue, shared evenly among its effects (Bonferroni)."""

DETECTION = 0.9
"""Chance to find an effect of the size that is called detectable."""

DECISIVE = 21.7
"""Noncentrality at which the right one of two names has 99 % (one column, both at 1 %)."""

MIRROR = 0.99
"""Rivals that mimic this share of each other look alike in every view of this plan."""

_LOST = 1e-9
"""Share of its information that rounding leaves of a number that something else absorbs."""


@dataclass(frozen=True)
class Limit:
    """One amount of an effect: the smallest size that would be found, None where none would."""

    name: str
    unit: str
    typical: float
    smallest: float | None


@dataclass(frozen=True)
class Rival:
    """Another effect that could be taken for this one.

    Attributes
    ----------
    label:
        Its name and law.
    strength:
        Noncentrality left of this effect, at its usual size, once the rival is fitted.
    overlap:
        Share of this effect's trace in the corners that the rival can mimic.
    experiment:
        What would distinguish the two, as text.
    """

    label: str
    strength: float
    overlap: float
    experiment: str

    @property
    def mirror(self) -> bool:
        """Whether the two look alike in all of the plan's views."""
        return self.overlap >= MIRROR


@dataclass(frozen=True)
class EffectPower:
    """What the plan can say about one effect.

    Attributes
    ----------
    effect:
        Of the catalogue.
    strength:
        Noncentrality at its usual size: mean over the signs of its amounts.
    needed:
        Noncentrality at which it is found with the chance `DETECTION`.
    limits:
        One for each of its amounts.
    rivals:
        Those it could not be distinguished from, the most alike first.
    """

    effect: Effect
    strength: float
    needed: float
    limits: tuple[Limit, ...]
    rivals: tuple[Rival, ...]

    @property
    def detected(self) -> bool:
        """Whether it would be found at its usual size."""
        return self.strength >= self.needed


@dataclass(frozen=True)
class Power:
    """What a plan can see.

    Attributes
    ----------
    effects:
        In the catalogue's order.
    unseen:
        Effects that such a log could not show, and why.
    noise:
        What was assumed.
    frames:
        How many poses show the board.
    """

    effects: tuple[EffectPower, ...]
    unseen: dict[str, str]
    noise: Noise
    frames: int


def plan_power(model: CellModel, views: Views, noise: Noise) -> Power:
    """Say what a plan would reveal.

    Parameters
    ----------
    model:
        The plain cell; effects that it has are fitted alongside.
    views:
        The log that the plan would give; corners are not looked at.
    noise:
        Of corners and flange.
    """
    taken = {p.effect.label for p in model.effects}
    effects = [
        Present(effect, usual_shape(effect, views))
        for effect in catalogue()
        if effect.missing(views) is None and effect.label not in taken
    ]
    found = pose_information(model, views, effects, noise)
    amounts = np.flatnonzero(found.owner >= 0)
    projected = project_out(found.total, amounts, found.nuisance)
    raw = np.diag(found.total)[amounts]
    # what rounding leaves of a number that the cell's own numbers absorb is nothing
    lost = np.diag(projected) < _LOST * raw
    projected[lost] = projected[:, lost] = 0.0
    reported = tuple(
        _effect_power(at, effects, found, projected, found.owner[amounts])
        for at in range(len(effects))
    )
    frames = int((np.abs(found.frames).max(axis=(1, 2)) > 0.0).sum())
    return Power(reported, unseen(views), noise, frames)


def usual_shape(effect: Effect, views: Views) -> FloatArray:
    """(P,) amounts zero; shapes usual where those are worth trying on such a log, else the middle.

    A thing that slips before the first frame, for one, has not slipped.
    """
    usual = effect.values({})
    tried = [effect.values(shape) for shape in effect.candidates(views)]
    if not tried or any(np.array_equal(values, usual) for values in tried):
        return usual
    return tried[len(tried) // 2]


def _effect_power(
    at: int,
    effects: Sequence[Present],
    found: PoseInformation,
    projected: FloatArray,
    owner: NDArray[np.int64],
) -> EffectPower:
    mine = np.flatnonzero(owner == at)
    own = projected[np.ix_(mine, mine)]
    unknowns = [found.unknowns[k] for k in found.of(at)]
    typical = np.array([u.typical for u in unknowns])
    needed = noncentrality(_rank(own), FALSE_ALARM / len(effects), DETECTION)
    limits = tuple(
        Limit(u.name.split(".", 1)[1], u.unit, u.typical, _smallest(own[k, k], needed))
        for k, u in enumerate(unknowns)
    )
    strength = float(typical**2 @ np.diag(own))
    rivals = _rivals(at, effects, projected, owner, typical) if strength >= needed else ()
    return EffectPower(effects[at].effect, strength, needed, limits, rivals)


def _smallest(information: float, needed: float) -> float | None:
    return float(np.sqrt(needed / information)) if information > 0.0 else None


def _rank(information: FloatArray) -> int:
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    value = np.linalg.eigvalsh(information * scale[:, None] * scale[None, :])
    return max(int((value > 1e-7).sum()), 1)


def _rivals(
    at: int,
    effects: Sequence[Present],
    projected: FloatArray,
    owner: NDArray[np.int64],
    typical: FloatArray,
) -> tuple[Rival, ...]:
    mine = np.flatnonzero(owner == at)
    strength = float(typical**2 @ np.diag(projected)[mine])
    found = []
    for other, present in enumerate(effects):
        if other == at or _contains(present.effect, effects[at].effect):
            continue
        rest = project_out(projected, mine, np.flatnonzero(owner == other))
        left = max(float(typical**2 @ np.diag(rest)), 0.0)
        if left < DECISIVE:
            distinguishing = experiment(effects[at].effect, present.effect)
            found.append(Rival(present.effect.label, left, 1.0 - left / strength, distinguishing))
    return tuple(sorted(found, key=lambda rival: rival.strength))


def _contains(other: Effect, effect: Effect) -> bool:
    """Whether the other is the free curve of which this one is a law: no rival, but a cover."""
    return other.name == effect.name and "free" in (other.law, effect.law)


def alike(power: Power) -> list[tuple[EffectPower, Rival]]:
    """Every pair that the plan could not distinguish once, from the side that is harder."""
    by_label = {e.effect.label: e for e in power.effects}
    pairs = []
    for first, second in combinations(by_label, 2):
        sides = [
            (by_label[one], rival)
            for one, two in ((first, second), (second, first))
            for rival in by_label[one].rivals
            if rival.label == two
        ]
        if sides:
            pairs.append(min(sides, key=lambda side: side[1].strength))
    return sorted(pairs, key=lambda pair: pair[1].strength)
