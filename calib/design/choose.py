"""Which of many candidate views to take, for the least uncertainty of what is needed.

The criterion is the geometric mean of the needs' standard errors: one per cent less of any of them
counts alike, in whatever unit, so pixels need not be weighed against millimetres. Views are taken
greedily and then exchanged one by one while that helps (Fedorov 1972; Cook and Nachtsheim 1980).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.design.needs import Need
from calib.views import FloatArray

_RIDGE = 1e-10
"""Of all candidates' information together: makes the first few views comparable."""

_MOST_PASSES = 6


class Criterion:
    """Standard errors of the needs for sums of the candidates' information.

    Parameters
    ----------
    candidates:
        (C, p, p) information that each candidate view brings.
    needs:
        What to make certain.
    """

    def __init__(self, candidates: FloatArray, needs: Sequence[Need]) -> None:
        scale = 1.0 / np.sqrt(np.maximum(np.einsum("cii->i", candidates), 1e-300))
        both = scale[:, None] * scale[None, :]
        self.candidates = candidates * both
        self.start = _RIDGE * np.eye(len(scale))
        self._weights = np.array([need.weight * both for need in needs])

    def sigma(self, information: FloatArray) -> FloatArray:
        """(..., K) standard errors for (..., p, p) scaled information."""
        covariance = np.linalg.inv(information)
        square = np.einsum("...ij,kji->...k", covariance, self._weights)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))

    def best(self, information: FloatArray, among: NDArray[np.int64]) -> int:
        """The candidate to add for the least geometric mean of the standard errors."""
        with_one = information + self.candidates[among]
        cost = np.log(np.maximum(self.sigma(with_one), 1e-300)).sum(axis=-1)
        return int(among[np.argmin(cost)])


def choose_views(criterion: Criterion, slots: Sequence[NDArray[np.int64]]) -> tuple[int, ...]:
    """Fill every slot with one of the candidates that may stand in it, none twice.

    Parameters
    ----------
    criterion:
        Over all candidates.
    slots:
        For each view to be taken the indices of its candidates. A slot whose candidates are all
        taken stays empty.

    Returns
    -------
    The candidate of each slot that could be filled.
    """
    picked = np.full(len(slots), -1)
    for _ in range(1 + _MOST_PASSES):
        before = picked.copy()
        for at, slot in enumerate(slots):
            others = np.delete(picked, at)
            others = others[others >= 0]
            free = np.setdiff1d(slot, others)
            if len(free):
                information = criterion.start + criterion.candidates[others].sum(axis=0)
                picked[at] = criterion.best(information, free)
        if np.array_equal(picked, before):
            break
    return tuple(int(k) for k in picked[picked >= 0])
