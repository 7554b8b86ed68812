"""What the program on the controller is doing."""

from __future__ import annotations

from enum import IntEnum


class Runtime(IntEnum):
    """``runtime_state``: what the program on the controller is doing."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5
