"""What a plan has less of than was asked, and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice, pairwise

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from calib.views import FloatArray
from cell.devices.planned_camera import PlannedCamera
from cell.errors import InputError
from cell.sequencer.guard import Guard
from cell.storage.files.cell_file import CellFile
from cell.storage.files.plan_file import Plan
from cell.verbs.plan.candidates import TWELFTHS_RAD, parallel, varied
from cell.verbs.plan.reach import Candidate, flange_pose, layout_of, planning_guard, usual_branches
from cell.verbs.plan.size import FEWEST_FRAMES, PlanSize
from drivers.errors import SafetyError

_TRIED = 36
_GAP_SHARE = 0.1
"""Of the way from the nearest to the farthest distance: less than that is no gap."""

_INNER_GAP_SHARE = 0.2
_GAP_VIEWS = 4.0
"""Between views less than the share is no gap, nor what so many views spread evenly would leave."""


def shortfalls(plan: Plan, size: PlanSize) -> tuple[str, ...]:
    """A line for each kind of view and each end of the distances that the plan lacks.

    Parameters
    ----------
    plan, size:
        What was found, and what was asked.
    """
    stations: list[str | None] = [view.station for view in plan.file.views]
    lines = []
    asked = {"parallel": (size.parallel, "parallel"), "varied": (size.varied, "tilted")}
    for station, (count, name) in asked.items():
        found = stations.count(station)
        if found < count:
            lines.append(f"{count} {name} views were asked for and {found} found")
    lines += _gaps(plan)
    if not lines:
        return ()
    return (*lines, why_not(plan.cell))


def require_enough(reached: Sequence[Candidate], cell: CellFile) -> None:
    """Raise `InputError` where too few views can be taken to calibrate at all."""
    if len(reached) < FEWEST_FRAMES:
        low, high = layout_of(cell).distances_m
        raise InputError(
            f"cell {cell.name}: the arm can take only {len(reached)} views of the board between"
            f" {low} and {high} m: {why_not(cell)}. Check layout, workspace and keep_out, or move"
            " the board."
        )


def _gaps(plan: Plan) -> Iterator[str]:
    near, far = layout_of(plan.cell).distances_m
    guard = planning_guard(plan.cell)
    home = np.radians(layout_of(plan.cell).home_deg)
    joints = [guard.joints_of(plan, k, home) for k in range(len(plan.file.views))]
    depth = [_in_camera(plan.cell, guard, q)[2] for q in joints]
    if min(depth) > near + _GAP_SHARE * (far - near):
        yield f"no view is nearer than {min(depth):.3f} m, and {near:g} m was asked for"
    if max(depth) < far - _GAP_SHARE * (far - near):
        yield f"no view is farther than {max(depth):.3f} m, and {far:g} m was asked for"
    wide = max(_INNER_GAP_SHARE, _GAP_VIEWS / len(depth)) * (far - near)
    for below, above in pairwise(sorted(depth)):
        if above - below > wide:
            yield f"no view is between {below:.3f} and {above:.3f} m"


def _camera_from_board(cell: CellFile, guard: Guard, joints_rad: FloatArray) -> RigidTransform:
    layout = layout_of(cell)
    flange = RigidTransform.from_matrix(guard.kinematics.forward(joints_rad))
    mounted_from_fixed = (flange * layout.mounted.transform()).inv() * layout.fixed.transform()
    return mounted_from_fixed if cell.mount == "eye_in_hand" else mounted_from_fixed.inv()


def _in_camera(cell: CellFile, guard: Guard, joints_rad: FloatArray) -> FloatArray:
    """(3,) the board's centre in the camera."""
    centre = cell.board.board().corners_m.mean(axis=0)
    return np.asarray(_camera_from_board(cell, guard, joints_rad).apply(centre))


def why_not(cell: CellFile) -> str:
    """Why views of the board cannot be taken, by what some all over the distances meet."""
    guard = planning_guard(cell)
    met: Counter[str] = Counter()
    example = ""
    for camera_from_board in _sights(cell):
        reason, refusal = _refusal(cell, guard, camera_from_board)
        met[reason] += 1
        example = example or refusal
    free = met.pop("", 0)
    if not free + met.total():
        return (
            "at none of these distances does the picture hold the whole board: it takes a shorter"
            " focal length, a smaller board or larger `layout.distances_m`"
        )
    parts = [f"{count} {reason}" for reason, count in met.most_common()]
    reported = f"of {free + met.total()} views tried over the distances {free} can be taken"
    lines = [", ".join([reported, *parts]) + (f" (such as: {example})" if example else "")]
    at_home = _seen_from_home(cell, guard)
    return "; ".join([*lines, *([at_home] if at_home else [])])


def _sights(cell: CellFile) -> Iterator[RigidTransform]:
    """Views (camera_from_board) all over the distances, tilted and parallel."""
    sight, (near, far) = PlannedCamera.of(cell), layout_of(cell).distances_m
    for distance in np.linspace(near, far, _TRIED // 4):
        yield from islice(parallel(sight, float(distance), TWELFTHS_RAD[:1]), 1)
    if sight.whole(Rotation.identity(), np.array([0.0, 0.0, far])):
        yield from islice(varied(sight, (near, far), seed=1), _TRIED)


def _refusal(cell: CellFile, guard: Guard, camera_from_board: RigidTransform) -> tuple[str, str]:
    """What keeps the arm from a view, and the guard's own words for it; empty where nothing."""
    home = np.radians(layout_of(cell).home_deg)
    pose = flange_pose(cell, camera_from_board)
    if not len(guard.kinematics.inverse_all(pose, home)):
        return "are out of the arm's reach", ""
    branches = usual_branches(pose, home, guard)
    if not len(branches):
        return "need shoulder, elbow or wrist turned far from home", ""
    refusal = ""
    for joints in branches:
        try:
            guard.check_move(home, joints, "the view")
        except SafetyError as refused:
            refusal = refusal or str(refused)
        else:
            return "", ""
    return "would meet a body, a limit or a box on the way from home", refusal


def _seen_from_home(cell: CellFile, guard: Guard) -> str:
    home = np.radians(layout_of(cell).home_deg)
    seen = _camera_from_board(cell, guard, home)
    centre = _in_camera(cell, guard, home)
    if PlannedCamera.of(cell).whole(seen.rotation, centre):
        return ""
    x, y, z = centre
    return (
        f"the board is not in view from home: its middle is {x:+.2f} m right, {y:+.2f} m down and"
        f" {z:+.2f} m ahead of the camera there. Check layout.mounted, layout.fixed and"
        " layout.home_deg"
    )
