"""Which quantities the views at hand cannot separate, and which views would.

The information matrix of all views, scaled so that each number known by itself counts one, has a
small eigenvalue for every combination that the views hardly see (Rao 1973, section 4a; collinearity
diagnostics as in Belsley, Kuh, Welsch 1980). A lens that refocuses is always taken into account:
whether the focal length moves is the question that views of one distance leave open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.calibration.simulated_views import views_that_see
from calib.chain.effects import make_effect
from calib.chain.rigid import compose
from calib.solver.joint import JointFit
from calib.solver.pose_information import pose_information
from calib.solver.unknowns import Unknown
from calib.views import FloatArray, Views

WEAK = 2e-3
"""Eigenvalue: together known 22 times worse than each would be alone."""

TAKES_PART = 0.3
"""Share of a combination (its unit vector) from which a quantity is named."""

_HELPS = 1.5
_TILT_RAD = np.radians(30.0)


@dataclass(frozen=True)
class Weakness:
    """A combination of quantities that the views hardly see.

    Attributes
    ----------
    quantities:
        Names, the strongest first.
    inflation:
        How many times worse the combination is known than its members would be, each alone.
    views:
        What to record besides, as text.
    gain:
        By what factor those views would lower its uncertainty.
    """

    quantities: tuple[str, ...]
    inflation: float
    views: str
    gain: float


def find_weaknesses(joint: JointFit, views: Views) -> tuple[Weakness, ...]:
    """Weak combinations, the worst first.

    Parameters
    ----------
    joint, views:
        The fit, and the views that took part in it.
    """
    total, names = _information(joint, views)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(total), 1e-300))
    both = scale[:, None] * scale[None, :]
    eigenvalue, vector = np.linalg.eigh(total * both)
    weak = np.flatnonzero(eigenvalue < WEAK)
    if not len(weak):
        return ()
    kinds = _more_views(joint, views)
    added = {remedy: _information(joint, more)[0] * both for remedy, more in kinds}
    found = []
    for k in weak:
        u = vector[:, k]
        order = np.argsort(-np.abs(u))
        members = tuple(names[i] for i in order if abs(u[i]) > TAKES_PART)
        remedy, gain = _best(added, total * both, u)
        found.append(Weakness(members, float(max(eigenvalue[k], 1e-16) ** -0.5), remedy, gain))
    return tuple(found)


def _information(joint: JointFit, views: Views) -> tuple[FloatArray, tuple[str, ...]]:
    """(p, p) with alpha as the focal length (beta goes along) and beta as the aspect ratio."""
    moves = any(e.effect.name == "focus_breathing" for e in joint.model.effects)
    asked = () if moves else (make_effect("focus_breathing", {"law": "thin_lens"}),)
    each = pose_information(joint.model, views, asked, joint.noise)
    names = [u.name for u in each.unknowns]
    alpha, beta = names.index("alpha_px"), names.index("beta_px")
    together = np.eye(len(names))
    together[beta, alpha] = joint.model.optics[1] / joint.model.optics[0]
    return together.T @ each.total @ together, tuple(_named(u, views) for u in each.unknowns)


def _named(unknown: Unknown, views: Views) -> str:
    mounted, fixed = "camera", "board"
    if views.mount == "eye_to_hand":
        mounted, fixed = fixed, mounted
    frames = {
        "flange_from_mounted": f"flange_from_{mounted}",
        "base_from_fixed": f"base_from_{fixed}",
    }
    frame, _, axis = unknown.name.partition(".")
    plain = {"alpha_px": "focal length", "beta_px": "aspect ratio"}
    if frame.startswith("focus_breathing"):
        return "focal length's change with distance"
    return f"{frames[frame]}.{axis}" if frame in frames else plain.get(frame, frame)


_ROUNDING = 1e-14
"""Where nothing at all is known of a number, rounding may leave its variance below zero."""


def _best(added: dict[str, FloatArray], scaled: FloatArray, u: FloatArray) -> tuple[str, float]:
    """The views that lower the uncertainty along `u` most, and by what factor."""

    def sigma(information: FloatArray) -> float:
        held = information + 1e-14 * np.eye(len(u))
        return float(np.sqrt(max(float(u @ np.linalg.solve(held, u)), _ROUNDING)))

    gains = {remedy: sigma(scaled) / sigma(scaled + more) for remedy, more in added.items()}
    remedy = max(gains, key=lambda w: gains[w])
    if gains[remedy] < _HELPS:
        return "none of those tried helps much", gains[remedy]
    return remedy, gains[remedy]


def _more_views(joint: JointFit, views: Views) -> tuple[tuple[str, Views], ...]:
    """Four more views of each of several kinds, about the middle of those there are."""
    depth = joint.dependence.state.distance_m
    middle = float(np.median(depth))
    near, far = min(0.5 * middle, float(depth.min())), max(2.0 * middle, float(depth.max()))
    tilts = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]) * _TILT_RAD
    rolls = np.array([[0.0, 0.0, angle] for angle in (-np.pi / 2, 0.0, np.pi / 2, np.pi)])
    square = np.zeros((4, 3))
    return (
        (
            f"views at {middle:.2f} m with the board tilted 30 degrees, both ways about both axes",
            _aimed(joint, views, tilts, np.full(4, middle)),
        ),
        (
            f"views square to the board at distances from {near:.2f} m to {far:.2f} m",
            _aimed(joint, views, square, np.geomspace(near, far, 4)),
        ),
        (
            f"views tilted 30 degrees at distances from {near:.2f} m to {far:.2f} m",
            _aimed(joint, views, tilts, np.geomspace(near, far, 4)),
        ),
        (
            f"views at {middle:.2f} m rolled by quarter turns about the optical axis",
            _aimed(joint, views, rolls, np.full(4, middle)),
        ),
    )


def _aimed(joint: JointFit, views: Views, turns: FloatArray, distance_m: FloatArray) -> Views:
    """Views that see the board's middle in the image's middle, turned and this far away."""
    seen = compose(turns, np.zeros((len(turns), 3)))
    seen[:, 2, 3] = distance_m
    seen[:, :3, 3] -= seen[:, :3, :3] @ views.board.corners_m.mean(axis=0)
    return views_that_see(joint.model, views, views.board, seen)
