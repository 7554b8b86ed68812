"""What a frame is known by: anything that something in the chain might follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from calib.chain import rigid
from calib.chain.state import DOWN_IN_BASE, ChainState
from calib.views import FloatArray, Views


@dataclass(frozen=True)
class Covariate:
    """Something a frame is known by.

    Attributes
    ----------
    name, unit:
        As shown to the reader.
    of:
        (N,) or (N, D) values from the state; NaN where not known.
    cyclic:
        An angle whose full turn comes back to itself.
    two_sided:
        It takes the values -1, 0 and 1 only: a side from which, or to which.
    """

    name: str
    unit: str
    of: Callable[[ChainState], FloatArray]
    cyclic: bool = False
    two_sided: bool = False


def _logged(column: str) -> Callable[[ChainState], FloatArray]:
    return lambda state: np.asarray(getattr(state.views, column))


def _logged_joint(column: str, index: int) -> Callable[[ChainState], FloatArray]:
    return lambda state: np.asarray(getattr(state.views, column)[:, index])


def _approach(index: int) -> Callable[[ChainState], FloatArray]:
    return lambda state: np.sign(
        state.views.joints_rad[:, index] - state.views.approach_joints_rad[:, index]
    )


def _nominal_distance(state: ChainState) -> FloatArray:
    if state.camera_from_board.size:
        return state.distance_m
    pose = rigid.inverse(state.base_from_camera) @ state.base_from_board
    return np.asarray(pose[:, 2, :3] @ state.points_m.mean(axis=0) + pose[:, 2, 3])


def _tilt(state: ChainState) -> FloatArray:
    pose = rigid.inverse(state.base_from_camera) @ state.base_from_board
    return np.asarray(np.arccos(np.clip(np.abs(pose[:, 2, 2]), 0.0, 1.0)))


def _gravity(state: ChainState) -> FloatArray:
    return state.gravity_in_camera()


def _gravity_along(axis: int) -> Callable[[ChainState], FloatArray]:
    return lambda state: np.asarray(state.base_from_camera[:, :3, axis] @ DOWN_IN_BASE)


def _torques_nm(state: ChainState) -> FloatArray:
    arm, views = state.arm, state.views
    if arm is None:
        return np.full((len(views), 6), np.nan)
    return state.once(
        "gravity_torques_nm",
        lambda: arm.gravity_torques(views.joints_rad, views.payload_kg or 0.0),
    )


def _moment(axis: int) -> Callable[[ChainState], FloatArray]:
    def of(state: ChainState) -> FloatArray:
        arm, views = state.arm, state.views
        if arm is None:
            return np.full(len(views), np.nan)
        load_kg = views.payload_kg or 0.0
        moment = state.once("base_moment_Nm", lambda: arm.base_moment(views.joints_rad, load_kg))
        return np.asarray(moment[:, axis])

    return of


def _load(index: int) -> Callable[[ChainState], FloatArray]:
    return lambda state: np.asarray(_torques_nm(state)[:, index])


def _load_side(index: int) -> Callable[[ChainState], FloatArray]:
    return lambda state: np.sign(_torques_nm(state)[:, index])


def _position(axis: int) -> Callable[[ChainState], FloatArray]:
    return lambda state: np.asarray(state.views.base_from_flange[:, axis, 3])


def _reach(state: ChainState) -> FloatArray:
    return np.asarray(np.linalg.norm(state.views.base_from_flange[:, :2, 3], axis=1))


COVARIATES: tuple[Covariate, ...] = (
    Covariate("distance", "m", _nominal_distance),
    Covariate("tilt", "rad", _tilt),
    Covariate("time", "s", _logged("t_s")),
    Covariate("order", "frame", lambda state: state.views.frame.astype(np.float64)),
    Covariate("gravity", "g", _gravity),
    Covariate("temperature", "degC", _logged("temperature_c")),
    Covariate("focus_position", "steps", _logged("focus_position")),
    *(Covariate(f"joint_{k + 1}", "rad", _logged_joint("joints_rad", k), True) for k in range(6)),
    *(
        Covariate(f"velocity_{k + 1}", "rad/s", _logged_joint("joint_velocity_rad_s", k))
        for k in range(6)
    ),
    *(Covariate(f"approach_{k + 1}", "sign", _approach(k), two_sided=True) for k in range(6)),
)
"""Those that a smooth curve is looked for along, at every site."""

DERIVED: tuple[Covariate, ...] = (
    Covariate("exposure", "s", _logged("exposure_s")),
    Covariate("focus_distance", "m", _logged("focus_distance_m")),
    Covariate("inverse_distance", "1/m", lambda state: 1.0 / _nominal_distance(state)),
    Covariate("blur", "px", _logged("blur_px")),
    *(Covariate(f"gravity_{axis}", "g", _gravity_along(k)) for k, axis in enumerate("xyz")),
    *(Covariate(f"load_{k + 1}", "Nm", _load(k)) for k in range(1, 5)),
    *(Covariate(f"base_moment_{axis}", "Nm", _moment(k)) for k, axis in enumerate("xy")),
    *(Covariate(f"load_side_{k + 1}", "sign", _load_side(k), two_sided=True) for k in range(1, 5)),
    *(Covariate(f"position_{axis}", "m", _position(k)) for k, axis in enumerate("xyz")),
    Covariate("reach", "m", _reach),
)
"""Those that only laws of few numbers are looked for along."""

CONSTANT = Covariate("constant", "1", lambda state: np.ones((len(state.views), 1)))
"""The same in every frame: one column for each number of a site."""

_UNITS = {
    "s": "s",
    "ms": "ms",
    "us": "us",
    "c": "degC",
    "db": "dB",
    "m": "m",
    "mm": "mm",
    "um": "um",
    "rad": "rad",
    "deg": "deg",
    "px": "px",
    "nm": "Nm",
    "n": "N",
    "kg": "kg",
    "a": "A",
    "v": "V",
    "hz": "Hz",
    "bar": "bar",
    "pct": "%",
}
"""Unit by the last word of a key: `gain_db`, `torque_2_nm`."""


def _unit_of(key: str) -> str:
    parts = [word for word in key.lower().split("_") if not word.isdigit()]
    return _UNITS.get(parts[-1], "1") if len(parts) > 1 else "1"


def _extra(key: str) -> Covariate:
    def of(state: ChainState) -> FloatArray:
        column = state.views.extra.get(key)
        return np.full(len(state.views), np.nan) if column is None else column

    return Covariate(key, _unit_of(key), of)


def _label(key: str, word: str) -> Covariate:
    def of(state: ChainState) -> FloatArray:
        column = state.views.labels.get(key)
        if column is None:
            return np.full(len(state.views), np.nan)
        return np.where(column == "", np.nan, (column == word).astype(np.float64))

    return Covariate(f"{key}={word}", "1", of)


_FEWEST_OF_A_LABEL = 2


def covariates_of(views: Views) -> tuple[Covariate, ...]:
    """Every covariate that these frames could have, those of their own log included.

    Of a word in the log (the name of a station) every value that some frames have and others do
    not is one, `KEY=WORD`: one for those frames, zero for the others.
    """
    labels = []
    for key, column in views.labels.items():
        parts, counts = np.unique(column[column != ""], return_counts=True)
        few = [str(w) for w, c in zip(parts, counts, strict=True) if c >= _FEWEST_OF_A_LABEL]
        labels += [_label(key, word) for word in few if len(parts) > 1]
    return (*COVARIATES, *DERIVED, *(_extra(key) for key in views.extra), *labels)


def covariate_named(name: str) -> Covariate:
    """Return the covariate of that name; one that is not known is a key of the log."""
    known = {covariate.name: covariate for covariate in (*COVARIATES, *DERIVED)}
    if name in known:
        return known[name]
    key, is_label, word = name.partition("=")
    return _label(key, word) if is_label else _extra(key)
