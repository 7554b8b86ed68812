"""An arm among what it must not strike: how near, where, between what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from calib.bodies.shape import Shape
from calib.bodies.sweep import smallest_gap
from calib.chain.kinematics import ArmKinematics
from calib.chain.kinematics.dh import link_transforms
from calib.views import FloatArray

IntArray = np.ndarray[Any, np.dtype[np.int64]]

FIXED = -1
"""Link of what stands in the cell."""

_LINKS_AT_THE_FOOT = 2
"""Foot and first link stand where the arm was bolted down: nothing fixed is held against them."""

_NEIGHBOURS = 2
_GRID = 24
_BUILT_SO = 0.7
_NEVER_ENOUGH_M = -1.0
"""Below every distance of two bodies that are deep in each other."""

_SHORTEST_STEP_RAD, _LONGEST_STEP_RAD = np.radians([0.5, 1.0])


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body.

    Attributes
    ----------
    name:
        What a person calls it.
    link:
        The link it moves with: 0 the foot, 1 to J the links (J for what the flange carries),
        `FIXED` for what stands in the cell.
    shapes:
        In the frame of its link, or in the base.
    carried:
        It hangs on the flange and is not the arm's own last link.
    doubted:
        Nobody knows where exactly it is: it is held against what stands in the cell only, the arm
        itself can be seen to be clear of it.
    clear_of:
        Links of the arm that it cannot come near to, or is built near to.
    """

    name: str
    link: int
    shapes: tuple[Shape, ...]
    carried: bool = False
    doubted: bool = False
    clear_of: frozenset[int] = frozenset()

    def stays_clear_of(self, other: Body) -> bool:
        """Whether the two need not be held against each other."""
        return not other.carried and other.link in self.clear_of


class Nearest(NamedTuple):
    """Where two bodies come nearest to each other.

    Attributes
    ----------
    distance_m:
        Between their surfaces; not above 0 where they touch or overlap.
    first, second:
        Their names.
    place_m:
        (3,) on the first one, in the base.
    share:
        Of the move at which that is: 0 at its start, 1 at its end.
    """

    distance_m: float
    first: str
    second: str
    place_m: FloatArray
    share: float


