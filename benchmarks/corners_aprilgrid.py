"""AprilGrid corners against truth, beside OpenCV's own refinements of the same tags.

    python -m benchmarks.corners_aprilgrid [VIEWS]

A 4 x 4 grid of tags about 100 px wide, in 800 x 600 pictures, tilted to 30 degrees, lens k1 -0.1,
noise of 2 grey levels. Prints root mean square errors per axis in px over the corners at least 12
px inside the picture, the fit's own sigma, and the share of corners that was found.
"""

from __future__ import annotations

import sys

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.optics import optics_row
from calib.chain.projection import project
from calib.detection import detect
from calib.views import Board
from sim.render import render

BOARD = Board("aprilgrid", 8, 8, 0.03, dictionary="DICT_APRILTAG_36h11", gap_m=0.009)
WIDTH, HEIGHT, PAD, RIM = 800, 600, 16, 12
OPTICS = {"alpha_px": 900.0, "beta_px": 900.0, "k1": -0.1, "height_px": float(HEIGHT)}
REFINED = {"as found": cv2.aruco.CORNER_REFINE_NONE, "SUBPIX": cv2.aruco.CORNER_REFINE_SUBPIX,
           "CONTOUR": cv2.aruco.CORNER_REFINE_CONTOUR}  # fmt: skip


def picture(rng: np.random.Generator, blur_px: float) -> tuple[np.ndarray, np.ndarray]:
    """8 bits, and (M, 2) true corners."""
    turn = Rotation.from_euler("xyz", [*rng.uniform(-30, 30, 2), rng.uniform(-180, 180)], True)
    middle = BOARD.corners_m.mean(axis=0)
    pose = RigidTransform.from_components(np.array([0, 0, 0.27]) - turn.apply(middle), turn)
    wide = optics_row(u0_px=400 + PAD, v0_px=300 + PAD, **OPTICS)
    size = {"width_px": WIDTH + 2 * PAD, "height_px": HEIGHT + 2 * PAD}
    clear = 255 * render(BOARD, BOARD.corners_m, wide, pose.as_matrix(), **size)
    soft = cv2.GaussianBlur(clear, (0, 0), blur_px) if blur_px else clear
    image = soft[PAD:-PAD, PAD:-PAD] + rng.normal(0, 2, (HEIGHT, WIDTH))
    there = project(wide[None], pose.as_matrix()[None], BOARD.corners_m)[0] - PAD
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), there


def by_opencv(image: np.ndarray, truth: np.ndarray, method: int) -> np.ndarray:
    """(K, 2) errors of the tags' corners, each against the true corner nearest to it."""
    settings = cv2.aruco.DetectorParameters()
    settings.markerBorderBits, settings.cornerRefinementMethod = 2, method
    settings.minMarkerPerimeterRate = 0.05
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    outlines, _, _ = cv2.aruco.ArucoDetector(dictionary, settings).detectMarkers(image)
    corners = np.array(outlines, dtype=float).reshape(-1, 2)
    nearest = np.linalg.norm(corners[:, None] - truth, axis=2).argmin(axis=1)
    return corners - truth[nearest]


def rms(errors: list[np.ndarray]) -> float:
    return float(np.sqrt(np.square(np.concatenate(errors)).mean()))


def main(views: int) -> None:
    print("| blur px | ours | its own sigma | found |", " | ".join(REFINED), "|")
    print("|---|---|---|---|" + "---|" * len(REFINED))
    for blur_px in (0.0, 0.6, 1.0, 2.0, 3.0):
        rng = np.random.default_rng(0)
        ours, sigma, seen, there = [], [], 0, 0
        theirs: dict[str, list[np.ndarray]] = {name: [] for name in REFINED}
        for _ in range(views):
            image, truth = picture(rng, blur_px)
            inside = ((truth > RIM) & (truth < np.array([WIDTH, HEIGHT]) - RIM)).all(axis=1)
            there += int(inside.sum())
            for name, method in REFINED.items():
                theirs[name].append(by_opencv(image, truth, method))
            found = detect(image, BOARD)
            if not found:
                continue
            good = inside & np.isfinite(found.corners_px).all(axis=1)
            seen += int(good.sum())
            ours.append((found.corners_px - truth)[good])
            sigma.append(found.sigma_px[good])
        own = f"{rms(ours):.4f} | {rms(sigma):.4f}" if ours else "- | -"
        row = " | ".join(f"{rms(theirs[name]):.3f}" for name in REFINED)
        print(f"| {blur_px} | {own} | {100 * seen / there:.0f} % | {row} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 6)
