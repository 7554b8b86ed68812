"""The paper's experiment on its two simulated cells: poses, recordings, every solution, the truth.

Three pose plans per cell. `reach`: what the arm reaches in front of one fixed board. `far`: the
paper's distances, which no IRB 140 or UR3 covers without moving the board; the flange poses are
then given without an arm. The third has the far plan's distances, and near views tilted as one
takes them by hand. Zhang's solutions use 15 general views only, as in the paper; the scale factors
come from a series of parallel ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from calib.calibration import Calibration, Solution, Statistics, calibrate
from calib.calibration.baseline import as_solution, unfitted_solution
from calib.chain.model import evaluate
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
AS_IN_THE_PAPER = "far, near views tilted"
"""The plan whose errors have the paper's signs and order."""


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
    """One plan on one cell.

    Attributes
    ----------
    whole:
        The calibration of all views.
    solutions:
        By name, on the general views.
    camera_from_board:
        (N, 4, 4) the truth of the general views.
    parallel:
        How many further views were parallel.
    alpha0:
        alpha and beta far away, by the law found.
    """

    whole: Calibration
    solutions: Mapping[str, Solution]
    camera_from_board: FloatArray
    parallel: int
    alpha0: dict[str, float]

    def error_m(self, solution: str) -> FloatArray:
        """(N, 3) where a solution has the camera, in the true camera's frame."""
        return camera_position_error_m(
            self.solutions[solution].camera_from_board, self.camera_from_board
        )

    @property
    def error(self) -> dict[str, Statistics]:
        """Of every solution's camera positions."""
        return {name: Statistics.of(self.error_m(name)) for name in self.solutions}


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
    truth = evaluate(cell.model, picked).camera_from_board
    return Run(whole, solutions, truth, int((~general).sum()), alpha0)


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


def run_named(cell: str, plan: str = AS_IN_THE_PAPER) -> Run:
    """The run of a cell and one of its plans, both by name; each is made once."""
    return _made(cell, plan)


@cache
def _made(cell: str, plan: str) -> Run:
    preset, plans = PLANS[cell]
    return run(preset(0), next(p for p in plans if p.name == plan))
