"""The paper's Tables 1 and 2 beside the same tables of the two simulated cells, as Markdown.

    python benchmarks/paper_tables.py

Two pose plans per cell. `reach`: what the arm reaches in front of one fixed board. `far`: the
paper's distances, which no IRB 140 or UR3 covers without moving the board; the flange poses are
then given without an arm. Zhang's solutions use 15 general views only, as in the paper; the scale
factors come from a series of parallel ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib.calibration import Calibration, Solution, Statistics, calibrate
from calib.calibration.baseline import as_solution, unfitted_solution
from calib.chain.model import walk
from calib.chain.rigid import inverse
from calib.handeye import camera_position_error_m
from calib.paper.fixed_alpha import FREE, algebraic_poses, fit_fixed_alpha, held_optics
from calib.paper.homography import fit_homography
from calib.views import BoolArray, FloatArray, Views
from sim.cell import ARM_STREAM, CORNER_STREAM, SimulatedCell
from sim.log import tour
from sim.presets import irb140_eosens, ur3_robotiq
from sim.synthesize import synthesize_corners

PARALLEL, GENERAL = 14, 15
PARAMETERS = ("alpha_px", "beta_px", "u0_px", "v0_px", "skew_px", "k1", "k2")
ROWS = (
    "fixed_alpha_algebraic",
    "held_algebraic",
    "held_mle",
    "fixed_alpha_mle",
    "zhang_algebraic",
    "zhang_mle",
    "joint_ml",
)
NAMES = {
    "fixed_alpha_algebraic": "proposed, algebraic, each distance's value (Eq. 20)",
    "held_algebraic": "proposed, algebraic, one held value for all views",
    "held_mle": "proposed, MLE, one held value for all views",
    "fixed_alpha_mle": "proposed, MLE, held at each distance's value (Eq. 24)",
    "zhang_algebraic": "Zhang, algebraic",
    "zhang_mle": "Zhang, MLE",
    "joint_ml": "joint fit with the robot (not in the paper)",
}
TABLE_1 = {
    "ur3-robotiq": {
        "held_algebraic": (0.3362, 2.1709),
        "held_mle": (9.0165e-11, 1.5626),
        "zhang_algebraic": (0.0472, 1.8667),
        "zhang_mle": (1.8347e-10, 1.0487),
    },
    "irb140-eosens": {
        "held_algebraic": (-2.4143, 14.4151),
        "held_mle": (-1.5807e-10, 3.1542),
        "zhang_algebraic": (0.4644, 9.0036),
        "zhang_mle": (1.2092e-09, 2.3201),
    },
}
TABLE_2 = {
    "ur3-robotiq": {
        "proposed": (1370.8, 1373.8, 645.8, 359.3, 0.0001, 0.0087, -0.072),
        "zhang_algebraic": (1362.8, 1369.9, 651.7, 370.5, -0.002, 0.0048, -0.056),
        "zhang_mle": (1319.7, 1329.7, 711.2, 375.9, 0.0008, -0.016, -0.003),
    },
    "irb140-eosens": {
        "proposed": (4755.8, 4789.1, 2052.3, 1548.5, 0.0012, 0.0022, 0.0570),
        "zhang_algebraic": (4487.0, 4442.8, 2046.8, 1448.1, 0.0239, 0.0421, -0.134),
        "zhang_mle": (4289.8, 4295.1, 2127.5, 1566.7, 0.0280, -0.1703, 0.1389),
    },
}


@dataclass(frozen=True)
class Plan:
    """Distances of a run, whether the arm has to reach them, tilt of the nearest and farthest."""

    name: str
    nearest_m: float
    farthest_parallel_m: float
    farthest_general_m: float
    by_arm: bool
    tilt_deg: tuple[float, float]


PLANS: dict[str, tuple[Callable[[int], SimulatedCell], tuple[Plan, ...]]] = {
    "irb140-eosens": (
        irb140_eosens,
        (
            Plan("reach", 0.36, 0.95, 0.95, True, (8.0, 8.0)),
            Plan("far", 0.35, 2.7, 1.5, False, (8.0, 8.0)),
            Plan("far, near views tilted", 0.35, 2.7, 1.5, False, (40.0, 3.0)),
        ),
    ),
    "ur3-robotiq": (
        ur3_robotiq,
        (
            Plan("reach", 0.36, 0.60, 0.60, True, (8.0, 8.0)),
            Plan("far", 0.34, 1.2, 1.0, False, (8.0, 8.0)),
            Plan("far, near views tilted", 0.34, 1.2, 1.0, False, (40.0, 3.0)),
        ),
    ),
}


@dataclass(frozen=True)
class Run:
    """One plan on one cell: the whole calibration, the general views' own, and the truth."""

    whole: Calibration
    solutions: Mapping[str, Solution]
    error: Mapping[str, Statistics]
    frames: tuple[int, int]
    alpha0: dict[str, float]


