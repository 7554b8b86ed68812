"""An arm that does not do as ordered, in whole runs through the drivers, as a table.

    python -m benchmarks.fault_runs.disturbances [--stand ur+gige] [--only WORDS] [--instants 10]

Each trial is a `cell run` in a process of its own, against peers. Where the arm stands, it is
pushed or sags; on its way, the controller takes another one, or drives faster than ordered. Nobody
reports it to the run; only readings do. It must end with exit status 5 and say which it was,
and the arm must stand. Times are from the push, or from the first motion of the move that is wrong.
"""

from __future__ import annotations

import random
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.fault_runs.launch import Launch
from benchmarks.fault_runs.stands import Stand
from benchmarks.fault_runs.stop_table import Judged, print_table, worst
from benchmarks.fault_runs.stops import StopTrial, home, moving, seen_through, slow_stand

_SPEED_DEG_S = 10.0
_SAFETY = 5
_FIRST_S, _LAST_S = 0.3, 6.0
_STANDING_S, _POLL_S = 0.2, 0.002
_TRIES = 4
_ELBOW = np.eye(6)[2]
_PUSHED = "moved where it was to stand|left the way|turns at"
"""The run may not have noted yet that it has arrived, or may be about to go on."""


@dataclass(frozen=True)
class Disturbance:
    """One thing that the arm does.

    Attributes
    ----------
    name:
        In the table.
    pattern:
        Pattern of what the operator must be shown.
    prepare:
        Makes the controller ready for it.
    push:
        Moves the arm where it stands; None where the next move is the wrong one.
    stands:
        Whether the arm can be stopped at all.
    """

    name: str
    pattern: str
    prepare: Callable[[Stand], None] = lambda stand: None
    push: Callable[[Stand], None] | None = None
    stands: bool = True


def _pushes(by_deg: float, speed_rad_s: float) -> Callable[[Stand], None]:
    return lambda stand: stand.sim.push(np.radians(by_deg) * _ELBOW, speed_rad_s)


def _sets(**faults: object) -> Callable[[Stand], None]:
    def prepare(stand: Stand) -> None:
        for name, value in faults.items():
            setattr(stand.sim.faults, name, value)

    return prepare


def _stops_and_sags(stand: Stand) -> None:
    stop = getattr(stand.arm, "protective_stop", None) or stand.arm.guard_stop
    stop()
    _pushes(20.0, 0.05)(stand)


DISTURBANCES = (
    Disturbance("pushed where it stands", _PUSHED, push=_pushes(1.5, 0.2)),
    Disturbance("sags where it stands", _PUSHED, push=_pushes(20.0, 0.03)),
    Disturbance(
        "another way, 8° beside", "left the way|turns at", _sets(bulge_rad=float(np.radians(8.0)))
    ),
    Disturbance(
        "2.5 times as fast as ordered", "turns at|the plan allows", _sets(speed_factor=2.5)
    ),
    Disturbance(
        "stops by itself, and sags on",
        "THE ARM DOES NOT STOP",
        _sets(brakes_slip=True),
        _stops_and_sags,
        stands=False,
    ),
)


def complaints(kind: Disturbance, trial: StopTrial) -> list[str]:
    """What was not as it must be."""
    found = []
    if trial.exit_status != _SAFETY:
        found.append(f"exit status {trial.exit_status}, not {_SAFETY}")
    if re.search(kind.pattern, trial.output) is None:
        found.append(f"operator does not see '{kind.pattern}'")
    if kind.stands and trial.moving:
        found.append("the arm moved when the run reported what became of it")
    if "Traceback" in trial.output:
        found.append("a traceback")
    return found


def trial_of(stand: Stand, folder: Path, kind: Disturbance, instant_s: float) -> StopTrial | None:
    """Let it happen at the first occasion from then on; None where the run ended before it."""
    launch = Launch(stand.plan.path, folder)
    try:
        due_s = time.monotonic() + instant_s
        if not (moving(stand, launch) and _standing(stand, launch, due_s)):
            return None
        kind.prepare(stand)
        if kind.push is None and not moving(stand, launch):
            return None
        push = kind.push
        return seen_through(stand, folder, launch, (lambda: push(stand)) if push else lambda: None)
    finally:
        launch.finish()
        for name, value in vars(type(stand.sim.faults)()).items():
            setattr(stand.sim.faults, name, value)
        stand.arm.restore()
        stand.sim.stop()
        home(stand)


def _standing(stand: Stand, launch: Launch, from_s: float) -> bool:
    """Wait until the arm has stood for a while, at that time or after it."""
    since_s = np.inf
    while time.monotonic() < max(from_s, since_s + _STANDING_S) or since_s == np.inf:
        if launch.ended:
            return False
        since_s = np.inf if stand.truly_moving() else min(since_s, time.monotonic())
        time.sleep(_POLL_S)
    return True


def trials_of(
    stand: Stand, folder: Path, name: str, kind: Disturbance, count: int, seed: int
) -> list[StopTrial]:
    """The same disturbance at random instants, the same ones every time."""
    chance = random.Random(f"{seed} {name} {kind.name}")
    found: list[StopTrial] = []
    for number in range(_TRIES * count):
        if len(found) == count:
            break
        folder_name = "-".join(re.findall(r"\w+", kind.name))
        instant_s = chance.uniform(_FIRST_S, _LAST_S)
        trial = trial_of(stand, folder / f"{folder_name}-{number}", kind, instant_s)
        found += [] if trial is None else [trial]
    return found


def _judged(
    stand: Stand, folder: Path, name: str, kind: Disturbance, count: int, seed: int
) -> Judged[StopTrial]:
    trials = trials_of(stand, folder, name, kind, count, seed)
    return [(trial, complaints(kind, trial)) for trial in trials]


def _row(name: str, kind: Disturbance, found: Judged[StopTrial]) -> list[str]:
    trials = [trial for trial, _ in found]
    good = sum(not complaints for _, complaints in found)
    return [
        name,
        kind.name,
        f"{good} of {len(trials)}",
        worst([trial.order_s for trial in trials]),
        worst([trial.halt_s for trial in trials]) if kind.stands else "-",
        worst([trial.report_s for trial in trials]),
        ", ".join(sorted({str(trial.exit_status) for trial in trials})),
    ]


def main() -> None:
    """Print the table; exit status 1 unless everything was as it must be."""
    print_table(
        (__doc__ or "").splitlines()[0],
        (
            "cell",
            "the arm",
            "stopped and reported",
            "stop order, worst",
            "halt, worst",
            "word, worst",
            "exit",
        ),
        lambda _: DISTURBANCES,
        partial(slow_stand, joint_speed_deg_s=_SPEED_DEG_S),
        _judged,
        _row,
    )


if __name__ == "__main__":
    main()
