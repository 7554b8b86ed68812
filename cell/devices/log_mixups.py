"""Mix-ups in the log that a simulated recording can be given: wrong pairs, units, conventions, arm.

They change what is written, not what happened, so they are no part of the chain's physics. Names
are those a diagnosis gives them, and a parameter means what it means there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.chain import rigid
from calib.chain.kinematics import UnknownArm, arm
from calib.discovery.log_consistency.mixup import ROBOT_COLUMNS
from calib.views import FloatArray, Views
from cell.errors import InputError
from cell.storage.files.cell_file import EffectFile


def mix_up(views: Views, effect: EffectFile, rng: np.random.Generator) -> Views:
    """The views with one mix-up in their log; raises `InputError` where it is not understood."""
    return MIXUPS[effect.name](views, effect, rng)


def _offset(views: Views, effect: EffectFile, rng: np.random.Generator) -> Views:
    """Every frame carries the pose of the frame so many before it."""
    rows = np.arange(len(views)) - int(_number(effect, "frames", 1.0))
    return _paired(views, np.clip(rows, 0, len(views) - 1))


def _swap(views: Views, effect: EffectFile, rng: np.random.Generator) -> Views:
    """So many frames, picked by the seed, carry each other's poses, two by two."""
    count = int(_number(effect, "frames", 2.0))
    if count % 2 or not 2 <= count <= len(views):
        raise InputError(f"{effect.name}: frames must be even, 2 to {len(views)}; got {count}")
    picked = rng.permutation(len(views))[:count].reshape(-1, 2)
    rows = np.arange(len(views))
    rows[picked] = picked[:, ::-1]
    return _paired(views, rows)


def _paired(views: Views, rows: NDArray[np.int64]) -> Views:
    return replace(views, **{name: getattr(views, name)[rows] for name in ROBOT_COLUMNS})


def _unit(views: Views, effect: EffectFile, rng: np.random.Generator) -> Views:
    """Positions are logged in another unit than metres."""
    poses = views.base_from_flange.copy()
    poses[:, :3, 3] /= _number(effect, "metres_per_unit", 1e-3)
    return replace(views, base_from_flange=poses)


def _scalar_first(poses: FloatArray) -> FloatArray:
    """Poses whose quaternion w x y z is read as if it were x y z w."""
    out = poses.copy()
    quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat(scalar_first=True)
    out[:, :3, :3] = Rotation.from_quat(quaternion).as_matrix()
    return out


def _transposed(poses: FloatArray) -> FloatArray:
    out = poses.copy()
    out[:, :3, :3] = np.swapaxes(poses[:, :3, :3], 1, 2)
    return out


_CONVENTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "scalar_first": _scalar_first,
    "inverse": rigid.inverse,
    "transposed": _transposed,
}


def _convention(views: Views, effect: EffectFile, rng: np.random.Generator) -> Views:
    """Rotations, or whole poses, are logged in another convention."""
    write = _CONVENTIONS.get(effect.law or "")
    if write is None:
        raise InputError(f"{effect.name}: needs law={'|'.join(_CONVENTIONS)}; got {effect.law}")
    return replace(views, base_from_flange=write(views.base_from_flange))


def _model(views: Views, effect: EffectFile, rng: np.random.Generator) -> Views:
    """The controller computes poses with the kinematics of another arm."""
    try:
        wrong = arm(effect.law or "")
    except UnknownArm as unknown:
        raise InputError(f"{effect.name}: needs law=MODEL: {unknown}") from None
    poses = wrong.forward(views.joints_rad)
    return replace(views, base_from_flange=poses, robot_model=wrong.name)


MIXUPS: dict[str, Callable[[Views, EffectFile, np.random.Generator], Views]] = {
    "frame_pose_offset": _offset,
    "frame_pose_swap": _swap,
    "length_unit": _unit,
    "rotation_convention": _convention,
    "robot_model": _model,
}


def _number(effect: EffectFile, name: str, default: float) -> float:
    unknown = sorted(set(effect.parameters) - {name})
    if unknown:
        raise InputError(f"{effect.name} has no parameter {unknown[0]!r}; it has {name}")
    value = effect.parameters.get(name, default)
    if not isinstance(value, float) or value == 0:
        raise InputError(f"{effect.name}: {name} is one number other than 0; got {value}")
    return value
