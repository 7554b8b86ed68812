"""A wide lens calibrated by this program, OpenCV's fisheye, mrcal's models and Kalibr's, on the
same pictures; judged by frames that had no say.

    python -m benchmarks.wide_lens [FRAMES]

Pictures of a chessboard, 1280 x 960, with corners at most 77 degrees off the axis: the lens is
equidistant with four radial terms, decentering (p1 3e-4, p2 -2e-4) and an entrance pupil that moves
by 0.5 mm per squared radian, which none of the programs has; blur 0.7 px, noise of 2 grey levels.
Every program gets the corners of this program's detector. Two frames of three calibrate; on the
others each lens is held and the pose alone is fitted. Prints misses of held-out corners, RMS per
axis in px: of all, and of those more than 60 degrees off the axis; and how far the corners
themselves are off the truth.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from calib.calibration.joint_lens import deserved_terms
from calib.calibration.lens_choice import chosen_lens
from calib.calibration.pictures import Pictures
from calib.chain.domain import off_axis_rad
from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.detection import detect
from calib.solver.free_poses import fit_free_poses
from calib.views import Board, FloatArray, Views
from sim.render import render

BOARD = Board("chessboard", 7, 10, 0.02)
WIDTH, HEIGHT = 1280, 960
TRUE = optics_row(
    alpha_px=445.0, beta_px=446.0, u0_px=645.0, v0_px=471.0, height_px=960.0, equidistant=1.0,
    k1=0.03, k2=-0.01, k3=0.003, k4=-0.0006, p1=3e-4, p2=-2e-4, pupil_m_rad2=5e-4,
)  # fmt: skip
MRCAL = Path(__file__).parents[1] / ".mrcal" / "bin" / "python"
_WIDEST_RAD, _FAR_RAD, _RIM_PX = np.radians(77.0), np.radians(60.0), 12


def off_axis(place: FloatArray) -> FloatArray:
    """(M,) angles of the corners."""
    return off_axis_rad(BOARD.corners_m @ place[:3, :3].T + place[:3, 3])


def pose(rng: np.random.Generator) -> FloatArray:
    """(4, 4) a board that is whole in the picture, anywhere."""
    while True:
        off, around = np.radians(70.0) * np.sqrt(rng.random()), rng.uniform(0, 2 * np.pi)
        toward = Rotation.from_rotvec([-off * np.sin(around), off * np.cos(around), 0.0])
        turn = toward * Rotation.from_rotvec(rng.normal(0, 0.35, 3))
        place = np.eye(4)
        place[:3, :3] = turn.as_matrix()
        aim = toward.apply([0.0, 0.0, rng.uniform(0.2, 0.35)])
        place[:3, 3] = aim - turn.apply(BOARD.corners_m.mean(axis=0))
        seen = project(TRUE[None], place[None], BOARD.corners_m)[0]
        size = np.array([WIDTH, HEIGHT])
        whole = ((seen > _RIM_PX) & (seen < size - _RIM_PX)).all()
        if whole and off_axis(place).max() < _WIDEST_RAD:
            return place


def picture(place: FloatArray, rng: np.random.Generator) -> np.ndarray:
    """8 bits."""
    clear = render(BOARD, BOARD.corners_m, TRUE, place, width_px=WIDTH, height_px=HEIGHT)
    soft = cv2.GaussianBlur(255 * clear, (0, 0), 0.7)
    return np.clip(np.rint(soft + rng.normal(0, 2, soft.shape)), 0, 255).astype(np.uint8)


def detected(frames: int) -> tuple[FloatArray, FloatArray]:
    """(N, M, 2) corners found, and (N, 4, 4) the true poses."""
    rng = np.random.default_rng(5)
    corners, poses = [], []
    for _ in range(frames):
        place = pose(rng)
        found = detect(picture(place, rng), BOARD)
        if found:
            truth = project(TRUE[None], place[None], BOARD.corners_m)[0]
            ahead, behind = found.corners_px, found.corners_px[::-1]
            turned = np.abs(behind - truth).sum() < np.abs(ahead - truth).sum()
            corners.append(behind if turned else ahead)
            poses.append(place)
    return np.array(corners), np.array(poses)


def held(optics: FloatArray, corners: FloatArray, poses: FloatArray) -> FloatArray:
    """(N, M, 2) misses of frames of which the pose alone is fitted."""
    rows = np.repeat(optics[None], len(corners), axis=0)
    return fit_free_poses(rows, poses, BOARD.corners_m, corners, ()).residual_px


def ours(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(K,) this program's lens, and Kalibr's model: its four radial terms alone."""
    blank = Views.blank(BOARD, width_px=WIDTH, height_px=HEIGHT, frames=len(corners))
    baseline, homographies = chosen_lens(replace(blank, corners_px=corners))
    assert homographies is None, "taken for a pinhole"
    used = baseline.used
    optics, poses = baseline.mle.optics[used], baseline.mle.camera_from_board[used]
    pictures = Pictures(optics, poses, BOARD.corners_m, corners[used], baseline.weight[used])
    return pictures.fit(deserved_terms(pictures)).optics[0], optics[0]


