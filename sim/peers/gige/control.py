"""Who controls the device: one host, for as long as it is heard."""

from __future__ import annotations

import math
import time

from sim.peers.gige.gvcp import Refused, Status

Host = tuple[str, int]
_EXCLUSIVE_OR_CONTROL = 0x3
_ANOTHER_PROGRAM = ("127.255.255.254", 9)


class ControlPrivilege:
    """The control channel privilege; `holder` is the address and port of the host that has it."""

    def __init__(self) -> None:
        self.holder: Host | None = None
        self._heard_s = 0.0

    def hear(self, host: Host) -> None:
        """Any command of the holder is a sign of life."""
        if host == self.holder:
            self._heard_s = time.monotonic()

    def require(self, host: Host) -> None:
        """Refuse a host that does not hold it."""
        if host != self.holder:
            raise Refused(Status.ACCESS_DENIED)

    def claim(self, privilege: int, host: Host) -> None:
        """Take or give back the privilege, as the value written to its register says."""
        if self.holder not in (None, host):
            raise Refused(Status.ACCESS_DENIED)
        self.holder = host if privilege & _EXCLUSIVE_OR_CONTROL else None
        self._heard_s = time.monotonic()

    def seize(self) -> None:
        """Another program takes it, and does not let go until `release`."""
        self.holder, self._heard_s = _ANOTHER_PROGRAM, math.inf

    def release(self) -> None:
        """Whoever has it gives it back."""
        self.holder = None

    def expired(self, heartbeat_s: float) -> bool:
        """Whether the holder has been silent for longer than that; it then holds it no more."""
        if self.holder is None or time.monotonic() - self._heard_s <= heartbeat_s:
            return False
        self.holder = None
        return True
