"""A plan for a cell: the most informative views, in an order that keeps the arm's way short."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

import numpy as np

from cell.devices.planned_camera import PlannedCamera
from cell.errors import InputError
from cell.storage.files.cell_file import CellFile
from cell.storage.files.plan_file import SCHEMA, PlanFile
from cell.verbs.plan.candidate_pool import CandidatePool
from cell.verbs.plan.candidates import parallel, varied
from cell.verbs.plan.reach import Candidate, layout_of, planning_guard, reachable
from cell.verbs.plan.shortfall import require_enough
from cell.verbs.plan.size import FEWEST_FRAMES, PlanSize
from cell.verbs.plan.tour import shortest_tour

_ROUNDS = 3
"""How often views that no move leads to are replaced by others."""

_TRIES_PER_VIEW = 60


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
        The cell does not say enough, too few views are asked for, or too few can be reached.
    """
    size = size or PlanSize()
    if size.frames < FEWEST_FRAMES:
        raise InputError(
            f"{size.frames} views do not make a calibration: ask for {FEWEST_FRAMES} or more"
        )
    tour = _by_hand(cell, size) if size.by_hand else _chosen(CandidatePool(cell, size.seed), size)
    return _plan(cell, tour, cell_path)


def _chosen(pool: CandidatePool, size: PlanSize) -> list[Candidate]:
    """The most informative views, in order; what no move leads to is replaced."""
    barred: list[Candidate] = []
    for _ in range(_ROUNDS):
        tour, left_out = shortest_tour(pool.choose(size, barred), pool.home_rad, pool.guard)
        if not left_out:
            break
        barred += left_out
    return tour


def _by_hand(cell: CellFile, size: PlanSize) -> list[Candidate]:
    """Views as a person takes them, none chosen for its information."""
    layout, sight, guard = layout_of(cell), PlannedCamera.of(cell), planning_guard(cell)
    views = varied(sight, layout.distances_m, size.seed, by_hand=True)
    tries = islice(views, _TRIES_PER_VIEW * size.varied)
    found = list(islice(reachable("varied", tries, cell, guard), size.varied))
    for distance in np.linspace(*layout.distances_m, size.parallel):
        found += islice(reachable("parallel", parallel(sight, distance), cell, guard), 1)
    require_enough(found, cell)
    tour, _ = shortest_tour(found, np.radians(layout.home_deg), guard)
    return tour


def _plan(cell: CellFile, tour: Sequence[Candidate], cell_path: str | None) -> PlanFile:
    views = [view_of(number, candidate) for number, candidate in enumerate(tour)]
    if cell.camera.focus_positions is not None:
        _sweep_focus(views, tour, cell.camera.focus_positions)
    plan: dict[str, object] = {"schema": SCHEMA, "name": cell.name, "views": views}
    plan["cell"] = cell_path or cell
    if cell.camera.focus == "auto":
        plan["exposure"] = {"focus": "auto"}
    elif cell.camera.focus_positions is not None:
        plan["exposure"] = {"focus": "position"}
    return PlanFile.model_validate(plan)


def _sweep_focus(
    views: Sequence[dict[str, object]], tour: Sequence[Candidate], positions: Sequence[float]
) -> None:
    """Give the views the positions in turn, so that each has near and far ones of both kinds."""
    order = sorted(range(len(tour)), key=lambda k: (tour[k].station, tour[k].distance_m))
    for rank, k in enumerate(order):
        views[k]["focus_position"] = positions[rank % len(positions)]


def view_of(number: int, candidate: Candidate) -> dict[str, object]:
    """A candidate as a view of a plan file."""
    degrees = [round(value, 4) for value in np.degrees(candidate.joints_rad).tolist()]
    name = f"{candidate.station} {number:02d}, {candidate.distance_m:.2f} m"
    return {"name": name, "station": candidate.station, "joints_deg": degrees}
