"""The controller's status words.

Source: Universal Robots, "Real-Time Data Exchange (RTDE) Guide", robot controller outputs.
"""

from __future__ import annotations

from enum import IntEnum


class Runtime(IntEnum):
    """RTDE's ``runtime_state``."""

    STOPPED = 1
    PLAYING = 2
    PAUSED = 4


class Robot(IntEnum):
    """RTDE's ``robot_mode``."""

    POWER_OFF = 3
    IDLE = 5
    RUNNING = 7


class Safety(IntEnum):
    """RTDE's ``safety_status_bits``."""

    NORMAL = 1 << 0
    PROTECTIVE_STOP = 1 << 2
    EMERGENCY_STOP = (1 << 6) | (1 << 7)
