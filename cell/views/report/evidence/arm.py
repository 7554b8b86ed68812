"""Evidence for what the arm does: errors against its joints."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from calib.views import FloatArray
from cell.views.report.data import ReportData
from cell.views.report.evidence.scatter import WITH, WITHOUT, before_after, component, shifts_m
from cell.views.report.figures.canvas import BLUE, ORANGE
from cell.views.report.plot import Figure, legend_below, panels

_AXES = "xyz"


def named_joint(effect: Mapping[str, Any]) -> int | None:
    """The joint, from 1, whose parameter of the effect stands out most, or None."""
    weights: dict[int, float] = {}
    for name, entry in (effect.get("parameters") or {}).items():
        if match := re.search(r"_([1-9])$", str(name)):
            weights[int(match.group(1))] = abs(entry["value"]) / (entry.get("sigma") or 1.0)
    return max(weights, key=weights.__getitem__, default=None)


def error_against_joints(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """The error component that moved most, against each joint's angle, before and after."""
    shifts = shifts_m(data, effect)
    joints = data.evidence.joints_rad if data.evidence else None
    joints = data.views.joints_rad if joints is None else joints
    if shifts is None or not np.isfinite(joints).any():
        return None
    axis = int(np.argmax(np.nanstd(shifts[0], axis=0)))
    rows = -(-joints.shape[1] // 3)
    figure, axes = panels(9.2, 0.6 + 1.9 * rows, columns=3, rows=rows, sharey=True)
    hurt = named_joint(effect)
    for joint, ax in enumerate(axes[: joints.shape[1]]):
        before_after(ax, np.degrees(joints[:, joint]), shifts, partial(component, axis=axis))
        mark = " — named" if hurt == joint + 1 else ""
        ax.set(title=f"joint {joint + 1}{mark}", xlabel="angle (°)")
    for row in range(rows):
        axes[3 * row].set(ylabel=f"{_AXES[axis]} error (mm)")
    legend_below(figure, axes)
    return figure


def error_against_approach(data: ReportData, effect: Mapping[str, Any]) -> Figure | None:
    """The position error where a joint arrived from below and from above."""
    shifts = shifts_m(data, effect)
    views = data.views
    came = np.sign(views.joints_rad - views.approach_joints_rad)
    if shifts is None or not np.isfinite(came).any():
        return None
    joint = (named_joint(effect) or 1 + _most_informative(came, shifts[0])) - 1
    names = (WITHOUT, WITH)
    shown = [(n, s) for n, s in zip(names, shifts, strict=True) if s is not None]
    figure, axes = panels(9.2, 2.8, columns=len(shown), sharey=True)
    axis = int(np.argmax(np.nanstd(shifts[0], axis=0)))
    for ax, (name, shift) in zip(axes, shown, strict=True):
        for sign, marker, colour, side in ((1, "^", ORANGE, "below"), (-1, "v", BLUE, "above")):
            chosen = came[:, joint] == sign
            ax.plot(np.degrees(views.joints_rad[chosen, joint]), shift[chosen, axis] * 1e3,
                    marker=marker, linestyle="", color=colour, fillstyle="none",
                    label=f"joint came from {side}")  # fmt: skip
        ax.set(title=name, xlabel=f"joint {joint + 1} (°)")
    axes[0].set(ylabel=f"{_AXES[axis]} error (mm)")
    legend_below(figure, axes)
    return figure


def _most_informative(came: FloatArray, shift: FloatArray) -> int:
    """The joint whose direction of arrival splits the errors most."""
    split = [_distance(shift[side > 0], shift[side < 0]) for side in came.T]
    return int(np.argmax(split))


def _distance(these: FloatArray, those: FloatArray) -> float:
    if not len(these) or not len(those):
        return 0.0
    return float(np.linalg.norm(np.nanmean(these, axis=0) - np.nanmean(those, axis=0)))
