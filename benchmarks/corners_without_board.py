"""How long the search takes where there is no board to find: the slowest pictures we know of.

    python -m benchmarks.corners_without_board            # 4096 x 3072
    python -m benchmarks.corners_without_board --small    # 1279 x 724

Noise, gravel, thousands of crossings without order, boards that are larger or smaller than the one
looked for, a field of markers. CPU seconds are of all threads.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import cv2
import numpy as np

from benchmarks.corner_pictures import Image
from calib.detection import detect, make_ready
from calib.views import Board

BOARDS = {
    "10 x 7": Board("chessboard", 7, 10, 0.025),
    "14 x 14": Board("chessboard", 14, 14, 0.025),
    "ChArUco 8 x 6": Board("charuco", 6, 8, 0.03, 0.022, "DICT_5X5_100"),
}
Size = tuple[int, int]


def _eight_bit(levels: np.ndarray) -> Image:
    return np.asarray(np.clip(np.rint(levels), 0, 255), np.uint8)


def noise(size: Size, sigma_px: float, contrast: float) -> Image:
    """White noise, smoothed."""
    levels = np.random.default_rng(0).normal(0, 1, size).astype(np.float32)
    if sigma_px > 0:
        levels = cv2.GaussianBlur(levels, (0, 0), sigma_px)
    return _eight_bit(128 + contrast * levels / levels.std())


def gravel(size: Size, stone_px: float) -> Image:
    """Ellipses of all greys on top of each other."""
    rng = np.random.default_rng(1)
    image = np.full(size, 128, np.uint8)
    for y, x in rng.uniform(0, 1, (int(size[0] * size[1] / stone_px**2), 2)) * size:
        axes = (stone_px * rng.uniform(0.3, 0.8, 2)).astype(int).tolist()
        grey = int(rng.integers(20, 240))
        cv2.ellipse(image, (int(x), int(y)), axes, rng.uniform(0, 180), 0, 360, grey, -1)
    return image


def crossings(size: Size, step_px: int) -> Image:
    """A random field cut at zero: crossings everywhere, in no order."""
    coarse = np.random.default_rng(2).uniform(-1, 1, (size[0] // step_px, size[1] // step_px))
    field = cv2.resize(coarse.astype(np.float32), size[::-1], interpolation=cv2.INTER_CUBIC)
    return _eight_bit(128 + 100 * np.clip(5 * field, -1, 1))


def squares(size: Size, square_px: int) -> Image:
    """A chessboard without end."""
    y, x = np.indices(size) // square_px
    return _eight_bit(45 + 160 * ((x + y) % 2) + np.random.default_rng(3).normal(0, 2, size))


def small_boards(size: Size, corners: int, square_px: int) -> Image:
    """Many boards that are not the one looked for."""
    print_ = np.indices((corners + 1, corners + 1)).sum(axis=0) % 2 * 160 + 45
    one = np.pad(np.kron(print_, np.ones((square_px, square_px))), square_px, constant_values=205)
    times = [side // len(one) for side in size]
    tiled = np.tile(one, times)
    rest = [(0, side - part) for side, part in zip(size, tiled.shape, strict=True)]
    return _eight_bit(np.pad(tiled, rest, constant_values=205))


def markers(size: Size, side_px: int) -> Image:
    """Markers of the board's dictionary in rows, none of them where the board has it."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    image = np.full(size, 255, np.uint8)
    pitch = side_px * 3 // 2
    for number, (i, j) in enumerate(np.ndindex(size[0] // pitch - 1, size[1] // pitch - 1)):
        marker = cv2.aruco.generateImageMarker(dictionary, number * 7 % 100, side_px)
        image[i * pitch : i * pitch + side_px, j * pitch : j * pitch + side_px] = marker
    return image


def pictures(size: Size) -> Iterator[tuple[str, Image]]:
    """The pictures, with their names."""
    yield "even grey", np.full(size, 90, np.uint8)
    yield "white noise, dim", noise(size, 0.0, 3.0)
    yield "white noise, full contrast", noise(size, 0.0, 60.0)
    for sigma_px in (2.0, 6.0):
        yield f"noise smoothed by {sigma_px:g} px", noise(size, sigma_px, 50.0)
    for px in (12, 30, 80):
        yield f"gravel of {px} px", gravel(size, px)
    for px in (12, 30, 90):
        yield f"random crossings, {px} px", crossings(size, px)
    for px in (10, 20, 40, 100):
        yield f"endless chessboard of {px} px", squares(size, px)
    for count, px in ((5, 20), (9, 16), (5, 10)):
        yield f"boards of {count} x {count}, {px} px", small_boards(size, count, px)
    yield "field of markers", markers(size, 42)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--small", action="store_true", help="1279 x 724 instead of 4096 x 3072")
    size = (724, 1279) if parser.parse_args().small else (3072, 4096)
    make_ready()
    print(f"CPU s at {size[1]} x {size[0]}; {'':12s}" + "".join(f"{name:>15s}" for name in BOARDS))
    for name, picture in pictures(size):
        row = ""
        for board in BOARDS.values():
            begin = time.process_time()
            found = detect(picture, board)
            row += f"{time.process_time() - begin:9.2f}{' FOUND' if found else '':6s}"
        print(f"    {name:32s}{row}", flush=True)


if __name__ == "__main__":
    main()
