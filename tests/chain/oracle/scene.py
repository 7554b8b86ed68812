"""One frame's way along the chain for automatic differentiation, with any effects on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import autograd.numpy as anp
import numpy as np

from calib.views import FloatArray, Views
from tests.chain.oracle import formulas
from tests.chain.oracle.formulas import Array

DOWN = np.array([0.0, 0.0, -1.0])
_MOMENT_S = 1e-4
ORDER = ("clock", "arm", "mount", "board", "lens", "sensor", "detector")


class Scene:
    """What is true while one frame is exposed; effects put new values in place of these.

    `base` is where the arm's base stands against where it was taken to stand, `dh` are the arm's
    nominal rows, `flange`, `mounted` and `fixed` (4, 4) transforms as in a cell model, `optics` its
    columns by name; `focused_before` is the frame before's distance;
    `found_at` says where the detector finds (C, 2) pixels.
    """

    def __init__(self, views: Views, frame: int, dh: FloatArray, optics: dict[str, Array]) -> None:
        self.views, self.frame = views, frame
        self.logged_joints: FloatArray = views.joints_rad[frame]
        self.speed: FloatArray = views.joint_velocity_rad_s[frame]
        self.joints: Array = self.logged_joints
        self.nominal_dh, self.dh = dh, dh
        self.base: Array = np.eye(4)
        self.flange: Array = views.base_from_flange[frame]
        self.mounted: Array = np.eye(4)
        self.fixed: Array = np.eye(4)
        self.points: Array = views.board.corners_m
        self.optics = optics
        self.found_at: Callable[[Array], Array] = lambda pixels: pixels
        self.focused_before: Callable[[], Array] = lambda: self.focused

    def logged(self, column: str) -> float:
        return float(getattr(self.views, column)[self.frame])

    def turned_about(self, moving: Array) -> tuple[Array, Array]:
        """Camera and board in the base, with the flange there."""
        rides = anp.dot(moving, self.mounted)
        in_hand = self.views.mount == "eye_in_hand"
        return (rides, self.fixed) if in_hand else (self.fixed, rides)

    @property
    def camera(self) -> Array:
        return self.turned_about(self.flange)[0]

    def pose(self, moving: Array | None = None) -> Array:
        """(4, 4) of the board in the camera's frame."""
        camera, board = self.turned_about(self.flange if moving is None else moving)
        return anp.dot(anp.linalg.inv(camera), board)

    def depth(self, pose: Array) -> Array:
        """Of the board's middle."""
        return anp.dot(pose[2, :3], anp.mean(self.points, axis=0)) + pose[2, 3]

    @property
    def focused(self) -> Array:
        logged = self.logged("focus_distance_m")
        return logged if np.isfinite(logged) else self.depth(self.pose())

    def down_in(self, frame: Array) -> Array:
        return anp.dot(anp.transpose(frame[:3, :3]), DOWN)

    def move_arm(self) -> None:
        """The logged pose, corrected by what the effects change in the nominal arm."""
        moved = anp.dot(self._to_nominal(), formulas.flange(self.joints, self.dh))
        self.flange = anp.dot(self.base, moved)

    def _to_nominal(self) -> FloatArray:
        nominal = formulas.flange(self.logged_joints, self.nominal_dh)
        return np.asarray(self.views.base_from_flange[self.frame] @ np.linalg.inv(nominal))

    def board_speed(self) -> Array:
        """(6,) per second in the camera's frame: a secant over a moment, as the joints turn on."""
        back = anp.linalg.inv(formulas.flange(self.joints, self.dh))

        def at(time_s: float) -> Array:
            turned = formulas.flange(self.joints + self.speed * time_s, self.dh)
            return self.pose(anp.dot(self.flange, anp.dot(back, turned)))

        rate = (at(_MOMENT_S) - at(-_MOMENT_S)) / (2.0 * _MOMENT_S)
        step = anp.dot(rate, anp.linalg.inv(self.pose()))
        return anp.stack([step[0, 3], step[1, 3], step[2, 3], step[2, 1], step[0, 2], step[1, 0]])


Oracle = Callable[[Mapping[str, Array], Scene], None]
"""What an effect does to a scene, its numbers given by name."""

Acting = Sequence[tuple[str, Oracle, Mapping[str, Array]]]
"""Effects: link, oracle, numbers of each."""


def evaluate(scene: Scene, effects: Acting, flange_error: Array, links: Sequence[str]) -> None:
    """Let every effect of these links act, and the flange be off by its error."""
    for link in links:
        for where, oracle, numbers in effects:
            if where == link:
                oracle(numbers, scene)
        if link == "arm":
            scene.move_arm()
            scene.flange = anp.dot(scene.flange, flange_error)


def pixels(scene: Scene, corners: Sequence[int]) -> Array:
    """(C, 2) of those corners."""
    pose = scene.pose()
    seen = anp.dot(scene.points[list(corners)], anp.transpose(pose[:3, :3])) + pose[:3, 3]
    return scene.found_at(anp.transpose(formulas.swept_pixel(scene.optics, anp.transpose(seen))))
