"""The smallest distance between bodies along a joint move, without a gap in the checking.

Conservative advancement (B. Mirtich, "Timewarp rigid body simulation", SIGGRAPH 2000, section 4):
from a pose where the nearest two bodies are so far apart, the arm may go on until one of them can
have covered that way, and nothing in between needs a look.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from calib.bodies.gap import hull_gap
from calib.chain.kinematics.dh import place_links


@njit(cache=True, nogil=True, error_model="numpy")
def _place(poses, points, first, count, link, middle, points_out, middle_out):  # type: ignore[no-untyped-def]
    for s in range(link.shape[0]):
        pose = poses[link[s]]
        for i in range(3):
            middle_out[s, i] = pose[i, 3]
            for j in range(3):
                middle_out[s, i] += pose[i, j] * middle[s, j]
            for k in range(first[s], first[s] + count[s]):
                points_out[k, i] = pose[i, 3]
                for j in range(3):
                    points_out[k, i] += pose[i, j] * points[k, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _before(points, start, normal, place):  # type: ignore[no-untyped-def]
    """Distance of points from the plane through `start`, seen along its normal."""
    best = np.inf
    for k in range(points.shape[0]):
        ahead = 0.0
        for i in range(3):
            ahead += normal[i] * (points[k, i] - start[i])
        if ahead < best:
            best = ahead
            place[:] = points[k]
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def _apart(a, b, points, first, count, normal, place):  # type: ignore[no-untyped-def]
    """Distance of two shapes without the balls that sweep them."""
    one = points[first[a] : first[a] + count[a]]
    other = points[first[b] : first[b] + count[b]]
    if normal[b, 0] != 0.0 or normal[b, 1] != 0.0 or normal[b, 2] != 0.0:
        return _before(one, other[0], normal[b], place)
    return hull_gap(one, other, place)


@njit(cache=True, nogil=True, error_model="numpy")
def _at_least(a, b, middle, around, normal):  # type: ignore[no-untyped-def]
    """Distance of the balls that enclose two shapes, or of a ball and what is behind a plane."""
    square = ahead = 0.0
    for i in range(3):
        square += (middle[a, i] - middle[b, i]) ** 2
        ahead += normal[b, i] * (middle[a, i] - middle[b, i])
    plane = normal[b, 0] != 0.0 or normal[b, 1] != 0.0 or normal[b, 2] != 0.0
    return (ahead if plane else np.sqrt(square)) - around[a] - around[b]


@njit(cache=True, nogil=True, error_model="numpy")
def smallest_gap(start, travel, chain, shapes, pairs, of_pairs, bounds, out):  # type: ignore[no-untyped-def]
    """Write the smallest distance along a straight joint move, and where it is.

    Parameters
    ----------
    start, travel:
        (J,) joint angles at the start and the way to the end, radians.
    chain:
        (rows (J, 5), ends (2, 4, 4)), see `ArmKinematics`.
    shapes:
        (points (P, 3), first (S,), count (S,), radius (S,), link (S,), middle (S, 3),
        around (S,), normal (S, 3)): all points in their links' frames, and of each shape its
        points, radius, link, the ball that encloses it, and the normal of what is behind a plane.
    pairs:
        (Q, 2) shapes that must not come near each other.
    of_pairs:
        (speed (Q,), spare (Q,)): how far the two can approach each other over the whole move, and
        what is taken off their distance, metres.
    bounds:
        (end below, shortest step, longest step): a distance at which to end at once, and steps as
        shares of the move.
    out:
        (6,) written: distance, share of the move, pair, place of the first shape there.
    """
    points, first, count, radius, link, middle, around, normal = shapes
    enough, shortest, longest = bounds
    speed, spare = of_pairs
    rows, ends = chain
    poses = np.empty((rows.shape[0] + 1, 4, 4))
    placed, centre, place = np.empty_like(points), np.empty_like(middle), np.empty(3)
    out[0], share = np.inf, 0.0
    while True:
        place_links(start + share * travel, rows, ends, poses)
        _place(poses, points, first, count, link, middle, placed, centre)
        best, step = np.inf, longest
        for k in range(pairs.shape[0]):
            a, b = pairs[k, 0], pairs[k, 1]
            least = _at_least(a, b, centre, around, normal) - spare[k]
            if least >= best and least - enough >= step * speed[k]:
                continue
            gap = _apart(a, b, placed, first, count, normal, place)
            gap -= radius[a] + radius[b] + spare[k]
            step = min(step, (gap - enough) / max(speed[k], 1e-12))
            best = min(best, gap)
            if gap < out[0]:
                out[0], out[1], out[2] = gap, share, k
                out[3:] = place
        if share >= 1.0 or best < enough:
            return
        share = min(1.0, share + max(step, shortest))