def wanted_poses(cell: SimulatedCell, plan: Plan, rng: np.random.Generator) -> FloatArray:
    """(N, 4, 4) camera_from_board: the parallel series, then the general views."""
    distance = np.concatenate(
        [
            np.geomspace(plan.nearest_m, plan.farthest_parallel_m, PARALLEL),
            np.linspace(plan.nearest_m, plan.farthest_general_m, GENERAL),
        ]
    )
    n = len(distance)
    tilt = np.concatenate([rng.uniform(0, 0.5, PARALLEL), np.linspace(*plan.tilt_deg, GENERAL)])
    azimuth = rng.uniform(0, 2 * np.pi, n)
    axis = np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1)
    turned = Rotation.from_rotvec(axis * tilt[:, None], degrees=True) * Rotation.from_rotvec(
        rng.uniform(-0.25, 0.25, n)[:, None] * [[0, 0, 1]]
    )
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = turned.as_matrix()
    aim = np.column_stack([rng.uniform(-0.02, 0.02, (n, 2)), np.ones(n)]) * distance[:, None]
    poses[:, :3, 3] = aim - poses[:, :3, :3] @ cell.board.corners_m.mean(axis=0)
    return poses


def record(cell: SimulatedCell, plan: Plan, rng: np.random.Generator) -> tuple[Views, BoolArray]:
    """The views of a plan, and (N,) which are general; unreachable poses are left out."""
    model = cell.model
    camera = inverse(wanted_poses(cell, plan, rng))
    flange = model.base_from_fixed @ camera @ inverse(model.flange_from_mounted)
    general: BoolArray = np.asarray(np.arange(len(flange)) >= PARALLEL)
    if plan.by_arm:
        reached = [joints_at(cell, pose) for pose in flange]
        kept = np.array([joints is not None for joints in reached])
        log, general = tour(cell, np.array([q for q in reached if q is not None])), general[kept]
    else:
        blank = Views.blank(
            cell.board,
            width_px=cell.camera.width_px,
            height_px=cell.camera.height_px,
            frames=len(flange),
        )
        log = replace(blank, base_from_flange=flange)
    views = synthesize_corners(
        model,
        log,
        corner_sigma_px=cell.corner_sigma_px,
        repeatability=cell.repeatability,
        arm_rng=cell.random(ARM_STREAM),
        corner_rng=cell.random(CORNER_STREAM),
    )
    seen: BoolArray = np.asarray(views.seen.all(axis=1))
    return views.take(seen), general[seen]


def joints_at(cell: SimulatedCell, base_from_flange: FloatArray) -> FloatArray | None:
    """Joints that bring the flange there, or None out of reach."""
    try:
        return cell.kinematics.inverse(base_from_flange, cell.home_rad)
    except ValueError:
        return None


def run(cell: SimulatedCell, plan: Plan) -> Run:
    """Record, calibrate, and judge every solution against the simulator's truth."""
    views, general = record(cell, plan, np.random.default_rng(1))
    whole = calibrate(views)
    few = calibrate(views.take(general))
    law, beta_law = whole.focus_law, whole.beta_law
    assert law is not None
    assert beta_law is not None
    alpha0 = {
        "alpha_px": next(iter(law.preferred.parameters.values())).value,
        "beta_px": next(iter(beta_law.parameters.values())).value,
    }
    picked = views.take(general)
    solutions = {
        "zhang_algebraic": few.solutions["zhang_algebraic"],
        "zhang_mle": few.solutions["zhang_mle"],
        **held_at(picked, alpha0),
    }
    for name in ("fixed_alpha_algebraic", "fixed_alpha_mle", "joint_ml"):
        solutions[name] = part_of(whole.solutions[name], general)
    truth = walk(cell.model, picked).camera_from_board
    error = {
        name: Statistics.of(camera_position_error_m(s.camera_from_board, truth))
        for name, s in solutions.items()
    }
    return Run(whole, solutions, error, (int((~general).sum()), int(general.sum())), alpha0)


