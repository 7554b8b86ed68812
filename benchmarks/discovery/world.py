"""A robot cell of its own: arm, camera and board by other code than the project's.

Nothing here imports `calib.chain` or `sim`. Rotations go through SciPy, the arm through elementary
transforms, the lens through Brown's polynomials, all frames at once as plain NumPy arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])

# d, a, twist; masses and centres of mass in their links' frames: the maker's published tables
_TWIST = np.array([np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0])
ARMS: dict[str, dict[str, Any]] = {
    "ur3e": {
        "d": [0.15185, 0.0, 0.0, 0.13105, 0.08535, 0.0921],
        "a": [0.0, -0.24355, -0.2132, 0.0, 0.0, 0.0],
        "mass": [1.98, 3.4445, 1.437, 0.871, 0.805, 0.261],
        "com": [[0, -0.02, 0], [0.13, 0, 0.1157], [0.05, 0, 0.0238], [0, 0, 0.01], [0, 0, 0.01],
                [0, 0, -0.02]],
    },
    "ur5e": {
        "d": [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996],
        "a": [0.0, -0.425, -0.3922, 0.0, 0.0, 0.0],
        "mass": [3.761, 8.058, 2.846, 1.37, 1.3, 0.365],
        "com": [[0, -0.02561, 0.00193], [0.2125, 0, 0.11336], [0.15, 0, 0.0265],
                [0, -0.0018, 0.01634], [0, 0.0018, 0.01634], [0, 0, -0.001159]],
    },
    "ur10e": {
        "d": [0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655],
        "a": [0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0],
        "mass": [7.369, 13.051, 3.989, 2.1, 1.98, 0.615],
        "com": [[0.021, 0, 0.027], [0.38, 0, 0.158], [0.24, 0, 0.068], [0, 0.007, 0.018],
                [0, 0.007, 0.018], [0, 0, -0.026]],
    },
}  # fmt: skip
PAYLOAD_KG = 0.9

CAMERAS: dict[str, dict[str, float]] = {
    "12 MP": {"width": 4096, "height": 3072, "alpha": 4750.0, "k1": -0.035, "k2": 0.02},
    "3 MP": {"width": 2048, "height": 1536, "alpha": 2400.0, "k1": -0.08, "k2": 0.05},
    "webcam": {"width": 1280, "height": 720, "alpha": 1350.0, "k1": 0.01, "k2": -0.06},
}
BOARDS: dict[str, tuple[int, int, float]] = {
    "7x10": (7, 10, 0.025),
    "6x9": (6, 9, 0.02),
    "14x14": (14, 14, 0.012),
}


def rigid(six: Array) -> Array:
    """(..., 4, 4) of metres and a rotation vector."""
    six = np.asarray(six, dtype=float)
    out = np.zeros((*six.shape[:-1], 4, 4))
    out[..., :3, :3] = (
        Rotation.from_rotvec(six[..., 3:].reshape(-1, 3)).as_matrix().reshape(*six.shape[:-1], 3, 3)
    )
    out[..., :3, 3] = six[..., :3]
    out[..., 3, 3] = 1.0
    return out


def inverse(pose: Array) -> Array:
    back = np.swapaxes(pose[..., :3, :3], -1, -2)
    out = np.zeros_like(pose)
    out[..., :3, :3] = back
    out[..., :3, 3] = -(back @ pose[..., :3, 3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def links(arm: str, joints: Array, off: Array | None = None) -> list[Array]:
    """(N, 4, 4) of the frame behind each joint; `off` (6, 4) adds to theta, d, a, twist."""
    off = np.zeros((6, 4)) if off is None else off
    pose, found = np.broadcast_to(np.eye(4), (len(joints), 4, 4)), []
    for k in range(6):
        c, s = np.cos(joints[:, k] + off[k, 0]), np.sin(joints[:, k] + off[k, 0])
        d, a = ARMS[arm]["d"][k] + off[k, 1], ARMS[arm]["a"][k] + off[k, 2]
        ct, st = np.cos(_TWIST[k] + off[k, 3]), np.sin(_TWIST[k] + off[k, 3])
        step = np.zeros((len(joints), 4, 4))
        step[:, 0] = np.stack([c, -s * ct, s * st, a * c], axis=1)
        step[:, 1] = np.stack([s, c * ct, -c * st, a * s], axis=1)
        step[:, 2] = [0.0, st, ct, d]
        step[:, 3, 3] = 1.0
        pose = pose @ step
        found.append(pose)
    return found


def base_moment(arm: str, joints: Array) -> Array:
    """(N, 3) moment of the arm's weight about its base's origin, Nm."""
    frames = links(arm, joints)
    out = np.cross(frames[-1][:, :3, 3], -PAYLOAD_KG * 9.80665 * UP)
    for frame, com, mass in zip(frames, ARMS[arm]["com"], ARMS[arm]["mass"], strict=True):
        out += np.cross((frame @ np.array([*com, 1.0]))[:, :3], -mass * 9.80665 * UP)
    return np.asarray(out)


def sag_torques(arm: str, joints: Array) -> Array:
    """(N, 6) torque that gravity puts on each joint's axis, Nm."""
    frames = links(arm, joints)
    axes = [np.broadcast_to(UP, (len(joints), 3)), *(f[:, :3, 2] for f in frames[:-1])]
    origin = [np.zeros((len(joints), 3)), *(f[:, :3, 3] for f in frames[:-1])]
    out = np.zeros((len(joints), 6))
    for k in range(6):
        for body in range(k, 7):
            f = frames[min(body, 5)]
            c = ARMS[arm]["com"][body] if body < 6 else [0.0, 0.0, 0.0]
            m = ARMS[arm]["mass"][body] if body < 6 else PAYLOAD_KG
            at = (f @ np.array([*c, 1.0]))[:, :3]
            out[:, k] += (axes[k] * np.cross(at - origin[k], -m * 9.80665 * UP)).sum(axis=1)
    return out


