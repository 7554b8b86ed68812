"""Poses whose numbers have names: columns of a table, keys of JSON or YAML."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
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
_SUFFIX = re.compile(r"(?:_|\[|\(|\s)(mm|cm|in|m|deg|rad)[\])]?$")
"""A unit at the end of a name, set apart: `x_mm`, `x [mm]`; the m of `num` is none."""

_AROUND = re.compile(r"pose|\bfield\b|\bmsg\b|\bdata\b|\btransform\b")
"""Words that tools put around every name, as `rostopic echo -p` does."""


@dataclass(frozen=True)
class NamedPose:
    """Position, then rotation, in the order of a convention.

    Attributes
    ----------
    values:
        6, 7, 12 or 16 numbers.
    rotations:
        What the names allow; empty where they do not say.
    unit:
        Of the position, where a name states.
    """

    values: FloatArray
    rotations: tuple[RotationName, ...]
    unit: Unit | None


def named_pose(data: Mapping[str, Any]) -> NamedPose | None:
    """The pose that these named numbers are, or None; other names may stand among them."""
    flat = _flat(data)
    plain = {_plain(name): value for name, value in flat.items()}
    matrix = _matrix(plain)
    if matrix is not None:
        return NamedPose(matrix, ("matrix",), None)
    position = _of(plain, "position", "xyz")
    if position is None:
        return None
    unit = _unit(flat)
    quaternion = _of(plain, "quaternion", "xyzw")
    if quaternion is not None:
        return NamedPose(np.array(position + quaternion), ("quat_xyzw",), unit)
    turn = _of(plain, "rotvec", "xyz")
    if turn is not None:
        return NamedPose(np.array(position + turn), ("rotvec", "rotvec_deg"), unit)
    for names, rotations in _ANGLES:
        if all(name in plain for name in names):
            turn = [plain[name] for name in names]
            return NamedPose(np.array(position + turn), _by_unit(flat, rotations), unit)
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
    name_only = re.sub(r"[._/]+", " ", _SUFFIX.sub("", name.strip().lower()))
    return re.sub(r"[^a-z0-9]", "", _AROUND.sub("", name_only))


def _of(plain: Mapping[str, float], kind: str, axes: str) -> list[float] | None:
    for before in _BEFORE[kind]:
        if all(before + axis in plain for axis in axes):
            return [plain[before + axis] for axis in axes]
    return None


def _matrix(plain: Mapping[str, float]) -> FloatArray | None:
    """(12,) where the names are elements of a matrix: t00..t23, m11..m34, r11..r33 with x, y, z."""
    for letter in ("t", "m", "h", ""):
        for first in (0, 1):
            names = [f"{letter}{i + first}{j + first}" for i in range(3) for j in range(4)]
            if all(name in plain for name in names):
                return np.array([plain[name] for name in names])
    position = _of(plain, "position", "xyz")
    for first in (0, 1):
        names = [f"r{i + first}{j + first}" for i in range(3) for j in range(3)]
        if position is not None and all(name in plain for name in names):
            turn = np.array([plain[name] for name in names]).reshape(3, 3)
            return np.hstack([turn, np.array(position)[:, None]]).ravel()
    return None


def _ends(names: Sequence[str]) -> list[str]:
    return [found[1] for name in names if (found := _SUFFIX.search(name.lower()))]


def _unit(flat: Mapping[str, float]) -> Unit | None:
    """The unit at the ends of the position's names."""
    ends = _ends([name for name in flat if _plain(name)[-1:] in ("x", "y", "z")])
    units: tuple[Unit, ...] = ("mm", "cm", "in", "m")
    return next((unit for unit in units if unit in ends), None)


def _by_unit(
    flat: Mapping[str, float], rotations: tuple[RotationName, RotationName]
) -> tuple[RotationName, ...]:
    ends = _ends(list(flat))
    if "deg" in ends:
        return rotations[1:]
    return rotations[:1] if "rad" in ends else rotations


def together(data: Mapping[str, Any]) -> dict[str, Any]:
    """The mapping with numbered names gathered: q_0..q_5, joint1..joint6, pose[0]..pose[5]."""
    groups: dict[str, list[tuple[int, str]]] = {}
    for name, index, stem in _numbered(data):
        groups.setdefault(stem, []).append((index, name))
    gathered = dict(data)
    for stem, members in groups.items():
        places = sorted(members)
        if len(places) >= 6 and [p for p, _ in places] == list(
            range(places[0][0], places[0][0] + len(places))
        ):
            gathered |= {stem: [data[name] for _, name in places]}
            for _, name in places:
                del gathered[name]
    return gathered


def _numbered(data: Mapping[str, Any]) -> Iterator[tuple[str, int, str]]:
    for name, value in data.items():
        found = re.fullmatch(r"(.*?)[_\[. ]?(\d)\]?(?:_(?:rad|deg))?", str(name).strip())
        if found and isinstance(value, int | float):
            yield name, int(found[2]), found[1] or "column"
