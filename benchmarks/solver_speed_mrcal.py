"""mrcal's part of `solver_speed.py`, for the interpreter that has mrcal (2.5 and newer)."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import mrcal
import numpy as np


def solve(data):
    """(8,) the optimum."""
    frames = len(data["corners"])
    intrinsics = np.array(data["intrinsics"], dtype=float)[None]
    indices = np.zeros((frames, 3), dtype=np.int32)
    indices[:, 0] = np.arange(frames)
    indices[:, 2] = -1
    weight = np.ones((*data["corners"].shape[:3], 1))
    mrcal.optimize(
        intrinsics=intrinsics,
        rt_cam_ref=None,
        rt_ref_frame=np.array(data["poses"], dtype=float),
        points=None,
        observations_board=np.ascontiguousarray(np.concatenate([data["corners"], weight], axis=3)),
        indices_frame_camintrinsics_camextrinsics=indices,
        observations_point=None,
        indices_point_camintrinsics_camextrinsics=None,
        lensmodel="LENSMODEL_OPENCV4",
        imagersizes=np.array([data["size"]], dtype=np.int32),
        calibration_object_spacing=float(data["square_m"]),
        do_optimize_calobject_warp=False,
        do_apply_outlier_rejection=False,
        do_apply_regularization=False,
    )
    return intrinsics[0]


def memory_mb(what):
    """What the kernel reports of this process's memory."""
    # getrusage would count what the parent held when it forked
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split(f"{what}:")[1].split()[0]) / 1024


before_mb = memory_mb("VmHWM")
data = dict(np.load(sys.argv[1]))
times = []
for _ in range(int(sys.argv[2])):
    began = time.process_time()
    result = solve(data)
    times.append(time.process_time() - began)
reported = {
    "seconds": min(times),
    "before_mb": before_mb,
    "peak_mb": memory_mb("VmHWM"),
    "files_mb": memory_mb("RssFile"),
}
print(json.dumps({**reported, "result": result.tolist()}))
