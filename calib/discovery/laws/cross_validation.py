"""What each effect is worth to frames that had no say in its amounts.

The fit's quadratic forms, frame by frame, let blocks of frames be left out and predicted at the
price of a few small solutions: the noise levels and the shapes stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.discovery.laws.frames import FrameBlocks, inverse_root
from calib.solver.joint import JointFit
from calib.views import BoolArray, FloatArray

_FOLDS = 8
_BLOCK_FRAMES = 2


_BEYOND_CHANCE = 1.64
"""One-sided 5 %: so many standard errors above zero is a gain in frames that had no say."""

_BEYOND_SELECTION = 2.33
"""One-sided 1 %: of a hundred thousand laws the best is the one that chance favours."""


@dataclass(frozen=True)
class Worth:
    """What the left-out frames lose without an effect.

    Attributes
    ----------
    minus_two_log:
        Rise of -2 log likelihood over all frames, each left out once.
    sigma:
        Its standard error, from how differently the frames gain: corners of one picture may err
        alike, which the likelihood of each does not know.
    gain_px:
        Rise of the RMS distance of the corners from where they are predicted by the log alone.
    """

    minus_two_log: float
    sigma: float
    gain_px: float

    @property
    def supported(self) -> bool:
        """Whether the left-out frames want the effect, beyond chance."""
        return self.minus_two_log > _BEYOND_CHANCE * self.sigma

    @property
    def supports_a_law(self) -> bool:
        """The same of a law, which was picked among very many for these very frames."""
        return self.minus_two_log > _BEYOND_SELECTION * self.sigma


def folds(frames: int) -> NDArray[np.int64]:
    """(N,) number of the fold: short blocks of neighbours, dealt round."""
    return (np.arange(frames) // _BLOCK_FRAMES) % min(_FOLDS, max(frames // _BLOCK_FRAMES, 2))


class CrossValidation:
    """Every fold of a fit solved once without its own frames."""

    def __init__(self, fit: JointFit, blocks: FrameBlocks) -> None:
        self.fit, self.blocks = fit, blocks
        fold = folds(len(blocks.gradient))
        self.left_out = [fold == k for k in np.unique(fold)]
        self.train = [blocks.base(~out) for out in self.left_out]
        self.whole = self._lost(np.zeros(0, dtype=np.int64), np.zeros(0))

    def without(self, effect: int) -> Worth:
        """What the effect of that index in the fit's model is worth."""
        numbers = range(len(self.fit.model.effects[effect].values))
        return self.without_numbers({(effect, k) for k in numbers})

    def without_numbers(self, numbers: set[tuple[int, int]]) -> Worth:
        """What some fitted numbers, (effect, place) each, are worth; shapes stay as they are."""
        mine, zero = [], []
        for k, unknown in enumerate(self.fit.unknowns):
            kind, effect, place = unknown.place
            if kind == "effect" and (effect, place) in numbers:
                present = self.fit.model.effects[effect]
                amount = present.effect.parameters[place].role == "amount"
                mine.append(k)
                zero.append(-present.values[place] if amount else 0.0)
        lost = self._lost(np.array(mine, dtype=np.int64), np.array(zero))
        more = lost[0] - self.whole[0]
        sigma = float(np.sqrt(len(more)) * more.std())
        return Worth(float(more.sum()), sigma, lost[1] - self.whole[1])

    def _lost(self, held: NDArray[np.int64], at: FloatArray) -> tuple[FloatArray, float]:
        """(N,) -2 log likelihood but for a constant, and RMS px, some numbers held at a step."""
        free = np.setdiff1d(np.arange(self.blocks.shared), held)
        quadratic = np.zeros(len(self.blocks.gradient))
        square_px, weight = 0.0, 0.0
        for out, (information, gradient) in zip(self.left_out, self.train, strict=True):
            step = np.zeros(self.blocks.shared)
            step[held] = at
            right = gradient[free] - information[np.ix_(free, held)] @ at
            root = inverse_root(information[np.ix_(free, free)])
            step[free] = root @ (root.T @ right)
            quadratic[out] = _form(self.blocks.information, self.blocks.gradient, out, step)
            moved_px = _form(self.blocks.pixel_information, self.blocks.pixel_gradient, out, step)
            square_px += float(moved_px.sum())
            square_px += float(self.blocks.pixel_square[out].sum())
            weight += float(self.blocks.corners[out].sum())
        return quadratic, float(np.sqrt(max(square_px, 0.0) / max(weight, 1.0)))


def _form(
    information: FloatArray, gradient: FloatArray, frames: BoolArray, step: FloatArray
) -> FloatArray:
    """(n,) of the chosen frames."""
    t = len(step)
    h, g = information[frames, :t, :t], gradient[frames, :t]
    return np.asarray((h @ step) @ step - 2.0 * g @ step)