@dataclass
class State:
    """What is true in N frames; physics change it before it is projected."""

    arm: str
    in_hand: bool
    log: dict[str, Array]
    joints: Array
    dh: Array
    base: Array
    tool: Array
    mounted: Array
    fixed: Array
    points: Array
    alpha: Array
    centre: Array
    k1: Array
    k2: Array
    p: Array
    roll: Array
    picture: list[Any] = field(default_factory=list)

    def flange(self) -> Array:
        return rigid(self.base) @ links(self.arm, self.joints, self.dh)[-1] @ rigid(self.tool)

    def camera_from_board(self) -> Array:
        rides = self.flange() @ self.mounted
        return inverse(rides) @ self.fixed if self.in_hand else inverse(self.fixed) @ rides

    def distance(self) -> Array:
        pose = self.camera_from_board()
        return np.asarray((pose[:, 2, :3] * self.points.mean(axis=-2)).sum(-1) + pose[:, 2, 3])

    def gravity(self) -> Array:
        """(N, 3) down in the camera's frame."""
        camera = self.flange() @ self.mounted if self.in_hand else self.fixed
        return np.asarray(-(np.swapaxes(camera[..., :3, :3], -1, -2) @ UP))

    def pixels(self) -> Array:
        """(N, M, 2)."""
        pose = self.camera_from_board()
        at = self.points @ np.swapaxes(pose[:, :3, :3], 1, 2) + pose[:, None, :3, 3]
        x, y = at[..., 0] / at[..., 2], at[..., 1] / at[..., 2]
        r2 = x * x + y * y
        radial = 1.0 + self.k1[:, None] * r2 + self.k2[:, None] * r2 * r2
        p1, p2 = self.p[:, 0, None], self.p[:, 1, None]
        xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        c, s = np.cos(self.roll)[:, None], np.sin(self.roll)[:, None]
        u = self.alpha[:, None] * (c * xd - s * yd) + self.centre[:, 0, None]
        v = self.alpha[:, None] * (s * xd + c * yd) + self.centre[:, 1, None]
        out = np.stack([u, v], axis=-1)
        for bend in self.picture:
            out = bend(out)
        return np.asarray(out)


