"""How far off alpha is where a run ends early, beside the sigma it ended on.

``python benchmarks/early_end.py [RUNS] [CELL ...]`` simulates corners of the shipped plans, half
of the runs in the plan's own order and half with every third view first, estimates after every
second frame, and ends each run as ``until: {alpha_sigma_px: 0.5}`` does. Beside it stands where a
sigma alone would have ended it: that of a lens whose law is free only when the frames demand it.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.calibration.running import fit_so_far
from calib.calibration.uncertainty import optics_at
from calib.chain.optics import COLUMN
from calib.errors import CalibrationError
from calib.views import FloatArray, Views
from cell.files.plan_file import Plan, Until, read_plan
from cell.recording import Recording, read_recording
from cell.running_estimate.early_end import EarlyEnd
from cell.running_estimate.estimate import Estimator
from cell.running_estimate.view_kinds import planned_flange_poses
from cell.simulate import simulate_corners
from cell.simulated import home_of, simulated_cell

CONFIGS = Path(__file__).parents[1] / "configs"
GOAL_PX = 0.5
FIRST, STEP = 6, 2

End = tuple[int, float, float]
"""Frames, the worst error over the distances in pixels, and in sigmas of its place."""


def ordered(plan: Plan, strided: bool) -> Plan:
    views = plan.file.views
    if strided:
        views = (*views[0::3], *views[1::3][::-1], *views[2::3])
    return replace(plan, file=plan.file.model_copy(update={"views": views}))


def off(plan: Plan, views: Views, distance_m: FloatArray, alpha: FloatArray) -> FloatArray:
    """(D,) how far alpha is from the truth."""
    truth = simulated_cell(plan.cell, home_of(plan)).model
    at = COLUMN["alpha_px"]
    return alpha - np.array([optics_at(truth, views, float(d))[at] for d in distance_m])


def by_goal(plan: Plan, recording: Recording, views: Views) -> End | None:
    estimator, goal = (
        Estimator(plan, planned_flange_poses(plan)),
        EarlyEnd(Until(alpha_sigma_px=GOAL_PX)),
    )
    for k, frame in enumerate(recording.frames):
        estimator.add(frame, views.corners_px[k], views.corner_sigma_px[k])
        if k + 1 >= FIRST and (k + 1) % STEP == 0:
            now = estimator.estimate()
            goal.heed(now)
            if goal.reached():
                error = off(plan, views, now.distance_m, now.alpha_px)
                return k + 1, float(np.abs(error).max()), float(np.abs(error / now.sigma_px).max())
    return None


def by_sigma_alone(plan: Plan, views: Views, distance_m: FloatArray) -> End | None:
    for frames in range(FIRST, len(views) + 1, STEP):
        try:
            fit = fit_so_far(views.take(np.arange(frames)), lens_moves=False)
        except CalibrationError:
            continue
        alpha, sigma = fit.alpha_over(distance_m)
        if sigma.max() <= GOAL_PX:
            error = off(plan, views, distance_m, alpha)
            return frames, float(np.abs(error).max()), float(np.abs(error / sigma).max())
    return None


def runs(name: str, count: int) -> Iterator[tuple[str, End | None, End | None]]:
    plan = read_plan(CONFIGS / f"{name}.plan.yaml")
    layout = plan.cell.layout
    assert layout is not None
    distance_m = np.geomspace(*layout.distances_m, 5)
    for k in range(count):
        strided = k % 2 == 1
        with tempfile.TemporaryDirectory() as scratch:
            chosen = ordered(plan, strided)
            simulate_corners(chosen, Path(scratch) / "run", seed=100 + k)
            recording = read_recording(Path(scratch) / "run")
            views = recording.views()
            order = "every third" if strided else "plan's"
            yield (
                order,
                by_goal(chosen, recording, views),
                by_sigma_alone(chosen, views, distance_m),
            )


def main(count: int, cells: list[str]) -> None:
    print("| cell | order | ended by | runs | frames | worst error px | in sigmas |")
    print(7 * "|---" + "|")
    for name in cells:
        found = list(runs(name, count))
        for order in ("plan's", "every third"):
            for way, words in ((1, "until"), (2, "sigma alone")):
                ends = [row[way] for row in found if row[0] == order and row[way] is not None]
                if not ends:
                    continue
                frames, error, ratio = np.array(ends).T
                told = f"{frames.min():.0f} to {frames.max():.0f} | {error.max():.2f}"
                print(f"| {name} | {order} | {words} | {len(ends)} | {told} | {ratio.max():.1f} |")


if __name__ == "__main__":
    asked = sys.argv[1:]
    main(int(asked[0]) if asked else 6, asked[1:] or ["irb140-eosens", "ur3-robotiq"])
