"""Stops that a controller obeys, or does not, at random instants of whole runs, as a table.

    python -m benchmarks.fault_runs.stops [--stand ur+gige] [--only WORDS] [--instants 10]

Each trial is a `cell run` in a process of its own. While the arm is on a slow move, the controller
is given its fault and the run a Ctrl-C. What comes of it is held against the simulated arm itself:
a stop counts as done (exit status 4) only where the arm stands, and confirmed wherever there are
true readings of it; in all other cases the alarm is raised and the status is 5.
"""

from __future__ import annotations

import json
import random
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fault_runs.launch import Launch
from benchmarks.fault_runs.stands import ABB, STANDS, UR, Stand
from benchmarks.fault_runs.stop_table import Judged, print_table, worst
from cell.sequencer.journal import read_journal
from cell.storage.files.plan_file import read_plan
from drivers.arm import MoveTarget
from sim.peers.controller_faults import Stops

_SLOW_DEG_S, _WIDE_DEG = 3.0, {UR: 36.0, ABB: 80.0}
"""Moves of the wrist that last longer than a stop may take to be confirmed."""
_TRIES = 3
_POLL_S, _END_S, _WIRE_S = 0.002, 30.0, 0.1
_LAST_S = 3.0
_STOPPED, _ALARM = 4, 5
_ORDERS = (
    *("dashboard: stop", "robot api: stop", "script: stopj", "script refused"),
    *("rws: stop", "rws: motors off"),
)


@dataclass(frozen=True)
class Kind:
    """What a controller does with a stop.

    Attributes
    ----------
    faults:
        Values of its `ControllerFaults`.
    arrives:
        Whether orders reach it at all.
    confirmed:
        Makers of the arms whose true readings show the stop, so that it must be confirmed.
    either:
        Makers of the arms with which it may be confirmed by something else that is true.
    alarm:
        What the operator reads where it was not, or did not last.
    """

    name: str
    faults: dict[str, Any] = field(default_factory=dict)
    arrives: bool = True
    confirmed: tuple[str, ...] = ()
    either: tuple[str, ...] = ()
    alarm: str = "PRESS THE EMERGENCY STOP"


_ALL = (UR, ABB)
_CUT = {"mute": True, "deaf": True}
KINDS = (
    Kind("obeyed", confirmed=_ALL),
    Kind("obeyed 0.5 s late", {"stops": Stops.LATE, "late_s": 0.5}, confirmed=_ALL),
    Kind("taken and ignored", {"stops": Stops.IGNORED}),
    Kind("refused, no watchdog", {"stops": Stops.REFUSED, "watchdog_fails": True}),
    Kind("cable cut", _CUT, arrives=False),
    Kind("cable cut, no watchdog", _CUT | {"watchdog_fails": True}, arrives=False),
    Kind("mute", {"mute": True}),
    Kind(
        "obeyed, and the arm goes on",
        {"stops": Stops.RESUMED, "late_s": 0.9},
        # where the stop was not confirmed by then, it is ordered again, and confirmed
        either=_ALL,
        alarm="moved again after it had been stopped",
    ),
    # Robot Web Services report no clock that could stand still
    Kind("frozen clock", {"frozen_clock": True}, confirmed=(ABB,)),
    # joints that never change differ from an arm at rest only by the way it must have gone
    # since; where they are as new as the order, RAPID's having stopped is what confirms it
    Kind("old readings", {"old_readings": True}, either=(ABB,)),
)


@dataclass
class StopTrial:
    """What came of one stop; times are from the Ctrl-C.

    Attributes
    ----------
    order_s, halt_s, report_s:
        To the first order at the controller, to the arm's halt (both None where there was none
        while the run lasted), and to the word of it.
    moving:
        Whether the arm moved when the report came.
    """

    order_s: float | None
    halt_s: float | None
    report_s: float
    moving: bool
    exit_status: int | None
    output: str

    def complaints(self, kind: Kind, maker: str) -> list[str]:
        """What was not as it must be."""
        found = []
        if self.exit_status == _STOPPED and self.moving:
            found.append("reported as stopped while it moved")
        wanted = _STOPPED if maker in kind.confirmed else _ALARM
        if maker in kind.either and self.exit_status == _STOPPED:
            wanted = _STOPPED
        if self.exit_status != wanted:
            found.append(f"exit status {self.exit_status}, not {wanted}")
        if wanted == _ALARM and kind.alarm not in self.output:
            found.append("no alarm")
        if kind.arrives and (self.order_s is None or self.order_s > _WIRE_S):
            found.append(f"the order was there after {self.order_s} s")
        return found


@contextmanager
def slow_stand(name: str, folder: Path, joint_speed_deg_s: float = _SLOW_DEG_S) -> Iterator[Stand]:
    """A cell of `STANDS` whose arm makes long, slow moves."""
    with STANDS[name](folder) as stand:
        path = stand.plan.path
        plan = json.loads(path.read_text()) | {"joint_speed_deg_s": joint_speed_deg_s}
        for number, view in enumerate(plan["views"]):
            # one way only: on the other the UR3's camera comes too near to its own wrist
            view["joints_deg"][-1] -= 0.0 if number % 2 else _WIDE_DEG[stand.maker]
        path.write_text(json.dumps(plan))
        yield replace(stand, plan=read_plan(path))


