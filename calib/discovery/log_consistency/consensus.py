"""Which frames' pictures and poses agree with each other, however many of the others do not.

Camera and flange turn by the same angle between two frames, whatever the hand-eye transform: no
closure has to be solved, and so none can be spoilt by the frames that are off (the invariant of
Chen, CVPR 1991; consensus by the largest set of mutual agreement, as in RANSAC).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from calib.views import BoolArray, FloatArray

TOLERANCES_RAD = (3e-3, 1e-2, 3e-2)
"""Of the angles' difference: a good arm, an ordinary one, one that closes to a degree or two."""

_MUTUAL_SHARE = 0.6


def angle_misfits(mounted_from_fixed: FloatArray, base_from_flange: FloatArray) -> FloatArray:
    """(N, N) difference of the angles by which camera and flange turned; NaN where not known."""
    known = np.asarray(
        (np.isfinite(mounted_from_fixed) & np.isfinite(base_from_flange)).all(axis=(1, 2))
    )
    out = np.full((len(known), len(known)), np.nan)
    rows = np.flatnonzero(known)
    if len(rows):
        turned = [
            _relative_angles(np.swapaxes(mounted_from_fixed[rows, :3, :3], 1, 2)),
            _relative_angles(base_from_flange[rows, :3, :3]),
        ]
        out[np.ix_(rows, rows)] = np.abs(turned[0] - turned[1])
    return out


def _relative_angles(rotation: FloatArray) -> FloatArray:
    n = len(rotation)
    i, j = np.divmod(np.arange(n * n), n)
    return np.asarray(
        Rotation.from_matrix(np.swapaxes(rotation[i], 1, 2) @ rotation[j]).magnitude()
    ).reshape(n, n)


def agreeing(misfits: FloatArray, tolerance_rad: float) -> BoolArray:
    """(N,) the largest set of frames that agree with most of each other."""
    close = np.nan_to_num(misfits, nan=np.inf) < tolerance_rad
    chosen = close[int(close.sum(axis=1).argmax())]
    for _ in range(3):
        if not chosen.any():
            break
        chosen = close[:, chosen].mean(axis=1) > _MUTUAL_SHARE
    return np.asarray(chosen)
