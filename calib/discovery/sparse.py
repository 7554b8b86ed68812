"""Which of an effect's amounts the data ask for: a fault of one joint should not pay for six."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from calib.chain.effect import Present
from calib.discovery.score import Score, bic
from calib.views import FloatArray, Views

_DEPENDENT = 1e-7


@dataclass(frozen=True)
class Picked:
    """The amounts that were picked.

    Attributes
    ----------
    present:
        The effect with the other amounts held.
    gain, columns:
        What the picked ones are expected to gain, and how many numbers that takes.
    ways:
        Logarithm of the number of picks of that size: picking has its price.
    """

    present: Present
    gain: float
    columns: int
    ways: float


def pick(present: Present, score: Score, views: Views) -> Picked:
    """Pick amounts one by one, each time the one that gains most, and stop at the best criterion.

    All of them are taken where that is as good, and where single ones make no sense.
    """
    free = present.free
    everything = Picked(present, score.gain, score.columns, 0.0)
    if len(free) < 2 or not present.effect.separable:
        return everything
    best, worth = everything, bic(score.gain, score.columns, views)
    shapes = sum(p.role == "shape" for p in present.effect.parameters)
    chosen: list[int] = []
    for k, gain in _one_by_one(score.information, score.gradient):
        chosen.append(k)
        ways = _log_ways(len(free), len(chosen))
        columns = len(chosen) + shapes
        reached = bic(gain, columns, views) - 2.0 * ways
        if reached > worth:
            held = present.held | {free[j] for j in range(len(free)) if j not in chosen}
            best = Picked(Present(present.effect, present.values, held), gain, columns, ways)
            worth = reached
    return best


def _log_ways(many: int, few: int) -> float:
    return float(gammaln(many + 1) - gammaln(few + 1) - gammaln(many - few + 1))


def _one_by_one(information: FloatArray, gradient: FloatArray) -> list[tuple[int, float]]:
    """Columns in the order of what each gains beside those before it, with the sums of gains."""
    matrix, right = information.copy(), gradient.copy()
    first = np.maximum(np.diag(information), 1e-300)
    total, order = 0.0, []
    left = list(range(len(right)))
    while left:
        own = np.diag(matrix)
        alone = [right[k] ** 2 / own[k] if own[k] > _DEPENDENT * first[k] else -1.0 for k in left]
        at = int(np.argmax(alone))
        if alone[at] < 0.0:
            break
        k = left.pop(at)
        total += alone[at]
        order.append((k, total))
        ratio = matrix[:, k] / own[k]
        right = right - ratio * right[k]
        matrix = matrix - np.outer(ratio, matrix[k])
    return order
