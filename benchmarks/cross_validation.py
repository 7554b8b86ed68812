"""How often does cross-validation raise its flag, where nothing is wrong and where something is?

    python benchmarks/cross_validation.py [RUNS] [PROCESSES]

The simulated cells of `coverage.py` (20 parallel and 30 tilted views, corner noise 0.05 px, robot
0.05 mm and 0.005 degrees), their frames in no order, as they are and with something wrong:

- 15 frames: only so many of them, nothing wrong;
- slip: the flange drifts 0.3 mm along its x from the first frame to the last;
- one frame: the pose of the nearest frame is logged 0.5 mm off;
- bent: each picture is bent by itself, 0.1 px RMS over its corners (a board that gives, a detector
  that errs with the light), beside the noise;
- half: the robot's scatter is taken for half of what it is.

Printed: the verdicts, the factor by which the worst quantity's sigma is called too small (median),
and by how much sigmas are: error over sigma of all numbers, RMS over the runs.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import product
from multiprocessing import Pool

import numpy as np

from calib.calibration.cross_validation import cross_validate
from calib.chain.model import evaluate
from calib.chain.rigid import from_vector
from calib.solver.joint import fit_joint
from calib.solver.noise import Noise, profile
from calib.solver.unknowns import unknowns_of
from calib.views import FloatArray, Views

# numba must have looked for the package of that name before
from coverage import CELLS, pulls, simulate, start  # isort: skip

FEW, SLIP_M, OFF_M, BENT_PX = 15, 3e-4, 5e-4, 0.1
CASES = ("nothing", "15 frames", "slip", "one frame", "bent", "half")


@dataclass(frozen=True)
class Run:
    """What one run reported."""

    case: str
    verdict: str
    factor: float
    named: bool
    error: float


def spoilt(case: str, views: Views, nearest: int, rng: np.random.Generator) -> Views:
    """The views with something wrong."""
    push = np.zeros((len(views), 6))
    if case == "15 frames":
        return views.take(np.arange(FEW))
    if case == "slip":
        push[:, 0] = np.linspace(0.0, SLIP_M, len(views))
    if case == "one frame":
        push[nearest, 2] = OFF_M
    if case == "bent":
        return replace(views, corners_px=views.corners_px + bend(views, rng))
    return replace(views, base_from_flange=views.base_from_flange @ from_vector(push))


def bend(views: Views, rng: np.random.Generator) -> FloatArray:
    """(N, M, 2) a smooth picture of its own for each frame, of second and third order."""
    x, y = np.moveaxis(views.corners_px / [views.width_px, views.height_px] - 0.5, 2, 0)
    shapes = np.stack([x**2, y**2, x * y, x**3, y**3], axis=-1)
    found = shapes @ rng.normal(size=(len(views), 5, 2))
    rms = np.sqrt(np.nanmean(found**2, axis=(1, 2), keepdims=True))
    return np.asarray(found / rms * BENT_PX)


def one(task: tuple[str, int]) -> Run:
    """Simulate, spoil, fit and cross-validate."""
    case, seed = task
    true, views, _ = simulate(*CELLS[seed % len(CELLS)], seed)
    rng = np.random.default_rng(seed)
    views = views.take(rng.permutation(len(views)))
    views = replace(views, frame=np.arange(len(views)))
    distance = evaluate(true, views).distance_m
    nearest = int(distance.argmin())
    views = spoilt(case, views, nearest, rng)
    guess = start(true)
    fit = fit_joint(guess, views, unknowns_of(guess), Noise(0.2, 3e-4, 3e-4))
    if case == "half":
        half = replace(
            fit.noise, flange_m=fit.noise.flange_m / 2, flange_rad=fit.noise.flange_rad / 2
        )
        covariance = profile(fit.equations, half).covariance
        fit = replace(fit, noise=half, covariance=covariance)
    found = cross_validate(fit, views, (float(distance.min()), float(distance.max())))
    off = [z for one in pulls(fit, true).values() for z in one]
    named = bool(found.pulls) and found.pulls[0].frame == nearest
    return Run(case, found.verdict, found.factor, named, float(np.mean(np.square(off))))


def table(runs: Iterable[Run]) -> list[str]:
    """In Markdown."""
    head = "agree", "sigma too small", "single frames", "factor, median", "error / sigma, RMS"
    lines = [f"| case | runs | {' | '.join(head)} |", "|---" * (len(head) + 2) + "|"]
    runs = list(runs)
    for case in CASES:
        own = [r for r in runs if r.case == case]
        verdicts = Counter(r.verdict for r in own)
        counts = [verdicts[v] for v in ("agree", "sigma_too_small", "single_frames")]
        numbers = " | ".join(str(c) for c in counts)
        factors = [r.factor for r in own if r.factor > 1.0]
        factor = f"{np.median(factors):.2f}" if factors else "–"
        error = float(np.sqrt(np.mean([r.error for r in own])))
        lines.append(f"| {case} | {len(own)} | {numbers} | {factor} | {error:.2f} |")
    named = [r.named for r in runs if r.case == "one frame"]
    lines += ["", f"The frame that is off is the first one named in {sum(named)} of {len(named)}."]
    return lines


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 120
    workers = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    with Pool(workers) as pool:
        runs = pool.map(one, list(product(CASES, range(count))), chunksize=4)
    print(f"{datetime.now(UTC):%d %B %Y}, {count} runs of each\n")
    print("\n".join(table(runs)))


if __name__ == "__main__":
    main()
