"""What bodies are made of: the convex hull of a few points, swept by a ball."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from calib.views import FloatArray

Point = Sequence[float] | FloatArray


@dataclass(frozen=True, eq=False)
class Shape:
    """A convex piece of a body.

    Attributes
    ----------
    points_m:
        (N, 3) in the frame of its body.
    radius_m:
        Of the ball that sweeps the hull of the points: two points and a radius are a capsule,
        eight points without one a box.
    normal:
        (3,) where the shape is all that lies behind a plane through its one point; it points out.
    """

    points_m: FloatArray
    radius_m: float = 0.0
    normal: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def middle_m(self) -> FloatArray:
        """(3,) middle of the points' extent."""
        return np.asarray(0.5 * (self.points_m.min(axis=0) + self.points_m.max(axis=0)))

    @property
    def around_m(self) -> float:
        """Radius of a ball around `middle_m` that holds the whole shape."""
        far = np.linalg.norm(self.points_m - self.middle_m, axis=1).max()
        return float(far) + self.radius_m

    def moved(self, transform: FloatArray) -> Shape:
        """The shape in another frame, (4, 4) other_from_frame."""
        return Shape(self.points_m @ transform[:3, :3].T + transform[:3, 3], self.radius_m)


def capsule(start_m: Point, end_m: Point, radius_m: float) -> Shape:
    """A cylinder with round ends."""
    return Shape(np.array([start_m, end_m], dtype=float), radius_m)


def box(low_m: Point, high_m: Point) -> Shape:
    """A box along the axes of its frame."""
    low, high = np.asarray(low_m, float), np.asarray(high_m, float)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    return Shape(low + corners * (high - low))


def behind(point_m: Point, normal: Point) -> Shape:
    """All that lies behind a plane: a wall, or the floor."""
    return Shape(np.array([point_m], dtype=float), normal=np.asarray(normal, float))
