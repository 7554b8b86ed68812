"""What the controller's status words mean, for the operator.

Source: Universal Robots, "Real-Time Data Exchange (RTDE) Guide", robot controller outputs.
"""

from __future__ import annotations

from drivers.ur.reader import Packet

ROBOT_RUNNING = 7

_ROBOT_MODES = {
    -1: "has no controller",
    0: "is disconnected",
    1: "waits for a safety confirmation",
    2: "is booting",
    3: "is powered off",
    4: "is powered on with its brakes on",
    5: "is idle with its brakes on",
    6: "is being moved by hand (backdrive)",
    8: "is updating its firmware",
}

_SAFETY_BITS = {
    10: ("stopped for safety", "look at the teach pendant"),
    9: ("safety fault", "look at the teach pendant; the controller must be restarted"),
    8: ("safety violation", "look at the teach pendant; the safety system must be restarted"),
    7: ("emergency stop", "release the button, then power on and release the brakes"),
    6: ("emergency stop at the robot", "release the button, then power on and release the brakes"),
    5: ("emergency stop of the system", "release it, then power on and release the brakes"),
    4: ("safeguard stop", "leave the guarded area and reset the safeguard"),
    3: ("recovery mode", "move the arm back inside its limits by hand"),
    2: (
        "protective stop",
        "find out what it ran into, clear it, wait five seconds, unlock it at the teach pendant",
    ),
}


def fault_in(packet: Packet) -> str | None:
    """Return what keeps the arm from moving, and what to do; None where nothing does."""
    # the more particular bit comes with the general ones, so the order of _SAFETY_BITS matters
    bits = int(packet.number("safety_status_bits"))
    for bit in (6, 5, 7, 9, 8, 2, 4, 3, 10):
        if bits >> bit & 1:
            what, remedy = _SAFETY_BITS[bit]
            return f"{what}: {remedy}"
    mode = int(packet.number("robot_mode"))
    if mode != ROBOT_RUNNING:
        state = _ROBOT_MODES.get(mode, f"is in mode {mode}")
        return f"the arm {state}: power it on and release the brakes on the teach pendant"
    return None
