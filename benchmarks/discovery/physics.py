"""Physics to conceal: what the catalogue knows, and what no catalogue has.

Each is a function of a state and a size; size one is typical. Written from the sources of the
field and for this benchmark alone: the diagnosis shares no line with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.discovery.world import Array, State, base_moment, rigid, sag_torques

Act = Callable[[State, float], None]


@dataclass(frozen=True)
class Physics:
    """One thing to conceal.

    `names` are right in `effects` (empty: nobody's catalogue), `links` and `covariates` where it
    may be said to live, `forms` which shapes of a law are right.
    """

    key: str
    act: Act
    names: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    covariates: tuple[str, ...] = ()
    forms: tuple[str, ...] = ()


def _late(s: State, share: float = 0.5) -> Array:
    frame = s.log["frame"]
    return np.asarray(frame >= share * (s.log["frames"][0] - 1), dtype=float)


def _inverse_square(s: State, k: float) -> None:
    s.alpha = s.alpha - k * 0.003 * s.alpha * 0.16 / s.distance() ** 2


def _thin_lens(s: State, k: float) -> None:
    s.alpha = s.alpha / (1.0 - k * 0.004 / s.distance())


def _zero(s: State, k: float) -> None:
    s.dh[2, 0] += k * 1.2e-3


def _compliance(s: State, k: float) -> None:
    torque = sag_torques(s.arm, s.joints)
    s.joints[:, 1:3] += k * 2.5e-5 * torque[:, 1:3]


def _once_per_turn(s: State, k: float) -> None:
    s.joints[:, 3] += k * 1.2e-3 * np.sin(s.joints[:, 3] + 0.7)


def _warp(s: State, k: float) -> None:
    half = s.points[..., :2].max(axis=1, keepdims=True) / 2
    x = s.points[..., 0] / half[..., 0] - 1
    s.points[..., 2] += k * 6e-4 * (x * x - 1)


def _scale(s: State, k: float) -> None:
    s.points = s.points * np.array([1.0, 1.0 + 1.2e-3 * k, 1.0])


def _flex(s: State, k: float) -> None:
    flange = s.flange()
    down = -flange[:, 2, :3]
    turn = np.cross(np.array([0, 0, 1.2e-3 * k]), down)
    s.mounted = rigid(np.concatenate([0 * turn, turn], axis=1)) @ s.mounted


def _board_slip(s: State, k: float) -> None:
    step = k * np.array([1.5e-3, -1e-3, 5e-4, 1e-3, 0, -2e-3])
    s.fixed = s.fixed @ rigid(_late(s)[:, None] * step)


def _mount_slip(s: State, k: float) -> None:
    step = k * np.array([1e-3, 5e-4, -1e-3, 2e-3, -1e-3, 0])
    s.mounted = s.mounted @ rigid(_late(s)[:, None] * step)


def _bump(s: State, k: float) -> None:
    late = _late(s)
    s.alpha = s.alpha * (1 - 0.003 * k * late)
    s.centre = s.centre + late[:, None] * np.array([-2.0, 3.5]) * k


def _base_tilt(s: State, k: float) -> None:
    s.base[:, 3:] += k * 1.0e-5 * base_moment(s.arm, s.joints)


def _bloom(s: State, k: float) -> None:
    _marks_grow(s, k * 90.0 * s.log["exposure_s"])


def _bloom_with_gain(s: State, k: float) -> None:
    _marks_grow(s, k * 0.08 * s.log["gain_db"])


def _marks_grow(s: State, px: Array) -> None:
    def grow(pixels: Array) -> Array:
        middle = pixels.mean(axis=1, keepdims=True)
        out = pixels - middle
        far = np.linalg.norm(out, axis=2).max(axis=1)
        return np.asarray(middle + out * (1 + px / far)[:, None, None])

    s.picture.append(grow)


def _picture_drifts(s: State, k: float) -> None:
    warm = 1.0 - np.exp(-s.log["t_s"] / 200.0)
    s.centre = s.centre + k * warm[:, None] * np.array([-1.1, 0.7])


def _slack(s: State, k: float) -> None:
    down = -s.flange()[:, 2, :3]
    side = np.sign(0.8 * down[:, 0] - 0.6 * down[:, 1])
    stop = k * np.array([0.0, 1e-4, 0.0, 4e-4, 6e-4, 0.0])
    s.mounted = s.mounted @ rigid(side[:, None] * stop)


def _sag(s: State, k: float) -> None:
    s.centre = s.centre + 3.0 * k * s.gravity()[..., :2]


def _decentred(s: State, k: float) -> None:
    s.p = s.p + k * np.array([1.2e-3, -8e-4])


_ARM, _MOUNT, _LENS, _BOARD = ("arm",), ("mount", "arm"), ("lens", "sensor"), ("board", "arm")

CATALOGUE = (
    Physics("focus inverse square", _inverse_square, ("focus_breathing",), _LENS),
    Physics("focus thin lens", _thin_lens, ("focus_breathing",), _LENS),
    Physics("joint zero", _zero, ("joint_zero_offset", "link_geometry"), _ARM),
    Physics("joint compliance", _compliance, ("joint_compliance",), _ARM),
    Physics("once per turn", _once_per_turn, ("joint_periodic_error",), _ARM),
    Physics("board bend", _warp, ("board_warp",), ("board",)),
    Physics("board aspect", _scale, ("board_shear", "board_scale"), ("board", *_LENS)),
    Physics("bracket bends", _flex, ("mount_flex",), _MOUNT),
    Physics("board slips", _board_slip, ("board_slip",), _BOARD),
    Physics("mount slips", _mount_slip, ("mount_slip",), _MOUNT),
    Physics("focus ring bumped", _bump, ("optics_step",), _LENS),
    Physics("base tilts", _base_tilt, ("base_compliance",), _BOARD),
    Physics("bloom", _bloom, ("exposure_bias",), (*_LENS, "detector")),
    Physics("lens sags", _sag, ("lens_sag",), _LENS),
    Physics("decentred", _decentred, ("decentering", "sensor_tilt"), _LENS),
    Physics("bloom with gain", _bloom_with_gain, ("exposure_bias",), (*_LENS, "detector")),
    Physics("picture drifts", _picture_drifts, ("thermal_image_drift",), _LENS),
    Physics("bracket has play", _slack, ("mount_play",), _MOUNT),
)


def _joint(j: int, of: Callable[[State], Array]) -> Act:
    def act(s: State, k: float) -> None:
        s.joints[:, j] += k * of(s)

    return act


def _tool(component: int, of: Callable[[State], Array]) -> Act:
    def act(s: State, k: float) -> None:
        by = np.zeros((len(s.joints), 6))
        by[:, component] = k * of(s)
        s.mounted = s.mounted @ rigid(by)

    return act


def _board(component: int, of: Callable[[State], Array]) -> Act:
    def act(s: State, k: float) -> None:
        by = np.zeros((len(s.joints), 6))
        by[:, component] = k * of(s)
        s.fixed = s.fixed @ rigid(by)

    return act


def _focal(of: Callable[[State], Array]) -> Act:
    def act(s: State, k: float) -> None:
        s.alpha = s.alpha * (1 + k * of(s))

    return act


def _centre(axis: int, of: Callable[[State], Array]) -> Act:
    def act(s: State, k: float) -> None:
        s.centre = s.centre + k * of(s)[:, None] * np.eye(2)[axis]

    return act


def _dent(s: State, k: float) -> None:
    at, wide = 0.62 * 2 * s.centre, 0.14 * s.centre[:, 0]

    def bend(pixels: Array) -> Array:
        away = pixels - at[:, None]
        near = np.exp(-0.5 * (away**2).sum(-1) / wide[:, None] ** 2)
        return np.asarray(pixels + 0.0012 * k * s.centre[:, :1, None] * near[..., None] * [0.6, 1])

    s.picture.append(bend)


def _board_dent(s: State, k: float) -> None:
    size = s.points[..., :2].max(axis=1, keepdims=True)
    away = s.points[..., :2] / size - [0.3, 0.6]
    s.points[..., 2] += k * 9e-4 * np.exp(-0.5 * (away**2).sum(-1) / 0.15**2)


def _q(j: int) -> Callable[[State], Array]:
    return lambda s: s.log["joints"][:, j]


def _logged(name: str) -> Callable[[State], Array]:
    return lambda s: s.log[name]


def _reach_m(s: State) -> Array:
    flange = s.flange()
    return np.asarray(np.linalg.norm(flange[..., :2, 3], axis=-1))


_TIME = ("time", "order")

OUTSIDE = (
    Physics("kink of joint 3", _joint(2, lambda s: 2e-3 * np.maximum(_q(2)(s) - 1.9, 0)),
            (), _ARM, ("joint_3",), ("saturating", "curve", "step")),
    Physics("cable drags joint 5 with joint 6", _joint(4, lambda s: 1.2e-3 * np.sin(_q(5)(s))),
            (), _ARM, ("joint_6",), ("periodic", "linear", "curve")),
    Physics("bracket rocks thrice a turn of joint 6",
            _tool(4, lambda s: 1e-3 * np.sin(3 * _q(5)(s))),
            (), _MOUNT, ("joint_6",), ("periodic",)),
    Physics("dent in the image", _dent, (), _LENS, ("image",), ("field",)),
    Physics("dent in the board", _board_dent, ("board_warp",), ("board",), ("board",), ("field",)),
    Physics("base sways", _board(0, lambda s: 8e-4 * np.sin(2 * np.pi * s.log["t_s"] / 260)),
            (), _BOARD, _TIME, ("periodic",)),
    Physics("focus ripples", _focal(lambda s: 1.2e-3 * np.sin(12 / s.distance())),
            ("focus_breathing",), _LENS, ("distance",), ("periodic", "curve")),
    Physics("focal length follows temperature",
            _focal(lambda s: 2e-4 * (s.log["temperature_c"] - 25)), ("thermal_focal_drift",), _LENS,
            ("temperature", *_TIME), ("linear",)),
    Physics("principal point follows gain", _centre(0, lambda s: 0.4 * s.log["gain_db"]),
            (), _LENS, ("gain_db",), ("linear",)),
    Physics("joint 2 saturates", _joint(1, lambda s: 1e-3 * np.tanh(3 * (_q(1)(s) + 1.7))),
            (), _ARM, ("joint_2",), ("saturating", "linear", "curve")),
    Physics("joint 4 by two joints",
            _joint(3, lambda s: 3e-3 * (_q(1)(s) + 1.7) * (_q(2)(s) - 1.9)),
            (), _ARM, ("joint_2", "joint_3"), ("product",)),
    Physics("focal length follows exposure", _focal(lambda s: 0.12 * s.log["exposure_s"]),
            ("exposure_bias",), (*_LENS, "detector"), ("exposure", "exposure_s"), ("linear",)),
    Physics("bracket has slack", _tool(3, lambda s: 8e-4 * np.sign(s.gravity()[:, 0])),
            ("mount_play",), _MOUNT, ("gravity",), ("play", "step", "saturating")),
    Physics("joint 3 creeps after a stop",
            _joint(2, lambda s: 1.2e-3 * np.exp(-s.log["dwell_s"] / 4.0)), (), _ARM, ("dwell_s",),
            ("relaxation", "curve", "linear")),
    Physics("wrist sags with reach squared", _tool(1, lambda s: 6e-3 * (_reach_m(s) ** 2 - 0.2)),
            (), _MOUNT, ("joint_2", "joint_3", "reach", "distance"), ("quadratic", "linear")),
    Physics("bracket grows with temperature",
            _tool(2, lambda s: 1.5e-4 * (s.log["temperature_c"] - 25)), ("thermal_mount_drift",),
            _MOUNT, ("temperature", *_TIME), ("linear",)),
    Physics("board creeps with time", _board(1, lambda s: 1.5e-6 * s.log["t_s"]),
            ("base_drift",), _BOARD, _TIME, ("linear", "relaxation")),
    Physics("joint 6 seven times a turn", _joint(5, lambda s: 2e-3 * np.sin(7 * _q(5)(s))),
            ("joint_periodic_error",), _ARM, ("joint_6",), ("periodic",)),
    Physics("base turns with joint 1 squared", _board(5, lambda s: 8e-4 * (_q(0)(s) - 0.3) ** 2),
            (), _BOARD, ("joint_1",), ("quadratic",)),
    Physics("a station's clamp", _board(2, lambda s: 1e-3 * (s.log["clamp_N"] > 40)),
            (), _BOARD, ("clamp_N",), ("step", "linear", "saturating")),
    Physics("focus by its last step", _focal(lambda s: 8e-4 * np.sign(s.log["focus_step"])),
            ("focus_hysteresis",), _LENS, ("focus_step", "focus_step_m", "distance"),
            ("play", "step")),
)  # fmt: skip


def present(key: str) -> Physics:
    """The physics of that key."""
    return {p.key: p for p in (*CATALOGUE, *OUTSIDE)}[key]
