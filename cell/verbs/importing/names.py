"""Poses whose numbers have names: columns of a CSV file, keys of JSON or YAML."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.verbs.importing import RotationName, Unit

_BEFORE = {
    "position": ("", "p", "t", "pos", "position", "trans", "translation", "tcp", "flange"),
    "quaternion": ("q", "quat", "quaternion", "orientation", "rotation", "rot"),
    "rotvec": ("rv", "rotvec", "rotationvector", "axisangle"),
    "three": ("r", "rot", "rotation", "orientation"),
}
_ANGLES: tuple[tuple[tuple[str, str, str], tuple[RotationName, RotationName]], ...] = (
    (("roll", "pitch", "yaw"), ("rpy", "rpy_deg")),
    (("w", "p", "r"), ("rpy", "rpy_deg")),
    (("a", "b", "c"), ("euler_zyx", "euler_zyx_deg")),
)
_SUFFIX = re.compile(r"(?<=[a-z])_?(mm|m|deg|rad)$")


@dataclass(frozen=True)
class NamedPose:
    """Position, then rotation, in the order of a convention.

    Attributes
    ----------
    values:
        6 or 7 numbers.
    rotations:
        What the names allow; empty where they do not tell.
    unit:
        Of the position, where a name tells.
    """

    values: FloatArray
    rotations: tuple[RotationName, ...]
    unit: Unit | None


def named_pose(data: Mapping[str, Any]) -> NamedPose | None:
    """The pose that these named numbers are, or None; other names may stand among them."""
    plain = {_plain(name): value for name, value in _flat(data).items()}
    position = _of(plain, "position", "xyz")
    if position is None:
        return None
    unit = _unit(data)
    quaternion = _of(plain, "quaternion", "xyzw")
    if quaternion is not None:
        return NamedPose(np.array(position + quaternion), ("quat_xyzw",), unit)
    turn = _of(plain, "rotvec", "xyz")
    if turn is not None:
        return NamedPose(np.array(position + turn), ("rotvec", "rotvec_deg"), unit)
    for names, rotations in _ANGLES:
        if all(name in plain for name in names):
            turn = [plain[name] for name in names]
            return NamedPose(np.array(position + turn), _by_unit(data, rotations), unit)
    turn = _of(plain, "three", "xyz")
    return None if turn is None else NamedPose(np.array(position + turn), (), unit)


def _flat(data: Mapping[str, Any]) -> dict[str, float]:
    """Numbers by their names, those of inner mappings with the outer name before."""
    flat: dict[str, float] = {}
    for name, value in data.items():
        if isinstance(value, Mapping):
            flat |= {f"{name}_{inner}": number for inner, number in _flat(value).items()}
        elif isinstance(value, int | float) and not isinstance(value, bool):
            flat[str(name)] = float(value)
    return flat


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", _SUFFIX.sub("", name.strip().lower().replace("pose", "")))


def _of(plain: Mapping[str, float], kind: str, axes: str) -> list[float] | None:
    for before in _BEFORE[kind]:
        if all(before + axis in plain for axis in axes):
            return [plain[before + axis] for axis in axes]
    return None


def _unit(data: Mapping[str, Any]) -> Unit | None:
    ends = [found[1] for name in _flat(data) if (found := _SUFFIX.search(name.lower()))]
    if "mm" in ends:
        return "mm"
    return "m" if "m" in ends else None


def _by_unit(
    data: Mapping[str, Any], rotations: tuple[RotationName, RotationName]
) -> tuple[RotationName, ...]:
    ends = [found[1] for name in _flat(data) if (found := _SUFFIX.search(name.lower()))]
    if "deg" in ends:
        return rotations[1:]
    return rotations[:1] if "rad" in ends else rotations