def stop_trial(stand: Stand, folder: Path, kind: Kind, instant_s: float) -> StopTrial | None:
    """One stop, `instant_s` after the first motion; None where the run ended before it."""
    launch = Launch(stand.plan.path, folder)
    try:
        if not (moving(stand, launch) and moving(stand, launch, time.monotonic() + instant_s)):
            return None
        return _stopped(stand, folder, kind, launch)
    finally:
        launch.finish()
        stand.arm.restore()
        stand.arm.halt("the trial is over")
        home(stand)


def home(stand: Stand) -> None:
    """Drive it back to where the plan's first, long move begins."""
    assert stand.plan.cell.layout is not None
    joints = np.radians(stand.plan.cell.layout.home_deg)
    _wait_for_rest(stand)
    # a stop that the controller obeys late may come on the way
    while not np.allclose(stand.sim.truth().joints_rad, joints):
        stand.sim.start_move(MoveTarget(tuple(joints.tolist()), None, 5.0, 2.0))
        _wait_for_rest(stand)


def _wait_for_rest(stand: Stand) -> None:
    while stand.truly_moving():
        time.sleep(_POLL_S)


def moving(stand: Stand, launch: Launch, from_s: float = 0.0) -> bool:
    """Wait until the arm moves, at that time or after it; False where the run ended before."""
    while time.monotonic() < from_s or not stand.truly_moving():
        if launch.ended:
            return False
        time.sleep(_POLL_S)
    return True


def _stopped(stand: Stand, folder: Path, kind: Kind, launch: Launch) -> StopTrial:
    for name, value in kind.faults.items():
        setattr(stand.arm.faults, name, value)
    return seen_through(stand, folder, launch, lambda: launch.send(signal.SIGINT))


def seen_through(
    stand: Stand, folder: Path, launch: Launch, happens: Callable[[], None]
) -> StopTrial:
    """Let it happen, and look at arm and controller until the run has ended."""
    asked_s, asked_unix_s = time.monotonic(), time.time()
    happens()
    moved: list[tuple[float, bool]] = []
    while not launch.ended and time.monotonic() < asked_s + _END_S:
        moved.append((time.monotonic() - asked_s, stand.truly_moving()))
        time.sleep(_POLL_S)
    ended_s = time.monotonic() - asked_s
    launch.finish()
    report_s = _report_s(folder, asked_unix_s, ended_s)
    orders = [
        event.t_s - asked_s
        for event in stand.arm.events
        if event.t_s >= asked_s and event.what.startswith(_ORDERS)
    ]
    halted = next((t_s for t_s, moving in moved if not moving), None)
    at_report = [moving for t_s, moving in moved if t_s <= report_s]
    return StopTrial(
        min(orders, default=None),
        halted,
        report_s,
        at_report[-1],
        launch.exit_status,
        launch.output,
    )


def _report_s(folder: Path, asked_unix_s: float, ended_s: float) -> float:
    """When the run journalled what became of the stop; its end where it did not."""
    halts = [event["at"] for event in read_journal(folder) if event["event"] == "halt"]
    at_s = datetime.fromisoformat(halts[-1]).timestamp() - asked_unix_s if halts else ended_s
    return at_s if at_s >= 0.0 else ended_s


def stops_of(
    stand: Stand, folder: Path, name: str, kind: Kind, count: int, seed: int
) -> Judged[StopTrial]:
    """The same kind at random instants, the same ones every time; (trial, complaints) each."""
    chance = random.Random(f"{seed} {name} {kind.name}")
    found: Judged[StopTrial] = []
    for number in range(_TRIES * count):
        if len(found) == count:
            break
        label = "-".join(kind.name.replace(",", "").split())
        trial = stop_trial(stand, folder / f"{label}-{number}", kind, chance.uniform(0.0, _LAST_S))
        if trial is not None:
            found.append((trial, trial.complaints(kind, stand.maker)))
    return found


def _row(name: str, kind: Kind, found: Judged[StopTrial]) -> list[str]:
    trials = [trial for trial, _ in found]
    good = sum(not complaints for _, complaints in found)
    confirmed = sum(trial.exit_status == _STOPPED for trial in trials)
    return [
        name,
        kind.name,
        f"{good} of {len(found)}",
        f"{confirmed} of {len(found)}",
        worst([trial.order_s for trial in trials]),
        worst([trial.halt_s for trial in trials]),
        worst([trial.report_s for trial in trials]),
        ", ".join(sorted({str(trial.exit_status) for trial in trials})),
    ]


def main() -> None:
    """Print the table; exit status 1 unless everything was as it must be."""
    print_table(
        (__doc__ or "").splitlines()[0],
        (
            "cell",
            "the stop is",
            "reported as it was",
            "confirmed",
            "order at the controller, worst",
            "halt, worst",
            "word, worst",
            "exit",
        ),
        lambda _: KINDS,
        slow_stand,
        stops_of,
        _row,
    )


if __name__ == "__main__":
    main()
