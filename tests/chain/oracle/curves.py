"""Curves without a name, by other formulas: what each site shifts, what each covariate is."""

from __future__ import annotations

from collections.abc import Callable

import autograd.numpy as anp
import numpy as np

from tests.chain.oracle import formulas
from tests.chain.oracle.formulas import Array
from tests.chain.oracle.scene import Scene

AXES = tuple(range(6))


def _joint(index: int) -> Callable[[Array, Scene], None]:
    def shift(amount: Array, scene: Scene) -> None:
        scene.joints = scene.joints + amount[0] * np.eye(6)[index]

    return shift


def _flange(amount: Array, scene: Scene) -> None:
    scene.flange = anp.dot(scene.flange, formulas.rigid(amount))


def _base(amount: Array, scene: Scene) -> None:
    scene.flange = anp.dot(formulas.rigid(amount), scene.flange)


def _mounted(amount: Array, scene: Scene) -> None:
    scene.mounted = anp.dot(scene.mounted, formulas.rigid(amount))


def _fixed(amount: Array, scene: Scene) -> None:
    scene.fixed = anp.dot(scene.fixed, formulas.rigid(amount))


def _focal(amount: Array, scene: Scene) -> None:
    for name in ("alpha_px", "beta_px"):
        scene.optics[name] = scene.optics[name] + scene.optics[name] * amount[0]


def _principal(amount: Array, scene: Scene) -> None:
    scene.optics["u0_px"] = scene.optics["u0_px"] + amount[0]
    scene.optics["v0_px"] = scene.optics["v0_px"] + amount[1]


def _radial(amount: Array, scene: Scene) -> None:
    scene.optics["k1"] = scene.optics["k1"] + amount[0]


SITES: dict[str, Callable[[Array, Scene], None]] = {
    **{f"joint_{k + 1}": _joint(k) for k in AXES},
    "flange_pose": _flange,
    "base_pose": _base,
    "mounted_pose": _mounted,
    "fixed_pose": _fixed,
    "focal_length": _focal,
    "principal_point": _principal,
    "radial_distortion": _radial,
}


def _of_joint(column: str, index: int) -> Callable[[Scene], Array]:
    return lambda scene: getattr(scene.views, column)[scene.frame, index]


def _approach(index: int) -> Callable[[Scene], Array]:
    def side(scene: Scene) -> float:
        before = scene.views.approach_joints_rad[scene.frame, index]
        return 1.0 if scene.logged_joints[index] > before else -1.0

    return side


COVARIATES: dict[str, Callable[[Scene], Array]] = {
    "distance": lambda scene: scene.depth(scene.pose()),
    "tilt": lambda scene: anp.arccos(anp.abs(scene.pose()[2, 2])),
    "time": lambda scene: scene.logged("t_s"),
    "order": lambda scene: scene.logged("frame"),
    "gravity": lambda scene: scene.down_in(scene.camera),
    "temperature": lambda scene: scene.logged("temperature_c"),
    "focus_position": lambda scene: scene.logged("focus_position"),
    **{f"joint_{k + 1}": _of_joint("joints_rad", k) for k in AXES},
    **{f"velocity_{k + 1}": _of_joint("joint_velocity_rad_s", k) for k in AXES},
    **{f"approach_{k + 1}": _approach(k) for k in AXES},
}


def functions(covariate: str, value: Array, low: float, high: float, period: float) -> Array:
    """(B,) what a curve along that covariate is made of."""
    if period:
        turn = 2.0 * np.pi * value / period
        return anp.stack([anp.sin(turn), anp.cos(turn)])
    if covariate == "gravity":
        return value
    if covariate.startswith("approach"):
        return np.array([value])
    if covariate.startswith("joint") and high - low > np.pi:
        return anp.stack([f(k * value) for k in (1, 2, 3) for f in (anp.sin, anp.cos)])
    u = (2.0 * value - low - high) / (high - low)
    return anp.stack(
        [u, (3 * u**2 - 1) / 2, (5 * u**3 - 3 * u) / 2, (35 * u**4 - 30 * u**2 + 3) / 8]
    )


def shift(site: str, covariate: str, numbers: dict[str, Array], scene: Scene) -> None:
    """Let the site follow the covariate; `numbers` as in a file, coefficients `c{b}_...`."""
    low, high = float(numbers["low"]), float(numbers["high"])
    value = COVARIATES[covariate](scene)
    made_of = functions(covariate, value, low, high, float(numbers["period"]))
    if site in ("joint_2", "joint_3", "joint_4", "joint_5"):
        made_of = anp.concatenate([made_of, np.ones(1)])
    coefficients = [v for k, v in numbers.items() if k[0] == "c"]
    table = anp.reshape(anp.stack(coefficients), (len(made_of), -1))
    SITES[site](anp.dot(made_of, table), scene)
