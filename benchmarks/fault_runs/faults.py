"""What goes wrong in these runs, how it is put right, and what must come of it."""

from __future__ import annotations

import os
import random
import resource
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.fault_runs.launch import Launch
from benchmarks.fault_runs.stands import Stand

Act = Callable[[Stand, Launch], None]
DEVICE, _OPERATOR, SAFETY, _KILLED = 3, 4, 5, -signal.SIGKILL
RESUMES = r"--resume"
_NOBODY_KNOWS = ("NOBODY KNOWS WHETHER THE ARM STANDS", "PRESS THE EMERGENCY STOP", RESUMES)
"""Without a reading there is no word of the stop."""
NOT_REACHED = ("[Cc]heck|try again", "No motion was ordered", RESUMES)
"""Of a link that never was up."""
_CONNECTING_S, _MOVING_S = 0.8, 4.2


def _nothing(stand: Stand, launch: Launch) -> None:
    """Nothing to put right."""


def _always(stand: Stand, launch: Launch) -> bool:
    return True


@dataclass(frozen=True)
class Fault:
    """One fault and its outcome.

    Attributes
    ----------
    name:
        In the table.
    happen:
        Brings it about. One that the run survives puts it right again, too.
    exits:
        The exit statuses that the contract has for it.
    patterns:
        Patterns of what the operator must be shown: what happened, what to do.
    halt_s:
        The longest that the arm may move on after it; None where it may until the run's end.
    survived:
        The run goes on: a frame is logged after the fault, and then the run is interrupted.
    restore:
        What is put right afterwards, before the run is gone on with.
    possible:
        Whether it can happen now; the fault waits for it.
    """

    name: str
    happen: Act
    exits: tuple[int, ...] = (DEVICE,)
    patterns: tuple[str, ...] = ()
    halt_s: float | None = None
    survived: bool = False
    restore: Act = _nothing
    possible: Callable[[Stand, Launch], bool] = _always


def _restore_arm(stand: Stand, _: Launch) -> None:
    stand.arm.restore()


def _mend_cable(stand: Stand, launch: Launch) -> None:
    stand.arm.faults.mend_cable()
    time.sleep(1.0)  # what is still being ordered by the process that outlives the run
    _restore_arm(stand, launch)


def _revive_arm(stand: Stand, launch: Launch) -> None:
    time.sleep(1.0)  # what the run had still ordered comes to nothing
    stand.arm.kill()
    stand.arm.__enter__()
    _restore_arm(stand, launch)


def _restore_camera(stand: Stand, _: Launch) -> None:
    for name, value in vars(type(stand.camera.faults)()).items():
        setattr(stand.camera.faults, name, value)


def _revive_camera(stand: Stand, _: Launch) -> None:
    stand.camera.close()
    stand.camera.start()


def _sends(number: signal.Signals) -> Act:
    return lambda _, launch: launch.send(number)


