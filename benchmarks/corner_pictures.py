"""Pictures of boards whose corners are known, and the least error that their noise allows.

The simulator's renderer integrates pixels in closed form and shares nothing with the fit. It draws
on a finer grid, where the blur is put on, and the fine pixels are averaged: a finished picture
blurred by 1 px would have its edges moved by 0.002 px.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.chain.optics import COLUMN, OPTICS
from calib.views import Board, FloatArray
from sim.render import Blur, render
from sim.render.pattern import BLACK, WHITE

Image = NDArray[np.uint8]
Light = FloatArray | float

CONTRAST, DARK, NOISE = 160.0, 45.0, 2.0
WINDOW_SQUARES, WINDOW_LIMIT_PX = 0.4, 40.0


@dataclass(frozen=True)
class View:
    """One pose of a board before the camera."""

    board: Board
    optics: FloatArray
    camera_from_board: FloatArray
    truth_px: FloatArray
    size_px: tuple[int, int]


@dataclass(frozen=True)
class Softness:
    """What blurs a picture.

    Attributes
    ----------
    sigma_px:
        Standard deviation per axis of a Gaussian, or of the defocus disk if `disk`.
    disk:
        A thin lens's disk in place of the Gaussian.
    focused_on_board:
        With `disk`: the lens is focused on the board's middle and `sigma_px` is what a point at
        one and a half times that distance has, so that only what lies nearer or farther blurs.
    motion_px:
        Length of the way, from left to right, that the picture moves during the exposure.
    """

    sigma_px: float = 0.0
    disk: bool = False
    focused_on_board: bool = False
    motion_px: float = 0.0


def views(
    board: Board,
    square_px: float,
    size_px: tuple[int, int],
    count: int,
    *,
    tilt_deg: tuple[float, float] = (0.0, 40.0),
    roll_rad: float = 0.4,
    focal_widths: float = 1.2,
    seed: int | None = None,
) -> Iterator[View]:
    """Poses near the picture's middle, as many as `count`.

    Parameters
    ----------
    square_px:
        Side of a square at the board's middle before it is tilted, to 8 percent.
    tilt_deg:
        Least and greatest tilt off the axis.
    roll_rad:
        Greatest roll about the axis either way.
    focal_widths:
        Focal length in widths of the picture.
    """
    rng = np.random.default_rng(board.rows if seed is None else seed)
    width, height = size_px
    optics = np.zeros(len(OPTICS))
    f_px = focal_widths * width
    for name, value in (
        ("height_px", height),
        ("alpha_px", f_px),
        ("beta_px", f_px),
        ("u0_px", (width - 1) / 2),
        ("v0_px", (height - 1) / 2),
    ):
        optics[COLUMN[name]] = value
    for _ in range(count):
        axis = np.deg2rad(rng.uniform(*tilt_deg)) * _unit(rng.uniform(0, 2 * np.pi))
        roll = np.array([0, 0, rng.uniform(-roll_rad, roll_rad)])
        R = cv2.Rodrigues(axis)[0] @ cv2.Rodrigues(roll)[0]
        depth_m = f_px * board.square_m / (square_px * rng.uniform(0.92, 1.08))
        pose = np.eye(4)
        pose[:3, :3] = R
        shift = rng.uniform(-0.03, 0.03, 2) * depth_m * np.array([1.0, height / width])
        pose[:3, 3] = np.array([*shift, depth_m]) - R @ board.corners_m.mean(axis=0)
        seen = (board.corners_m @ R.T + pose[:3, 3]) / depth_m
        truth = optics[[COLUMN["u0_px"], COLUMN["v0_px"]]] + f_px * seen[:, :2] / seen[:, 2:]
        yield View(board, optics, pose, truth, size_px)


def _unit(angle: float) -> FloatArray:
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def clean_picture(view: View, soft: Softness) -> FloatArray:
    """Grey levels without noise."""
    fine = oversampling(view)
    width, height = (side * fine for side in view.size_px)
    optics = view.optics.copy()
    for name in ("height_px", "alpha_px", "beta_px"):
        optics[COLUMN[name]] *= fine
    for name in ("u0_px", "v0_px"):
        optics[COLUMN[name]] = (optics[COLUMN[name]] + 0.5) * fine - 0.5
    picture = render(
        view.board,
        view.board.corners_m,
        optics,
        view.camera_from_board,
        width_px=width,
        height_px=height,
        blur=_lens(view, soft, float(optics[COLUMN["alpha_px"]]), fine),
    )
    if soft.sigma_px > 0 and not soft.disk:
        side = 2 * int(6 * fine * soft.sigma_px + 2) + 1
        picture = np.asarray(cv2.GaussianBlur(picture, (side, side), fine * soft.sigma_px))
    if soft.motion_px > 0:
        picture = cv2.blur(picture, (2 * int(fine * soft.motion_px / 2) + 1, 1))
    picture = np.asarray(
        cv2.resize(picture, view.size_px, interpolation=cv2.INTER_AREA), np.float32
    )
    return np.asarray(DARK + CONTRAST * (picture.astype(float) - BLACK) / (WHITE - BLACK))


def _lens(view: View, soft: Softness, alpha_px: float, fine: int) -> Blur | None:
    if not soft.disk or soft.sigma_px == 0:
        return None
    # a disk's sigma per axis is half its radius
    middle_m = view.camera_from_board[:3, :3] @ view.board.corners_m.mean(axis=0)
    depth_m = float(middle_m[2] + view.camera_from_board[2, 3])
    aperture_m = 4 * soft.sigma_px * fine * depth_m / alpha_px
    if soft.focused_on_board:
        return Blur(aperture_m=3 * aperture_m, focus_distance_m=depth_m)
    return Blur(aperture_m=aperture_m, focus_distance_m=np.inf)


def oversampling(view: View) -> int:
    """Fine pixels to a side of a pixel."""
    return 3 if view.size_px[0] < 2000 else 2


def photograph(clean: FloatArray, seed: int, noise: float = NOISE) -> Image:
    """8-bit picture with white noise."""
    noisy = clean + np.random.default_rng(seed).normal(0, noise, clean.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


def moved_picture(view: View, name: str, soft: Softness) -> FloatArray:
    """Change of every pixel for one pixel's move of the picture along an axis."""
    step_px = 0.05
    pictures = []
    for sign in (1, -1):
        optics = view.optics.copy()
        optics[COLUMN[name]] += sign * step_px
        pictures.append(clean_picture(replace(view, optics=optics), soft))
    return np.asarray((pictures[0] - pictures[1]) / (2 * step_px))


