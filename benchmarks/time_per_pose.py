"""A recording's time per pose, against the time that physics asks for.

The bound of a pose is the fastest move within the plan's speeds, the standstill that arm and plan
ask for, focusing, the exposure, and the picture's way over the link.

    python benchmarks/time_per_pose.py PLAN.yaml RECORDING --transfer-s 0.0074
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np

from cell.sequencer.guard import Guard
from cell.storage.files.plan_file import Plan, read_plan
from cell.storage.recording import FrameRecord, read_recording
from cell.verbs.plan.duration import move_s
from sim.arm import SETTLE_S
from sim.camera import FOCUSING_S


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("plan", type=Path)
    asked.add_argument("recording", type=Path)
    asked.add_argument("--transfer-s", type=float, required=True)
    options = asked.parse_args()
    plan = read_plan(options.plan)
    frames = sorted(read_recording(options.recording).frames, key=lambda frame: frame.t_s)
    guard = Guard.of(plan)
    rows = np.array([_row(plan, guard, a, b, options.transfer_s) for a, b in pairwise(frames)])
    taken, bound = rows.T
    print(f"{len(rows)} poses: {taken.sum():.1f} s against {bound.sum():.1f} s,", end=" ")
    print(f"ratio {taken.sum() / bound.sum():.3f};", end=" ")
    late = np.percentile(taken - bound, [50, 90, 100])
    print("over the bound by {:.3f} s (median), {:.3f} (90 %), {:.3f} (worst)".format(*late))
    waited = sum(_picture_s(frame, options.transfer_s) for frame in frames[1:])
    print(f"{waited:.1f} s of that went by between order and arrival of the pictures")


def _row(
    plan: Plan, guard: Guard, before: FrameRecord, after: FrameRecord, transfer_s: float
) -> tuple[float, float]:
    """Seconds from one frame to the next, and the least they could be."""
    here, there = (np.array(frame.joints_rad) for frame in (before, after))
    exposure = plan.file.exposure
    bound_s = move_s(guard, here, there) + SETTLE_S
    bound_s += plan.file.settle.still_s + float(after.exposure_s) + transfer_s
    bound_s += FOCUSING_S if exposure.focus == "auto" else 0.0
    return after.t_s - before.t_s, bound_s


def _picture_s(frame: FrameRecord, transfer_s: float) -> float:
    """Seconds that a picture came later than exposure and transfer make it; a peer renders it."""
    raw = (frame.model_extra or {}).get("camera_raw", {})
    ordered_s = raw.get("trigger_sent_s", raw.get("asked_s"))
    return (
        0.0 if ordered_s is None else raw["arrived_s"] - ordered_s - frame.exposure_s - transfer_s
    )


if __name__ == "__main__":
    main()