class Scene:
    """The bodies of a cell, and which of them must not meet.

    Parameters
    ----------
    arm:
        The kinematics that move the bodies.
    bodies:
        The arm's own, what it carries, and what stands around it.
    clearance_m:
        How near bodies may come to each other in operation.

    Bodies on one link, on neighbouring links, and two that stand are not held against each other;
    neither is what stands against the arm's foot and first link. Two bodies at most two links
    apart that are nearer than `clearance_m` in most positions (within the limits) of the joints
    between them are built so near to each other that shapes with a margin cannot separate them
    apart; they are left out too (`built_together`).
    """

    def __init__(
        self, arm: ArmKinematics, bodies: Sequence[Body], clearance_m: float = 0.0
    ) -> None:
        self._clearance_m = clearance_m
        self._rows, self._limits_rad = np.ascontiguousarray(arm.dh), arm.limits_rad
        self._chain = self._rows, np.ascontiguousarray(arm.ends)
        self.bodies = tuple(bodies)
        owners = [b for b, body in enumerate(bodies) for _ in body.shapes]
        shapes = [shape for body in bodies for shape in body.shapes]
        self._owner = np.array(owners)
        link = np.array([max(bodies[b].link, 0) for b in owners])
        counts = np.array([len(shape.points_m) for shape in shapes])
        self._shapes = (
            np.concatenate([shape.points_m for shape in shapes]),
            np.cumsum(counts) - counts,
            counts,
            np.array([shape.radius_m for shape in shapes]),
            link,
            np.array([shape.middle_m for shape in shapes]),
            np.array([shape.around_m for shape in shapes]),
            np.array([shape.normal for shape in shapes]),
        )
        self._lever_m = _levers_m(self._rows, arm.ends, link, shapes)
        apart = [p for p in combinations(range(len(bodies)), 2) if self._may_meet(*p)]
        self.built_together = tuple(p for p in apart if self._meets_mostly(*p))
        self._pairs = self._shape_pairs([p for p in apart if p not in self.built_together])
        fixed = np.array([bodies[b].link == FIXED for b in owners])
        self._with_fixed = fixed[self._pairs].any(axis=1)

    def at(self, joints_rad: FloatArray) -> Nearest | None:
        """Where two bodies are nearest at (J,) joint angles; None where nothing can meet."""
        return self.along(joints_rad, joints_rad)

    def along(
        self,
        start_rad: FloatArray,
        end_rad: FloatArray,
        enough_m: float | None = None,
        spare_m: float = 0.0,
    ) -> Nearest | None:
        """Where two bodies come nearest on a straight joint move.

        Parameters
        ----------
        start_rad, end_rad:
            (J,) joint angles.
        enough_m:
            Where given, only whether the distance stays above it is asked: the first place where
            it does not ends the search, and steps are as long as safety allows.
        spare_m:
            Taken off the distance of what stands in the cell.
        """
        if not len(self._pairs):
            return None
        start = np.asarray(start_rad, float)
        travel = np.asarray(end_rad, float) - start
        turn = max(float(np.abs(travel).max()), 1e-12)
        longest = _LONGEST_STEP_RAD / turn if enough_m is None else 1.0
        enough = _NEVER_ENOUGH_M if enough_m is None else enough_m
        bounds = (enough, _SHORTEST_STEP_RAD / turn, longest)
        spare = np.where(self._with_fixed, spare_m, 0.0)
        return self._smallest(start, travel, self._pairs, bounds, spare)

    def _smallest(
        self,
        start: FloatArray,
        travel: FloatArray,
        pairs: IntArray,
        bounds: tuple[float, float, float],
        spare_m: FloatArray | float = 0.0,
    ) -> Nearest:
        out, speed = np.empty(6), self._approach_m(pairs) @ np.abs(travel)
        spare = np.broadcast_to(np.asarray(spare_m, float), len(pairs))
        smallest_gap(start, travel, self._chain, self._shapes, pairs, (speed, spare), bounds, out)
        first, second = (self.bodies[self._owner[s]].name for s in pairs[int(out[2])])
        return Nearest(float(out[0]), first, second, out[3:].copy(), float(out[1]))

    def _approach_m(self, pairs: IntArray) -> FloatArray:
        """(Q, J) most that a turn of each joint brings two shapes nearer, metres a radian.

        Seen from the link nearer to the foot, the other shape is moved by the joints between.
        """
        on = self._shapes[4][pairs]
        outer = np.take_along_axis(pairs, on.argmax(axis=1)[:, None], axis=1)[:, 0]
        joint = np.arange(len(self._rows))
        between = (joint >= on.min(axis=1)[:, None]) & (joint < on.max(axis=1)[:, None])
        return np.asarray(self._lever_m[outer] * between)

    def _may_meet(self, a: int, b: int) -> bool:
        one, other = self.bodies[a], self.bodies[b]
        low, high = sorted((one.link, other.link))
        if low == FIXED:
            return high >= _LINKS_AT_THE_FOOT
        if one.doubted or other.doubted:
            return False
        if one.stays_clear_of(other) or other.stays_clear_of(one):
            return False
        next_to = 0 if one.carried or other.carried else 1
        return high - low > next_to

    def _meets_mostly(self, a: int, b: int) -> bool:
        low, high = sorted((self.bodies[a].link, self.bodies[b].link))
        if low == FIXED or high - low > _NEIGHBOURS:
            return False
        pairs = self._shape_pairs([(a, b)])
        limits = np.clip(self._limits_rad[low:high], -np.pi, np.pi)
        angles = np.linspace(limits[:, 0], limits[:, 1], _GRID, axis=-1)
        meet = 0
        for between in product(*angles):
            joints = np.zeros(len(self._rows))
            joints[low:high] = between
            near = self._smallest(joints, np.zeros_like(joints), pairs, (_NEVER_ENOUGH_M, 1.0, 1.0))
            meet += int(near.distance_m <= self._clearance_m)
        return bool(meet > _BUILT_SO * float(_GRID ** (high - low)))

    def _shape_pairs(self, bodies: Sequence[tuple[int, int]]) -> IntArray:
        shapes = [np.flatnonzero(self._owner == b) for b in range(len(self.bodies))]
        pairs = [p for a, b in bodies for p in product(shapes[a], shapes[b])]
        return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _levers_m(
    rows: FloatArray, ends: FloatArray, link: IntArray, shapes: Sequence[Shape]
) -> FloatArray:
    """(S, J) most that a turn of each joint moves each shape, metres a radian.

    That is how far its points can be from the joint's axis: exactly so for the joint that its
    link turns on; for those before, by way of the origins of the frames between.
    """
    lengths, steps = np.hypot(rows[:, 1], rows[:, 2]), link_transforms(np.zeros(len(rows)), rows)
    steps[-1] = steps[-1] @ ends[1]
    levers = np.zeros((len(shapes), len(rows)))
    for s, on in enumerate(link):
        if on == 0:
            continue
        points = shapes[s].moved(steps[on - 1]).points_m
        radius = shapes[s].radius_m
        levers[s, on - 1] = np.linalg.norm(points[:, :2], axis=1).max() + radius
        outer = np.linalg.norm(points, axis=1).max() + radius
        for joint in range(on - 1):
            levers[s, joint] = abs(rows[joint, 2]) + lengths[joint + 1 : on - 1].sum() + outer
    return levers
