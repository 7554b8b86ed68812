"""Single poses in another unit of length than the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_consistency.odd_frames import READ_OTHERWISE, OddFrames
from calib.views import FloatArray, Views

UNITS = {
    "millimetre": 1e-3,
    "centimetre": 1e-2,
    "inch": 0.0254,
    "micrometre": 1e-6,
    "foot": 0.3048,
}
"""Metres in each unit that a log might be written in."""


def find_single_units(views: Views, odd: OddFrames, loop: FloatArray) -> Mixup | None:
    """Name the odd frames whose position fits once it is read in another unit.

    Parameters
    ----------
    views, odd:
        The frames, and which do not fit their pose.
    loop:
        (N, 4, 4) mounted_from_fixed of the free poses.
    """
    expected = odd.closure.expected(loop)
    found: dict[int, str] = {}
    for name, metres in UNITS.items():
        poses = views.base_from_flange.copy()
        poses[:, :3, 3] *= metres
        for i in np.flatnonzero(odd.odd):
            if odd.miss(expected[i], poses[[i]])[0] < READ_OTHERWISE:
                found.setdefault(int(views.frame[i]), name)
    if not found:
        return None

    def mend(some: Views, neighbours: Views) -> Views:
        poses = some.base_from_flange.copy()
        for i, frame in enumerate(some.frame):
            poses[i, :3, 3] *= UNITS[found[int(frame)]] if int(frame) in found else 1.0
        return replace(some, base_from_flange=poses)

    reported = ", ".join(f"that of frame {frame} is in {unit}s" for frame, unit in found.items())
    return Mixup(
        name="length_unit",
        physics=f"The log says metres, but not every position is: {reported}.",
        remedy="Correct the unit in the program that writes the log.",
        mend=mend,
        parameters={"frames": (float(len(found)), "frame")},
    )