def bounds_px(view: View, soft: Softness, light: Light = 1.0, noise: float = NOISE) -> FloatArray:
    """(M,) least RMS per axis that the noise allows inside each corner's window, pixels.

    Cramer-Rao for a known pattern, from the change of the window when the whole picture moves.
    `light` is what the grey levels are multiplied with.
    """
    gx, gy = (light * moved_picture(view, name, soft) for name in ("u0_px", "v0_px"))
    grid = view.truth_px.reshape(view.board.rows, view.board.cols, 2)
    across = np.asarray(np.gradient(grid, axis=1)).reshape(-1, 2)
    down = np.asarray(np.gradient(grid, axis=0)).reshape(-1, 2)
    variances = []
    for corner, e1, e2 in zip(view.truth_px, across, down, strict=True):
        reach = min(WINDOW_SQUARES, WINDOW_LIMIT_PX / max(np.linalg.norm(e1), np.linalg.norm(e2)))
        half = reach * (np.abs(e1) + np.abs(e2)) + 1
        (x0, y0), (x1, y1) = (corner - half).astype(int), (corner + half).astype(int) + 1
        x, y = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
        offset = np.stack([x, y], axis=-1).reshape(-1, 2) - corner
        lattice = offset @ np.linalg.inv([e1, e2])
        inside = (np.abs(lattice) <= reach).all(axis=1) & _free_of_print(lattice, view.board)
        slope = np.stack([gx[y, x], gy[y, x]], axis=-1).reshape(-1, 2)[inside]
        variances.append(np.diag(np.linalg.inv(slope.T @ slope)).mean())
    return np.asarray(np.hypot(noise, 12**-0.5) * np.sqrt(variances))


def _free_of_print(lattice: FloatArray, board: Board) -> NDArray[np.bool_]:
    """Which places (in squares from a corner) lie in the cross that markers leave free."""
    if board.marker_m is None:
        return np.ones(len(lattice), dtype=bool)
    clear = 0.45 * (1 - board.marker_m / board.square_m)
    return np.asarray(np.abs(lattice).min(axis=1) <= clear)
