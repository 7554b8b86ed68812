"""Frames that had to be left out: a few are chance, a run or a tenth of them is a finding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.calibration.result import Rejection
from calib.distributions import binomial_tail

_BY_CHANCE = 0.02
"""Share of frames that a sound run may lose to a wrong detection or an unlucky pose."""

_ALARM = 1e-3
_RUN = 3
_NOTHING_SEEN = ("no corners", "only ", "no flange pose")
"""Reasons that say that there was nothing to be wrong."""


@dataclass(frozen=True)
class LostFrames:
    """Frames that contradict the others, too many or too close together for chance."""

    where: str
    p_value: float


def lost_frames(rejected: Sequence[Rejection], frames: NDArray[np.int64]) -> LostFrames | None:
    """Judge the frames that were left out although there was something to be seen.

    Parameters
    ----------
    rejected:
        Frames left out, with reasons.
    frames:
        (N,) every frame of the recording, in order.
    """
    odd = {r.frame for r in rejected if not r.reason.startswith(_NOTHING_SEEN)}
    lost = np.isin(frames, list(odd))
    count, longest = int(lost.sum()), _longest_run(lost)
    many = binomial_tail(count - 1, len(frames), _BY_CHANCE)
    run = min(1.0, len(frames) * _BY_CHANCE**longest)
    if count == 0 or (many > _ALARM and longest < _RUN):
        return None
    first, last = int(frames[lost].min()), int(frames[lost].max())
    where = f"{count} frames between {first} and {last} contradict the others and were left out"
    return LostFrames(where, min(many, run))


def _longest_run(lost: NDArray[np.bool_]) -> int:
    longest = here = 0
    for each in lost:
        here = here + 1 if each else 0
        longest = max(longest, here)
    return longest
