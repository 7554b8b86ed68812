"""Which end of a symmetric board is row 0: the same physical one in every frame.

A board whose colours do not distinguish its ends is found up to a half turn (a square one with
even rows up to a quarter turn). With the board fixed in the world (or to the flange), every
frame says G_i X R_i Z^t_i = W: flange, mount, camera from board, t_i quarter turns, and the
board in the base. Rotations between two frames have the same angle seen by the robot and by
the camera, whatever the mount X, and that gives a first answer; the mount fitted to it then
decides each frame on its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.chain.rigid import inverse
from calib.detection.result import Detection, FloatArray
from calib.views import Board, Mount

IntArray = NDArray[np.int64]

_MOST_FRAMES_FOR_OPTICS = 15
_MOST_CORNERS = 120
_ROUNDS = 20
_FEWEST_POSES = 3


def turned_order(board: Board, quarters: int) -> IntArray:
    """(M,) for each corner after `quarters` quarter turns, which corner it was before."""
    grid = np.arange(board.corner_count).reshape(board.rows, board.cols)
    return np.rot90(grid, quarters).reshape(-1)


def possible_turns(board: Board) -> tuple[int, ...]:
    """Quarter turns that the board's colours do not distinguish."""
    if board.identified or (board.rows + board.cols) % 2:
        return (0,)
    return (0, 1, 2, 3) if board.rows == board.cols and board.rows % 2 == 0 else (0, 2)


def _rough_rotations(corners_px: FloatArray, board: Board) -> Rotation:
    """camera_from_board rotations of N frames under rough intrinsics, which no turn changes."""
    return _rough_poses(corners_px, board)[0]


