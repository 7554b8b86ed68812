"""Corner detection against OpenCV's finders: RMS, bias, detections and CPU seconds in one run.

    python -m benchmarks.corners            # 1279 x 724, blur 0 to 6 px, Gaussian and disk
    python -m benchmarks.corners --large    # 4096 x 3072
    python -m benchmarks.corners --charuco  # ChArUco boards, with either size

CPU seconds are of all threads. The bound is Cramer-Rao's for a known pattern; for ChArUco boards
in the cross that runs free of print between the markers.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np

from benchmarks.corner_pictures import (
    CONTRAST,
    NOISE,
    Image,
    Softness,
    View,
    bounds_px,
    clean_picture,
    photograph,
    views,
)
from calib.detection import detect, make_ready
from calib.detection.markers import layouts
from calib.views import Board, FloatArray

Finder = Callable[[Image, Board], "FloatArray | None"]

EXACT = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY


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


def of_markers(image: Image, board: Board) -> FloatArray | None:
    """OpenCV's ChArUco detector; NaN where it saw no corner, None below six."""
    corners, ids, _, _ = cv2.aruco.CharucoDetector(layouts(board)[0]).detectBoard(image)
    if ids is None or len(ids) < 6:
        return None
    found = np.full((board.corner_count, 2), np.nan)
    found[ids.ravel()] = corners.reshape(-1, 2)
    return found


def error_px(found: FloatArray, view: View) -> FloatArray:
    """(K, 2) error of the corners seen, in the order, mirrored ones too, that suits best."""
    board = view.board
    grid = found.reshape(board.rows, board.cols, 2)
    turned = [np.rot90(g, k) for g in (grid, grid[:, ::-1]) for k in range(4)]
    errors = [t.reshape(-1, 2) - view.truth_px for t in turned if t.shape == grid.shape]
    best = min(errors, key=lambda error: float(np.nansum(np.square(error))))
    return best[np.isfinite(best[:, 0])]


def compare(set_of_views: list[View], soft: Softness, finders: dict[str, Finder]) -> None:
    """Print one block of the table."""
    scores = {name: Score() for name in finders}
    bounds = []
    for seed, view in enumerate(set_of_views):
        clean = clean_picture(view, soft)
        bounds.append(bounds_px(view, soft))
        image = photograph(clean, seed)
        for name, find in finders.items():
            begin = time.process_time()
            found = find(image, view.board)
            scores[name].cpu_s.append(time.process_time() - begin)
            if found is not None:
                scores[name].errors_px.append(error_px(found, view))
    bound = float(np.sqrt(np.mean(np.square(bounds))))
    board, shape = set_of_views[0].board, "disk" if soft.disk else "gauss"
    print(
        f"  {board.cols} x {board.rows}, blur {soft.sigma_px:g} px ({shape}), bound {bound:.4f} px"
    )
    for name, score in scores.items():
        print(score.line(name, bound), flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--large", action="store_true", help="4096 x 3072 instead of 1279 x 724")
    parser.add_argument("--views", type=int, default=6, help="poses for each board")
    parser.add_argument("--charuco", action="store_true", help="ChArUco boards, not chessboards")
    parser.add_argument("--ours-only", action="store_true", help="leave OpenCV out")
    parser.add_argument(
        "--classic-at-any-blur",
        action="store_true",
        help="findChessboardCorners on large blurred pictures too, minutes for some",
    )
    arguments = parser.parse_args()
    size = (4096, 3072) if arguments.large else (1279, 724)
    print(
        f"{size[0]} x {size[1]}, contrast {CONTRAST:g}, noise {NOISE:g}, OpenCV {cv2.__version__}"
    )
    heads = f"{'found':>6s} {'RMS px':>8s} {'/bound':>6s} {'bias':>7s} {'CPU s':>7s} {'worst':>8s}"
    print(f"    {'finder':28s} {heads}")
    make_ready()
    for board, square_px in boards(large=arguments.large, charuco=arguments.charuco):
        seen = list(views(board, square_px, size, arguments.views))
        for sigma_px, disk in ((0, False), (1, False), (3, False), (6, False), (3, True)):
            finders: dict[str, Finder] = {"this project": ours}
            if not arguments.ours_only and arguments.charuco:
                finders["ChArUco"] = of_markers
            elif not arguments.ours_only:
                if not arguments.large or sigma_px < 2 or arguments.classic_at_any_blur:
                    finders["findChessboardCorners+SubPix"] = classic
                finders["SB"] = sector_based(0)
                finders["SB exhaustive, accuracy"] = sector_based(EXACT)
            compare(seen, Softness(sigma_px, disk), finders)


def boards(*, large: bool, charuco: bool) -> list[tuple[Board, float]]:
    """The boards, and how large their squares are seen, pixels."""
    if charuco:
        few = Board("charuco", 6, 8, 0.03, 0.022, "DICT_5X5_100")
        many = Board("charuco", 10, 13, 0.03, 0.0225, "DICT_4X4_250")
        return [(few, 150), (many, 80)] if large else [(few, 47), (many, 30)]
    few, many = (Board("chessboard", rows, cols, 0.025) for rows, cols in ((7, 10), (14, 14)))
    return [(few, 150), (many, 80)] if large else [(few, 47), (many, 24)]


if __name__ == "__main__":
    main()
