"""Whether the frames so far are enough for what the plan's `until` asks."""

from __future__ import annotations

from concurrent.futures import Future

import numpy as np

from cell.storage.files.plan_file import Until
from cell.views.running_estimate.estimate import Estimate


class EarlyEnd:
    """Says when a run may end; see `cell.sequencer.goal.Goal`.

    A sigma is only as good as the model and the frames behind it, so one that is small enough does
    not end a run by itself:

    - `min_views` frames take part;
    - they cover the plan's distances and tilts (`view_kinds.lacking`), so that a wrong law or an
      arm's own error has had the chance to show;
    - two estimates running say so, the second with more frames, and the scale factor has moved
      between them by no more than the goal, at any of the distances.
    """

    def __init__(self, until: Until) -> None:
        self._until = until
        self._before: Estimate | None = None
        self._reason = ""
        self._caught_up: Future[None] = Future()

    def heed(self, estimate: Estimate) -> None:
        """Take one more estimate into account."""
        if not self._enough(estimate):
            self._before = None
        elif self._before is None:
            self._before = estimate
        elif estimate.frames > self._before.frames:
            if self._steady(self._before, estimate):
                self._reason = self._explained(estimate)
            self._before = estimate

    def catch_up(self) -> None:
        """Everything that was recorded before has been heeded, or never will be."""
        if not self._caught_up.done():
            self._caught_up.set_result(None)

    def caught_up(self) -> Future[None]:
        """See `Goal`."""
        return self._caught_up

    def reached(self) -> str:
        """See `Goal`."""
        return self._reason

    def _enough(self, estimate: Estimate) -> bool:
        return (
            estimate.used >= self._until.min_views
            and estimate.worst_sigma_px <= self._until.alpha_sigma_px
            and not estimate.lacks
        )

    def _steady(self, before: Estimate, now: Estimate) -> bool:
        at_same = np.interp(now.distance_m, before.distance_m, before.alpha_px)
        return float(np.abs(now.alpha_px - at_same).max()) <= self._until.alpha_sigma_px

    def _explained(self, estimate: Estimate) -> str:
        near, far = estimate.distance_m[[0, -1]]
        return (
            f"alpha is known to {estimate.worst_sigma_px:.2g} px from {near:.2f} to {far:.2f} m"
            f" after {estimate.used} frames; the plan asks for {self._until.alpha_sigma_px:g} px"
        )
