"""Corner detection against OpenCV's finders: RMS, bias, detections and CPU seconds in one run.

    python benchmarks/corners.py            # 1279 x 724, blur 0 to 6 px, Gaussian and disk
    python benchmarks/corners.py --large    # 4096 x 3072

The pictures come from the simulator's renderer, which integrates pixels in closed form and
shares nothing with the fit. CPU seconds are of all threads. The bound is Cramer-Rao's for a
known pattern, from the change of a corner's window when the whole picture moves.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.chain.optics import COLUMN, OPTICS
from calib.detection import detect
from calib.views import Board, FloatArray
from sim.render import Blur, render
from sim.render.pattern import BLACK, WHITE

Image = NDArray[np.uint8]
Finder = Callable[[Image, Board], "FloatArray | None"]

CONTRAST, DARK, NOISE = 160.0, 45.0, 2.0
WINDOW_SQUARES, WINDOW_LIMIT_PX = 0.4, 40.0
EXACT = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY


@dataclass(frozen=True)
class View:
    """One pose of a board before the camera."""

    board: Board
    optics: FloatArray
    camera_from_board: FloatArray
    truth_px: FloatArray
    size_px: tuple[int, int]


@dataclass
class Score:
    """What one finder made of one set of pictures."""

    errors_px: list[FloatArray] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)

    def line(self, name: str, bound_px: float) -> str:
        """One row of the table."""
        cpu = f"{np.median(self.cpu_s):7.3f} {max(self.cpu_s):8.3f}"
        found = f"{len(self.errors_px)}/{len(self.cpu_s)}"
        if not self.errors_px:
            return f"    {name:28s} {found:>6s} {'-':>8s} {'-':>6s} {'-':>7s} {cpu}"
        errors = np.concatenate(self.errors_px)
        rms = float(np.sqrt(np.square(errors).mean()))
        # the boards are rolled by less than 23 degrees: a bias along their axes shows
        bias = float(np.abs(errors.mean(axis=0)).max())
        return f"    {name:28s} {found:>6s} {rms:8.4f} {rms / bound_px:6.2f} {bias:7.4f} {cpu}"


def views(
    rows: int, cols: int, square_px: float, size_px: tuple[int, int], count: int
) -> Iterator[View]:
    """Poses up to 40 degrees off the axis, filling about a third of the picture."""
    rng = np.random.default_rng(rows)
    board = Board("chessboard", rows, cols, 0.025)
    width, height = size_px
    optics = np.zeros(len(OPTICS))
    f_px = 1.2 * width
    for name, value in (
        ("height_px", height),
        ("alpha_px", f_px),
        ("beta_px", f_px),
        ("u0_px", (width - 1) / 2),
        ("v0_px", (height - 1) / 2),
    ):
        optics[COLUMN[name]] = value
    for _ in range(count):
        axis = np.deg2rad(rng.uniform(0, 40)) * _unit(rng.uniform(0, 2 * np.pi))
        R = cv2.Rodrigues(axis)[0] @ cv2.Rodrigues(np.array([0, 0, rng.uniform(-0.4, 0.4)]))[0]
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


def clean_picture(view: View, blur_px: float, shape: str) -> FloatArray:
    """Grey levels without noise; `shape` of the blur is 'gauss' or 'disk', same sigma."""
    fine = oversampling(view)
    width, height = (side * fine for side in view.size_px)
    optics = view.optics.copy()
    for name in ("height_px", "alpha_px", "beta_px"):
        optics[COLUMN[name]] *= fine
    for name in ("u0_px", "v0_px"):
        optics[COLUMN[name]] = (optics[COLUMN[name]] + 0.5) * fine - 0.5
    blur = None
    if shape == "disk" and blur_px > 0:
        # a disk's sigma per axis is half its radius; focused at infinity all of the board blurs
        depth_m = float(view.camera_from_board[2, 3])
        aperture_m = 4 * blur_px * fine * depth_m / float(optics[COLUMN["alpha_px"]])
        blur = Blur(aperture_m=aperture_m, focus_distance_m=np.inf)
    picture = render(
        view.board,
        view.board.corners_m,
        optics,
        view.camera_from_board,
        width_px=width,
        height_px=height,
        blur=blur,
    )
    if shape == "gauss" and blur_px > 0:
        side = 2 * int(6 * fine * blur_px + 2) + 1
        picture = np.asarray(cv2.GaussianBlur(picture, (side, side), fine * blur_px), np.float32)
    picture = np.asarray(
        cv2.resize(picture, view.size_px, interpolation=cv2.INTER_AREA), np.float32
    )
    return np.asarray(DARK + CONTRAST * (picture.astype(float) - BLACK) / (WHITE - BLACK))


def oversampling(view: View) -> int:
    """Fine pixels to a side of a pixel: blurring finished pixels would move edges by 0.002 px."""
    return 3 if view.size_px[0] < 2000 else 2


def photograph(clean: FloatArray, seed: int) -> Image:
    """8-bit picture with white noise."""
    noisy = clean + np.random.default_rng(seed).normal(0, NOISE, clean.shape)
    return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


def moved_picture(view: View, name: str, blur_px: float, shape: str) -> FloatArray:
    """Change of every pixel for one pixel's move of the picture along an axis."""
    step_px = 0.05
    pictures = []
    for sign in (1, -1):
        optics = view.optics.copy()
        optics[COLUMN[name]] += sign * step_px
        pictures.append(clean_picture(replace(view, optics=optics), blur_px, shape))
    return np.asarray((pictures[0] - pictures[1]) / (2 * step_px))