def by_opencv(corners: FloatArray) -> FloatArray:
    """(K,) `cv2.fisheye.calibrate` from its own start, skew fixed."""
    board = [BOARD.corners_m[None]] * len(corners)
    flags = cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
    enough = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    _, K, D, _, _ = cv2.fisheye.calibrate(
        board, list(corners[:, None]), (WIDTH, HEIGHT), np.eye(3), np.zeros((4, 1)),
        flags=flags, criteria=enough,
    )  # fmt: skip
    named = dict(zip(("k1", "k2", "k3", "k4"), D.ravel(), strict=True))
    return optics_row(alpha_px=K[0, 0], beta_px=K[1, 1], u0_px=K[0, 2], v0_px=K[1, 2],
                      height_px=HEIGHT, equidistant=1.0, **named)  # fmt: skip


def by_mrcal(train: FloatArray, test: FloatArray, places: FloatArray) -> Mapping[str, FloatArray]:
    """(N, M, 2) misses of mrcal's models; nothing where it is not installed."""
    if not MRCAL.exists():
        return {}
    vectors = [
        np.concatenate([Rotation.from_matrix(p[:3, :3]).as_rotvec(), p[:3, 3]]) for p in places
    ]
    grid = (-1, BOARD.rows, BOARD.cols, 2)
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        np.savez(
            file.name, size=[WIDTH, HEIGHT], square_m=BOARD.square_m,
            core=[440.0, 440.0, 639.5, 479.5], train=train.reshape(grid), test=test.reshape(grid),
            train_poses=vectors[: len(train)], test_poses=vectors[len(train) :],
        )  # fmt: skip
        script = Path(__file__).with_name("wide_lens_mrcal.py")
        done = subprocess.run(
            [MRCAL, script, file.name], capture_output=True, text=True, check=True
        )
    found = json.loads(done.stdout.splitlines()[-1])
    return {name: np.array(misses) for name, misses in found.items()}


def main(frames: int) -> None:
    corners, poses = detected(frames)
    truth = project(np.repeat(TRUE[None], len(poses), axis=0), poses, BOARD.corners_m)
    angle = np.array([off_axis(place) for place in poses])
    out = np.arange(len(corners)) % 3 == 2
    (best, kalibr), far = ours(corners[~out]), angle[out] > _FAR_RAD
    misses = {
        "the corners themselves": (corners - truth)[out],
        "this program": held(best, corners[out], poses[out]),
        "Kalibr's model, fitted here": held(kalibr, corners[out], poses[out]),
    }
    try:
        misses["cv2.fisheye"] = held(by_opencv(corners[~out]), corners[out], poses[out])
    except cv2.error as error:
        print(f"cv2.fisheye.calibrate: {' '.join(str(error).split())}")
    ordered = np.concatenate([poses[~out], poses[out]])
    misses |= {f"mrcal {n}": m for n, m in by_mrcal(corners[~out], corners[out], ordered).items()}
    print(
        f"{len(corners)} of {frames} boards found; farthest {np.degrees(angle.max()):.1f} degrees"
    )
    print("| held-out frames | all corners | beyond 60 degrees |\n|---|---|---|")
    for name, miss in misses.items():
        all_px, far_px = np.sqrt((miss**2).mean()), np.sqrt((miss[far] ** 2).mean())
        print(f"| {name} | {all_px:.4f} | {far_px:.4f} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
