"""Other solvers' part of `solver_speed.py`: each in a process that imports only what it needs.

python benchmarks/solver_speed_peers.py opencv|colmap DATA.npz REPEATS
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np


def points_m(data):
    """(M, 3) the board's corners."""
    rows, cols = data["corners"].shape[1:3]
    row, col = np.divmod(np.arange(rows * cols), cols)
    return np.stack([col, row, 0 * row], axis=1) * float(data["square_m"])


class OpenCV:
    """With its own start, and its faster way to solve (`CALIB_USE_LU`)."""

    def __init__(self, data):
        import cv2

        self.cv2, self.size = cv2, tuple(int(s) for s in data["size"])
        frames = len(data["corners"])
        self.seen = [c.reshape(-1, 2).astype(np.float32) for c in data["corners"]]
        self.points = [points_m(data).astype(np.float32)] * frames

    def solve(self):
        """(8,) the optimum."""
        cv2 = self.cv2
        flags = cv2.CALIB_FIX_K3 | cv2.CALIB_USE_LU
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-10)
        _, A, k, *_ = cv2.calibrateCamera(
            self.points, self.seen, self.size, None, None, flags=flags, criteria=criteria
        )
        return np.array([A[0, 0], A[1, 1], A[0, 2], A[1, 2], *np.ravel(k)[:4]])


class Colmap:
    """COLMAP's bundle adjustment (Ceres) from the given start, the board's points held."""

    def __init__(self, data):
        import pycolmap

        self.pycolmap = pycolmap
        model = pycolmap.Reconstruction()
        camera = pycolmap.Camera(
            camera_id=1, model="OPENCV", params=list(data["intrinsics"]),
            width=int(data["size"][0]), height=int(data["size"][1]),
        )  # fmt: skip
        model.add_camera_with_trivial_rig(camera)
        points = points_m(data)
        self.points = [
            model.add_point3D(p, pycolmap.Track(), np.zeros(3, np.uint8)) for p in points
        ]
        for i, (corners, pose) in enumerate(zip(data["corners"], data["poses"], strict=True), 1):
            angle = float(np.linalg.norm(pose[:3]))
            quaternion = [*(np.sin(angle / 2) * pose[:3] / angle), np.cos(angle / 2)]
            seen = [pycolmap.Point2D(uv) for uv in corners.reshape(-1, 2)]
            image = pycolmap.Image(name=str(i), camera_id=1, image_id=i, points2D=seen)
            place = pycolmap.Rigid3d(pycolmap.Rotation3d(np.array(quaternion)), pose[3:])
            model.add_image_with_trivial_frame(image, place)
            for k, point in enumerate(self.points):
                model.add_observation(point, pycolmap.TrackElement(i, k))
        self.model, self.frames = model, len(data["corners"])

    def solve(self):
        """(8,) the optimum."""
        pycolmap = self.pycolmap
        model = pycolmap.Reconstruction(self.model)
        config = pycolmap.BundleAdjustmentConfig()
        for i in range(1, self.frames + 1):
            config.add_image(i)
        for point in self.points:
            config.add_constant_point(point)
        options = pycolmap.BundleAdjustmentOptions()
        options.print_summary = False
        options.refine_principal_point = True
        options.ceres.solver_options.num_threads = 1
        adjuster = pycolmap.create_default_bundle_adjuster(options, config, model)
        self.began = time.process_time()
        adjuster.solve()
        return np.array(model.cameras[1].params)


def memory_mb(what):
    """What the kernel reports of this process's memory."""
    # getrusage would count what the parent held when it forked
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(status.split(f"{what}:")[1].split()[0]) / 1024


def main():
    """Measure, and print the result as JSON."""
    who, path, repeats = sys.argv[1:4]
    data = dict(np.load(path))
    few = {k: v[:10] if k in ("corners", "poses") else v for k, v in data.items()}
    peer = {"opencv": OpenCV, "colmap": Colmap}[who]
    peer(few).solve()
    before_mb = memory_mb("VmHWM")
    work = peer(data)
    times = []
    for _ in range(int(repeats)):
        work.began = time.process_time()
        result = work.solve()
        times.append(time.process_time() - work.began)
    reported = {
        "seconds": min(times),
        "median": float(np.median(times)) if len(times) > 2 else None,
        "before_mb": before_mb,
        "peak_mb": memory_mb("VmHWM"),
        "files_mb": memory_mb("RssFile"),
    }
    print(json.dumps({**reported, "result": result.tolist()}))


if __name__ == "__main__":
    main()
