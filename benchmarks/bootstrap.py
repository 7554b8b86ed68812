"""`cell bootstrap` on simulated cells whose layout is wrong by as much as it is allowed to be.

    python benchmarks/bootstrap.py --seeds 20               # corners without pictures
    python benchmarks/bootstrap.py --seeds 20 --pictures    # whole dry runs

Prints how many ended with a plan, how far off hand-eye is, whether each planned view has the whole
board in the true camera's picture, and whether any move broke a true box or left the start.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from tests.bootstrap.trials import (
    Trial,
    Wrong,
    eye_to_hand,
    irb140,
    run_on_corners,
    run_trial,
    start_in_view,
    ur3,
    worn_out,
)

CELLS = {"irb140": lambda: irb140(shrunk=4), "ur3": ur3, "ur5e-outside": eye_to_hand}


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--seeds", type=int, default=20)
    asked.add_argument("--first", type=int, default=0)
    asked.add_argument("--cells", nargs="*", choices=CELLS, default=list(CELLS))
    asked.add_argument("--pictures", action="store_true", help="whole dry runs")
    asked.add_argument("--worn", action="store_true", help="joints that are off, a soft bracket")
    options = asked.parse_args()
    for name in options.cells:
        with tempfile.TemporaryDirectory() as folder:
            seeds = range(options.first, options.first + options.seeds)
            trials = [
                _trial(name, seed, Path(folder), worn=options.worn, pictures=options.pictures)
                for seed in seeds
            ]
            _sum_up(name, trials)


def _trial(name: str, seed: int, folder: Path, *, worn: bool, pictures: bool) -> Trial:
    rng = np.random.default_rng([seed, 7])
    cell = Wrong().layout_of(CELLS[name](), rng)
    if worn:
        cell = worn_out(cell, rng)
    start_deg = start_in_view(cell, rng)
    if pictures:
        trial = run_trial(cell, folder / f"{name}-{seed}", start_deg)
    else:
        trial = run_on_corners(cell, rng, start_deg)
    print(f"{name} seed {seed}: {_line(trial)}", flush=True)
    return trial


def _line(trial: Trial) -> str:
    parts = [f"error: {trial.error}"] if trial.error else []
    parts.append(f"{len(trial.stops_rad)} stops")
    parts += trial.violations()
    if trial.found is not None:
        off_m, off_rad = trial.mounted_error()
        parts.append(
            f"hand-eye {1e3 * off_m:.2f} mm {np.degrees(off_rad):.3f} deg off (stated"
            f" {1e3 * trial.found.mounted_sigma_m.max():.2f}), alpha {trial.found.alpha_px:.0f}"
        )
        if not trial.error:
            parts.append("{} of {} views whole".format(*trial.planned_views_seen_whole()))
    return "; ".join(parts)


def _sum_up(name: str, trials: list[Trial]) -> None:
    done = [trial for trial in trials if not trial.error]
    if not done:
        print(f"{name}: none of {len(trials)} planned")
        return
    off = np.array([trial.mounted_error() for trial in done]).reshape(-1, 2)
    seen = np.array([trial.planned_views_seen_whole() for trial in done]).reshape(-1, 2)
    broken = sum(bool(trial.violations()) for trial in trials)
    print(
        f"{name}: {len(done)} of {len(trials)} planned; hand-eye off by"
        f" {1e3 * np.median(off[:, 0]):.2f} mm (median), {1e3 * off[:, 0].max():.2f} (worst),"
        f" {np.degrees(off[:, 1].max()):.3f} deg (worst);"
        f" {int((seen[:, 0] == seen[:, 1]).sum())} plans with every view whole,"
        f" {int(seen[:, 0].sum())} of {int(seen[:, 1].sum())} views; {broken} broke a box or left"
    )


if __name__ == "__main__":
    main()
