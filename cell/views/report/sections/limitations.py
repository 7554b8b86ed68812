"""What can be trusted of a calibration, and what not, in plain sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cell.views.numbers import known, measured, millimetres, number, solution_name
from cell.views.report.data import ReportData
from cell.views.report.geometry import workpiece_error_m
from cell.views.report.sections.cross_validation import cross_validation_sentences
from cell.views.report.sections.uncertainty import uncertainty_sentences
from cell.views.report.workpiece_error import corrected, of_solution

_MANY_TIMES = 3.0


def sentences(data: ReportData) -> list[str]:
    """Sentences a technician can act on, those first that decide whether the camera is used.

    What was not logged is among them; the numbers, which the tables have as well, stand last.
    """
    return [
        *_outliers(data),
        *cross_validation_sentences(data),
        *_corrected(data),
        *uncertainty_sentences(data),
        *_independence(data),
        *_truth(data),
        *_zhang(data),
        *not_logged(data),
        *_scale(data),
    ]


def not_logged(data: ReportData) -> Iterator[str]:
    """What the log does not have, and what therefore cannot be known."""
    views = data.views
    if not views.has_pose.any():
        yield "Flange poses were not logged: nothing is known about errors in millimetres."
        return
    columns = (
        (
            views.joints_rad,
            "Joint angles were not logged: faults of single joints are hard to distinguish.",
        ),
        (views.t_s, "Times were not logged: drifts stay hidden."),
        (views.temperature_c, "Temperature was not logged: drift can only be seen against time."),
        (
            views.approach_joints_rad,
            "The joints each move came from were not logged: backlash stays hidden.",
        ),
    )
    for column, message in columns:
        if not np.isfinite(column).any():
            yield message


def _scale(data: ReportData) -> Iterator[str]:
    best = data.solutions.get(data.recommended or "", {})
    sigma = best.get("sigma") or {}
    if known(best.get("alpha_px")):
        alpha = measured(best["alpha_px"], sigma.get("alpha_px"), "px")
        at = best.get("at_distance_m")
        where = f" at {number(at, 'm')}; it moves with distance" if at else ""
        yield f"α is {alpha}{where} ({solution_name(str(data.recommended))})."
    if known(best.get("u0_px")):
        u0 = measured(best["u0_px"], sigma.get("u0_px"), "px")
        v0 = measured(best.get("v0_px"), sigma.get("v0_px"), "px")
        yield f"The principal point is at {u0}, {v0}."


def _corrected(data: ReportData) -> Iterator[str]:
    found = corrected(data)
    if found is not None and (data.diagnosis or {}).get("effects"):
        yield (
            f"With what the diagnosis found put right, the error at the work piece is "
            f"{millimetres(found.rms_m)} RMS on these frames."
        )


def _zhang(data: ReportData) -> Iterator[str]:
    name = data.recommended
    zhang = of_solution(data, "zhang_mle")
    best = None if name is None else of_solution(data, name)
    if zhang is None or best is None or name == "zhang_mle":
        return
    rms = data.solutions.get("zhang_mle", {}).get("reprojection_px", {}).get("rms")
    if known(rms) and zhang.rms_m > _MANY_TIMES * best.rms_m:
        yield (
            f"Zhang's fit reprojects to {number(rms, 'px', 2)}, yet it is "
            f"{millimetres(zhang.rms_m)} off at the work piece: do not judge by reprojection."
        )


def _truth(data: ReportData) -> Iterator[str]:
    poses = data.poses.get(data.recommended or "")
    true = None if data.truth is None else data.truth.board_from_camera
    if poses is None or true is None:
        return
    error = workpiece_error_m(poses.board_from_camera, true, data.views.board)
    rms = float(np.sqrt(np.nanmean(error**2)))
    yield f"Against the simulator's truth the error at the work piece is {millimetres(rms)} RMS."


def _independence(data: ReportData) -> Iterator[str]:
    poses = data.poses.get(data.recommended or "")
    if poses is not None and poses.board_from_camera_by_robot is not None:
        yield (
            "Camera and robot were matched on these same frames: an error common to all of them, "
            "such as a wrong scale of robot or board, would not show. Check with a known length."
        )


def _outliers(data: ReportData) -> Iterator[str]:
    for frame in ((data.calibration or {}).get("robot") or {}).get("outliers") or []:
        yield f"Frame {frame}: the logged pose disagrees with the picture; look at that frame."
