"""What could have been known: the true model fitted to the same frames, and the plain one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.discovery.recordings import Concealed, state
from benchmarks.discovery.world import Array

_STEP = np.array([1.0, 1.0, 1.0, *[1e-4] * 12])
_ROUNDS = 5


@dataclass(frozen=True)
class Oracle:
    """Held-out RMS (px) of the plain and the true model; what the truth gains in -2 log."""

    plain_px: float
    true_px: float
    gain: float
    numbers: int

    @property
    def detectable(self) -> bool:
        """Whether the truth pays for its size by the Bayesian criterion and a margin of eight."""
        return bool(self.gain > 8.0 + np.log(self.numbers))


def consult(case: Concealed) -> Oracle:
    """Fit both models by Gauss and Newton on differences; physics by their sizes."""
    plain, plain_left = _fit(case, 0)
    true, true_left = _fit(case, len(case.physics))
    numbers = 6 * int((~case.ahead).sum())
    gain = numbers * float(np.log(plain_left / true_left))
    return Oracle(_miss(case, plain), _miss(case, true), gain, numbers)


def _fit(case: Concealed, sizes: int) -> tuple[Array, float]:
    x = np.zeros(15 + sizes)
    x[15:] = [size for _, size in case.physics][:sizes]
    step = np.concatenate([_STEP, np.full(sizes, 0.05)])
    seen = ~case.ahead
    for _ in range(_ROUNDS):
        left = (case.pixels - _pixels(case, x))[seen].ravel()
        columns = [
            (_pixels(case, x + e) - _pixels(case, x - e))[seen].ravel() / (2 * h)
            for h, e in zip(step, np.diag(step), strict=True)
        ]
        x = x + np.linalg.lstsq(np.stack(columns, axis=1), left, rcond=1e-12)[0]
    left = (case.pixels - _pixels(case, x))[seen]
    return x, float(np.mean(left**2))


def _pixels(case: Concealed, x: Array) -> Array:
    physics = tuple(
        (what, float(size)) for (what, _), size in zip(case.physics, x[15:], strict=False)
    )
    return state(case.cell.shifted(x[:15]), case.log["joints"], case.log, physics).pixels()


def _miss(case: Concealed, x: Array) -> float:
    miss = (_pixels(case, x) - case.true_pixels)[case.ahead]
    return float(np.sqrt((miss**2).sum(-1).mean()))