def bound_px(view: View, blur_px: float, shape: str) -> float:
    """Least RMS per axis that the noise allows inside the windows, pixels."""
    gx, gy = (moved_picture(view, name, blur_px, shape) for name in ("u0_px", "v0_px"))
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
        inside = (np.abs(offset @ np.linalg.inv([e1, e2])) <= reach).all(axis=1)
        slope = np.stack([gx[y, x], gy[y, x]], axis=-1).reshape(-1, 2)[inside]
        variances.append(np.diag(np.linalg.inv(slope.T @ slope)))
    return float(np.hypot(NOISE, 12**-0.5) * np.sqrt(np.mean(variances)))


def ours(image: Image, board: Board) -> FloatArray | None:
    """This project's detector."""
    found = detect(image, board)
    return found.corners_px if found else None


def classic(image: Image, board: Board) -> FloatArray | None:
    """findChessboardCorners and cornerSubPix with a window of 0.35 squares."""
    found, corners = cv2.findChessboardCorners(image, (board.cols, board.rows))
    if not found:
        return None
    grid = corners.reshape(board.rows, board.cols, 2)
    step = min(
        np.linalg.norm(np.diff(grid, axis=0), axis=-1).min(),
        np.linalg.norm(np.diff(grid, axis=1), axis=-1).min(),
    )
    half = max(2, int(0.35 * step))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    refined = cv2.cornerSubPix(image, corners, (half, half), (-1, -1), criteria)
    return np.asarray(refined, float).reshape(-1, 2)


def sector_based(flags: int) -> Finder:
    """findChessboardCornersSB with these flags."""

    def find(image: Image, board: Board) -> FloatArray | None:
        found, corners = cv2.findChessboardCornersSB(image, (board.cols, board.rows), flags=flags)
        return np.asarray(corners, float).reshape(-1, 2) if found else None

    return find


def error_px(found: FloatArray, view: View) -> FloatArray:
    """(M, 2) error in the order, mirrored ones too, that suits the truth best."""
    board = view.board
    grid = found.reshape(board.rows, board.cols, 2)
    turned = [np.rot90(g, k) for g in (grid, grid[:, ::-1]) for k in range(4)]
    errors = [t.reshape(-1, 2) - view.truth_px for t in turned if t.shape == grid.shape]
    return min(errors, key=lambda error: float(np.square(error).sum()))


def compare(
    set_of_views: list[View], blur_px: float, shape: str, finders: dict[str, Finder]
) -> None:
    """Print one block of the table."""
    scores = {name: Score() for name in finders}
    bounds = []
    for seed, view in enumerate(set_of_views):
        clean = clean_picture(view, blur_px, shape)
        bounds.append(bound_px(view, blur_px, shape))
        image = photograph(clean, seed)
        for name, find in finders.items():
            begin = time.process_time()
            found = find(image, view.board)
            scores[name].cpu_s.append(time.process_time() - begin)
            if found is not None:
                scores[name].errors_px.append(error_px(found, view))
    bound = float(np.sqrt(np.mean(np.square(bounds))))
    board = set_of_views[0].board
    print(f"  {board.cols} x {board.rows}, blur {blur_px:g} px ({shape}), bound {bound:.4f} px")
    for name, score in scores.items():
        print(score.line(name, bound), flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--large", action="store_true", help="4096 x 3072 instead of 1279 x 724")
    parser.add_argument("--views", type=int, default=6, help="poses for each board")
    parser.add_argument("--ours-only", action="store_true", help="leave OpenCV out")
    parser.add_argument(
        "--classic-at-any-blur",
        action="store_true",
        help="findChessboardCorners on large blurred pictures too, minutes for some",
    )
    arguments = parser.parse_args()
    size, squares = ((4096, 3072), (150, 80)) if arguments.large else ((1279, 724), (47, 24))
    print(
        f"{size[0]} x {size[1]}, contrast {CONTRAST:g}, noise {NOISE:g}, OpenCV {cv2.__version__}"
    )
    heads = f"{'found':>6s} {'RMS px':>8s} {'/bound':>6s} {'bias':>7s} {'CPU s':>7s} {'worst':>8s}"
    print(f"    {'finder':28s} {heads}")
    for (rows, cols), square_px in zip(((7, 10), (14, 14)), squares, strict=True):
        seen = list(views(rows, cols, square_px, size, arguments.views))
        warm = photograph(clean_picture(seen[0], 1.0, "gauss"), 0)
        ours(warm, seen[0].board)
        for blur_px, shape in ((0, "gauss"), (1, "gauss"), (3, "gauss"), (6, "gauss"), (3, "disk")):
            finders: dict[str, Finder] = {"this project": ours}
            if not arguments.ours_only:
                if not arguments.large or blur_px < 2 or arguments.classic_at_any_blur:
                    finders["findChessboardCorners+SubPix"] = classic
                finders["SB"] = sector_based(0)
                finders["SB exhaustive, accuracy"] = sector_based(EXACT)
            compare(seen, blur_px, shape, finders)


if __name__ == "__main__":
    main()
