"""CPU time and memory of the solver beside OpenCV's, COLMAP's and mrcal's, on the same data.

    python -m benchmarks.solver_speed [REPEATS]

Camera 4096 x 3072, alpha 4750 px, k1 k2 p1 p2, 14 x 14 corners, noise 0.1 px, 0.35 to 1 m, tilts 0
to 45 degrees. CPU seconds are user and system time of all threads, the least of the repeats, after
one small fit that loads what is compiled. Ours and OpenCV (with `CALIB_USE_LU`) find their own
start; COLMAP and mrcal are given ours, whose time is a row of its own.
mrcal is asked in `.mrcal` (see `tools/install-mrcal`); a peer that is missing is left out.
Every fit runs in a process of its own, which loads no more than its work needs. Memory is that
process's greatest resident set, what it held before it had any data, and how much of it were pages
of library files, which all processes share and of which the kernel maps more or fewer at a time as
they lie in its cache.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.solver_speed_problem import BOARD, FREE, HEIGHT, WIDTH, observed
from calib.chain.optics import COLUMN
from calib.paper.homography import robust_homographies
from calib.paper.zhang import zhang_pinhole
from calib.solver.free_poses import fit_free_poses
from calib.views import FloatArray

FIT_GOAL_S = {200: 0.06, 1000: 0.32}
JOINT_GOAL_S = 0.14
MRCAL = Path(__file__).parents[1] / ".mrcal" / "bin" / "python"


def start(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Zhang's closed form: (K,) optics and (N, 4, 4) poses."""
    flat = BOARD.corners_m[:, :2]
    row, poses = zhang_pinhole(robust_homographies(flat, corners)[0], WIDTH, HEIGHT)
    row[COLUMN["skew_px"]] = 0.0
    return row, poses


def fitted(corners: FloatArray, row: FloatArray, poses: FloatArray) -> FloatArray:
    """(8,) our optimum from a start."""
    optics = np.repeat(row[None], len(corners), axis=0)
    fit = fit_free_poses(optics, poses, BOARD.corners_m, corners, FREE)
    return fit.optics[0, [COLUMN[name] for name in FREE]]


def memory_mb(what: str) -> float:
    """What the kernel reports of this process's memory: `VmHWM` is the greatest resident set."""
    # getrusage would count what the parent held when it forked
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split(f"{what}:")[1].split()[0]) / 1024


def measured(work: Callable[[], FloatArray], repeats: int, before_mb: float) -> dict[str, Any]:
    """Least CPU seconds, and the greatest memory."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        result = work()
        times.append(time.process_time() - began)
    return {
        "seconds": min(times),
        "before_mb": before_mb,
        "peak_mb": memory_mb("VmHWM"),
        "files_mb": memory_mb("RssFile"),
        "result": result.tolist(),
    }


def child(what: str, frames: int, repeats: int) -> dict[str, Any]:
    """What one process measures."""
    if what == "joint":
        # the chain is loaded here alone, so that the fit's memory is not charged with it
        from benchmarks.solver_speed_joint import joint_cell, normal_equations

        normal_equations(*joint_cell(5))
        before_mb = memory_mb("VmHWM")
        cell = joint_cell(frames)
        return measured(lambda: normal_equations(*cell), repeats, before_mb)
    few = observed(10)[0]
    fitted(few, *start(few))
    before_mb = memory_mb("VmHWM")
    corners = observed(frames)[0]
    if what == "start":
        return measured(lambda: start(corners)[0], repeats, before_mb)
    return measured(lambda: fitted(corners, *start(corners)), repeats, before_mb)


PEERS = {
    "opencv": [sys.executable, str(Path(__file__).with_name("solver_speed_peers.py")), "opencv"],
    "colmap": [sys.executable, str(Path(__file__).with_name("solver_speed_peers.py")), "colmap"],
    "mrcal": [str(MRCAL), str(Path(__file__).with_name("solver_speed_mrcal.py"))],
}


def peers(frames: int, repeats: int) -> dict[str, dict[str, Any] | None]:
    """The peers' own measurements, each in its own process, from our start where it has none."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data.npz"
        corners, _ = observed(frames)
        row, poses = start(corners)
        rotation = Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()
        np.savez(
            data,
            corners=corners.reshape(frames, BOARD.rows, BOARD.cols, 2),
            intrinsics=[*(row[COLUMN[name]] for name in FREE[:4]), 0.0, 0.0, 0.0, 0.0],
            poses=np.concatenate([rotation, poses[:, :3, 3]], axis=1),
            square_m=BOARD.square_m,
            size=[WIDTH, HEIGHT],
        )
        return {
            name: answer([*command, str(data), str(repeats)]) if Path(command[0]).exists() else None
            for name, command in PEERS.items()
        }


def answer(command: list[str]) -> dict[str, Any] | None:
    """The last line a process prints, as JSON; None where it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{command[1]}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return None
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> None:
    """Measure everything and print a table in Markdown."""
    if sys.argv[1:2] == ["--child"]:
        print(json.dumps(child(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))))
        return
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    me = [sys.executable, "-m", "benchmarks.solver_speed", "--child"]
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n")
    print("| work | solver | CPU s | goal | peak MB | before data | of files | off ours, px |")
    print("|---|---|---|---|---|---|---|---|")
    for frames, goal in FIT_GOAL_S.items():
        found = {
            who: answer([*me, who, str(frames), str(repeats)]) for who in ("ours", "start")
        } | peers(frames, repeats)
        ours = found["ours"]
        for who, one in found.items():
            if one is None or ours is None:
                continue
            gap = "" if who in ("ours", "start") else f"{farthest(one, ours):.4f}"
            line(f"{frames} x {BOARD.corner_count}", NAMES[who], one, goal, gap)
    for frames in (3000, 10_000):
        one = answer([*me, "ours", str(frames), "2"])
        line(f"{frames} x {BOARD.corner_count}", NAMES["ours"], one)
    for frames in (1000, 3000, 10_000):
        one = answer([*me, "joint", str(frames), str(repeats if frames == 1000 else 2)])
        work = f"{frames} x {BOARD.corner_count}, joint normal equations"
        line(work, "ours", one, JOINT_GOAL_S if frames == 1000 else None)


NAMES = {
    "ours": "ours, with its start",
    "start": "our start alone",
    "opencv": "OpenCV, with its start",
    "colmap": "COLMAP (Ceres), from our start",
    "mrcal": "mrcal, from our start",
}


def farthest(one: dict[str, Any], ours: dict[str, Any]) -> float:
    """Largest difference of alpha, beta, u0 and v0."""
    return float(np.abs(np.subtract(one["result"], ours["result"])[:4]).max())


def line(
    work: str, who: str, one: dict[str, Any] | None, goal: float | None = None, gap: str = ""
) -> None:
    """One row of the table."""
    if one is None:
        return
    reported = f"{goal}" if goal is not None and who.startswith("ours") else ""
    memory = f"{one['peak_mb']:.0f} | {one['before_mb']:.0f} | {one['files_mb']:.0f}"
    print(f"| {work} | {who} | {one['seconds']:.3f} | {reported} | {memory} | {gap} |", flush=True)


if __name__ == "__main__":
    main()
