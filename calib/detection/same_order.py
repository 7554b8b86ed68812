"""One order of a symmetric board's corners in every frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.detection.orientation import turned_order, turns_to_agree
from calib.views import Views


def same_order_everywhere(views: Views) -> Views:
    """The views with the corners of a symmetric board named alike in every complete frame."""
    whole = np.flatnonzero(views.seen.all(axis=1))
    turns = turns_to_agree(
        views.corners_px[whole], views.board, views.base_from_flange[whole], views.mount
    )
    corners_px, sigma_px = views.corners_px.copy(), views.corner_sigma_px.copy()
    for frame, turn in zip(whole, turns, strict=True):
        order = turned_order(views.board, int(turn))
        corners_px[frame] = views.corners_px[frame, order]
        sigma_px[frame] = views.corner_sigma_px[frame, order]
    return replace(views, corners_px=corners_px, corner_sigma_px=sigma_px)
