"""On how many pictures of real recordings the board is found, by this project and by OpenCV.

    python -m benchmarks.corners_recordings FOLDER...   # folders of recordings, or one of them

OpenCV's finders for chessboards: the classic one with its default flags and with normalised
pictures and filtered quads, the sector-based one (SB) plain, exhaustive and accurate, and
normalised besides; for ChArUco boards its own detector. A ChArUco board counts as found from six
corners on. CPU seconds are of all threads.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from benchmarks.corner_pictures import Image
from calib.detection import detect, make_ready
from calib.detection.markers import layouts
from calib.views import Board
from cell.storage.recording import Recording, read_recording

Finder = Callable[[Image, Board], bool]

FEWEST = 6
EXACT = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
NORMALISED = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
CLASSIC = {"classic": NORMALISED, "classic, filtered": NORMALISED | cv2.CALIB_CB_FILTER_QUADS}
SECTORS = {"SB": 0, "SB EA": EXACT, "SB EA, normalised": EXACT | cv2.CALIB_CB_NORMALIZE_IMAGE}


def classic(flags: int) -> Finder:
    """findChessboardCorners with these flags."""
    return lambda image, board: cv2.findChessboardCorners(
        image, (board.cols, board.rows), flags=flags
    )[0]


def sector_based(flags: int) -> Finder:
    """findChessboardCornersSB with these flags."""
    return lambda image, board: cv2.findChessboardCornersSB(
        image, (board.cols, board.rows), flags=flags
    )[0]


def of_markers(image: Image, board: Board) -> bool:
    """OpenCV's ChArUco detector, with whichever of its two layouts sees more."""
    seen = [cv2.aruco.CharucoDetector(layout).detectBoard(image)[1] for layout in layouts(board)]
    return max(0 if ids is None else len(ids) for ids in seen) >= FEWEST


def finders_for(board: Board) -> dict[str, Finder]:
    """The finders to compare, by name."""
    ours: dict[str, Finder] = {"this project": lambda image, board: bool(detect(image, board))}
    if board.kind == "charuco":
        return ours | {"ChArUco": of_markers}
    return (
        ours
        | {name: classic(flags) for name, flags in CLASSIC.items()}
        | {name: sector_based(flags) for name, flags in SECTORS.items()}
    )


def compare(recording: Recording, name: str) -> None:
    """Print one line for each finder."""
    finders = finders_for(recording.board)
    found = dict.fromkeys(finders, 0)
    cpu_s: dict[str, list[float]] = {name: [] for name in finders}
    pictures = 0
    for frame in recording.frames:
        if frame.image is None or not (recording.path / frame.image).exists():
            continue
        image = recording.image(frame)
        grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        pictures += 1
        for finder, find in finders.items():
            begin = time.process_time()
            found[finder] += bool(find(grey, recording.board))
            cpu_s[finder].append(time.process_time() - begin)
    print(f"{name}: {pictures} pictures")
    for finder, count in found.items():
        seconds = cpu_s[finder] or [0.0]
        print(
            f"    {finder:20s} {count:4d} found, {np.median(seconds):6.3f} s,"
            f" {max(seconds):6.3f} s at most",
            flush=True,
        )


def main() -> None:
    """Go through the folders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    make_ready()
    for folder in parser.parse_args().folders:
        for header in sorted(folder.glob("**/recording.yaml")):
            compare(read_recording(header.parent), header.parent.name)


if __name__ == "__main__":
    main()
