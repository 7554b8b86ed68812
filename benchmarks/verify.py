"""How often `cell verify` is right: false alarms where nothing changed, and what else it reports.

    python benchmarks/verify.py [RUNS] [PROCESSES] [PLAN...]

Both shipped plans, simulated. In every run a calibration is made from the whole plan with its own
noise; then eight views of the plan (`choose_views`) are taken anew with other noise, once for each
of the changes below and some times more for none; the board has been moved by 6 mm in every other
run.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace
from multiprocessing import Pool
from pathlib import Path

import numpy as np

from calib import Views, as_mapping, calibrate
from calib.chain.optics import COLUMN
from calib.chain.rigid import from_vector
from cell.devices.simulated_cell import home_of, log_of, simulated_cell
from cell.storage.files.calibration_source import CalibrationSource
from cell.storage.files.plan_file import read_plan
from cell.verbs.verify.judge import Judgement, judge
from cell.verbs.verify.old_cell import OldCell, old_cell
from cell.verbs.verify.short_plan import SHORT, choose_views
from sim.cell import SimulatedCell
from sim.synthesize import synthesize

CONFIGS = Path(__file__).parents[1] / "configs"
PLANS = ("irb140-eosens", "ur3-robotiq")
MORE = 5
"""Times that nothing changes, besides the one among the cases: false alarms are rare."""

CASES = {
    "nothing": "good",
    "mount 0.3 mm, 0.3 mrad": "moved",
    "mount 1 mm": "moved",
    "focal length +0.05 %": "lens_changed",
    "focal length +0.2 %": "lens_changed",
    "both: 1 mm, +0.2 %": "moved_and_lens_changed",
}


def changed(cell: SimulatedCell, case: str) -> SimulatedCell:
    """The cell after what the case states."""
    model, knock, more = cell.model, np.zeros(6), 0.0
    if "0.3 mm" in case:
        knock = np.array([2e-4, -1e-4, 2e-4, 0.0, 3e-4, 0.0])
    if "1 mm" in case:
        knock = np.array([6e-4, -6e-4, 5e-4, 0.0, 0.0, 0.0])
    if "%" in case:
        more = 5e-4 if "0.05" in case else 2e-3
    optics = model.optics.copy()
    optics[[COLUMN["alpha_px"], COLUMN["beta_px"]]] *= 1 + more
    mounted = model.flange_from_mounted @ from_vector(knock)
    return replace(cell, model=replace(model, optics=optics, flange_from_mounted=mounted))


def board_moved(cell: SimulatedCell) -> SimulatedCell:
    """The cell with its board moved by 6 mm, and turned."""
    moved = cell.model.base_from_fixed @ from_vector(np.array([0.005, 0.003, 0, 0, 0, 0.005]))
    return replace(cell, model=replace(cell.model, base_from_fixed=moved))


def calibrated(views: Views) -> OldCell:
    """The calibration of views, by way of its file."""
    return old_cell(CalibrationSource.model_validate(as_mapping(calibrate(views), "benchmark")))


def one_run(job: tuple[str, int]) -> list[tuple[str, str, Judgement, bool]]:
    """(plan, case, judgement, whether the board was moved) of every case."""
    name, seed = job
    plan = read_plan(CONFIGS / f"{name}.plan.yaml")
    cell = simulated_cell(plan.cell, home_of(plan), seed=seed)
    log = log_of(plan, cell)
    old = calibrated(synthesize(cell, log))
    short = log.take(choose_views(old, log, SHORT))
    found = []
    for k, case in enumerate([*CASES, *["nothing"] * MORE]):
        now = replace(changed(cell, case), seed=10_000 + 100 * seed + k)
        now = board_moved(now) if seed % 2 else now
        found.append((name, case, judge(old, synthesize(now, short)), bool(seed % 2)))
    return found


def main(runs: int = 50, processes: int = 2, *plans: str) -> None:
    """Print what was reported, by plan and case."""
    jobs = [(name, seed) for name in plans or PLANS for seed in range(1, runs + 1)]
    reported = []
    with Pool(processes) as pool:
        for done, rows in enumerate(pool.imap_unordered(one_run, jobs), start=1):
            reported += rows
            print(f"\r{done} of {len(jobs)} runs", end="", file=sys.stderr)
    for name in plans or PLANS:
        print(f"{name}, {runs} runs, {SHORT} views each")
        for case, right in CASES.items():
            rows = [(j, moved) for plan, c, j, moved in reported if plan == name and c == case]
            verdicts = Counter(j.verdict for j, _ in rows)
            board = sum(j.board.moved == moved for j, moved in rows)
            others = ", ".join(f"{n} {v}" for v, n in verdicts.items() if v != right)
            print(
                f"  {case:24} {right}: {verdicts[right]}/{len(rows)}"
                f"{'; else ' + others if others else ''}; board right {board}/{len(rows)}"
            )
        null = sorted(j.p_value for plan, c, j, _ in reported if plan == name and c == "nothing")
        arm = [j.arm_ratio for plan, c, j, _ in reported if plan == name and c == "nothing"]
        low = np.round(np.quantile(null, [0, 0.05, 0.1, 0.5, 0.9]), 4)
        print(f"  p values where nothing changed, quantiles 0, 5, 10, 50, 90 %: {low}")
        print(f"  scatter of the arm, now over then: {np.round(np.quantile(arm, [0, 0.5, 1]), 2)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
