"""Rotation conventions and length units: each is tried, the one that closes the loop is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calib.chain import rigid
from calib.discovery.log_consistency.consistency import Closure, close_loop
from calib.discovery.log_consistency.mixup import Mixup
from calib.discovery.log_consistency.rotation_readings import readings
from calib.discovery.log_consistency.single_units import UNITS
from calib.views import FloatArray, Views

_BETTER = 0.2
"""Another convention must close the loop this much better than the logged one."""

_ANGLE_SUSPECT_RAD = 0.02
_UNIT_TOLERANCE = 0.05


def _with_rotation(pose: FloatArray, quaternion: FloatArray) -> FloatArray:
    out = pose.copy()
    known = np.isfinite(quaternion).all(axis=1)
    out[known, :3, :3] = Rotation.from_quat(quaternion[known]).as_matrix()
    return out


def _quaternion(pose: FloatArray) -> FloatArray:
    out = np.full((len(pose), 4), np.nan)
    known = np.isfinite(pose).all(axis=(1, 2))
    out[known] = Rotation.from_matrix(pose[known, :3, :3]).as_quat()
    return out


def _scalar_first(pose: FloatArray) -> FloatArray:
    return _with_rotation(pose, np.roll(_quaternion(pose), -1, axis=1))


def _scalar_last_read_first(pose: FloatArray) -> FloatArray:
    return _with_rotation(pose, np.roll(_quaternion(pose), 1, axis=1))


def _transposed(pose: FloatArray) -> FloatArray:
    out = pose.copy()
    out[:, :3, :3] = np.swapaxes(pose[:, :3, :3], 1, 2)
    return out


@dataclass(frozen=True)
class _Convention:
    description: str
    read: Callable[[FloatArray], FloatArray]
    inverts: bool = False


_AS_LOGGED = _Convention("base_from_flange, quaternion x y z w", lambda pose: pose)
_OTHERS = (
    _Convention("its quaternion stands as w x y z", _scalar_first),
    _Convention("its quaternion stands as y z w x", _scalar_last_read_first),
    _Convention("it is flange_from_base, the inverse", rigid.inverse, True),
    _Convention("its rotation is transposed", _transposed),
    _Convention("w x y z, and the inverse", lambda p: rigid.inverse(_scalar_first(p)), True),
    _Convention("w x y z, and transposed", lambda p: _transposed(_scalar_first(p))),
)


_OR_MOUNT = (
    "; or they are right, and the recording's `mount` is the wrong one of eye_in_hand and"
    " eye_to_hand: pictures and poses are the same for both, so they cannot decide"
)


@dataclass(frozen=True)
class ConventionsFound:
    """The mix-ups, and the loop with them mended."""

    mixups: tuple[Mixup, ...]
    closure: Closure | None


def find_conventions(views: Views, loop: FloatArray) -> ConventionsFound:
    """Find the rotation convention and length unit that close the loop.

    Parameters
    ----------
    views, loop:
        The log, and (N, 4, 4) mounted_from_fixed of the free poses.
    """
    logged = close_loop(loop, views.base_from_flange, free_length=True)
    if logged is None:
        return ConventionsFound((), None)
    chosen, closure = _AS_LOGGED, logged
    if logged.typical_angle_rad > _ANGLE_SUSPECT_RAD:
        angles = (_Convention(description, read) for description, read in readings())
        for convention in (*_OTHERS, *angles):
            read = convention.read(views.base_from_flange)
            tried = close_loop(loop, read, free_length=True)
            if tried is None or tried.length_factor <= 0.0:
                continue
            if tried.typical_angle_rad < _BETTER * min(
                closure.typical_angle_rad, logged.typical_angle_rad
            ) or (
                tried.typical_angle_rad < 1.2 * closure.typical_angle_rad
                and tried.typical_distance_m < _BETTER * closure.typical_distance_m
            ):
                chosen, closure = convention, tried
    mixups: list[Mixup] = []
    if chosen is not _AS_LOGGED:
        mixups.append(_rotation_mixup(chosen, logged, closure))
    unit = _unit_of(closure.length_factor)
    if unit is not None:
        mixups.append(_unit_mixup(unit, closure))
    return ConventionsFound(tuple(mixups), closure)


def _unit_of(factor: float) -> str | None:
    for name, size in UNITS.items():
        if abs(factor / size - 1.0) < _UNIT_TOLERANCE:
            return name
    for name, size in UNITS.items():
        if abs(factor * size - 1.0) < _UNIT_TOLERANCE:
            return f"1/{name}"
    return None


def _rotation_mixup(convention: _Convention, before: Closure, after: Closure) -> Mixup:
    def mend(views: Views, neighbours: Views) -> Views:
        return replace(views, base_from_flange=convention.read(views.base_from_flange))

    inverts = convention.inverts
    return Mixup(
        name="rotation_convention",
        physics=(
            f"The log's poses are not what they should be: {convention.description}"
            f"{_OR_MOUNT if inverts else ''}."
        ),
        remedy=(
            "Correct whichever of the two is wrong: `mount` in recording.yaml, or the program that"
            " writes the log."
            if inverts
            else "Correct the program that writes the log; the twin reads it as it should be."
        ),
        mend=mend,
        evidence=(_miss(before), _miss(after)),
        alike=("mount",) if inverts else (),
        apart=(
            "Look at the cell: whether the camera or the board rides on the flange, as the"
            " recording's key `mount` says."
            if inverts
            else ""
        ),
    )


def _unit_mixup(unit: str, closure: Closure) -> Mixup:
    name = unit.removeprefix("1/")
    size = UNITS[name] if unit == name else 1.0 / UNITS[name]

    def mend(views: Views, neighbours: Views) -> Views:
        pose = views.base_from_flange.copy()
        pose[:, :3, 3] *= size
        return replace(views, base_from_flange=pose)

    description = f"in {name}s" if unit == name else f"{1.0 / UNITS[name]:g} times too small"
    return Mixup(
        name="length_unit",
        physics=f"The log says metres, but its positions are {description}.",
        remedy="Correct the unit in the program that writes the log.",
        mend=mend,
        parameters={"metres_per_unit": (size, "m")},
        evidence=(_miss(closure), _miss(closure)),
    )


def _miss(closure: Closure) -> tuple[float, float]:
    return (closure.typical_angle_rad, closure.typical_distance_m)
