"""Semi-real recordings: a simulated cell whose arm errs as a real one was measured to.

    python -m benchmarks.discovery.semi_real POSE_ERRORS.csv [--cases N] [--results FILE.jsonl]

The file has measured poses of a real arm: joints (`q1_deg` to `q6_deg`) and what its kinematic
model leaves (`kinematic_dx_mm` to `kinematic_rz_deg`), as a laser tracker gives them. The errors
are carried to the simulated cell's joints by conditional simulation (kriging; Chiles, Delfiner
2012, section 7.3): a Gaussian process that goes through the measured errors. Its long length scale
and that one's share are chosen by likelihood; the rest is alike over a short one. Where no measured
pose is near, it errs as the arm does elsewhere. Every second case has a known effect besides.
"""

from __future__ import annotations

import argparse
import csv
import zlib
from pathlib import Path

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from benchmarks.discovery.outcomes import Outcome, append_outcome, read_outcomes
from benchmarks.discovery.physics import CATALOGUE, Physics
from benchmarks.discovery.recordings import conceal
from benchmarks.discovery.run import BACKGROUND, Case, diagnosed
from benchmarks.discovery.world import HOME, Array, State, rigid

ARM_FIELD = "the arm's measured error"
_LENGTHS_RAD = (0.3, 0.45, 0.7, 1.0, 1.5, 2.2)
_SHARES = (0.3, 0.4, 0.5, 0.7, 0.85)
_SHORT_RAD = 0.15
"""Of what is not alike over the long length: poses 0.18 rad apart correlate by 0.45 to 0.82."""

_BESIDE = (
    "focus inverse square", "focus thin lens", "board bend", "focus ring bumped", "decentred",
    "board slips", "mount slips", "lens sags",
)  # fmt: skip
_OF_THE_ARM = (*BACKGROUND, "joint_compliance", "joint_periodic_error")
"""Names that are true of this arm: its kinematic model has neither compliance nor waves."""


class MeasuredArm:
    """Errors of an arm's poses, measured at some joints, drawn at any."""

    def __init__(self, path: Path) -> None:
        with path.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.joints = np.radians([[float(row[f"q{k}_deg"]) for k in range(1, 7)] for row in rows])
        moved = [[float(row[f"kinematic_d{a}_mm"]) for a in "xyz"] for row in rows]
        turned = [[float(row[f"kinematic_r{a}_deg"]) for a in "xyz"] for row in rows]
        self.errors = np.concatenate([1e-3 * np.array(moved), np.radians(turned)], axis=1)
        self.errors -= self.errors.mean(axis=0)
        self.unit = self.errors.std(axis=0)
        tries = [(self._loss(d, s), d, s) for d in _LENGTHS_RAD for s in _SHARES]
        _, self.length_rad, self.share = min(tries)

    def _covariance(self, first: Array, second: Array, length: float, share: float) -> Array:
        square = ((first[:, None] - second[None]) ** 2).sum(axis=2)
        long = share * np.exp(-0.5 * square / length**2)
        return np.asarray(long + (1.0 - share) * np.exp(-0.5 * square / _SHORT_RAD**2))

    def _factor(self, length: float, share: float) -> tuple[Array, bool]:
        whole = self._covariance(self.joints, self.joints, length, share)
        return cho_factor(whole + 1e-6 * np.eye(len(whole)), lower=True)

    def _loss(self, length: float, share: float) -> float:
        factor, scaled = self._factor(length, share), self.errors / self.unit
        log_det = 2.0 * np.log(np.diag(factor[0])).sum()
        return float((scaled * cho_solve(factor, scaled)).sum() + 6 * log_det)

    def drawn(self, joints: Array, rng: np.random.Generator) -> Array:
        """(N, 6) errors in the flange's frame at (N, 6) joints."""
        numbers = (self.length_rad, self.share)
        factor = self._factor(*numbers)
        across = self._covariance(joints, self.joints, *numbers)
        mean = across @ cho_solve(factor, self.errors / self.unit)
        left = self._covariance(joints, joints, *numbers) - across @ cho_solve(factor, across.T)
        value, vector = np.linalg.eigh(left)
        root = vector * np.sqrt(np.maximum(value, 0.0))
        return np.asarray((mean + root @ rng.standard_normal((len(joints), 6))) * self.unit)


