"""Random numbers of one source that depend on what is done, not on what was done before.

A run that was interrupted and gone on with then scatters as one that was not.
"""

from __future__ import annotations

import hashlib
from collections import Counter

import numpy as np

from calib.views import FloatArray

_STEP_RAD = 1e-6
"""Joint angles nearer to each other than this are the same place."""


class PlacedNoise:
    """A generator for each place, and for each time that something is done there.

    Parameters
    ----------
    seed, stream:
        Of the cell, and of the source of noise.
    """

    def __init__(self, seed: int, stream: int) -> None:
        self._seed, self._stream = seed, stream
        self._times: Counter[bytes] = Counter()

    def at(self, *places_rad: FloatArray) -> np.random.Generator:
        """The generator for what is done at these joint angles for the next time."""
        steps = [np.rint(np.asarray(place) / _STEP_RAD).astype(np.int64) for place in places_rad]
        place = hashlib.sha256(b"".join(step.tobytes() for step in steps)).digest()[:8]
        self._times[place] += 1
        key = int.from_bytes(place, "little")
        return np.random.default_rng([self._seed, self._stream, key, self._times[place]])
