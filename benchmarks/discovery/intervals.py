"""Do the intervals hold the truth? Amounts of named effects, and slopes of laws, after search.

    python -m benchmarks.discovery.intervals [--named N] [--laws N] [--results FILE.jsonl]

Every case is concealed by the benchmark's own cell (no kinematics that are off), diagnosed as a
user would, and what was told is held against what was concealed, in the sigmas told. A case whose
effect was not found counts for nothing here; how often that is so is the other tables' business.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.discovery.physics import Physics, present
from benchmarks.discovery.recordings import Concealed, conceal
from benchmarks.discovery.run import views_of
from benchmarks.discovery.world import State, rigid
from calib.discovery.diagnose import diagnose
from calib.discovery.diagnosis import Diagnosis
from calib.errors import CalibrationError

TIMES_SIGMA = 1.96
SIZES = (1.0, 2.0)


@dataclass(frozen=True)
class Pull:
    """One number: how far it is from the truth, in its own unit and in sigmas."""

    case: str
    what: str
    told: float
    true: float
    sigma: float

    @property
    def inside(self) -> bool:
        """Whether the 95 % interval holds the truth."""
        return abs(self.told - self.true) <= TIMES_SIGMA * self.sigma


Truth = Callable[[Concealed, float], dict[str, float]]

NAMED: dict[str, tuple[str, str | None, Truth]] = {
    "focus inverse square": (
        "focus_breathing",
        "inverse_square",
        lambda c, k: {"k_px_m2": 0.003 * 0.16 * k * c.cell.alpha},
    ),
    "focus thin lens": ("focus_breathing", "thin_lens", lambda c, k: {"f_m": 0.004 * k}),
    "joint zero": ("joint_zero_offset", None, lambda c, k: {"offset_rad_3": 1.2e-3 * k}),
    "joint compliance": (
        "joint_compliance",
        None,
        lambda c, k: {f"rad_per_Nm_{j}": 2.5e-5 * k for j in (2, 3)},
    ),
    "bracket bends": ("mount_flex", None, lambda c, k: {"rad_per_g": 1.2e-3 * k}),
    "lens sags": ("lens_sag", None, lambda c, k: {"px_per_g": 3.0 * k}),
    "decentred": ("decentering", None, lambda c, k: {"p1": 1.2e-3 * k, "p2": -8e-4 * k}),
    "base tilts": ("base_compliance", None, lambda c, k: {"rad_per_Nm": 1e-5 * k}),
    "mount slips": (
        "mount_slip",
        None,
        lambda c, k: {"x_m": 1e-3 * k, "y_m": 5e-4 * k, "z_m": -1e-3 * k,
                      "rx_rad": 2e-3 * k, "ry_rad": -1e-3 * k},
    ),
    "focus ring bumped": (
        "optics_step",
        None,
        lambda c, k: {"relative": -0.003 * k, "u_px": -2.0 * k, "v_px": 3.5 * k},
    ),
    "picture drifts": ("thermal_image_drift", None, lambda c, k: {"tau_s": 200.0}),
}  # fmt: skip
"""Key of the physics to name, law, and true amounts for a size."""

_ALONG = ("gain_db", "temperature_c", "clamp_N", "dwell_s", "exposure_s", "joint_1", "joint_5")
_ALIAS = {"temperature_c": "temperature", "exposure_s": "exposure"}


@dataclass(frozen=True)
class _Site:
    name: str
    component: str
    size: float
    act: Callable[[State, np.ndarray], None]


def _six(place: str, component: int) -> Callable[[State, np.ndarray], None]:
    def act(s: State, by: np.ndarray) -> None:
        step = np.zeros((len(by), 6))
        step[:, component] = by
        setattr(s, place, getattr(s, place) @ rigid(step))

    return act


def _joint(place: int) -> Callable[[State, np.ndarray], None]:
    def act(s: State, by: np.ndarray) -> None:
        s.joints[:, place] += by

    return act


def _centre(axis: int) -> Callable[[State, np.ndarray], None]:
    def act(s: State, by: np.ndarray) -> None:
        s.centre = s.centre + by[:, None] * np.eye(2)[axis]

    return act


def _focal(s: State, by: np.ndarray) -> None:
    s.alpha = s.alpha * (1.0 + by)


SITES = (
    _Site("principal_point", "u", 2.0, _centre(0)),
    _Site("principal_point", "v", 2.0, _centre(1)),
    _Site("focal_length", "relative", 2e-3, _focal),
    _Site("joint_2", "joint_2", 1.2e-3, _joint(1)),
    _Site("joint_3", "joint_3", 1.2e-3, _joint(2)),
    _Site("mounted_pose", "z", 1.5e-3, _six("mounted", 2)),
    _Site("fixed_pose", "x", 1.5e-3, _six("fixed", 0)),
)
"""Where a law may live; `size` is what it does over the covariate's range."""


