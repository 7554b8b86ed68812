"""The order in which views are taken: the shortest way that was found, every move of it allowed.

Nearest neighbour first, then reversing and moving pieces of the way while that shortens it (2-opt,
Croes 1958; or-opt, Or 1976).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from calib.views import FloatArray
from cell.sequencer.guard import Guard
from cell.verbs.plan.reach import Candidate

_MOST_TURN_RAD = np.radians([120.0, 120.0, 120.0, 120.0, 120.0, 360.0])
"""Between two neighbours; what turns more is an arm or a wrist that flips over."""

_NEVER_S = 1e5
_PIECE = 3
_GAIN_S = 1e-9


def shortest_tour(
    candidates: Sequence[Candidate], home_rad: FloatArray, guard: Guard
) -> tuple[list[Candidate], list[Candidate]]:
    """The candidates in order, the arm coming from home; and those that no allowed move leads to.

    Parameters
    ----------
    candidates:
        Each with its joint angles.
    home_rad:
        (6,) where the arm starts.
    guard:
        Allows moves, and knows how long they take.
    """
    joints = np.array([home_rad, *(c.joints_rad for c in candidates)])
    seconds = _seconds(joints, guard)
    way = shortened(nearest_next(seconds), seconds)
    left_out = [b for a, b in pairwise(way) if seconds[a, b] >= _NEVER_S]
    if left_out:
        kept = [k for k in range(len(candidates)) if k + 1 not in left_out]
        tour, further = shortest_tour([candidates[k] for k in kept], home_rad, guard)
        return tour, [*further, *(candidates[k - 1] for k in left_out)]
    return [candidates[k - 1] for k in way[1:]], []


def _seconds(joints: FloatArray, guard: Guard) -> FloatArray:
    """(N, N) time of every move, the same both ways; `_NEVER_S` where it is not allowed."""
    n = len(joints)
    seconds = np.zeros((n, n))
    for a in range(n):
        for b in range(a):
            allowed = bool((np.abs(joints[a] - joints[b]) <= _MOST_TURN_RAD).all())
            allowed = allowed and guard.may_move(joints[a], joints[b])
            reported = guard.move_time_s(joints[a], joints[b]) if allowed else _NEVER_S
            seconds[a, b] = seconds[b, a] = reported
    return seconds


def nearest_next(seconds: FloatArray) -> list[int]:
    way, left = [0], list(range(1, len(seconds)))
    while left:
        nearest = min(left, key=lambda k: seconds[way[-1], k])
        left.remove(nearest)
        way.append(nearest)
    return way


def shortened(way: list[int], seconds: FloatArray) -> list[int]:
    """Change the way as long as a change shortens it, each time by the one that does most."""
    open_end = np.pad(seconds, ((0, 1), (0, 1)))
    end = len(seconds)
    while True:
        at = np.array([*way, end])
        between = open_end[np.ix_(at, at)]
        gain, changed = max((_reversed(way, between), _moved(way, between)), key=lambda c: c[0])
        if gain < _GAIN_S:
            return way
        way = changed


def _reversed(way: list[int], between: FloatArray) -> tuple[float, list[int]]:
    """Gain in seconds and way with the stretch i to j - 1 turned round, for the best i and j."""
    step = np.diag(between, 1)
    gain = step[:-1, None] + step[None, 1:] - between[:-2, 1:-1] - between[1:-1, 2:]
    gain = np.triu(gain, 1)
    i, j = (int(k) + 1 for k in np.unravel_index(np.argmax(gain), gain.shape))
    return float(gain[i - 1, j - 1]), way[:i] + way[i : j + 1][::-1] + way[j + 1 :]


def _moved(way: list[int], between: FloatArray) -> tuple[float, list[int]]:
    """Gain in seconds and way with a piece of a few views put elsewhere, for the best piece."""
    step = np.diag(between, 1)
    best = (0.0, way)
    for size in range(1, _PIECE + 1):
        for i in range(1, len(way) - size + 1):
            last = i + size - 1
            taken_out = step[i - 1] + step[last] - between[i - 1, last + 1]
            put_in = np.minimum(
                between[:-1, i] + between[last, 1:], between[:-1, last] + between[i, 1:]
            )
            gain = taken_out - put_in + step
            gain[i - 1 : last + 1] = 0.0
            at = int(np.argmax(gain))
            if gain[at] > best[0]:
                best = (float(gain[at]), _put(way, i, size, at, between))
    return best


def _put(way: list[int], i: int, size: int, at: int, between: FloatArray) -> list[int]:
    """The way with the piece at i put behind place `at`, turned round where that is shorter."""
    last = i + size - 1
    straight = between[at, i] + between[last, at + 1]
    turned = between[at, last] + between[i, at + 1]
    piece = way[i : i + size] if straight <= turned else way[i : i + size][::-1]
    if at < i:
        return way[: at + 1] + piece + way[at + 1 : i] + way[i + size :]
    return way[:i] + way[i + size : at + 1] + piece + way[at + 1 :]
