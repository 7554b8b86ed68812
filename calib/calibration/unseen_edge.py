"""Rows and columns of a marked board that no picture shows although it reaches beyond them.

A ChArUco board or AprilGrid with fewer squares than described looks, in one picture, like one that
is seen in part. Over all pictures it does not: a part that is there comes into some of them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from calib.calibration.caution import Caution
from calib.views import FloatArray, Views

_FEWEST_FRAMES = 3
"""A hand or a reflection may hide an edge in one picture or two."""

_SHARE_SEEN = 0.5
"""Of the last line that is seen, in a picture that counts: there the board is in sight, and sharp
enough, right up to the missing line."""

_MARGIN_STEPS = 1.0
"""From the missing line's corners to the picture's edge: their squares have to be in it, too."""


def unseen_edge(views: Views) -> Iterator[Caution]:
    """A caution for each edge of the board that is missing in all pictures, though inside some.

    Where the missing corners would be is continued from the two lines next to them, in each
    picture by itself: one step, in which neither lens nor perspective matters.
    """
    board = views.board
    if not board.identified or not len(views.frame):
        return
    grid = views.corners_px.reshape(-1, board.rows, board.cols, 2)
    across, down = board.places
    yield from _beyond(views, "row", grid, down)
    yield from _beyond(views, "column", np.swapaxes(grid, 1, 2), across)


def _beyond(views: Views, name: str, lines: FloatArray, places: FloatArray) -> Iterator[Caution]:
    """Cautions for the lines behind the last and before the first that any picture shows.

    `lines` (N, L, K, 2) are the corners of L lines that stand at `places` (L,) of the board.
    """
    seen = np.flatnonzero(np.any(np.isfinite(lines).all(axis=3), axis=(0, 2)))
    if len(seen) < 2:
        return
    first, last = int(seen[0]), int(seen[-1])
    for edge, towards, missing in (
        (last, 1, range(last + 1, lines.shape[1])),
        (first, -1, range(first)),
    ):
        if not missing:
            continue
        before, beyond = edge - towards, edge + towards
        ratio = (places[beyond] - places[edge]) / (places[edge] - places[before])
        inside = _inside(views, lines[:, edge], lines[:, before], float(ratio))
        if inside >= _FEWEST_FRAMES:
            yield _caution(views, name, missing, inside)


def _inside(views: Views, edge: FloatArray, before: FloatArray, ratio: float) -> int:
    """In how many pictures the line beyond `edge` (N, K, 2) would be, its squares included."""
    step = edge - before
    beyond = edge + ratio * step
    room = _MARGIN_STEPS * np.linalg.norm(step, axis=2)[..., None]
    size = np.array([views.width_px, views.height_px])
    known = np.isfinite(step).all(axis=2)
    fits = ((beyond - room >= 0) & (beyond + room <= size - 1)).all(axis=2)
    whole = (fits | ~known).all(axis=1) & (known.mean(axis=1) >= _SHARE_SEEN)
    return int(whole.sum())


def _caution(views: Views, name: str, missing: range, inside: int) -> Caution:
    rows, cols = views.board.rows, views.board.cols
    lines = f"{name} {missing[0]}"
    if len(missing) > 1:
        lines = f"{name}s {missing[0]} to {missing[-1]}"
    return Caution(
        f"the board may be smaller than described: of {rows} x {cols} corners {lines} are in no"
        f" picture, though {inside} of {len(views.frame)} reach beyond them",
        f"board; {lines} of its corners",
        "compare the numbers of squares in `board` with the print; if they are right, something"
        " covers that edge of the board in every picture",
    )