def _column(name: str, log: dict[str, np.ndarray]) -> np.ndarray:
    return log["joints"][:, int(name[-1]) - 1] if name.startswith("joint_") else log[name]


def law_case(turn: int) -> tuple[str, _Site, str, Physics]:
    """The law of that number: each site along each covariate in turn."""
    rng = np.random.default_rng(turn)
    site, along = SITES[turn % len(SITES)], _ALONG[(turn // len(SITES)) % len(_ALONG)]
    size = site.size * float(rng.uniform(0.7, 2.0) * rng.choice([-1, 1]))

    def act(s: State, k: float) -> None:
        x = _column(along, s.log)
        site.act(s, k * size * (x - x.mean()) / np.ptp(x))

    return f"law {turn}: {site.name}.{site.component} along {along}", site, along, Physics("", act)


def _law_pulls(turn: int) -> tuple[str, list[Pull]]:
    name, site, along, what = law_case(turn)
    case = conceal(name, ((what, 1.0),), background=False)
    found = _diagnosed(case)
    if found is None:
        return name, []
    x = _column(along, case.log)
    rng = np.random.default_rng(turn)
    slope = site.size * float(rng.uniform(0.7, 2.0) * rng.choice([-1, 1])) / np.ptp(x)
    for term in found.unexplained_all:
        law = term.law
        if law is None or law.form != "linear" or term.site != site.name:
            continue
        if law.covariates != (_ALIAS.get(along, along),):
            continue
        for key, value in law.parameters.items():
            if key.startswith("slope") and site.component in key:
                return name, [Pull(name, site.name, value.value, slope, value.sigma)]
    return name, []


def _named_pulls(key: str, size: float, turn: int) -> tuple[str, list[Pull]]:
    name = f"interval {turn}: {key} x {size:g}"
    effect, law, truth = NAMED[key]
    case = conceal(name, ((present(key), size),), background=False)
    found = _diagnosed(case)
    pulls = []
    for named in () if found is None else found.effects:
        if named.name == effect and named.law == law:
            for parameter, true in truth(case, size).items():
                value = named.parameters.get(parameter)
                if value is not None:
                    label = f"{effect}.{parameter}"
                    pulls.append(Pull(name, label, value.value, true, value.sigma))
    return name, pulls


def _diagnosed(case: Concealed) -> Diagnosis | None:
    rows = np.arange(len(case.ahead))
    try:
        return diagnose(views_of(case, rows[~case.ahead]), log=views_of(case, rows))
    except CalibrationError:
        return None


def _cases(named: int, laws: int) -> Iterator[tuple[str, list[Pull]]]:
    keys = list(NAMED)
    for turn in range(max(named, laws)):
        if turn < named:
            size = SIZES[turn // len(keys) % len(SIZES)]
            yield _named_pulls(keys[turn % len(keys)], size, turn)
        if turn < laws:
            yield _law_pulls(turn)


def table(pulls: list[Pull]) -> str:
    """Coverage by what it is a number of, and over all."""
    by: dict[str, list[Pull]] = defaultdict(list)
    for pull in pulls:
        by[pull.what].append(pull)
    lines = ["| number | inside the 95 % interval | rms of error / sigma |", "|---|---|---|"]
    for what, some in [*sorted(by.items()), ("all", pulls)]:
        pull = np.array([(p.told - p.true) / p.sigma for p in some])
        inside = sum(p.inside for p in some)
        lines.append(f"| {what} | {inside} of {len(some)} | {np.sqrt(np.mean(pull**2)):.2f} |")
    return "\n".join(lines)


def main() -> None:
    """Run what was asked for and print the table over all that stands in the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--named", type=int, default=0, metavar="N")
    parser.add_argument("--laws", type=int, default=0, metavar="N")
    parser.add_argument("--results", type=Path, default=Path("discovery-intervals.jsonl"))
    asked = parser.parse_args()
    pulls = []
    for name, some in _cases(asked.named, asked.laws):
        pulls += some
        with asked.results.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(asdict(pull)) + "\n" for pull in some)
        print(name, *(f"{p.what} {(p.told - p.true) / p.sigma:+.2f}" for p in some), flush=True)
    print(table(pulls))


if __name__ == "__main__":
    main()