@dataclass(frozen=True)
class Cell:
    """The plain cell, and what its log knows."""

    arm: str
    in_hand: bool
    camera: str
    board: str
    alpha: float
    centre: Array
    mounted: Array
    fixed: Array
    dh: Array

    @property
    def grid(self) -> Array:
        """(M, 3) of the board's corners."""
        rows, cols, square = BOARDS[self.board]
        row, col = np.divmod(np.arange(rows * cols), cols)
        return np.stack([col, row, 0 * row], axis=1) * square

    def state(self, joints: Array, log: dict[str, Array]) -> State:
        n, c = len(joints), CAMERAS[self.camera]
        return State(
            self.arm, self.in_hand, log, joints.copy(), self.dh.copy(), np.zeros((n, 6)),
            np.zeros((n, 6)), np.repeat(self.mounted[None], n, 0),
            np.repeat(self.fixed[None], n, 0), np.repeat(self.grid[None], n, 0),
            np.full(n, self.alpha),
            np.repeat(self.centre[None], n, 0), np.full(n, c["k1"]), np.full(n, c["k2"]),
            np.zeros((n, 2)), np.zeros(n),
        )  # fmt: skip

    def shifted(self, by: Array) -> Cell:
        """The cell with 15 numbers changed: alpha, centre, hand-eye, board."""
        return replace(
            self,
            alpha=self.alpha + by[0],
            centre=self.centre + by[1:3],
            mounted=self.mounted @ rigid(by[3:9]),
            fixed=self.fixed @ rigid(by[9:15]),
        )


HOME = np.array([0.3, -1.7, 1.9, -1.8, -1.5, 0.2])


def make_cell(rng: np.random.Generator, *, background: bool) -> Cell:
    """A random cell; with `background` the true arm differs a little from its log's kinematics."""
    arm, camera = str(rng.choice(list(ARMS))), str(rng.choice(list(CAMERAS)))
    c = CAMERAS[camera]
    in_hand = bool(rng.random() < 0.75)
    mounted = rigid(np.array([*rng.normal(0, 0.02, 2), 0.06, 0, 0, rng.uniform(-3, 3)]))
    mounted = mounted @ rigid(np.array([0, 0, 0, *rng.normal(0, 0.04, 3)]))
    board = str(rng.choice(list(BOARDS), p=[0.6, 0.3, 0.1]))
    rows, cols, square = BOARDS[board]
    middle = 0.5 * square * np.array([cols - 1, rows - 1, 0.0])
    away = np.array([*(-middle[:2]), 0.5])
    seen = rigid(np.array([*away, 0, 0, 0]))
    home = links(arm, HOME[None])[-1][0]
    fixed = home @ mounted @ (seen if in_hand else inverse(seen))
    dh = np.zeros((6, 4))
    if background:
        dh = rng.normal(0.0, [1.0e-4, 1.0e-4, 1.0e-4, 1.0e-4], (6, 4))
    return Cell(
        arm, in_hand, camera, board, c["alpha"] * (1 + rng.normal(0, 0.01)),
        np.array([c["width"], c["height"]]) / 2 - 0.5 + rng.normal(0, 0.004 * c["width"], 2),
        mounted, fixed, dh,
    )  # fmt: skip


def plan(cell: Cell, frames: int, rng: np.random.Generator) -> Array:
    """(N, 6) joints at which the whole board is in view, from many sides."""
    c = CAMERAS[cell.camera]
    middle = cell.grid.mean(axis=0)
    found: list[Array] = []
    while len(found) < frames:
        azimuth, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 0.6)
        lean = Rotation.from_rotvec(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
        turn = (Rotation.from_rotvec([0, 0, rng.uniform(-1.5, 1.5)]) * lean).as_matrix()
        distance = rng.uniform(0.36, 0.8)
        pose = np.eye(4)
        pose[:3, :3] = turn
        pose[:3, 3] = distance * np.array([*rng.uniform(-0.1, 0.1, 2), 1.0]) - turn @ middle
        back = inverse(pose) if cell.in_hand else pose
        target = cell.fixed @ back @ inverse(cell.mounted)
        joints = _reach(cell.arm, target, HOME + rng.normal(0, 0.2, 6))
        if joints is None:
            continue
        pixels = cell.state(joints[None], {}).pixels()[0]
        if ((pixels > 5) & (pixels < np.array([c["width"], c["height"]]) - 6)).all():
            found.append(joints)
    return np.array(found)


def _reach(arm: str, target: Array, start: Array) -> Array | None:
    def miss(joints: Array) -> Array:
        pose = links(arm, joints[None])[-1][0]
        turned = Rotation.from_matrix(pose[:3, :3].T @ target[:3, :3]).as_rotvec()
        return np.concatenate([pose[:3, 3] - target[:3, 3], 0.3 * turned])

    solved = least_squares(miss, start, xtol=1e-10, ftol=1e-12, max_nfev=60)
    inside = np.abs(solved.x - HOME).max() < 2.5
    return solved.x if solved.cost < 1e-12 and inside else None
