"""What `cell export --format colmap --views` writes, read by several versions of pycolmap.

python -m benchmarks.colmap_versions [VERSION ...]     (3.13.0 and 4.2.1 without)

Each version is installed into a folder of its own for the while (needs the package index). Prints,
per version, with `rigs.txt` and `frames.txt` and without, how many pictures have a pose and how far
the farthest corner is from where the model's camera, pose and point put it.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.projection import project
from calib.views import Board
from cell.storage.files.calibration_source import DISTORTION
from cell.verbs.export.camera import Camera
from cell.verbs.export.formats.colmap_model import Seen, texts

VERSIONS = ("3.13.0", "4.2.1")
READ = """
import sys, numpy as np, pycolmap
model = pycolmap.Reconstruction()
model.read_text(sys.argv[1])
off = [np.abs(image.project_point(model.points3D[p.point3D_id].xyz) - p.xy).max()
       for image in model.images.values() for p in image.points2D if image.has_pose]
posed = sum(image.has_pose for image in model.images.values())
print(posed, len(model.images), max(off, default=float("nan")))
"""


def write_model(folder: Path) -> None:
    """A model without noise: what it says must agree with itself."""
    board = Board("chessboard", 7, 10, 0.025)
    coefficients = {"k1": -0.11, "k2": 0.057, "p1": 0.0011, "p2": -0.0007, "k3": -0.02}
    distortion = tuple(coefficients.get(name, 0.0) for name in DISTORTION)
    camera = Camera((4096, 3072), 4755.8, 4789.1, 2052.3, 1548.5, distortion, "a check")
    turns = Rotation.from_euler("xyz", np.random.default_rng(1).uniform(-30, 30, (9, 3)), True)
    world_from_board = RigidTransform.from_components([0.6, 0.1, 0.0], Rotation.identity())
    seen = []
    for k, turn in enumerate(turns):
        view = RigidTransform.from_components([-0.1, -0.07, 0.5 + 0.03 * k], turn)
        pixels = project(camera.optics[None], view.as_matrix()[None], board.corners_m)[0]
        seen.append(Seen(k, f"{k:05d}.png", view * world_from_board.inv(), pixels))
    points_m = world_from_board.apply(board.corners_m)
    for name, text in texts(camera, "the robot's base", seen, points_m).items():
        (folder / name).write_text(text)


def main(versions: list[str]) -> int:
    bad = False
    with tempfile.TemporaryDirectory() as temporary:
        for version in versions:
            place = Path(temporary) / version
            venv.create(place, with_pip=True)
            python = place / "bin" / "python"
            wanted = ["--only-binary=:all:", "numpy", f"pycolmap=={version}"]
            subprocess.run([python, "-m", "pip", "install", "-q", *wanted], check=True)
            model = place / "model"
            model.mkdir()
            write_model(model)
            for files in ("rigs.txt and frames.txt", "images.txt alone"):
                output = subprocess.run(
                    [python, "-c", READ, model], check=True, capture_output=True, text=True
                ).stdout.split()
                posed, images, off_px = int(output[0]), int(output[1]), float(output[2])
                bad |= posed != images or not off_px < 1e-6
                print(f"pycolmap {version}, {files}: {posed} of {images} posed, {off_px:.1e} px")
                for name in ("rigs.txt", "frames.txt"):
                    (model / name).unlink(missing_ok=True)
    return int(bad)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or list(VERSIONS)))