def _rough_poses(corners_px: FloatArray, board: Board) -> tuple[Rotation, FloatArray]:
    """camera_from_board rotations of N frames, and (N, 3) where the board's centre is."""
    some = slice(None, None, -(-board.corner_count // _MOST_CORNERS))
    # OpenCV refuses points that do not lie one behind the other in memory
    points = np.ascontiguousarray(board.corners_m[some], dtype=np.float32)
    pixels = np.ascontiguousarray(corners_px[:, some], dtype=np.float32)
    extent = float(np.ptp(corners_px.reshape(-1, 2), axis=0).max())
    middle = corners_px.reshape(-1, 2).mean(axis=0)
    K: NDArray[Any] = np.array(
        [[1.5 * extent, 0, middle[0]], [0, 1.5 * extent, middle[1]], [0, 0, 1.0]]
    )
    distortion: NDArray[Any] = np.zeros(5)
    if len(corners_px) >= 3:
        chosen = slice(None, None, -(-len(corners_px) // _MOST_FRAMES_FOR_OPTICS))
        size = cast("tuple[int, int]", tuple(int(2 * c) for c in middle))
        K, distortion = cv2.calibrateCamera(
            [points] * len(pixels[chosen]),
            list(pixels[chosen]),
            size,
            K,
            distortion,
            flags=cv2.CALIB_USE_INTRINSIC_GUESS
            | cv2.CALIB_FIX_ASPECT_RATIO
            | cv2.CALIB_FIX_PRINCIPAL_POINT
            | cv2.CALIB_ZERO_TANGENT_DIST
            | cv2.CALIB_FIX_K2
            | cv2.CALIB_FIX_K3,
        )[1:3]
    poses = [cv2.solvePnP(points, frame, K, distortion)[1:] for frame in pixels]
    rotations = Rotation.from_rotvec(np.array([turn.ravel() for turn, _ in poses]))
    origin = np.array([place.ravel() for _, place in poses])
    return rotations, origin + rotations.apply(board.corners_m.mean(axis=0))


def _quarter(turns: int | IntArray) -> Rotation:
    return Rotation.from_rotvec(np.multiply.outer(turns, [0, 0, np.pi / 2]))


def _angle_misfits(robot: Rotation, camera: Rotation, turns: Sequence[int]) -> FloatArray:
    """(T, N, N) robot's against camera's rotation angle between i and j, turned by t_j - t_i."""
    n = len(robot)
    i, j = np.divmod(np.arange(n * n), n)
    by_robot = (robot[j].inv() * robot[i]).magnitude()
    by_camera = [(camera[j] * _quarter(t) * camera[i].inv()).magnitude() for t in turns]
    return np.abs(np.array(by_camera) - by_robot).reshape(len(turns), n, n)


def _settle(misfits: FloatArray) -> IntArray:
    """Indices of turns that suit all pairs: the surest pairs first, then each frame in turn."""
    T, n, _ = misfits.shape
    margin = np.diff(np.sort(misfits, axis=0)[:2], axis=0)[0]
    chosen = np.full(n, -1)
    chosen[0] = 0
    for _ in range(n - 1):
        known = chosen >= 0
        i, j = divmod(int(np.where(known[:, None] & ~known[None, :], margin, -1).argmax()), n)
        chosen[j] = (chosen[i] + misfits[:, i, j].argmin()) % T
    for _ in range(_ROUNDS):
        before = chosen.copy()
        for j in range(1, n):
            costs = [misfits[(t - chosen) % T, np.arange(n), j].sum() for t in range(T)]
            chosen[j] = int(np.argmin(costs))
        if (chosen == before).all():
            break
    return chosen


def _mount_and_board(robot: Rotation, camera: Rotation) -> tuple[Rotation, Rotation]:
    """X and W of G_i X R_i = W, by the linear Kronecker solution (Shah 2013)."""
    # row-major vec: vec(G X R) = (G kron R^T) vec X, and the best X and W of length one are
    # the leading singular vectors of the sum
    products = np.einsum("nab,ndc->acbd", robot.as_matrix(), camera.as_matrix()).reshape(9, 9)
    left, _, right = np.linalg.svd(products)
    X, W = right[0].reshape(3, 3), left[:, 0].reshape(3, 3)
    return _nearest_rotation(X), _nearest_rotation(W)


def _nearest_rotation(matrix: FloatArray) -> Rotation:
    signed = matrix * np.sign(np.linalg.det(matrix))
    return Rotation.from_matrix(signed)


def _turns_by_robot(robot: Rotation, camera: Rotation, turns: Sequence[int]) -> IntArray:
    """(N,) quarter turns that make the frames agree with the robot."""
    chosen = _settle(_angle_misfits(robot, camera, turns))
    for _ in range(_ROUNDS):
        X, W = _mount_and_board(robot, camera * _quarter(np.take(turns, chosen)))
        off = [(W.inv() * robot * X * camera * _quarter(t)).magnitude() for t in turns]
        better = np.argmin(off, axis=0)
        better = (better - better[0]) % len(turns)
        if (better == chosen).all():
            break
        chosen = better
    return np.take(turns, chosen)


def _turns_by_continuity(camera: Rotation, turns: Sequence[int]) -> IntArray:
    """(N,) quarter turns with the least rotation from each frame to the next."""
    chosen = [0]
    for i in range(1, len(camera)):
        before = camera[i - 1] * _quarter(chosen[-1])
        off = [(before.inv() * camera[i] * _quarter(t)).magnitude() for t in turns]
        chosen.append(turns[int(np.argmin(off))])
    return np.array(chosen)


def turns_to_agree(
    corners_px: FloatArray,
    board: Board,
    base_from_flange: FloatArray | None = None,
    mount: Mount = "eye_in_hand",
) -> IntArray:
    """(N,) quarter turns by which each frame's order must be turned so that all agree.

    For corners from anywhere (a recording that kept no pictures, say). Where the board's
    colours distinguish its ends, all are zero. Otherwise the robot's poses decide; frames
    without one, and recordings with fewer than three, follow the least rotation from frame to
    frame. The first frame keeps its order. `turned_order` applies a turn.

    Parameters
    ----------
    corners_px:
        (N, M, 2) complete corners, not mirrored, pixels.
    board:
        The board they belong to.
    base_from_flange:
        (N, 4, 4) logged flange poses, NaN where missing.
    mount:
        Where the camera sits.
    """
    turns = possible_turns(board)
    if len(turns) == 1 or len(corners_px) < 2:
        return np.zeros(len(corners_px), dtype=np.int64)
    camera = _rough_rotations(corners_px, board)
    chosen = _turns_by_continuity(camera, turns)
    if base_from_flange is None:
        return chosen
    posed = np.flatnonzero(np.isfinite(base_from_flange).all(axis=(1, 2)))
    if len(posed) < _FEWEST_POSES:
        return chosen
    robot = Rotation.from_matrix(base_from_flange[posed, :3, :3])
    robot = robot if mount == "eye_in_hand" else robot.inv()
    # frames without a pose keep their turn against the last frame that has one
    shift = (_turns_by_robot(robot, camera[posed], turns) - chosen[posed]) % 4
    last = np.searchsorted(posed, np.arange(len(chosen)), side="right") - 1
    chosen = (chosen + shift[np.maximum(last, 0)]) % 4
    return np.asarray((chosen - chosen[0]) % 4)


@dataclass(frozen=True)
class Closure:
    """How far poses of a robot are from what the pictures show.

    Attributes
    ----------
    angle_rad:
        Median angle by which the frames miss a mount and a board that stand still.
    place_share:
        RMS by which they miss their place, as a share of the way the flange went.
    length_factor:
        Units of the poses' lengths in a unit of the board's; negative where the pictures are
        mirrored, which rotations do not show.
    """

    angle_rad: float
    place_share: float
    length_factor: float


@dataclass(frozen=True)
class RoughPoses:
    """(N,) camera_from_board rotations under rough intrinsics, and (N, 3) the board's centre."""

    board: Board
    mount: Mount
    camera: Rotation
    centre: FloatArray

    @classmethod
    def of(cls, corners_px: FloatArray, board: Board, mount: Mount = "eye_in_hand") -> RoughPoses:
        """From (N, M, 2) complete frames, pixels."""
        return cls(board, mount, *_rough_poses(corners_px, board))

    def closure(self, base_from_flange: FloatArray) -> Closure:
        """Against (N, 4, 4) poses in any unit; frames with NaN do not take part.

        The best mount and board are solved for, with the unit of length free. The intrinsics
        are rough, and so is the answer.
        """
        known = np.flatnonzero(np.isfinite(base_from_flange).all(axis=(1, 2)))
        turns = possible_turns(self.board)
        camera, centre, flange = self.camera[known], self.centre[known], base_from_flange[known]
        flange = flange if self.mount == "eye_in_hand" else inverse(flange)
        robot = Rotation.from_matrix(flange[:, :3, :3])
        one_way = np.zeros(len(known), dtype=np.int64)
        chosen = one_way if len(turns) == 1 else _turns_by_robot(robot, camera, turns)
        turned = camera * _quarter(chosen)
        X, W = _mount_and_board(robot, turned)
        angle = float(np.median((W.inv() * robot * X * turned).magnitude()))
        return Closure(angle, *_place_misfit(flange, X, centre))


def _place_misfit(flange: FloatArray, mount: Rotation, centre: FloatArray) -> tuple[float, float]:
    """RMS of F_i (X s c_i + x) - w over the scatter of the flange's places, and s; all solved."""
    n, R, went = len(flange), flange[:, :3, :3], flange[:, :3, 3]
    scaled = (R @ mount.apply(centre)[:, :, None])[:, :, 0]
    A = np.concatenate([R, -np.tile(np.eye(3), (n, 1, 1)), scaled[:, :, None]], axis=2)
    A, b = A.reshape(3 * n, 7), -went.ravel()
    solved = np.linalg.lstsq(A, b, rcond=None)[0]
    way = float(np.linalg.norm(went - went.mean(axis=0)))
    return float(np.linalg.norm(A @ solved - b)) / max(way, 1e-12), float(solved[6])


def orient(
    detections: Sequence[Detection],
    board: Board,
    base_from_flange: FloatArray | None = None,
    mount: Mount = "eye_in_hand",
) -> list[Detection]:
    """Name the same physical corners alike in every frame of a recording.

    Parameters
    ----------
    detections:
        N accepted frames in the order of the recording.
    board, base_from_flange, mount:
        As for `turns_to_agree`, which says how it is decided.
    """
    corners_px = np.array([found.corners_px for found in detections])
    turns = turns_to_agree(corners_px, board, base_from_flange, mount)
    return [
        found.reordered(turned_order(board, int(turn)))
        for found, turn in zip(detections, turns, strict=True)
    ]