def errs_as_measured(arm: MeasuredArm, seed: int) -> Physics:
    """The measured error as physics to conceal, its joints' middle at the cell's."""
    middle = np.median(arm.joints, axis=0)

    def act(s: State, k: float) -> None:
        at = middle + s.log["joints"] - HOME
        error = k * arm.drawn(at, np.random.default_rng(seed))
        s.mounted = rigid(error) @ s.mounted

    return Physics(ARM_FIELD, act, _OF_THE_ARM, ("arm",), ("joints", "workspace"), ("field",))


def run_case(arm: MeasuredArm, index: int) -> Outcome:
    """Conceal, diagnose, judge."""
    name = f"semi-real {index}"
    measured = errs_as_measured(arm, zlib.crc32(name.encode()))
    physics = ((measured, 1.0), *((known, 2.5) for known in beside(index)))
    case = Case("outside", name, tuple((what.key, size) for what, size in physics))
    return diagnosed(case, conceal(name, physics, background=False))


def beside(index: int) -> tuple[Physics, ...]:
    """The effect of the catalogue that a case has besides; none in every second one."""
    key = _BESIDE[index // 2 % len(_BESIDE)] if index % 2 else None
    return tuple(what for what in CATALOGUE if what.key == key)


def table(outcomes: list[Outcome]) -> str:
    """The measures in Markdown."""
    gained = [1.0 - (o.after_px / o.before_px) ** 2 for o in outcomes]
    allowed = [1.0 - (o.oracle_px / o.before_px) ** 2 for o in outcomes]
    known = {o.name: beside(int(o.name.split()[1])) for o in outcomes}
    both = [o for o in outcomes if known[o.name]]
    rows = [
        ("cases", f"{len(outcomes)}, {len(both)} of them with a known effect"),
        ("`consistent`", str(sum(o.verdict == "consistent" for o in outcomes))),
        ("a name that is not true", str(sum(bool(o.false_names) for o in outcomes))),
        ("the known effect named",
         f"{sum(bool(set(o.names) & set(known[o.name][0].names)) for o in both)} of {len(both)}"),
        ("the arm named as the place, or a true name of it",
         str(sum(bool(o.link_right) for o in outcomes))),
        ("prediction worse than plain (by 2 %)",
         str(sum(o.after_px > 1.02 * o.before_px for o in outcomes))),
        ("share of the squared misses that went, median", f"{np.median(gained):.2f}"),
        ("... if the arm's error were known", f"{np.median(allowed):.2f}"),
    ]  # fmt: skip
    lines = ["| measure | value |", "|---|---|", *(f"| {a} | {b} |" for a, b in rows)]
    return "\n".join(lines)


def main() -> None:
    """Run the cases and print the table; those in the results already are not run again."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("pose_errors", type=Path)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--results", type=Path, default=Path("semi-real.jsonl"))
    asked = parser.parse_args()
    arm = MeasuredArm(asked.pose_errors)
    print(f"length scale {arm.length_rad:g} rad, share {arm.share:g}")
    done = read_outcomes(asked.results)
    for index in range(asked.cases):
        if f"semi-real {index}" in done:
            continue
        outcome = run_case(arm, index)
        done[outcome.name] = outcome
        append_outcome(asked.results, outcome)
        print(
            f"{outcome.name}: {outcome.verdict} {outcome.names} false {outcome.false_names}"
            f" {outcome.before_px:.2f} -> {outcome.after_px:.2f} px (oracle"
            f" {outcome.oracle_px:.2f}), {outcome.cpu_s:.0f} s",
            flush=True,
        )
    print(table(list(done.values())))


if __name__ == "__main__":
    main()
