"""What planned views are worth against random and hand-taught ones, predicted and realised.

    python benchmarks/plan_quality.py [RUNS] [FRAMES] [PROCESSES]

Both of the cells in configs/, with the noise and the focus law that stand there. Three ways to take
as many views: those of `cell plan`; random ones (distance, tilt up to 42 degrees, its direction,
roll and place in the image all drawn evenly), drawn anew in every run; and a raster as a person
teaches it (three distances, three by three places in the image, the board flat or tilted 20
degrees up, down, left or right). All show the whole board and can be reached by a free move. And
half as many views of `cell plan`. Last, for each number the least that any of `cell plan`'s
candidates could make of it if nothing else mattered: what no choice of poses goes below.

Predicted: one sigma from the joint problem's information at the true cell. Realised: the joint fit
of simulated corners and logs, started a per cent and some millimetres off and estimating its noise,
against the truth; root mean square over the runs.
"""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from itertools import islice, product
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain import rigid
from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.chain.optics import COLUMN
from calib.design.choose import Criterion, choose_views
from calib.design.expected import Expected, expect
from calib.design.needs import Need, needs_of
from calib.solver.joint import fit_joint
from calib.solver.noise import Noise
from calib.solver.pose_information import pose_information
from calib.solver.unknowns import PLAIN_OPTICS, unknowns_of
from calib.views import FloatArray, Views
from cell.devices.planned_camera import PlannedCamera
from cell.sequencer.guard import Guard
from cell.storage.files.cell_file import read_cell
from cell.verbs.plan import PlanSize, design_plan
from cell.verbs.plan.candidate_pool import CandidatePool
from cell.verbs.plan.candidates import TILT_RAD
from cell.verbs.plan.nominal import assume
from cell.verbs.plan.reach import layout_of, reachable
from sim.arm import Repeatability
from sim.synthesize import synthesize_corners

CONFIGS = Path(__file__).parents[1] / "configs"
NAMES = ("irb140-eosens", "ur3-robotiq")
START = Noise(0.2, 3e-4, 3e-4)
NUDGE = rigid.from_vector(np.array([2e-3, -3e-3, 2e-3, 3e-3, -4e-3, 2e-3]))
TAUGHT_TILT_RAD = np.radians(20.0)
SHOWN = {"px": 1.0, "m": 1e3, "rad": 1e3}


class Bench:
    """One cell: its truth, what is needed of it, and ways to take views."""

    def __init__(self, name: str) -> None:
        self.cell = read_cell(CONFIGS / f"{name}.cell.yaml")
        self.layout, self.sight = layout_of(self.cell), PlannedCamera.of(self.cell)
        self.guard = Guard(self.cell, 0.1, 0.5)
        self.assumed = assume(self.cell)
        truth = self.cell.simulation
        assert truth is not None
        (law,) = truth.effects
        self.lens = make_effect(law.name, {**law.parameters, "law": law.law or ""})
        self.plain = self.assumed.model
        self.true = self.plain.with_effects([self.lens])
        self.needs = self._needs()

    def _needs(self) -> tuple[Need, ...]:
        spread = self.expected(self.random(100, 0))
        return needs_of(spread, self.random(1, 0), self.layout.distances_m)

    def expected(self, views: Views) -> Expected:
        return expect(self.plain, [self.lens], views, self.assumed.noise)

    def predicted(self, views: Views) -> FloatArray:
        """(K,) one sigma of each need."""
        covariance = self.expected(views).covariance
        return np.sqrt([np.sum(need.weight * covariance) for need in self.needs])

    def realised(self, views: Views, seed: int) -> FloatArray:
        """(K,) square error of each need in one simulated run."""
        noise = self.assumed.noise
        logged = synthesize_corners(
            self.true,
            views,
            corner_sigma_px=noise.corner_px,
            repeatability=Repeatability(noise.flange_m, noise.flange_rad),
            arm_rng=np.random.default_rng([seed, 1]),
            corner_rng=np.random.default_rng([seed, 2]),
        )
        guess = self._start()
        fit = fit_joint(guess, logged, unknowns_of(guess), START)
        error = _error(fit.model, self.true)
        return np.array([error @ need.weight @ error for need in self.needs])

    def _start(self) -> CellModel:
        optics = self.true.optics.copy()
        optics[[COLUMN["alpha_px"], COLUMN["beta_px"]]] *= 1.01
        optics[[COLUMN["k1"], COLUMN["k2"]]] = 0.0
        law = make_effect("focus_breathing", {"law": self.lens.effect.law or ""})
        return CellModel(
            optics, self.true.flange_from_mounted @ NUDGE, self.true.base_from_fixed @ NUDGE, (law,)
        )

    def least(self, frames: int) -> FloatArray:
        """(K,) one sigma of each need with views chosen for it alone."""
        found = CandidatePool(self.cell, 1).varied
        views = self.assumed.views([c.base_from_flange for c in found])
        noise = self.assumed.noise
        information = pose_information(self.plain, views, [self.lens], noise).frames
        slots = [np.arange(len(found))] * frames
        out = []
        for number, need in enumerate(self.needs):
            picked = choose_views(Criterion(information, [need]), slots)
            out.append(self.predicted(views.take(np.array(picked)))[number])
        return np.array(out)

    def planned(self, frames: int) -> Views:
        plan = design_plan(self.cell, PlanSize.of(frames))
        joints = np.radians([view.joints_deg for view in plan.views])
        return self.assumed.views(list(self.guard.kinematics.forward(joints)))

    def random(self, frames: int, seed: int) -> Views:
        rng = np.random.default_rng([seed, 3])
        found = reachable("varied", self._random(rng), self.cell, self.guard)
        return self.assumed.views([c.base_from_flange for c in islice(found, frames)])

    def _random(self, rng: np.random.Generator) -> Iterator[RigidTransform]:
        half = 0.5 * np.array([self.sight.width_px, self.sight.height_px]) / self.sight.alpha_px
        while True:
            azimuth, roll = rng.uniform(0, 2 * np.pi, 2)
            axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            tilted = Rotation.from_rotvec(rng.uniform(0, TILT_RAD[1]) * axis)
            turn = Rotation.from_rotvec([0.0, 0.0, roll]) * tilted
            place = half * rng.uniform(-1, 1, 2)
            centre = rng.uniform(*self.layout.distances_m) * np.array([*place, 1.0])
            if self.sight.whole(turn, centre):
                yield self.sight.placed(turn, centre)

    def raster(self, frames: int) -> Views:
        found = list(reachable("varied", self._raster(), self.cell, self.guard))
        even = np.linspace(0, len(found) - 1, frames).round().astype(int)
        return self.assumed.views([found[k].base_from_flange for k in even])

    def _raster(self) -> Iterator[RigidTransform]:
        half = 0.5 * np.array([self.sight.width_px, self.sight.height_px]) / self.sight.alpha_px
        low, high = self.layout.distances_m
        tilts = TAUGHT_TILT_RAD * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        third = (-1, 0, 1)
        for share, x, y, tilt in product((0.2, 0.5, 0.8), third, third, tilts):
            turn = Rotation.from_rotvec([*tilt, 0.0])
            distance = low + share * (high - low)
            for reach in (0.5, 0.4, 0.3, 0.2, 0.1):
                centre = distance * np.array([*(reach * half * [x, y]), 1.0])
                if self.sight.whole(turn, centre):
                    yield self.sight.placed(turn, centre)
                    break


