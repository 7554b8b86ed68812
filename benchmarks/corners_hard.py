"""Corners in hard pictures at 1279 x 724: aslant, tiny, dim, noisy, glaring, moving, half in focus.

    python -m benchmarks.corners_hard

The bound is Cramer-Rao's for a known pattern under the same light and noise.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.corner_pictures import (
    DARK,
    NOISE,
    Softness,
    View,
    bounds_px,
    clean_picture,
    photograph,
    views,
)
from calib.detection import detect, make_ready
from calib.views import Board, FloatArray

SIZE = (1279, 724)
FEW, MANY = (Board("chessboard", rows, cols, 0.025) for rows, cols in ((7, 10), (14, 14)))
SLIGHT = Softness(1.0)
Look = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Case:
    """One row of the table: `gain` multiplies the light, `spoil` is done to it besides."""

    name: str
    board: Board = FEW
    square_px: float = 47.0
    soft: Softness = SLIGHT
    tilt_deg: tuple[float, float] = (0.0, 40.0)
    focal_widths: float = 1.2
    noise: float = NOISE
    gain: FloatArray | float = 1.0
    spoil: Look = lambda levels: levels


def uneven() -> FloatArray:
    """Light that falls to a fifth from the left to the right."""
    return np.tile(np.linspace(1.0, 0.2, SIZE[0]), (SIZE[1], 1))


def glare(levels: FloatArray) -> FloatArray:
    """A bright spot on the board that leaves its squares apart."""
    y, x = np.indices(levels.shape)
    return levels + 45 * np.exp(-((x - 640) ** 2 + (y - 360) ** 2) / (2 * 60.0**2))


ASLANT = (55.0, 62.0)
CASES = (
    *(Case(f"10 x 7 at 55-62 deg, blur {s}", soft=Softness(s), tilt_deg=ASLANT) for s in (0, 3, 6)),
    *(Case(f"14 x 14 at 55-62 deg, blur {s}", MANY, 30, Softness(s), ASLANT) for s in (0, 3)),
    *(Case(f"10 x 7, squares of 8 px, blur {s}", FEW, 8, Softness(s)) for s in (0, 1, 2)),
    *(Case(f"14 x 14, squares of 8 px, blur {s}", MANY, 8, Softness(s)) for s in (0, 1, 2)),
    *(
        Case(f"10 x 7, squares of {px} px at 55-62 deg, blur {s}", FEW, px, Softness(s), ASLANT)
        for px, s in ((16, 0), (16, 1), (8, 0), (8, 1))
    ),
    *(
        Case(
            f"wide lens, 30-45 deg, focus on the middle, disk {s}",
            FEW,
            60,
            Softness(s, disk=True, focused_on_board=True),
            (30.0, 45.0),
            0.6,
        )
        for s in (0.5, 2)
    ),
    *(Case(f"noise {noise}", noise=noise) for noise in (0.5, 8, 20)),
    *(Case(f"contrast {160 * gain:g}", gain=gain) for gain in (0.1, 0.25)),
    Case("light falls to a fifth", gain=uneven()),
    Case("glare", gain=0.8, spoil=glare),
    Case("white saturated", spoil=lambda levels: 1.5 * (levels - DARK) + DARK),
    *(Case(f"moved by {px} px", soft=Softness(1.0, motion_px=px)) for px in (3, 8)),
)


def error_px(found: FloatArray, view: View) -> FloatArray:
    """(M, 2) error in the unmirrored order that suits best."""
    grid = found.reshape(view.board.rows, view.board.cols, 2)
    turned = [np.rot90(grid, k) for k in range(4)]
    errors = [t.reshape(-1, 2) - view.truth_px for t in turned if t.shape == grid.shape]
    return min(errors, key=lambda error: float(np.square(error).sum()))


def row(case: Case, count: int) -> str:
    """What was found, RMS, bound, bias and time."""
    errors, bounds, cpu_s = [], [], []
    poses = views(
        case.board,
        case.square_px,
        SIZE,
        count,
        tilt_deg=case.tilt_deg,
        focal_widths=case.focal_widths,
    )
    for seed, view in enumerate(poses):
        levels = case.spoil(case.gain * clean_picture(view, case.soft))
        picture = photograph(levels, seed, case.noise)
        begin = time.process_time()
        found = detect(picture, case.board)
        cpu_s.append(time.process_time() - begin)
        if found:
            errors.append(error_px(found.corners_px, view))
            bounds.append(bounds_px(view, case.soft, case.gain, case.noise))
    head = f"{case.name:52s} {len(errors)}/{count}"
    if not errors:
        return f"{head}{'':34s} {max(cpu_s):6.3f}"
    rms, bound = (float(np.sqrt(np.mean(np.square(v)))) for v in (errors, bounds))
    bias = float(np.abs(np.concatenate(errors).mean(axis=0)).max())
    return f"{head} {rms:8.4f} {bound:8.4f} {rms / bound:6.2f} {bias:8.4f} {max(cpu_s):6.3f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=4, help="poses for each row")
    count = parser.parse_args().views
    make_ready()
    print(f"{'':52s} found  RMS px    bound /bound     bias  CPU s at most")
    for case in CASES:
        print(row(case, count), flush=True)


if __name__ == "__main__":
    main()
