"""All views a plan may be made of, what each would contribute, and the choice among them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache, cached_property
from itertools import islice

import numpy as np

from calib.calibration.uncertainty import focal_length_sigma_px
from calib.design.choose import Criterion, choose_views
from calib.design.expected import Expected
from calib.design.needs import ALPHA_DISTANCES, needs_of
from calib.solver.pose_information import PoseInformation, pose_information
from cell.devices.planned_camera import PlannedCamera
from cell.storage.files.cell_file import CellFile
from cell.verbs.plan.candidates import TWELFTHS_RAD, parallel, varied
from cell.verbs.plan.nominal import assume
from cell.verbs.plan.reach import Candidate, layout_of, planning_guard, reachable
from cell.verbs.plan.shortfall import require_enough
from cell.verbs.plan.size import PlanSize

_VARIED, _MOST_TRIES = 700, 1400
_TRIED_DISTANCES = 53


class CandidatePool:
    """Candidate views of one cell.

    Parameters
    ----------
    cell:
        Needs `layout`, and the lens.
    seed:
        Of the spread of the tilted candidates.

    Raises
    ------
    InputError
        The cell does not say enough, or too few views can be reached.
    """

    def __init__(self, cell: CellFile, seed: int) -> None:
        self._cell, self.guard = cell, planning_guard(cell)
        self.home_rad = np.radians(layout_of(cell).home_deg)
        self._sight = PlannedCamera.of(cell)
        self._distances_m = layout_of(cell).distances_m
        self._assumed = assume(cell)
        tries = islice(varied(self._sight, self._distances_m, seed), _MOST_TRIES)
        self.varied = tuple(islice(reachable("varied", tries, cell, self.guard), _VARIED))
        require_enough(self.varied, cell)
        given = self._assumed
        found = self._information(self.varied)
        self._varied_information = found.frames
        spread = Expected.of(given.model, given.lens, found)
        self._needs = needs_of(spread, given.views(()), self._distances_m)
        self._series = cache(self._reachable_series)

    def choose(self, size: PlanSize, without: Collection[Candidate] = ()) -> tuple[Candidate, ...]:
        """The views for the least uncertainty, in no order.

        Parameters
        ----------
        size:
            How many.
        without:
            Views that are not to be taken.
        """
        series = self._series(size.parallel)
        candidates = list(self.varied)
        tilted = np.arange(len(self.varied))
        slots = []
        for step in series:
            slots.append(np.arange(len(candidates), len(candidates) + len(step)))
            candidates += step
        slots = [slot for slot in slots if len(slot)]
        slots += [tilted] * (size.frames - len(slots))
        barred = [k for k, candidate in enumerate(candidates) if candidate in without]
        information = self._varied_information
        if len(candidates) > len(information):
            added = self._information(candidates[len(information) :]).frames
            information = np.concatenate([information, added])
        criterion = Criterion(information, self._needs)
        picked = choose_views(criterion, [np.setdiff1d(slot, barred) for slot in slots])
        return tuple(candidates[k] for k in picked)

    def alpha_sigma_px(self, candidates: Sequence[Candidate]) -> float:
        """Greatest one sigma of alpha over the distances to be expected of these views."""
        given, found = self._assumed, self._information(candidates)
        expected = Expected.of(given.model, given.lens, found)
        distances = np.linspace(*self._distances_m, ALPHA_DISTANCES)
        return float(focal_length_sigma_px(expected, given.views(()), distances).max())

    def _reachable_series(self, count: int) -> tuple[tuple[Candidate, ...], ...]:
        """For each of so many distances, evenly apart, the parallel views there."""
        return tuple(self._parallel(d) for d in np.linspace(*self._parallel_m, count))

    @cached_property
    def _parallel_m(self) -> tuple[float, float]:
        """Nearest and farthest distance at which a parallel view can be taken."""
        tried = np.linspace(*self._distances_m, _TRIED_DISTANCES)
        found = [float(d) for d in tried if self._parallel(d)]
        return (found[0], found[-1]) if found else self._distances_m

    def _parallel(self, distance_m: float) -> tuple[Candidate, ...]:
        sights = parallel(self._sight, distance_m, TWELFTHS_RAD)
        return tuple(reachable("parallel", sights, self._cell, self.guard))

    def _information(self, candidates: Sequence[Candidate]) -> PoseInformation:
        given = self._assumed
        views = given.views([c.base_from_flange for c in candidates])
        return pose_information(given.model, views, given.lens, given.noise)
