"""A plan for a cell: views the arm can reach, in an order that keeps its way short."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.views import FloatArray
from cell.errors import InputError
from cell.files.cell_file import CellFile, Layout
from cell.files.plan_file import SCHEMA, PlanFile
from cell.planning.candidates import Sight, parallel, varied
from cell.sequencer.guard import Guard
from drivers.errors import SafetyError

_TRIES_PER_VIEW = 60
_FEWEST_VIEWS = 8
_FROM_HOME_RAD = np.radians([110.0, 110.0, 110.0, 110.0, 110.0, 200.0])
"""Joints stay this near to home: an arm that folds over or flips its wrist may hit itself, which
the guard does not know."""


@dataclass(frozen=True)
class PlanSize:
    """How many views of which kind.

    Attributes
    ----------
    parallel:
        Fronto-parallel views along the distances, for the scale factors.
    varied:
        Tilted views all over the image and the distances.
    seed:
        Of the spread of the varied views.
    by_hand:
        Tilt the near views and leave the far ones flat, see `candidates.varied`.
    """

    parallel: int = 16
    varied: int = 24
    seed: int = 1
    by_hand: bool = False


@dataclass(frozen=True)
class Candidate:
    station: str
    distance_m: float
    base_from_flange: FloatArray


def design_plan(
    cell: CellFile, size: PlanSize | None = None, cell_path: str | None = None
) -> PlanFile:
    """Design a plan.

    Parameters
    ----------
    cell:
        Needs `layout`, and the lens.
    size:
        How many views.
    cell_path:
        What the plan's `cell` key shall say; the cell itself stands in the plan where None.

    Raises
    ------
    InputError
        The cell does not say enough, or too few views can be reached.
    """
    size = size or PlanSize()
    if cell.layout is None:
        raise InputError(f"cell {cell.name}: poses need `layout`; measure it with a tape")
    guard = Guard(cell, speed_m_s=0.1, joint_speed_rad_s=0.5)
    candidates = [
        *_parallel(cell, cell.layout, guard, size),
        *_varied(cell, cell.layout, guard, size),
    ]
    if len(candidates) < _FEWEST_VIEWS:
        raise InputError(
            f"cell {cell.name}: the arm can take only {len(candidates)} views of the board between"
            f" {cell.layout.distances_m[0]} and {cell.layout.distances_m[1]} m. Check layout,"
            " workspace and keep_out, or move the board."
        )
    stops = _tour(candidates, np.radians(cell.layout.home_deg), guard)
    views = [view_of(number, *stop) for number, stop in enumerate(stops)]
    plan: dict[str, object] = {"schema": SCHEMA, "name": cell.name, "views": views}
    plan["cell"] = cell_path or cell
    if cell.camera.focus == "auto":
        plan["exposure"] = {"focus": "auto"}
    return PlanFile.model_validate(plan)


def view_of(number: int, candidate: Candidate, joints_rad: FloatArray) -> dict[str, object]:
    degrees = [round(value, 4) for value in np.degrees(joints_rad).tolist()]
    name = f"{candidate.station} {number:02d}, {candidate.distance_m:.2f} m"
    return {"name": name, "station": candidate.station, "joints_deg": degrees}


def _parallel(cell: CellFile, layout: Layout, guard: Guard, size: PlanSize) -> Iterator[Candidate]:
    sight = Sight.of(cell)
    for distance in np.linspace(*layout.distances_m, size.parallel):
        candidates = reachable("parallel", parallel(sight, distance), cell, layout, guard)
        yield from islice(candidates, 1)


def _varied(cell: CellFile, layout: Layout, guard: Guard, size: PlanSize) -> Iterator[Candidate]:
    views = varied(Sight.of(cell), layout.distances_m, size.seed, by_hand=size.by_hand)
    tries = islice(views, _TRIES_PER_VIEW * size.varied)
    yield from islice(reachable("varied", tries, cell, layout, guard), size.varied)


def reachable(
    station: str,
    sights: Iterable[RigidTransform],
    cell: CellFile,
    layout: Layout,
    guard: Guard,
) -> Iterator[Candidate]:
    fixed, mounted = layout.fixed.transform(), layout.mounted.transform()
    home = np.radians(layout.home_deg)
    for camera_from_board in sights:
        middle = camera_from_board.inv() if cell.mount == "eye_in_hand" else camera_from_board
        pose = (fixed * middle * mounted.inv()).as_matrix()
        if any(free(guard, joints, joints) for joints in _branches(pose, home, home, guard)):
            centre = camera_from_board.apply(cell.board.board().corners_m.mean(axis=0))
            yield Candidate(station, float(centre[2]), pose)


def _tour(
    candidates: list[Candidate], home_rad: FloatArray, guard: Guard
) -> list[tuple[Candidate, FloatArray]]:
    """Always on to the nearest view that a free joint move leads to; others are left out."""
    left, here = list(candidates), home_rad
    tour: list[tuple[Candidate, FloatArray]] = []
    while left:
        step = _nearest(left, here, home_rad, guard)
        if step is None:
            return tour
        candidate, here = step
        left.remove(candidate)
        tour.append((candidate, here))
    return tour


def _nearest(
    candidates: list[Candidate], here: FloatArray, home: FloatArray, guard: Guard
) -> tuple[Candidate, FloatArray] | None:
    steps = [
        (float(np.abs(joints - here).max()), number, joints)
        for number, candidate in enumerate(candidates)
        for joints in _branches(candidate.base_from_flange, here, home, guard)
    ]
    for _, number, joints in sorted(steps, key=lambda step: step[:2]):
        if free(guard, here, joints):
            return candidates[number], joints
    return None


def _branches(pose: FloatArray, here: FloatArray, home: FloatArray, guard: Guard) -> FloatArray:
    """(B, 6) joint angles that reach a flange pose without leaving the arm's usual posture."""
    branches = np.concatenate([guard.kinematics.inverse_all(pose, near) for near in (here, home)])
    return np.asarray(branches[(np.abs(branches - home) <= _FROM_HOME_RAD).all(axis=1)])


def free(guard: Guard, here: FloatArray, there: FloatArray) -> bool:
    try:
        guard.check_move(here, there, "")
    except SafetyError:
        return False
    return True
