"""The few views of a plan that would show best whether the camera changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.chain.model import predict
from calib.solver.pose_information import pose_information
from calib.views import BoolArray, FloatArray, Views
from cell.devices.simulated_cell import home_of
from cell.errors import InputError
from cell.sequencer.guard import Guard
from cell.storage.files.plan_file import Plan
from cell.verbs.plan.reach import Candidate
from cell.verbs.plan.tour import shortest_tour
from cell.verbs.verify.change import wide
from cell.verbs.verify.judge import FRAMES_NEEDED
from cell.verbs.verify.old_cell import OldCell

SHORT = 8
_MARGIN = 0.03
"""Share of the image at its edge that a board moved a little would leave."""


def shortened(old: OldCell, plan: Plan, count: int) -> Plan:
    """The plan with its most informative views alone.

    Raises
    ------
    InputError
        Too few views are asked for, or show the board to the old calibration.
    """
    if count < FRAMES_NEEDED:
        raise InputError(f"--views {count}: at least {FRAMES_NEEDED} are needed")
    views = plan.file.views
    if count < len(views):
        views = tuple(views[k] for k in _passable(old, plan, count))
    # a run that ended early would lack the views that show a change
    return replace(plan, file=plan.file.model_copy(update={"views": views, "until": None}))


def _passable(old: OldCell, plan: Plan, count: int) -> list[int]:
    """Places of the most informative views, in an order in which every move is allowed.

    A view that no allowed move leads to from the others is done without.
    """
    guard, home = Guard.of(plan), home_of(plan)
    log, joints_rad = _log(old, plan, guard, home)
    left = np.arange(len(log))
    while True:
        chosen = left[choose_views(old, log.take(left), count)]
        stops = {
            k: Candidate(
                plan.file.views[k].station or "", 0.0, log.base_from_flange[k], joints_rad[k]
            )
            for k in chosen.tolist()
        }
        tour, barred = shortest_tour(list(stops.values()), home, guard)
        if not barred:
            return [k for stop in tour for k, candidate in stops.items() if candidate is stop]
        left = np.array([k for k in left.tolist() if stops.get(k) not in barred])


def choose_views(old: OldCell, log: Views, count: int) -> NDArray[np.int64]:
    """(count,) places of the views that leave least open what changed, in the plan's order.

    One view after the other is taken that lowers the volume of the uncertainty of a change of
    mount, lens and board most (D-optimal, greedy; Fedorov 1972).

    Parameters
    ----------
    old:
        The calibration to check.
    log:
        What a run of the plan would log, all frames with poses; corners are not looked at.
    count:
        How many to take.

    Raises
    ------
    InputError
        Fewer views show the whole board to the old calibration.
    """
    possible = np.flatnonzero(_whole(old, log))
    if len(possible) < count:
        raise InputError(
            f"only {len(possible)} of the plan's {len(log)} views show the whole board by the old"
            f" calibration, {count} are asked for: was it made with this cell and plan?"
        )
    reported = pose_information(old.model, log.take(possible), (), old.noise)
    gathered = np.diag([wide(old.model, unknown) ** -2.0 for unknown in reported.unknowns])
    chosen: list[int] = []
    for _ in range(count):
        gain = np.array([np.linalg.slogdet(gathered + one)[1] for one in reported.frames])
        gain[chosen] = -np.inf
        chosen.append(int(gain.argmax()))
        gathered = gathered + reported.frames[chosen[-1]]
    return np.sort(possible[chosen])


def _whole(old: OldCell, log: Views) -> BoolArray:
    """(N,) which views show the board, away from the image's edge."""
    pixels = predict(old.model, log)
    size = np.array([log.width_px, log.height_px])
    low, high = pixels > _MARGIN * size, pixels < (1 - _MARGIN) * size
    inside: BoolArray = np.asarray((low & high).all(axis=2))
    return np.asarray(inside.all(axis=1) if log.board.kind == "chessboard" else inside.any(axis=1))


def _log(old: OldCell, plan: Plan, guard: Guard, home_rad: FloatArray) -> tuple[Views, FloatArray]:
    """Where the flange will be in each view, by the arm's nominal kinematics, and (N, J) joints."""
    joints_rad, poses = [home_rad], []
    for index, view in enumerate(plan.file.views):
        joints_rad.append(guard.joints_of(plan, index, joints_rad[-1]))
        if view.joints() is None and view.base_from_flange is not None:
            poses.append(view.base_from_flange.transform().as_matrix())
        else:
            poses.append(guard.kinematics.forward(joints_rad[-1]))
    width, height = old.image_size_px
    blank = Views.blank(
        plan.cell.board.board(), width_px=width, height_px=height, frames=len(poses),
        mount=old.mount,
    )  # fmt: skip
    return replace(blank, base_from_flange=np.array(poses)), np.array(joints_rad[1:])
