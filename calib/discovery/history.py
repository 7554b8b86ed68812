"""What a frame is known by only beside the frame before it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.views import FloatArray, Views


def with_history(views: Views, log: Views) -> tuple[Views, Views]:
    """Views and log with further columns, worked out from the whole log in the order of frames.

    `since_last_frame_s`, `travel_rad` (the joints' largest angle since then) and `focus_step_m`
    (how far the focus has moved). Those that stand in the log already are kept.
    """
    order = np.argsort(log.frame, kind="stable")
    columns = {
        "since_last_frame_s": _change(log.t_s[order]),
        "travel_rad": np.abs(_change(log.joints_rad[order])).max(axis=1),
        "focus_step_m": _change(log.focus_distance_m[order]),
    }
    known = {k: v for k, v in columns.items() if k not in log.extra and np.isfinite(v).any()}
    frames = log.frame[order]
    return _given(views, frames, known), _given(log, frames, known)


def _change(column: FloatArray) -> FloatArray:
    first = np.full((1, *column.shape[1:]), np.nan)
    return np.concatenate([first, np.diff(column, axis=0)])[: len(column)]


def _given(views: Views, frames: NDArray[np.int64], columns: dict[str, FloatArray]) -> Views:
    row = np.searchsorted(frames, views.frame)
    return replace(views, extra={**views.extra, **{k: v[row] for k, v in columns.items()}})
