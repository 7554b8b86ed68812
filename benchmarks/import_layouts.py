"""What `cell import` recovers from each layout of poses: the focal length and the hand-eye.

One simulated cell, its corners as pictures would give them; its poses written in every layout that
the tests know, read back with nothing stated but what the layout needs, calibrated, and compared
with the truth::

    python -m benchmarks.import_layouts > import_layouts.md
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.calibration import calibrate
from calib.chain.rigid import inverse
from calib.detection.orientation import RoughPoses
from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.importing.conventions import Candidate, Convention, StatedConvention, conclude
from cell.verbs.importing.pairing import apply, pairings
from cell.verbs.importing.pose_files import flange_series, read_series
from tests.cell.pose_layouts import LAYOUTS, Layout, picture_names
from tests.paper.scene import ALPHA0, FLANGE_FROM_MOUNTED, mixed_scene

ALPHA_PX, HAND_EYE_MM = 0.1, 0.1
"""Nearer than this to the truth, a layout counts as read."""

FRAMES = 9
VIEWS = mixed_scene(2, FRAMES - 2, noise_px=0.01, robot_mm=0.005).views
ROUGH = RoughPoses.of(VIEWS.corners_px, VIEWS.board, "eye_in_hand")


def imported(layout: Layout, folder: Path) -> tuple[FloatArray, Convention]:
    """(N, 4, 4) poses as `cell import` reads them from the layout, and what it concluded."""
    path = layout.write(folder, VIEWS.base_from_flange)
    names = picture_names(layout, FRAMES)
    candidates = [
        Candidate(series.poses, pairing, series.notes)
        for series in flange_series(path, read_series(path))
        for pairing in pairings(names, series.poses)
    ]
    stated = StatedConvention(layout.stated.get("rotation"))
    chosen, convention = conclude(candidates, stated, ROUGH.closure, VIEWS.board.square_m)
    poses = np.array([convention.transform(pose).as_matrix() for pose in chosen.poses])
    return apply(chosen.pairing, poses), convention


def recovered(poses: FloatArray) -> tuple[float, float, float]:
    """How far alpha (px) and the hand-eye (mm, mrad) are from the truth."""
    found = calibrate(replace(VIEWS, base_from_flange=poses))
    assert found.robot is not None, found.missing
    off = inverse(FLANGE_FROM_MOUNTED) @ found.robot.flange_from_mounted
    turn = np.arccos(np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1))
    alpha = found.solutions["joint_ml"].values["alpha_px"] - ALPHA0
    return alpha, 1e3 * float(np.linalg.norm(off[:3, 3])), 1e3 * float(turn)


def rows() -> Iterator[tuple[str, ...]]:
    """A row for each layout."""
    for name, layout in LAYOUTS.items():
        with tempfile.TemporaryDirectory() as folder:
            try:
                poses, convention = imported(layout, Path(folder))
            except InputError as refused:
                yield (name, "refused", "", "", "", str(refused).splitlines()[0])
                continue
        alpha, far, turn = recovered(poses)
        right = abs(alpha) < ALPHA_PX and far < HAND_EYE_MM
        read = f"{convention.rotation}, {convention.unit}"
        yield (name, read, f"{alpha:+.3f}", f"{far:.3f}", f"{turn:.3f}", "yes" if right else "NO")


def main() -> int:
    """Print the table; 1 where a layout does not give the truth."""
    head = ("layout", "read as", "alpha off px", "hand-eye off mm", "mrad", "truth recovered")
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    bad = 0
    for row in rows():
        bad += row[-1] != "yes"
        print("| " + " | ".join(row) + " |", flush=True)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
