"""The parent's side of the process that holds ur-rtde."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

_CHILD = Path(__file__).with_name("child.py")


class Phase(Enum):
    """Where the child stands."""

    STARTING = "starting"
    READY = "ready"
    ORDERED = "ordered"
    MOVING = "moving"
    FAILED = "failed"


@dataclass(frozen=True)
class ChildOptions:
    """What the child is started with; see `drivers.ur.settings.URSettings` for the meanings."""

    host: str
    rate_hz: float
    upper_registers: bool
    watchdog_hz: float
    silence_s: float


@dataclass(frozen=True)
class MoveOrder:
    """One motion as ur-rtde takes it.

    Attributes
    ----------
    order:
        ``move_j`` (target: joint angles, radians; speed and acceleration of the leading joint) or
        ``move_l`` (target: TCP pose as a six-vector; speed and acceleration of the TCP).
    """

    order: str
    target: tuple[float, ...]
    speed: float
    acceleration: float


class MotionChild:
    """A running child. Nothing here blocks but `reap`, which waits for a process that was killed.

    The thread that makes one of these must outlive it: the kernel kills the child with that thread.
    """

    def __init__(self, options: ChildOptions) -> None:
        arguments = json.dumps({**vars(options), "parent_pid": os.getpid()})
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(_CHILD), arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # an interrupt typed at the terminal is for the sequencer, which then stops the arm
            start_new_session=True,
        )
        self._lock = threading.Lock()
        self._phase = Phase.STARTING
        self._since_s = time.monotonic()
        self._why = ""
        self._was_ready = False
        threading.Thread(target=self._listen, name="ur-motion-events", daemon=True).start()

    @property
    def phase(self) -> Phase:
        """Where the child stands."""
        return self._phase

    @property
    def in_phase_s(self) -> float:
        """How long it has stood there, seconds."""
        return time.monotonic() - self._since_s

    @property
    def why(self) -> str:
        """Why it failed, in the words of whoever noticed."""
        return self._why

    @property
    def was_ready(self) -> bool:
        """Whether the control script ever ran."""
        return self._was_ready

    def move(self, order: MoveOrder) -> None:
        """Pass a motion on."""
        self._enter(Phase.ORDERED)
        self._send(vars(order))

    def beat(self) -> None:
        """Show the child that this process is alive."""
        self._send({"order": "beat"})

    def kill(self) -> None:
        """End the process; returns before it is gone. Idempotent."""
        self._process.kill()

    def reap(self) -> None:
        """Wait until the process that was killed is gone, and free what it held."""
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError, ValueError):
                pipe.close()

    def _send(self, order: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(order).encode() + b"\n")
            self._process.stdin.flush()
        except (OSError, ValueError):
            self._fail("the process that moves the arm ended")

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with contextlib.suppress(OSError, ValueError):
            for line in self._process.stdout:
                self._hear(json.loads(line))
        self._fail("the process that moves the arm ended")

    def _hear(self, event: dict[str, Any]) -> None:
        if event["event"] == "failed":
            self._fail(event["why"])
        elif event["event"] == "moving":
            self._enter(Phase.MOVING)
        else:
            self._was_ready = True
            self._enter(Phase.READY)

    def _enter(self, phase: Phase) -> None:
        with self._lock:
            if self._phase is not Phase.FAILED:
                self._phase, self._since_s = phase, time.monotonic()

    def _fail(self, why: str) -> None:
        with self._lock:
            if self._phase is not Phase.FAILED:
                self._phase, self._since_s, self._why = Phase.FAILED, time.monotonic(), why
