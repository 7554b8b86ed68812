"""Does the joint fit's uncertainty hold, and how near does it come to it?

    python benchmarks/coverage.py [RUNS] [PROCESSES] [RESULTS.jsonl]

Simulated cells: both of the paper's cameras and a plain 18 mm lens, both mounts, chessboard and
ChArUco (a tenth of whose corners is hidden); 20 parallel and 30 tilted views, drawn anew in every
run; a lens that focuses as a thin one does; corner noise 0.05 px, robot 0.05 mm and 0.005 degrees,
hand-eye and board unknown. The fit starts a per cent off in focal length, 10 mm in distance and
some millimetres across, and estimates its noise levels.

Coverage: in how many runs the true value lies in the 95 % interval; of the numbers, of the pixel
where a thing appears that the robot has the place of, and of the place of a part that one perfect
picture locates. Accuracy: root mean square over a run's frames, of the focal length, of the depth
that the joint fit gives each frame, and of the depth that each picture alone gives with the camera
so found.

Each run is written to RESULTS as it ends; those that stand there already are not run again.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from itertools import product
from multiprocessing import Pool
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from calib.calibration.uncertainty import optics_at, projection_sigma_px, workpiece_sigma_m
from calib.chain import rigid
from calib.chain.effects import make_effect
from calib.chain.model import CellModel, Errors, evaluate
from calib.chain.optics import COLUMN, optics_row
from calib.chain.projection import project
from calib.chain.state import ChainState
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

BOARDS = {
    "chessboard": Board("chessboard", rows=7, cols=10, square_m=0.025),
    "charuco": Board(
        "charuco", rows=7, cols=10, square_m=0.025, marker_m=0.018, dictionary="DICT_6X6_250"
    ),
}
MOUNTS: tuple[Mount, ...] = ("eye_in_hand", "eye_to_hand")
FLANGE_FROM_MOUNTED = rigid.compose(np.array([0.02, -0.03, 0.7]), np.array([0.03, -0.04, 0.09]))
BASE_FROM_FIXED = rigid.compose(np.array([0.1, 3.0, 0.2]), np.array([0.7, 0.1, 0.3]))


IMAGE_SHARES = np.array([[0.5, 0.5], [0.15, 0.2], [0.9, 0.75]])
"""Where in the image the errors in pixels and at the work piece are asked for,"""

USED_AT_M = np.array([0.35, 0.9])
"""and at which distances."""

Task = tuple[str, Mount, str, int]
"""Camera, mount, board, seed."""


@dataclass(frozen=True)
class Run:
    """One simulated run: pulls (error over sigma) by name, and errors over the frames."""

    task: Task
    pulls: dict[str, list[float]]
    alpha_rms_px: float
    depth_rms_m: float
    picture_depth_rms_m: float
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


def simulate(camera: str, mount: Mount, kind: str, seed: int) -> tuple[CellModel, Views, Views]:
    """The true cell, what it recorded, and the same with the flange where it truly was."""
    width, height, alpha, f_m, k1, k2, near_m = CAMERAS[camera]
    rng = np.random.default_rng(seed)
    board = BOARDS[kind]
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
    state = evaluate(model, true)
    corners = project(state.optics, state.camera_from_board, state.points_m)
    corners += rng.normal(0, NOISE_PX, corners.shape)
    if board.kind == "charuco":
        corners[rng.random(corners.shape[:2]) < 0.1] = np.nan
    scatter = rng.normal(0, 1, (n, 6)) * np.repeat([ROBOT_M, ROBOT_RAD], 3)
    logged = replace(true, corners_px=corners, base_from_flange=flange @ rigid.from_vector(scatter))
    return model, logged, true


def start(true: CellModel) -> CellModel:
    """A per cent, 10 mm ahead, some millimetres, some tenths of a degree off; no focus law."""
    optics = true.optics.copy()
    optics[[COLUMN["alpha_px"], COLUMN["beta_px"]]] *= 1.01
    optics[[COLUMN["k1"], COLUMN["k2"]]] = 0.0
    nudge = rigid.from_vector(np.array([2e-3, -3e-3, 1e-2, 3e-3, -4e-3, 2e-3]))
    return CellModel(
        optics,
        true.flange_from_mounted @ nudge,
        true.base_from_fixed @ nudge,
        (make_effect("focus_breathing", {"law": "thin_lens"}),),
    )


def pulls(fit: JointFit, true: CellModel) -> dict[str, list[float]]:
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
    return {u.name: [float(z)] for u, z in zip(fit.unknowns, error / sigma, strict=True)}


def pulls_in_use(fit: JointFit, true: CellModel, views: Views) -> dict[str, list[float]]:
    """Errors in pixels and at the work piece in units of the stated sigma."""
    name = "flange_from_mounted" if views.mount == "eye_in_hand" else "base_from_fixed"
    found_from_true = rigid.inverse(getattr(fit.model, name)) @ getattr(true, name)
    back = rigid.inverse(found_from_true)
    pixels = IMAGE_SHARES * [views.width_px, views.height_px]
    off_px, off_m = [], []
    for d in USED_AT_M:
        is_, reported = (optics_at(cell, views, float(d)) for cell in (true, fit.model))
        at = ahead(is_, pixels, float(d))
        off_px.append(project(reported[None], found_from_true[None], at)[0] - pixels)
        part = flat_part(is_, views, float(d))
        poses = rigid.compose(np.zeros_like(at), at)
        n = len(poses)
        seen = project(np.repeat(is_[None], n, 0), poses, part)
        located = fit_free_poses(np.repeat(reported[None], n, 0), poses, part, seen, ())
        place = located.camera_from_board[:, :3, 3]
        off_m.append(place @ back[:3, :3].T + back[:3, 3] - at)
    sigma_px = projection_sigma_px(fit, views, pixels, USED_AT_M)
    sigma_m = workpiece_sigma_m(fit, views, pixels, USED_AT_M)
    return {
        "pixel where a known place appears": (np.array(off_px) / sigma_px).ravel().tolist(),
        "place of a part at work": (np.array(off_m) / sigma_m).ravel().tolist(),
    }


def ahead(optics: FloatArray, pixels_px: FloatArray, distance_m: float) -> FloatArray:
    """(G, 3) points at that depth that appear at the pixels."""
    points = np.column_stack([np.zeros_like(pixels_px), np.full(len(pixels_px), distance_m)])
    eye = np.eye(4)[None]
    for _ in range(30):
        miss = pixels_px - project(optics[None], eye, points)[0]
        points[:, :2] += miss * distance_m / optics[:2]
    return points


def flat_part(optics: FloatArray, views: Views, distance_m: float) -> FloatArray:
    """(9, 3) points of the part that `workpiece_sigma_m` speaks of, about its middle."""
    extent = float(np.ptp(views.board.corners_m[:, :2], axis=0).mean())
    fifth = 0.2 * min(views.width_px, views.height_px) * distance_m / float(optics[0])
    half = 0.5 * min(extent, fifth)
    return np.array([[x, y, 0.0] for y in (-1, 0, 1) for x in (-1, 0, 1)]) * half


def one(task: Task) -> Run:
    """Simulate one run, fit it, and compare."""
    true, views, exact = simulate(*task)
    began = time.process_time()
    guess = start(true)
    fit = fit_joint(guess, views, unknowns_of(guess), Noise(0.2, 3e-4, 3e-4))
    seconds = time.process_time() - began
    state = evaluate(fit.model, views, errors=Errors(fit.flange_error))
    free = fit_free_poses(
        state.optics, state.camera_from_board, state.points_m, views.corners_px, ()
    )
    truth = evaluate(true, exact)
    alpha = COLUMN["alpha_px"]
    alpha_error = state.optics[:, alpha] - truth.optics[:, alpha]
    return Run(
        task,
        pulls(fit, true) | pulls_in_use(fit, true, views),
        float(np.sqrt(np.mean(alpha_error**2))),
        depth_rms_m(state.camera_from_board, truth),
        depth_rms_m(free.camera_from_board, truth),
        seconds,
    )


def depth_rms_m(camera_from_board: FloatArray, truth: ChainState) -> float:
    """Of the board's middle along the optical axis."""
    off = (camera_from_board - truth.camera_from_board)[:, 2]
    depth = off[:, :3] @ truth.points_m.mean(axis=0) + off[:, 3]
    return float(np.sqrt(np.mean(depth**2)))


