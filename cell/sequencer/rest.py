"""Whether readings prove that an arm stands: fresh, finite, newer than the order, and all alike."""

from __future__ import annotations

import numpy as np

from calib.views import FloatArray
from drivers.arm import ArmState, Motion

REST_S = 0.25
"""So long must fresh readings agree, on the controller's own clock where it has one."""
REST_RAD, REST_RAD_S = 5e-4, 0.01
"""They agree within so much, and no joint is ordered to turn faster: 2 mrad/s over `REST_S`."""


class RestEvidence:
    """Judges the readings that come after an order to stop.

    Parameters
    ----------
    ordered_s:
        Host time of the order; what was read before it proves nothing.
    before:
        The newest reading from before, None where there was none.
    least_way_rad:
        The arm was on its way in `before`, and must have gone farther than this since; below
        zero where it may stand where it was.

    Attributes
    ----------
    missing:
        What keeps the readings from proving it, as text for the operator.
    fresh:
        Whether the newest reading was a fresh one, which showed motion or rest.
    """

    def __init__(self, ordered_s: float, before: ArmState | None, least_way_rad: float) -> None:
        self._ordered_s = ordered_s
        self._newest = self._before = before
        self._least_way_rad = least_way_rad
        self._anchor: ArmState | None = None
        self.missing = "no reading has come since the order"
        self.fresh = False

    def shows_rest(self, state: ArmState) -> bool:
        """Take one more reading; True once it and those before it prove that the arm stands."""
        if not self._is_news(state):
            return False
        doubt = self._doubt(state)
        if doubt is not None:
            self._disprove(doubt, fresh=False)
            return False
        self._newest = state
        if _moves(state) or (self._anchor is not None and _apart(self._anchor, state) > REST_RAD):
            self._disprove("the readings say that it still moves", fresh=True)
            return False
        self._anchor, self.fresh = self._anchor or state, True
        self.missing = "the readings have not shown for long enough that it stands"
        return _elapsed_s(self._anchor, state) >= REST_S

    @property
    def standing(self) -> bool:
        """Whether the newest readings show rest, if not for long enough yet."""
        return self._anchor is not None

    def lost(self, why: str) -> None:
        """No reading can be had."""
        self._disprove(f"no reading can be had ({why})", fresh=False)

    def _disprove(self, why: str, *, fresh: bool) -> None:
        self.missing, self.fresh, self._anchor = why, fresh, None

    def _is_news(self, state: ArmState) -> bool:
        since_s = self._ordered_s
        if self._newest is not None:
            since_s = max(since_s, self._newest.host_t_s)
        return state.host_t_s > since_s

    def _doubt(self, state: ArmState) -> str | None:
        """Why a reading proves nothing, None where it may."""
        newest, before = self._newest, self._before
        if _joints(state) is None or not np.isfinite(state.base_from_flange.as_matrix()).all():
            return "its readings are not finite"
        if newest is not None and not _clock_goes_on(newest, state):
            return "the controller's clock stands still, so that its readings may be old"
        if before is not None and _apart(before, state) <= self._least_way_rad:
            return "its readings are what they were when it was on its way, so they are old"
        return None


def _joints(state: ArmState) -> FloatArray | None:
    """(6,) joint angles, None where they are not reported or not finite."""
    if state.joints_rad is None:
        return None
    joints = np.asarray(state.joints_rad, dtype=float)
    return joints if np.isfinite(joints).all() else None


def fastest_rad_s(state: ArmState) -> float:
    """Speed of the fastest joint as the controller reports it; 0 where it does not."""
    reported = state.joint_velocity_rad_s
    return 0.0 if reported is None else float(np.abs(reported).max(initial=0.0))


def _moves(state: ArmState) -> bool:
    # a speed that is not a number is no speed of an arm at rest
    return state.motion is Motion.MOVING or not fastest_rad_s(state) < REST_RAD_S


def _clock_goes_on(before: ArmState, after: ArmState) -> bool:
    if before.controller_t_s is None or after.controller_t_s is None:
        return True
    return after.controller_t_s > before.controller_t_s


def _elapsed_s(first: ArmState, last: ArmState) -> float:
    if first.controller_t_s is None or last.controller_t_s is None:
        return last.host_t_s - first.host_t_s
    return last.controller_t_s - first.controller_t_s


def _apart(a: ArmState, b: ArmState) -> float:
    return float(np.abs(np.subtract(a.joints_rad or (), b.joints_rad or ())).max(initial=0.0))
