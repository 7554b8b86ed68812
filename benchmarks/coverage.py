"""Does the joint fit's uncertainty tell the truth, and how near does it come to it?

    python benchmarks/coverage.py [RUNS] [PROCESSES]

Simulated cells: both of the paper's cameras and a plain 18 mm lens, both mounts, chessboard and
ChArUco (a tenth of whose corners is hidden) in turn; 20 parallel and 30 tilted views, drawn anew in
every run; a lens that focuses as a thin one does; corner noise 0.05 px, robot 0.05 mm and 0.005
degrees, hand-eye and board unknown. The fit starts a per cent and some millimetres off and
estimates its noise levels.

Coverage: in how many runs the true value lies in the 95 % interval. Accuracy: root mean square over
a run's frames, of the focal length and of the depth of the poses that its pictures give with the
camera so found.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import product
from multiprocessing import Pool

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain import rigid
from calib.chain.effects import make_effect
from calib.chain.model import CellModel, walk
from calib.chain.optics import COLUMN, optics_row
from calib.chain.projection import project
from calib.solver.free_poses import fit_free_poses
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import PLAIN_OPTICS, unknowns_of
from calib.views import Board, FloatArray, Mount, Views

NOISE_PX, ROBOT_M, ROBOT_RAD = 0.05, 5e-5, np.radians(0.005)
PARALLEL, TILTED = 20, 30
CAMERAS = {
    "18 mm lens, 5.5 um pixels": (4096, 3072, 3272.7, 0.018, -0.05, 0.0, 0.3),
    "EoSens 4096 x 3072": (4096, 3072, 4755.8, 0.0267, -0.05, 0.057, 0.3),
    "Robotiq 1279 x 724": (1279, 724, 1370.8, 0.005, 0.0087, -0.072, 0.3),
}
"""Width, height, alpha far away, f in metres, k1, k2, nearest distance."""

BOARDS = (
    Board("chessboard", rows=7, cols=10, square_m=0.025),
    Board("charuco", rows=7, cols=10, square_m=0.025, marker_m=0.018, dictionary="DICT_6X6_250"),
)
MOUNTS: tuple[Mount, ...] = ("eye_in_hand", "eye_to_hand")
FLANGE_FROM_MOUNTED = rigid.compose(np.array([0.02, -0.03, 0.7]), np.array([0.03, -0.04, 0.09]))
BASE_FROM_FIXED = rigid.compose(np.array([0.1, 3.0, 0.2]), np.array([0.7, 0.1, 0.3]))


@dataclass(frozen=True)
class Run:
    """One simulated run: pulls (error over sigma) by name, and errors over the frames."""

    configuration: str
    pulls: dict[str, float]
    alpha_rms_px: float
    depth_rms_m: float
    seconds: float


def poses(board: Board, near_m: float, rng: np.random.Generator) -> FloatArray:
    """(N, 4, 4) camera_from_board: parallel ones over the distances, then tilted ones."""
    n = PARALLEL + TILTED
    distance = np.concatenate(
        [np.linspace(near_m, 1.0, PARALLEL), rng.uniform(near_m, 1.0, TILTED)]
    )
    tilt = np.radians(np.concatenate([rng.uniform(0, 0.5, PARALLEL), rng.uniform(15, 40, TILTED)]))
    azimuth = rng.uniform(0, 2 * np.pi, n)
    axis = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n)], axis=1)
    roll = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, n)[:, None] * [[0.0, 0.0, 1.0]])
    out = np.tile(np.eye(4), (n, 1, 1))
    out[:, :3, :3] = (Rotation.from_rotvec(axis * tilt[:, None]) * roll).as_matrix()
    aim = np.column_stack([rng.uniform(-0.04, 0.04, (n, 2)), np.ones(n)]) * distance[:, None]
    out[:, :3, 3] = aim - out[:, :3, :3] @ board.corners_m.mean(axis=0)
    return out


def simulate(camera: str, mount: Mount, seed: int) -> tuple[CellModel, Views, Views]:
    """The true cell, what it recorded, and the same with the flange where it truly was."""
    width, height, alpha, f_m, k1, k2, near_m = CAMERAS[camera]
    rng = np.random.default_rng(seed)
    board = BOARDS[seed % 2]
    optics = optics_row(
        alpha_px=alpha,
        beta_px=alpha * 1.002,
        u0_px=width / 2 + 4.3,
        v0_px=height / 2 - 2.2,
        k1=k1,
        k2=k2,
        height_px=height,
    )
    lens = make_effect("focus_breathing", {"law": "thin_lens", "f_m": f_m})
    model = CellModel(optics, FLANGE_FROM_MOUNTED, BASE_FROM_FIXED, (lens,))
    seen = poses(board, near_m, rng)
    loop = rigid.inverse(seen) if mount == "eye_in_hand" else seen
    flange = BASE_FROM_FIXED @ loop @ rigid.inverse(FLANGE_FROM_MOUNTED)
    n = len(flange)
    blank = Views.blank(board, width_px=width, height_px=height, frames=n, mount=mount)
    true = replace(blank, base_from_flange=flange)
    state = walk(model, true)
    corners = project(state.optics, state.camera_from_board, state.points_m)
    corners += rng.normal(0, NOISE_PX, corners.shape)
    if board.kind == "charuco":
        corners[rng.random(corners.shape[:2]) < 0.1] = np.nan
    scatter = rng.normal(0, 1, (n, 6)) * np.repeat([ROBOT_M, ROBOT_RAD], 3)
    logged = replace(true, corners_px=corners, base_from_flange=flange @ rigid.from_vector(scatter))
    return model, logged, true


def start(true: CellModel) -> CellModel:
    """A per cent, some millimetres, some tenths of a degree off, and no focus law."""
    optics = true.optics.copy()
    optics[[COLUMN["alpha_px"], COLUMN["beta_px"]]] *= 1.01
    optics[[COLUMN["k1"], COLUMN["k2"]]] = 0.0
    nudge = rigid.from_vector(np.array([2e-3, -3e-3, 2e-3, 3e-3, -4e-3, 2e-3]))
    return CellModel(
        optics,
        true.flange_from_mounted @ nudge,
        true.base_from_fixed @ nudge,
        (make_effect("focus_breathing", {"law": "thin_lens"}),),
    )


def pulls(fit: JointFit, true: CellModel) -> dict[str, float]:
    """Error of every free number in units of its own sigma."""
    optics = [COLUMN[name] for name in PLAIN_OPTICS]
    found = fit.model
    mounted = rigid.inverse(true.flange_from_mounted) @ found.flange_from_mounted
    fixed = rigid.inverse(true.base_from_fixed) @ found.base_from_fixed
    error = np.concatenate(
        [
            found.optics[optics] - true.optics[optics],
            rigid.to_vector(mounted),
            rigid.to_vector(fixed),
            found.effects[0].values - true.effects[0].values,
        ]
    )
    sigma = np.sqrt(np.diag(fit.covariance))
    return {u.name: float(z) for u, z in zip(fit.unknowns, error / sigma, strict=True)}


def one(task: tuple[str, Mount, int]) -> Run:
    """Simulate one run, fit it, and compare."""
    camera, mount, seed = task
    true, views, exact = simulate(camera, mount, seed)
    began = time.process_time()
    guess = start(true)
    fit = fit_joint(guess, views, unknowns_of(guess), Noise(0.2, 3e-4, 3e-4))
    seconds = time.process_time() - began
    state = walk(fit.model, views, flange_error=fit.flange_error)
    free = fit_free_poses(
        state.optics, state.camera_from_board, state.points_m, views.corners_px, ()
    )
    truth = walk(true, exact)
    centre = truth.points_m.mean(axis=0)
    alpha = COLUMN["alpha_px"]
    off = (free.camera_from_board - truth.camera_from_board)[:, 2]
    depth = off[:, :3] @ centre + off[:, 3]
    alpha_error = state.optics[:, alpha] - truth.optics[:, alpha]
    return Run(
        f"{camera}, {mount}",
        pulls(fit, true),
        float(np.sqrt(np.mean(alpha_error**2))),
        float(np.sqrt(np.mean(depth**2))),
        seconds,
    )


def table(runs: list[Run]) -> list[str]:
    """Two tables in Markdown."""
    lines = ["| cell | runs | α RMS px: median, 95 %, worst | depth RMS mm: median, 95 %, worst |"]
    lines.append("|---|---|---|---|")
    for name in sorted({r.configuration for r in runs}):
        own = [r for r in runs if r.configuration == name]
        alpha = np.quantile([r.alpha_rms_px for r in own], [0.5, 0.95, 1.0])
        depth = np.quantile([1e3 * r.depth_rms_m for r in own], [0.5, 0.95, 1.0])
        told = " | ".join(", ".join(f"{v:.3f}" for v in values) for values in (alpha, depth))
        lines.append(f"| {name} | {len(own)} | {told} |")
    lines += [
        "",
        "| number | coverage of the 95 % interval | rms of error / sigma |",
        "|---|---|---|",
    ]
    names = list(runs[0].pulls)
    z = np.array([[r.pulls[name] for name in names] for r in runs])
    for name, column in zip(names, z.T, strict=True):
        inside = np.mean(np.abs(column) < 1.96)
        lines.append(f"| {name} | {100 * inside:.1f} % | {np.sqrt(np.mean(column**2)):.3f} |")
    inside = np.mean(np.abs(z) < 1.96)
    lines.append(f"| all | {100 * inside:.1f} % | {np.sqrt(np.mean(z**2)):.3f} |")
    return lines


def main() -> None:
    """Print the tables."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 600
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    cells = list(product(CAMERAS, MOUNTS))
    tasks = [(*cells[i % len(cells)], i // len(cells)) for i in range(count)]
    if workers > 1:
        with Pool(workers) as pool:
            runs = pool.map(one, tasks, chunksize=4)
    else:
        runs = [one(task) for task in tasks]
    print(f"{datetime.now(UTC):%d %B %Y}, {count} runs,", end=" ")
    print(f"{np.median([r.seconds for r in runs]):.2f} s CPU a fit (median)\n")
    print("\n".join(table(runs)))


if __name__ == "__main__":
    main()
