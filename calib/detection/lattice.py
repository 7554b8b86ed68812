"""Joins candidates into a lattice: neighbours along edges, then whole numbers for all."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calib.detection.candidates import Candidates, FloatArray

IntArray = NDArray[np.int64]

_NEIGHBOURS = 28
_ALIGNMENT_RAD = 0.30
_FEWEST_CORNERS = 6


@dataclass(frozen=True)
class Lattice:
    """Corners with whole-number places, one connected piece of a board.

    Attributes
    ----------
    cells:
        (K, 2) integer (i, j); i runs 90 degrees clockwise (as seen) from j.
    xy:
        (K, 2) pixels.
    dark_first:
        Whether the square between the directions +j and +i of a cell with i + j even is dark.
    """

    cells: IntArray
    xy: FloatArray
    dark_first: bool

    def __len__(self) -> int:
        return len(self.cells)


@numba.njit(cache=True)
def _turn(angle: float) -> float:
    """The angle brought into (-pi, pi]."""
    return angle - 2 * math.pi * math.ceil(angle / (2 * math.pi) - 0.5)


@numba.njit(cache=True, nogil=True)
def _nearest_along(xy: Any, rays: Any, near: Any, alignment: float) -> Any:
    """(K, 4) the nearest candidate along each ray whose own ray points back, or -1.

    An edge has its dark side on the other hand when followed from the other end, so an even ray
    can only meet an odd one.
    """
    K = xy.shape[0]
    best = np.full((K, 4), -1)
    for p in range(K):
        for ray in range(4):
            least = 1e300
            for n in range(1, near.shape[1]):
                q = near[p, n]
                if q >= K:
                    break
                dx, dy = xy[q, 0] - xy[p, 0], xy[q, 1] - xy[p, 1]
                distance = math.hypot(dx, dy)
                heading = math.atan2(dy, dx)
                off = abs(_turn(heading - rays[p, ray]))
                if off > alignment:
                    continue
                back = 1e300
                for other in range(1 - ray % 2, 4, 2):
                    back = min(back, abs(_turn(heading + math.pi - rays[q, other])))
                if back > alignment:
                    continue
                cost = distance * (1.0 + 2.0 * (off + back))
                if cost < least:
                    least, best[p, ray] = cost, q
    return best


def _links(candidates: Candidates) -> tuple[IntArray, IntArray]:
    """(K, 4) mutual neighbours along each ray, -1 where there is none, and their ray back."""
    K = len(candidates)
    count = min(_NEIGHBOURS, K)
    _, near = cKDTree(candidates.xy).query(candidates.xy, k=count)
    best = _nearest_along(
        candidates.xy, candidates.rays_rad, near.reshape(K, count), _ALIGNMENT_RAD
    )
    answers = best[best] == np.arange(K)[:, None, None]
    return np.where((best >= 0) & answers.any(axis=2), best, -1), answers.argmax(axis=2)


def _spread(
    start: int, links: list[list[int]], back: list[list[int]], free: list[bool]
) -> tuple[list[int], list[tuple[int, int]]]:
    """Number the piece that hangs together with `start`, breadth first.

    Each member carries which of its rays is the +j direction; a step along ray k goes
    k - turn quarter turns clockwise from +j.
    """
    moves = ((0, 1), (1, 0), (0, -1), (-1, 0))
    members, cells = [start], [(0, 0)]
    place = {start: (0, 0, 0)}
    taken = {(0, 0)}
    free[start] = False
    queue = deque([start])
    while queue:
        p = queue.popleft()
        i, j, turn = place[p]
        for ray in range(4):
            q = links[p][ray]
            if q < 0 or not free[q]:
                continue
            quarter = (ray - turn) % 4
            cell = (i + moves[quarter][0], j + moves[quarter][1])
            if cell in taken:
                continue
            free[q] = False
            taken.add(cell)
            place[q] = (*cell, (back[p][ray] - (quarter + 2)) % 4)
            members.append(q)
            cells.append(cell)
            queue.append(q)
    return members, cells


def grow_lattices(candidates: Candidates) -> list[Lattice]:
    """All pieces of at least six corners, the largest first."""
    if len(candidates) < _FEWEST_CORNERS:
        return []
    links, back = _links(candidates)
    neighbours = (links >= 0).sum(axis=1)
    # plain lists: picking single numbers out of arrays takes several times as long
    of_links, of_back, free = links.tolist(), back.tolist(), (neighbours >= 1).tolist()
    pieces = []
    for start in np.argsort(-neighbours, kind="stable").tolist():
        if not free[start]:
            continue
        members, cells = _spread(start, of_links, of_back, free)
        if len(members) >= _FEWEST_CORNERS:
            # ray 0 of the start is its +j direction, and the sector after ray 0 is dark
            pieces.append(Lattice(np.array(cells), candidates.xy[members], dark_first=True))
    return sorted(pieces, key=len, reverse=True)
