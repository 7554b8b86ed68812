"""Which poses distinguish two rivals: T-optimal design (Atkinson, Fedorov 1975).

Poses are taken one after the other, each the one that adds most to what is left of the first
effect's trace when the second has been fitted to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.chain.effect import Effect, Present
from calib.chain.model import CellModel
from calib.solver.noise import Noise
from calib.solver.pose_information import PoseInformation, pose_information
from calib.views import FloatArray, Views

_DRAWS = 200
_RIDGE = 1e-11
_MOST_SHAPES = 12


@dataclass(frozen=True)
class Contest:
    """Two rivals, one of them with its amounts, and what each pose says about them.

    Attributes
    ----------
    information:
        Of recorded poses first, candidates after them; effect 0 is the first rival.
    recorded:
        How many poses were recorded.
    amounts:
        (a,) of the first rival: how large it is thought to be.
    """

    information: PoseInformation
    recorded: int
    amounts: FloatArray

    def strength(self, information: FloatArray) -> FloatArray:
        """Noncentrality (...) of the first rival given the second, for (..., p, p)."""
        mine = self.information.of(0)
        rest = np.flatnonzero(self.information.owner != 0)
        scale = np.sqrt(np.maximum(np.einsum("...ii->...i", information), 1e-300))[..., rest]
        block = information[..., rest[:, None], rest] / scale[..., :, None] / scale[..., None, :]
        block = block + _RIDGE * np.eye(len(rest))
        right = (information[..., rest[:, None], mine] @ self.amounts) / scale
        trace = np.einsum(
            "i,...ij,j->...", self.amounts, information[..., mine[:, None], mine], self.amounts
        )
        fitted = np.linalg.solve(block, right[..., None])[..., 0]
        return np.asarray(np.maximum(trace - (right * fitted).sum(axis=-1), 0.0))

    @property
    def start(self) -> FloatArray:
        """(p, p) of the recorded poses."""
        return np.asarray(self.information.frames[: self.recorded].sum(axis=0))

    @property
    def candidates(self) -> FloatArray:
        """(C, p, p) of the candidates."""
        return self.information.frames[self.recorded :]


@dataclass(frozen=True)
class Design:
    """The poses picked, and noncentralities: recorded, with them, with as many random ones."""

    picked: tuple[int, ...]
    before: float
    after: float
    at_random: float

    @property
    def ratio(self) -> float:
        """How many times more they add than as many random candidates (median of many draws)."""
        return (self.after - self.before) / max(self.at_random - self.before, 1e-12)


def contest(
    model: CellModel, first: Present, second: Effect, views: Views, recorded: int, noise: Noise
) -> Contest:
    """Set two rivals against each other, the second in the shape that mimics the first best.

    Parameters
    ----------
    model:
        The cell without either of them.
    first:
        With the amounts that were found.
    second:
        Its rival.
    views:
        The log of the recorded poses, and after them of the candidates.
    recorded:
        How many were recorded.
    noise:
        Of corners and flange.
    """
    amounts = first.values[list(first.free)]
    shapes: Sequence[FloatArray] = [second.values(s) for s in second.candidates(views)]
    step = max(1, -(-len(shapes) // _MOST_SHAPES))
    tried = [
        Contest(
            pose_information(
                model, views.take(np.arange(recorded)), [first, Present(second, shape)], noise
            ),
            recorded,
            amounts,
        )
        for shape in shapes[::step]
    ]
    hardest = int(np.argmin([float(c.strength(c.start)) for c in tried]))
    rival = Present(second, shapes[::step][hardest])
    return Contest(pose_information(model, views, [first, rival], noise), recorded, amounts)


def t_optimal(given: Contest, count: int, seed: int = 1) -> Design:
    """Pick so many candidates greedily, and hold them against random ones."""
    candidates, information = given.candidates, given.start
    left, picked = np.arange(len(candidates)), []
    for _ in range(min(count, len(candidates))):
        best = int(np.argmax(given.strength(information + candidates[left])))
        picked.append(int(left[best]))
        information = information + candidates[left[best]]
        left = np.delete(left, best)
    rng = np.random.default_rng(seed)
    drawn = [
        given.start + candidates[rng.permutation(len(candidates))[:count]].sum(axis=0)
        for _ in range(_DRAWS)
    ]
    return Design(
        tuple(picked),
        float(given.strength(given.start)),
        float(given.strength(information)),
        float(np.median(given.strength(np.array(drawn)))),
    )
