"""What a device may raise.

::

    DeviceError                 a device failed or answered nonsense          exit status 3
    ├── DeviceUnreachable       no connection, or the connection was lost
    ├── DeviceRefused           it answers, and says no (local mode, held by another program, ...)
    ├── FrameMissing               no whole frame came; the next trigger may succeed
    └── ArmStopped              the arm stopped by itself: protective stop, emergency stop, fault
    SafetyError                 a limit of ours refused or stopped a motion   exit status 5
    └── StopFailed              the arm was ordered to stop and did not confirm it

Every message says what happened, on which device, and what the operator can do.
"""

from __future__ import annotations


class DeviceError(Exception):
    """A device failed or answered nonsense."""


class DeviceUnreachable(DeviceError):
    """No connection could be made, or it was lost."""


class DeviceRefused(DeviceError):
    """The device answers and refuses: local mode, held by another program, no licence."""


class FrameMissing(DeviceError):
    """No whole frame came within the time; triggering again may succeed."""


class ArmStopped(DeviceError):
    """The arm stopped by itself: protective stop, emergency stop, program fault."""


class SafetyError(Exception):
    """A safety limit refused or stopped a motion."""


class StopFailed(SafetyError):
    """The arm was ordered to stop and did not confirm it. The loudest error there is."""