def table(runs: list[Run]) -> list[str]:
    """Two tables in Markdown; of the accuracies the median, 95 % and the worst."""
    lines = [
        "| cell | runs | α RMS px | depth RMS mm | depth RMS mm, pictures alone |",
        "|---|---|---|---|---|",
    ]
    for cell in CELLS:
        own = [r for r in runs if r.task[:3] == cell]
        if not own:
            continue
        alpha = [r.alpha_rms_px for r in own]
        depth = [1e3 * r.depth_rms_m for r in own]
        alone = [1e3 * r.picture_depth_rms_m for r in own]
        reported = " | ".join(spread(values) for values in (alpha, depth, alone))
        lines.append(f"| {', '.join(cell)} | {len(own)} | {reported} |")
    lines += [
        "",
        "| number | coverage of the 95 % interval | rms of error / sigma |",
        "|---|---|---|",
    ]
    names = list(runs[0].pulls)
    pulls_of = {name: np.array([r.pulls[name] for r in runs]).ravel() for name in names}
    single = np.concatenate([z for z in pulls_of.values() if len(z) == len(runs)])
    for name, z in (*pulls_of.items(), ("all numbers", single)):
        inside = np.mean(np.abs(z) < 1.96)
        lines.append(f"| {name} | {100 * inside:.1f} % | {np.sqrt(np.mean(z**2)):.3f} |")
    return lines