def _child_of(launch: Launch, script: str) -> int | None:
    """Process id of the child of the cell that runs a script."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            patterns = (entry / "cmdline").read_bytes()
        except (OSError, IndexError):
            continue
        if parent == launch.pid and script.encode() in patterns:
            return int(entry.name)
    return None


def _signals_child(script: str, number: signal.Signals) -> Act:
    def send(_: Stand, launch: Launch) -> None:
        child = _child_of(launch, script)
        if child is not None:
            os.kill(child, number)

    return send


def _has_child(script: str) -> Callable[[Stand, Launch], bool]:
    return lambda _, launch: _child_of(launch, script) is not None


def _fill_disk(_: Stand, launch: Launch) -> None:
    # every write to a file beyond its first byte fails from now on, as on a full disk
    resource.prlimit(launch.pid, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))


_OWN = (
    Fault("Ctrl-C", _sends(signal.SIGINT), (_OPERATOR,), ("stopped by Ctrl-C", RESUMES), 0.6),
    Fault("SIGTERM", _sends(signal.SIGTERM), (_OPERATOR,), ("stopped by SIGTERM", RESUMES), 0.6),
    Fault("terminal closed", _sends(signal.SIGHUP), (_OPERATOR,), ("SIGHUP", RESUMES), 0.6),
    Fault("kill -9", _sends(signal.SIGKILL), (_KILLED,), (), 0.8),
    Fault("disk full", _fill_disk, (DEVICE,), ("disk", "[Ff]ree", RESUMES)),
)


def _hang(limit_s: float) -> Fault:
    """Our process stands still; somebody ends it when the arm has long stopped."""

    def happen(stand: Stand, launch: Launch) -> None:
        launch.send(signal.SIGSTOP)
        time.sleep(limit_s + 0.5)
        launch.send(signal.SIGKILL)

    return Fault("our process hangs", happen, (_KILLED,), (), limit_s)


# ---- Universal Robots ------------------------------------------------------------------------


def _unlock(stand: Stand, launch: Launch) -> None:
    stand.arm.wait_out_protective_stop()
    assert stand.arm.unlock_protective_stop()
    stand.arm.play()  # a program that was left paused would drive on now
    time.sleep(0.3)
    assert not stand.truly_moving(), "unlocking drove the arm on"


def _plays(stand: Stand, _: Launch) -> bool:
    return bool(stand.arm.runtime == 2)


def _local(stand: Stand, _: Launch) -> None:
    stand.arm.remote_control = False


def _mute(stand: Stand, _: Launch) -> None:
    stand.arm.faults.mute = True


_EMERGENCY_STOP = Fault(
    "emergency stop",
    lambda stand, _: stand.arm.emergency_stop(),
    patterns=("emergency stop", "release the button", RESUMES),
    halt_s=0.6,
    restore=_restore_arm,
)
_CONTROLLER_DIES = Fault(
    "controller dies",
    lambda stand, _: stand.arm.kill(),
    exits=(SAFETY,),
    patterns=_NOBODY_KNOWS,
    halt_s=0.6,
    restore=_revive_arm,
)
_CABLE_CUT = Fault(
    "cable cut",
    lambda stand, _: stand.arm.cut(),
    exits=(SAFETY,),
    patterns=_NOBODY_KNOWS,
    halt_s=1.5,
    restore=_restore_arm,
)
"""Of an arm, whoever made it."""

_SILENT = ("silent|did not answer|does not answer", *_NOBODY_KNOWS)

_UR_CHILD = "ur/child.py"
_UR = (
    Fault(
        "protective stop",
        lambda stand, _: stand.arm.protective_stop(),
        patterns=("protective stop", "clear it", RESUMES),
        halt_s=0.6,
        restore=_unlock,
    ),
    _EMERGENCY_STOP,
    Fault(
        "program stopped at the pendant",
        lambda stand, _: stand.arm.stop_program("teach pendant"),
        patterns=("teach pendant", RESUMES),
        halt_s=0.6,
        possible=_plays,
    ),
    Fault(
        "local mode",
        _local,
        patterns=("local mode", "Remote Control", RESUMES),
        halt_s=1.5,
        restore=_restore_arm,
    ),
    Fault(
        "controller mute",
        _mute,
        exits=(SAFETY,),
        patterns=_SILENT,
        halt_s=1.0,
        restore=_restore_arm,
    ),
    replace(_CABLE_CUT, patterns=_SILENT, halt_s=1.0),
    Fault(
        "connections dropped",
        lambda stand, _: stand.arm.drop(),
        patterns=("UR", RESUMES),
        halt_s=0.6,
        possible=_plays,
    ),
    _CONTROLLER_DIES,
    Fault(
        "ur-rtde dies",
        _signals_child(_UR_CHILD, signal.SIGKILL),
        patterns=("the process that moves the arm ended", RESUMES),
        halt_s=0.8,
        possible=_has_child(_UR_CHILD),
    ),
    Fault(
        "ur-rtde hangs",
        _signals_child(_UR_CHILD, signal.SIGSTOP),
        patterns=("watchdog|did not start|did not take", RESUMES),
        halt_s=1.0,
        possible=_has_child(_UR_CHILD),
    ),
    *_OWN,
    _hang(3.2),
)


# ---- GigE Vision -----------------------------------------------------------------------------


def _power_cut(stand: Stand, _: Launch) -> None:
    stand.camera.kill()


def _power_gone_for(seconds: float) -> Act:
    def happen(stand: Stand, _: Launch) -> None:
        stand.camera.kill()
        time.sleep(seconds)
        stand.camera.start()

    return happen


def _seized(stand: Stand, _: Launch) -> None:
    stand.camera.seize_control()


def _released(stand: Stand, _: Launch) -> None:
    stand.camera.release_control()


def _seized_for(seconds: float) -> Act:
    def happen(stand: Stand, launch: Launch) -> None:
        _seized(stand, launch)
        time.sleep(seconds)
        _released(stand, launch)

    return happen


def _camera_has(seconds: float, **faults: object) -> Act:
    def happen(stand: Stand, launch: Launch) -> None:
        for name, value in faults.items():
            setattr(stand.camera.faults, name, value)
        time.sleep(seconds)
        _restore_camera(stand, launch)

    return happen


def _camera_mute(stand: Stand, _: Launch) -> None:
    stand.camera.faults.mute = True


_CAMERA_LOST = ("camera", "check its power|[Cc]heck|close its viewer", RESUMES)
_GIGE = (
    Fault("camera: power cut", _power_cut, patterns=_CAMERA_LOST, restore=_revive_camera),
    Fault("camera: silent", _camera_mute, patterns=_CAMERA_LOST, restore=_restore_camera),
    Fault("camera: another program takes it", _seized, patterns=_CAMERA_LOST, restore=_released),
    Fault("camera: off and on", _power_gone_for(0.7), survived=True),
    Fault("camera: taken and given back", _seized_for(1.0), survived=True),
    Fault(
        "camera: incomplete buffers",
        _camera_has(1.5, packet_loss=0.3, resend=False),
        survived=True,
    ),
    Fault("camera: 2 % of packets lost", _camera_has(1.5, packet_loss=0.02), survived=True),
    Fault("camera: late frames", _camera_has(1.5, frame_latency_s=1.3), survived=True),
)


# ---- ABB -------------------------------------------------------------------------------------


def _refuse_stop(stand: Stand, launch: Launch) -> None:
    stand.arm.faults.rapid_stop_refused = True
    launch.send(signal.SIGINT)


_ABB = (
    Fault(
        "guard stop",
        lambda stand, _: stand.arm.guard_stop(),
        patterns=("guard", "reset the guard", RESUMES),
        halt_s=0.6,
        restore=_restore_arm,
    ),
    _EMERGENCY_STOP,
    Fault(
        "key turned to manual",
        lambda stand, _: stand.arm.to_manual(),
        patterns=("automatic", RESUMES),
        halt_s=0.6,
        restore=_restore_arm,
    ),
    replace(_CABLE_CUT, restore=_mend_cable),
    _CONTROLLER_DIES,
    Fault("connections dropped", lambda stand, _: stand.arm.drop(), survived=True),
    Fault(
        "Ctrl-C, and the stop is refused",
        _refuse_stop,
        exits=(_OPERATOR,),
        patterns=("stopped by Ctrl-C", RESUMES),
        halt_s=1.0,
        restore=_restore_arm,
    ),
    *_OWN,
    _hang(2.0),
)


# ---- Robotiq ---------------------------------------------------------------------------------

_ROBOTIQ = (
    Fault(
        "camera: server gone",
        lambda stand, _: stand.camera.close(),
        patterns=("Robotiq", "[Cc]heck", RESUMES),
        restore=_revive_camera,
    ),
    Fault(
        "camera: silent",
        _camera_mute,
        patterns=("Robotiq", "[Cc]heck", RESUMES),
        restore=_restore_camera,
    ),
    Fault("camera: video stands still", _camera_has(1.5, frozen=True), survived=True),
    Fault("camera: cut pictures", _camera_has(1.5, cut_short=5), survived=True),
    Fault("camera: slow answers", _camera_has(1.5, answer_delay_s=0.4), survived=True),
)

FAULTS: dict[str, tuple[Fault, ...]] = {
    "ur+gige": (*_UR, *_GIGE),
    "polyscope-x+gige": _UR,
    "abb+robotiq": (*_ABB, *_ROBOTIQ),
    "omnicore+robotiq": _ABB,
}
"""By cell; what becomes of a camera does not depend on the arm's controller."""


def instants(stand: str, fault: Fault, count: int, seed: int) -> list[float]:
    """Instants of a run, evenly random and the same every time; see `trial`."""
    chance = random.Random(f"{seed} {stand} {fault.name}")
    # a camera that is lost while it is being opened ends the run, which is not what is asked there
    first_s = 0.0 if fault.survived else -_CONNECTING_S
    return [chance.uniform(first_s, _MOVING_S) for _ in range(count)]
