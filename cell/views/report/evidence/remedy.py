"""What a technician can do about an effect: the catalogue's own words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from calib.chain.effects import find_effect

# mix-ups in the log are not physics, so the chain's catalogue does not have them
_SLIPS = {
    "frame_pose_offset": "Check how pictures and poses were paired: the log is off by one frame.",
    "frame_pose_swap": "Check how pictures and poses were paired: leave the named frames out, or "
    "exchange their poses.",
    "length_unit": "Write the poses in metres, or import them again with the right unit.",
    "rotation_convention": "Import the poses again with the convention that was found.",
    "robot_model": "Enter the robot model that was found in the cell file.",
}


def remedy_of(effect: Mapping[str, Any]) -> str | None:
    """What to do about an effect of diagnosis.json, or None where there is no remedy."""
    if effect.get("remedy"):
        return str(effect["remedy"])
    name = str(effect["name"])
    if name in _SLIPS:
        return _SLIPS[name]
    try:
        return find_effect(name, effect.get("law")).remedy
    except KeyError:
        return None
