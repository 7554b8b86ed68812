"""How near the arm comes to anything on the way of a plan."""

from __future__ import annotations

from typing import Any

import numpy as np

from calib.bodies import Nearest
from cell.sequencer.guard import Guard
from cell.storage.files.plan_file import Plan
from cell.verbs.plan.reach import layout_of


def of_plan(plan: Plan) -> Nearest | None:
    """Where two bodies come nearest on the way from home through all views; None if none can."""
    guard = Guard.of(plan)
    home = np.radians(layout_of(plan.cell).home_deg)
    tour = [home]
    for index in range(len(plan.file.views)):
        tour.append(guard.joints_of(plan, index, tour[-1]))
    return guard.nearest(tour)


def as_line(near: Nearest | None) -> str:
    """One line for the terminal."""
    if near is None:
        return "smallest distance on the way: nothing to come near to"
    x, y, z = near.place_m
    return (
        f"smallest distance on the way: {1e3 * near.distance_m:.0f} mm, {near.first} to"
        f" {near.second} at x={x:.2f} y={y:.2f} z={z:.2f} m (volumes, not points)"
    )


def as_mapping(near: Nearest | None) -> dict[str, Any] | None:
    """The same for `--json`."""
    if near is None:
        return None
    return {
        "distance_m": near.distance_m,
        "between": [near.first, near.second],
        "place_m": near.place_m.tolist(),
    }
