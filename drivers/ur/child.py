"""The process that holds ur-rtde. Run by path, with the standard library and the wheel only.

ur-rtde's constructor holds the interpreter lock without a time-out, a call on a dead link blocks
for 301 s, and its reconnecting ends in a segmentation fault: whatever it does, it does here, where
it can be killed. Orders come in as JSON lines on standard input, events go out as JSON lines on
what was standard output. The controller's own watchdog is kicked from here, so that the arm stops
when this process ends in whatever way; and it ends when its parent does.
"""

from __future__ import annotations

import ctypes
import json
import os
import select
import signal
import sys
import time
from typing import Any, TextIO

_PR_SET_PDEATHSIG = 1
_FLAG_UPLOAD_SCRIPT, _FLAG_UPPER_RANGE, _FLAG_NO_EXT_FT = 0x01, 0x08, 0x40
_CYCLE_S = 0.01


def main() -> None:
    """Serve orders until the parent closes the pipe or falls silent."""
    options = json.loads(sys.argv[1])
    _die_with(options["parent_pid"])
    events = _claim_stdout()
    flags = _FLAG_UPLOAD_SCRIPT | _FLAG_NO_EXT_FT
    flags |= _FLAG_UPPER_RANGE if options["upper_registers"] else 0
    try:
        from rtde_control import RTDEControlInterface

        control = RTDEControlInterface(options["host"], options["rate_hz"], flags)
        if not control.setWatchdog(options["watchdog_hz"]):
            raise RuntimeError("the controller's watchdog could not be set")
    except Exception as error:
        _emit(events, "failed", why=str(error))
        os._exit(1)
    _emit(events, "ready")
    try:
        _serve(control, events, options["silence_s"])
    finally:
        control.stopScript()
        # the destructor is one of the places where ur-rtde crashes
        os._exit(0)


def _die_with(parent_pid: int) -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent_pid:
        os._exit(1)


def _claim_stdout() -> TextIO:
    """Take standard output for events; ur-rtde's own chatter goes to standard error."""
    events = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    return events


def _emit(events: TextIO, event: str, **more: Any) -> None:
    events.write(json.dumps({"event": event, **more}) + "\n")


def _serve(control: Any, events: TextIO, silence_s: float) -> None:
    heard_s = time.monotonic()
    pending = b""
    before: int | None = None
    while time.monotonic() - heard_s < silence_s:
        if select.select([0], [], [], _CYCLE_S)[0]:
            chunk = os.read(0, 65536)
            if not chunk:
                return
            heard_s = time.monotonic()
            *lines, pending = (pending + chunk).split(b"\n")
            for line in filter(None, lines):
                before = _obey(control, events, json.loads(line), before)
        if not control.kickWatchdog():
            _emit(events, "failed", why="the watchdog could not be kicked: link to the arm lost")
            return
        before = _progress(control, events, before)


def _obey(control: Any, events: TextIO, order: dict[str, Any], before: int | None) -> int | None:
    if order["order"] == "beat":
        return before
    operation = control.getAsyncOperationProgressEx().operationId()
    move = control.moveJ if order["order"] == "move_j" else control.moveL
    if not move(order["target"], order["speed"], order["acceleration"], True):
        _emit(events, "failed", why="the controller did not take the motion")
        return None
    _emit(events, "moving")
    return int(operation)


def _progress(control: Any, events: TextIO, before: int | None) -> int | None:
    """Signal when the motion that came after operation `before` has ended."""
    if before is None:
        return None
    status = control.getAsyncOperationProgressEx()
    if status.isAsyncOperationRunning() or status.operationId() == before:
        return before
    _emit(events, "done")
    return None


if __name__ == "__main__":
    main()
