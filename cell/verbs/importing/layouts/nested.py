"""Mappings and lists, as JSON, YAML and NumPy archives hold them: poses at any depth."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.verbs.importing.named import named_pose, together
from cell.verbs.importing.raw import WIDTHS, RawPose, Series
from cell.verbs.importing.roles import role_of
from cell.verbs.importing.rotations import is_rotation
from cell.verbs.importing.times import time_in

_NUMBERED = ("seq", "frame", "index", "idx", "id", "num", "number", "nr", "no", "i", "n", "sample")
_NAMED = ("image", "file", "filename", "name", "image_path", "img", "picture", "frame_id", "path")
_POSE_SHAPES = ((3, 4), (4, 4), (1, 6), (6, 1), (1, 7), (7, 1))
_PART = re.compile(
    r"^(?:R|t|rot\w*?|trans\w*?|r_?vecs?|t_?vecs?|q|quat\w*?|p|pos\w*?|orient\w*?)(?=_|2|$)", re.I
)
"""How the names of one half of a pose begin: R_gripper2base and t_gripper2base go together."""


def series_in(path: Path, data: Any, layout: str) -> list[Series]:
    """Whatever looks like poses or joint angles anywhere in the data, by where it stands."""
    found: dict[str, list[RawPose]] = {}
    for key, pose in _found_in(path, data, "", None, None, None):
        found.setdefault(re.sub(r"\d+", "#", key), []).append(pose)
    names = _joint_names(data)
    return [
        Series(layout, key, role_of(key), tuple(poses), joint_names=names)
        for key, poses in found.items()
    ]


def _found_in(
    path: Path, data: Any, key: str, number: int | None, name: str | None, time_s: float | None
) -> Iterator[tuple[str, RawPose]]:
    where = f"{path}: {key or 'top level'}"
    values = _one_pose(data)
    if values is not None:
        yield key, RawPose(where, number, values, name=name, time_s=time_s)
    elif isinstance(data, Mapping):
        data = together(data)
        number, name = _number_of(data, number), _name_of(data, name)
        time_s = time_in(data, time_s)
        yield from _mapping(path, data, key, number, name, time_s)
    elif isinstance(data, list):
        for place, item in enumerate(data):
            inner = None if key else number
            yield from _found_in(path, item, f"{key}[{place}]", inner, name, time_s)


def _mapping(
    path: Path,
    data: Mapping[str, Any],
    key: str,
    number: int | None,
    name: str | None,
    time_s: float | None,
) -> Iterator[tuple[str, RawPose]]:
    where = f"{path}: {key or 'top level'}"
    rest = dict(data)
    named = named_pose(data)
    if named is not None:
        pose = RawPose(where, number, named.values, named.rotations, named.unit, name, time_s)
        yield key, pose
        rest = {k: v for k, v in data.items() if _one_pose(v) is not None}
    for what, halves, values in _pairs(data):
        at = f"{key}.{what}".strip(".")
        if values.ndim == 1:
            yield at, RawPose(where, number, values, name=name, time_s=time_s)
        for place, row in enumerate(values if values.ndim == 2 else ()):
            yield at, RawPose(f"{where}[{place}]", None, row)
        for half in halves:
            rest.pop(half, None)
    for inner, item in rest.items():
        reported = _last_number(inner)
        at = f"{key}.{inner}".strip(".")
        own = inner if reported is not None else name
        yield from _found_in(path, item, at, number if reported is None else reported, own, time_s)


def _last_number(name: str) -> int | None:
    found = re.findall(r"\d+", Path(str(name)).stem)
    return int(found[-1]) if found else None


def _number_of(data: Mapping[str, Any], number: int | None) -> int | None:
    """Which image a mapping says it belongs to, by number."""
    lower = {str(key).strip().lower().split(".")[-1]: value for key, value in data.items()}
    header = data.get("header")
    if isinstance(header, Mapping):
        lower = {str(k).lower(): v for k, v in header.items()} | lower
    for key in _NUMBERED:
        value = lower.get(key)
        if isinstance(value, bool):
            continue
        if isinstance(value, int) or (isinstance(value, float) and value.is_integer()):
            return int(value)
    return number


def _name_of(data: Mapping[str, Any], name: str | None) -> str | None:
    """Which image a mapping says it belongs to, by name."""
    lower = {str(key).strip().lower(): value for key, value in data.items()}
    for key in _NAMED:
        value = lower.get(key)
        if isinstance(value, str) and re.search(r"\d", value):
            return Path(value.replace("\\", "/")).name
    return name


def _pairs(data: Mapping[str, Any]) -> Iterator[tuple[str, tuple[str, str], FloatArray]]:
    """Positions and rotations that stand under two names: of what, the names, (W,) or (N, W)."""
    arrays = {name: array for name, value in data.items() if (array := _array(value)) is not None}
    groups: dict[str, list[str]] = {}
    for name in arrays:
        groups.setdefault(_PART.sub("", name), []).append(name)
    if not any(len(names) == 2 for names in groups.values()):
        groups = {"": list(arrays)}
    for what, names in groups.items():
        halves = [name for name in names if _half(arrays[name]) is not None]
        if len(halves) == 2:
            joined = _joined(arrays[halves[0]], arrays[halves[1]])
            if joined is not None:
                yield what.strip("_"), (halves[0], halves[1]), joined


def _half(array: FloatArray) -> FloatArray | None:
    """(3,), (4,), (3, 3) or that for N poses; None for what is no half of a pose."""
    if array.shape in ((3, 1), (1, 3), (4, 1), (1, 4)):
        return array.ravel()
    if array.shape in ((3,), (4,), (3, 3)):
        return array
    if array.shape == (9,):
        return array.reshape(3, 3)
    if array.ndim == 3 and array.shape[1:] in ((3, 1), (1, 3)):
        return array.reshape(len(array), 3)
    if array.ndim == 3 and array.shape[1:] == (3, 3):
        return array
    if array.ndim == 2 and array.shape[1] in (3, 4) and len(array) > 2:
        return array
    return None


def _joined(first: FloatArray, second: FloatArray) -> FloatArray | None:
    one, other = _half(first), _half(second)
    assert one is not None
    assert other is not None
    if _is_place(one) and _is_turn(other):
        place, turn = one, other
    elif _is_place(other) and _is_turn(one):
        place, turn = other, one
    else:
        return None
    if place.ndim == 1 and turn.shape == (3, 3):
        return np.hstack([turn, place[:, None]]).ravel()
    if turn.ndim == 3:
        return np.concatenate([turn, place[:, :, None]], axis=2).reshape(len(place), 12)
    return np.concatenate([place, turn], axis=-1)


def _is_place(half: FloatArray) -> bool:
    return half.shape[-1] == 3 and not _is_matrices(half)


def _is_matrices(half: FloatArray) -> bool:
    """Whether it is one rotation matrix or several."""
    matrices = half.reshape(-1, 3, 3) if half.shape[-2:] == (3, 3) else np.empty((0, 3, 3))
    return len(matrices) > 0 and all(is_rotation(m) for m in matrices)


def _is_turn(half: FloatArray) -> bool:
    return _is_matrices(half) or half.shape[-1] in (3, 4)


def _one_pose(data: Any) -> FloatArray | None:
    array = _array(data)
    if array is None:
        return None
    if array.ndim == 1 and len(array) in WIDTHS:
        return array
    return array.ravel() if array.shape in _POSE_SHAPES else None


def _array(data: Any) -> FloatArray | None:
    if not isinstance(data, list) or not data:
        return None
    try:
        array = np.asarray(data, dtype=float)
    except (TypeError, ValueError):
        return None
    return array if np.isfinite(array).all() else None


def _joint_names(data: Any) -> tuple[str, ...]:
    if isinstance(data, Mapping):
        for key in ("joint_names", "name", "names"):
            names = data.get(key)
            if (
                isinstance(names, list)
                and len(names) == 6
                and all(isinstance(n, str) for n in names)
            ):
                return tuple(names)
    if isinstance(data, list) and data:
        return _joint_names(data[0])
    return ()