def part_of(solution: Solution, which: BoolArray) -> Solution:
    """The same solution on some of its views."""
    return replace(
        solution,
        optics=solution.optics[which],
        camera_from_board=solution.camera_from_board[which],
        residual_px=solution.residual_px[which],
    )


def held_at(views: Views, scale: Mapping[str, float]) -> dict[str, Solution]:
    """Eqs. 20 and 24 with one alpha and beta held in all views, as the paper's Table 1 has it."""
    n, points = len(views), views.board.corners_m
    optics = held_optics(
        np.full(n, scale["alpha_px"]),
        np.full(n, scale["beta_px"]),
        views.width_px,
        views.height_px,
    )
    homographies = np.array([fit_homography(points[:, :2], c).matrix for c in views.corners_px])
    weight = views.seen.astype(float)
    start = algebraic_poses(optics, homographies)
    fit = fit_fixed_alpha(optics, start, points, views.corners_px, weight)
    everything = np.ones(n, dtype=bool)
    return {
        "held_algebraic": unfitted_solution(views, everything, weight, optics, start),
        "held_mle": as_solution(fit, weight, FREE),
    }


def print_run(cell_name: str, cell: SimulatedCell, plan: Plan) -> None:
    """One plan's three tables."""
    found = run(cell, plan)
    law = found.whole.focus_law
    assert law is not None
    print(f"\n### {cell_name}, {plan.name}\n")
    tilts = " to ".join(f"{t:.0f}" for t in plan.tilt_deg)
    print(
        f"{found.frames[0]} parallel views {plan.nearest_m} to {plan.farthest_parallel_m} m,"
        f" {found.frames[1]} general ones to {plan.farthest_general_m} m, tilted {tilts} degrees"
        f" from near to far."
        f" Law found: {law.preferred.law}, "
        + ", ".join(
            f"{n} = {p.value:.4g} ± {p.sigma:.2g} {p.unit}"
            for n, p in law.preferred.parameters.items()
        )
        + f" ({law.why}).\n"
    )
    print_table_1(cell_name, found)
    print_table_2(cell_name, found)


def print_table_1(cell_name: str, found: Run) -> None:
    """Reprojection as in Table 1, and camera positions against the truth."""
    print(
        "| solution | paper: mean | paper: std px | simulated: mean | simulated: std px"
        " | simulated: camera error z mean, mm | rms, mm |\n|---|---|---|---|---|---|---|"
    )
    for name in ROWS:
        told = TABLE_1[cell_name].get(name)
        paper = f"{told[0]:.4g} | {told[1]:.4f}" if told else "– | –"
        pixels, error = found.solutions[name].reprojection_px, found.error[name]
        print(
            f"| {NAMES[name]} | {paper} | {pixels['mean']:.1e} | {pixels['std']:.4f}"
            f" | {1e3 * error.mean[2]:+.2f} | {1e3 * error.rms:.2f} |"
        )
    print()


def print_table_2(cell_name: str, found: Run) -> None:
    """Parameters as in Table 2; the proposed method's alpha and beta are those at infinity."""
    proposed = {**found.solutions["fixed_alpha_mle"].values, **found.alpha0}
    columns = {
        "proposed": proposed,
        "zhang_algebraic": found.solutions["zhang_algebraic"].values,
        "zhang_mle": found.solutions["zhang_mle"].values,
    }
    print(
        "| | proposed: paper | simulated | Zhang algebraic: paper | simulated"
        " | Zhang MLE: paper | simulated |\n|---|---|---|---|---|---|---|"
    )
    for k, parameter in enumerate(PARAMETERS):
        cells = [
            f"{TABLE_2[cell_name][column][k]:g} | {columns[column][parameter]:.4f}"
            if k >= 4
            else f"{TABLE_2[cell_name][column][k]:g} | {columns[column][parameter]:.1f}"
            for column in columns
        ]
        print(f"| {parameter} | " + " | ".join(cells) + " |")


def main() -> None:
    """Print everything."""
    for name, (preset, plans) in PLANS.items():
        for plan in plans:
            print_run(name, preset(0), plan)


if __name__ == "__main__":
    main()
