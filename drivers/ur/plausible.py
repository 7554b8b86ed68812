"""Whether a packet of the controller's can be a reading of an arm at all."""

from __future__ import annotations

import math

from drivers.ur.runtime import Runtime
from drivers.ur.wire import Value

_FARTHEST_JOINT_RAD = 7.0  # 363 degrees and a margin
_FARTHEST_M = 1e4  # a tool given in millimetres lies within; `cell doctor` names it


def implausible(values: dict[str, Value]) -> str | None:
    """Return what is wrong with the values of a packet, named by their RTDE names, or None."""
    for name, value in values.items():
        if not all(map(math.isfinite, value if isinstance(value, tuple) else (value,))):
            return f"its {name} is not finite"
    if values["runtime_state"] not in list(Runtime):
        return f"its runtime_state {values['runtime_state']} is unknown"
    if _largest(values["actual_q"]) > _FARTHEST_JOINT_RAD:
        return "its actual_q lies outside what the joints can turn"
    if max(_largest(values[name]) for name in ("actual_TCP_pose", "tcp_offset")) > _FARTHEST_M:
        return f"its actual_TCP_pose or tcp_offset lies more than {_FARTHEST_M:g} m away"
    return None


def _largest(value: Value) -> float:
    return max(map(abs, value if isinstance(value, tuple) else (value,)))