def spread(values: list[float]) -> str:
    """Median, 95 % and worst."""
    return ", ".join(f"{v:.3f}" for v in np.quantile(values, [0.5, 0.95, 1.0]))


CELLS = list(product(CAMERAS, MOUNTS, BOARDS))


def already(results: Path | None) -> list[Run]:
    """Runs of an earlier start; a last line that was cut off goes."""
    if results is None or not results.exists():
        return []
    text = results.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    results.write_text(whole, encoding="utf-8")
    runs = [Run(**json.loads(line)) for line in whole.splitlines()]
    return [replace(run, task=(*run.task[:3], run.task[3])) for run in runs]


def kept(runs: Iterable[Run], results: Path | None) -> list[Run]:
    """The runs, each written down as it ends."""
    if results is None:
        return list(runs)
    done = []
    with results.open("a", encoding="utf-8") as file:
        for run in runs:
            file.write(json.dumps(asdict(run)) + "\n")
            file.flush()
            done.append(run)
    return done


def main() -> None:
    """Print the tables."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1200
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    results = Path(sys.argv[3]) if len(sys.argv) > 3 else None
    tasks = [(*CELLS[i % len(CELLS)], i) for i in range(count)]
    runs = [run for run in already(results) if run.task in tasks]
    left = sorted(set(tasks) - {run.task for run in runs}, key=tasks.index)
    with Pool(workers) as pool:
        runs += kept(pool.imap_unordered(one, left, chunksize=4), results)
    print(f"{datetime.now(UTC):%d %B %Y}, {len(runs)} runs,", end=" ")
    print(f"{np.median([r.seconds for r in runs]):.2f} s CPU a fit (median)\n")
    print("\n".join(table(runs)))


if __name__ == "__main__":
    main()
