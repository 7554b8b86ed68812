"""Frames that hand-eye left out because the lens was wrong, not their pose.

Hand-eye judges a logged pose by the pose that one constant camera gives to the picture. Where the
lens moves, that pose is off by centimetres at the ends of the range, and a good frame there looks
like a mix-up of the log. The joint fit, whose lens may move, judges it again.
"""

from __future__ import annotations

import numpy as np

from calib.chain.model import CellModel, predict
from calib.views import BoolArray, FloatArray, Views

_AS_FAR = 1.5
"""A frame this many times as far off as the worst of those that took part may take part, too; a
pose that belongs to another picture is farther off by orders of magnitude."""


def cleared(model: CellModel, views: Views, taken: BoolArray, suspected: BoolArray) -> BoolArray:
    """(N,) which of the suspected frames lie as near to their logged pose as others do.

    Parameters
    ----------
    model:
        The cell as the joint fit of the `taken` frames found it.
    views:
        All N, with corners that do not count as NaN.
    """
    miss = _miss_px(model, views)
    return np.asarray(suspected & (miss <= _AS_FAR * np.nanmax(miss[taken])))


def _miss_px(model: CellModel, views: Views) -> FloatArray:
    """(N,) median distance of a frame's corners from where its logged pose puts them."""
    distance = np.linalg.norm(views.corners_px - predict(model, views), axis=2)
    miss = np.full(len(views), np.nan)
    shown = np.isfinite(distance).any(axis=1)
    miss[shown] = np.nanmedian(distance[shown], axis=1)
    return miss
