"""Joints worked out from poses: which of the arm's branches it was in each frame.

A pose has up to eight joint solutions, and an arm's faults distinguish them: a joint's zero offset
moves the flange elsewhere in each. For every simple fault the branches are chosen that explain
the flange's errors best, in turn with the fault's size, from several starts. Choosing among
branches has a price, reported as `price`, that a fault found with them must pay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.chain.kinematics import ArmKinematics
from calib.solver.joint import JointFit
from calib.views import FloatArray, Views

_ROUNDS = 12

_PRICE = 4.0
"""Of a choice, per logarithm of what there was to choose from: twice what a single fit's would
cost, for the choice follows the noise as well as the fault."""

_INNER = slice(1, 5)


@dataclass(frozen=True)
class Branches:
    """Joints by the branches that were chosen, and what choosing among them must cost."""

    joints_rad: FloatArray
    price: float


@dataclass(frozen=True)
class _Problem:
    """Flange errors (N, 6), scaled; nuisance columns (N, 6, c); branches (N, 8, 6), NaN-padded."""

    error: FloatArray
    nuisance: FloatArray
    branches: FloatArray
    columns: FloatArray


def choose_branches(fit: JointFit, views: Views, kinematics: ArmKinematics) -> Branches:
    """Choose each frame's branch by what the flange's errors ask for.

    Parameters
    ----------
    fit:
        The plain cell, with each flange's error in its own frame.
    views:
        Its frames, joints by some first choice of branches.
    kinematics:
        The arm.
    """
    branches = _all_branches(views, kinematics)
    counts = np.isfinite(branches).all(axis=2).sum(axis=1)
    numbers = 6.0 * len(views)
    price = _PRICE * float(np.log(np.maximum(counts, 1)).sum())
    best_gain, best = price, None
    for fault in (_offsets, _sags, _waves):
        problem = _problem(fit, branches, kinematics, fault)
        sound = _without_fault(problem)
        for start in _starts(branches, views.joints_rad):
            cost, chosen = _alternate(problem, start)
            gain = numbers * float(np.log(sound / max(cost, 1e-9)))
            gain -= problem.columns.shape[3] * float(np.log(numbers))
            if gain > best_gain:
                best_gain = gain
                best = branches[np.arange(len(views)), chosen]
    if best is None:
        return Branches(views.joints_rad, 0.0)
    known = np.isfinite(best).all(axis=1, keepdims=True)
    return Branches(np.where(known, best, views.joints_rad), price)


def with_branches(views: Views, branches: Branches, frames: NDArray[np.int64]) -> Views:
    """The views with the chosen joints of `frames` (frame numbers)."""
    where = {int(f): k for k, f in enumerate(frames)}
    joints = views.joints_rad.copy()
    for i, frame in enumerate(views.frame):
        if int(frame) in where:
            joints[i] = branches.joints_rad[where[int(frame)]]
    return replace(views, joints_rad=joints)


def _all_branches(views: Views, kinematics: ArmKinematics) -> FloatArray:
    out = np.full((len(views), 8, 6), np.nan)
    for i in range(len(views)):
        found = kinematics.inverse_all(views.base_from_flange[i], views.joints_rad[i])[:8]
        out[i, : len(found)] = found
    return out


def _offsets(joints: FloatArray, kinematics: ArmKinematics) -> FloatArray:
    return np.broadcast_to(np.eye(6)[:, _INNER], (*joints.shape[:-1], 6, 4))


def _sags(joints: FloatArray, kinematics: ArmKinematics) -> FloatArray:
    torque = kinematics.gravity_torques(joints)
    return np.asarray((torque[..., :, None] * np.eye(6))[..., _INNER])


def _waves(joints: FloatArray, kinematics: ArmKinematics) -> FloatArray:
    swing = [np.sin(joints)[..., :, None] * np.eye(6), np.cos(joints)[..., :, None] * np.eye(6)]
    return np.concatenate([s[..., _INNER] for s in swing], axis=-1)


def _problem(
    fit: JointFit,
    branches: FloatArray,
    kinematics: ArmKinematics,
    fault: Callable[[FloatArray, ArmKinematics], FloatArray],
) -> _Problem:
    found = fit.dependence
    a = len(found.active)
    to_flange = np.linalg.inv(found.pose_by_flange)
    pose_columns = np.flatnonzero(np.abs(found.local[:, a : a + 6]).max(axis=(0, 1)))
    scale = np.array([1.0 / fit.noise.flange_m] * 3 + [1.0 / fit.noise.flange_rad] * 3)
    nuisance = to_flange @ found.local[:, a : a + 6][:, :, pose_columns]
    safe = np.where(np.isfinite(branches), branches, 0.0)
    columns = kinematics.flange_jacobian(safe) @ fault(safe, kinematics)
    return _Problem(
        fit.flange_error * scale,
        nuisance * scale[:, None],
        branches,
        columns * scale[:, None],
    )


def _starts(branches: FloatArray, first: FloatArray) -> list[FloatArray]:
    """The first choice, and every kind of branch kept through all frames."""
    known = np.isfinite(branches).all(axis=2)
    nearest = np.abs(branches - first[:, None]).max(axis=2)
    starts = [np.argmin(np.where(known, nearest, np.inf), axis=1)]
    kinds = np.stack(
        [
            np.sin(branches[:, :, 2]) > 0,
            np.sin(branches[:, :, 4]) > 0,
            branches[:, :, 1] < -np.pi / 2,
        ],
        axis=2,
    )
    for code in range(8):
        wanted = np.array([code & 1, code & 2, code & 4], dtype=bool)
        agree = np.where(known, (kinds == wanted).sum(axis=2), -1)
        starts.append(np.argmax(agree, axis=1))
    return starts


def _without_fault(problem: _Problem) -> float:
    """Cost of the errors with hand-eye and board pose fitted, and no fault."""
    known = np.asarray(np.isfinite(problem.branches).all(axis=2)).any(axis=1)
    design = problem.nuisance[known].reshape(6 * int(known.sum()), -1)
    error = problem.error[known].ravel()
    size = np.linalg.norm(design, axis=0)
    size[size == 0.0] = 1.0
    solved = np.linalg.lstsq(design / size, error, rcond=1e-9)[0] / size
    return float(np.sum((error - design @ solved) ** 2))


def _alternate(problem: _Problem, chosen: FloatArray) -> tuple[float, FloatArray]:
    """Size of the fault and branches in turn, until neither changes; the cost reached."""
    n = len(problem.error)
    known = np.isfinite(problem.branches).all(axis=2)
    cost = np.inf
    for _ in range(_ROUNDS):
        mine = problem.columns[np.arange(n), chosen]
        design = np.concatenate([problem.nuisance, mine], axis=2).reshape(6 * n, -1)
        size = np.linalg.norm(design, axis=0)
        size[size == 0.0] = 1.0
        solved = np.linalg.lstsq(design / size, problem.error.ravel(), rcond=1e-9)[0] / size
        c = problem.nuisance.shape[2]
        rest = problem.error - problem.nuisance @ solved[:c]
        miss = ((rest[:, None] - problem.columns @ solved[c:]) ** 2).sum(axis=2)
        miss = np.where(known, miss, np.inf)
        chosen = np.argmin(miss, axis=1)
        reached = miss[np.arange(n), chosen]
        now = float(reached[np.isfinite(reached)].sum())
        if now >= cost - 1e-6:
            break
        cost = now
    return cost, chosen