def _error(found: CellModel, true: CellModel) -> FloatArray:
    """(p,) of every free number, transforms on their own side."""
    optics = [COLUMN[name] for name in PLAIN_OPTICS]
    moved = (
        rigid.to_vector(rigid.inverse(getattr(true, frame)) @ getattr(found, frame))
        for frame in ("flange_from_mounted", "base_from_fixed")
    )
    bend = found.effects[0].values - true.effects[0].values
    return np.concatenate([found.optics[optics] - true.optics[optics], *moved, bend])


def one(bench: Bench, views: Views | int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Square of what is predicted and of what is realised; `views` is given, or how many random."""
    taken = bench.random(views, seed) if isinstance(views, int) else views
    return bench.predicted(taken) ** 2, bench.realised(taken, seed)


def table(name: str, frames: int, runs: int, workers: int) -> Iterator[str]:
    """One cell's rows in Markdown."""
    bench = Bench(name)
    plans: dict[str, Views | int] = {
        f"planned, {frames}": bench.planned(frames),
        f"planned, {frames // 2}": bench.planned(frames // 2),
        f"random, {frames}": frames,
        f"raster, {frames}": bench.raster(frames),
    }
    scale = np.array([SHOWN[need.unit] for need in bench.needs])
    first = np.ones((2, len(scale)))
    yield "| " + " | ".join([name, "", *(_title(need) for need in bench.needs)]) + " |"
    yield "|---" * (2 + len(scale)) + "|"
    for number, (title, views) in enumerate(plans.items()):
        with multiprocessing.Pool(workers) as processes:
            squares = processes.map(partial(one, bench, views), range(1, runs + 1), chunksize=4)
        rms = scale * np.sqrt(np.mean(squares, axis=0))
        first = rms if number == 0 else first
        yield _row(title, "predicted", rms[0], first[0])
        yield _row(title, "realised", rms[1], first[1])
    yield _row(f"least, {frames}", "predicted", scale * bench.least(frames), first[0])


def _row(title: str, word: str, values: FloatArray, best: FloatArray) -> str:
    cells = [f"{v:.4f} ({v / b:.2f})" for v, b in zip(values, best, strict=True)]
    return "| " + " | ".join([title, word, *cells]) + " |"


def _title(need: Need) -> str:
    unit = {"px": "px", "m": "mm", "rad": "mrad"}[need.unit]
    return f"{need.name.replace('_', ' ')}, {unit}"


def main() -> None:
    """Print a table for each cell; in brackets how many times the planned views' value."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    frames = int(sys.argv[2]) if len(sys.argv) > 2 else 40
    workers = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    print(f"{datetime.now(UTC):%d %B %Y}, {runs} runs\n", flush=True)
    for name in NAMES:
        for line in table(name, frames, runs, workers):
            print(line, flush=True)
        print(flush=True)


if __name__ == "__main__":
    main()
