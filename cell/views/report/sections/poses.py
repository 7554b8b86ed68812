"""Arm and mount: where the camera was, by the robot and by each solution."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cell.views.numbers import (
    UNKNOWN,
    known,
    measured,
    millimetres,
    number,
    solution_name,
)
from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.figures import camera_positions, position_errors
from cell.views.report.sections.drawing import drawing

_NO_ROBOT = "No flange pose was logged, so the camera's true positions are not known."


def poses(data: ReportData) -> str:
    """Camera positions, their errors, and the two poses solved with them."""
    positions = drawing(
        lambda: camera_positions.draw(data),
        "Camera positions in the board's frame: stars where the arm carried the camera, open "
        "marks where the pictures put it. Compare Fig. 3 of the paper.",
        "No camera poses are at hand to draw.",
    )
    errors = drawing(
        lambda: position_errors.draw(data),
        "Camera position, computed less true, in the true camera's axes (z along the optical "
        "axis, positive towards the board). Compare Figs. 4 and 15 of the paper.",
        _NO_ROBOT,
    )
    title = "Arm and mount: where the camera was"
    return html.section(
        "arm", title, positions, errors, _agreement(data), _solved(data), _noise(data)
    )


def _agreement(data: ReportData) -> str:
    """Every solution against the robot: by the common yardstick, and by its own, kinder one."""
    rows = [
        (solution_name(name), *_agrees(solution))
        for name, solution in data.solutions.items()
        if solution.get("camera_position_error_m")
    ]
    if not rows:
        return ""
    head = ("solution", "camera RMS (mm)", "own hand-eye: camera RMS (mm)",
            "own hand-eye: board RMS (mm)", "turn RMS (°)", "robot's distances used")  # fmt: skip
    return html.table(head, rows, "Agreement with the robot") + html.paragraph(
        "The first column holds every solution against the same hand-eye and board poses, those of "
        "the joint fit. “Own hand-eye” solves them anew from that solution alone, which hides "
        "constant errors. Where the robot's distances were used, agreement along the optical axis "
        "is built in and proves nothing by itself.",
        "small",
    )


def _agrees(solution: Mapping[str, Any]) -> tuple[str, ...]:
    error = solution["camera_position_error_m"]
    own, consistency = error.get("own_hand_eye") or {}, solution.get("robot_consistency") or {}
    used = error.get("robot_in_it")
    return (
        number(_thousandths(error.get("rms"))),
        number(_thousandths(own.get("rms"))),
        number(_thousandths(consistency.get("rms_m"))),
        number(_degrees(consistency.get("rms_rad"))),
        UNKNOWN if used is None else ("yes" if used else "no"),
    )


def _noise(data: ReportData) -> str:
    robot = (data.calibration or {}).get("robot") or {}
    if not robot.get("source"):
        return ""
    outliers = ", ".join(str(frame) for frame in robot.get("outliers") or []) or "none"
    message = (
        f"Noise the joint fit estimated: flange {millimetres(robot.get('flange_sigma_m'))} and "
        f"{number(_degrees(robot.get('flange_sigma_rad')), '°', 2)} per axis, corners "
        f"{number(robot.get('corner_sigma_px'), 'px', 2)}. Frames whose logged pose disagrees with "
        f"their picture: {outliers}."
    )
    return html.paragraph(message)


def _thousandths(value: float | None) -> float | None:
    return value * 1e3 if known(value) else None


def _degrees(value: float | None) -> float | None:
    return math.degrees(value) if known(value) else None


def _solved(data: ReportData) -> str:
    calibration, why = data.calibration or {}, data.why_missing("robot")
    names = ("flange_from_camera", "base_from_board", "flange_from_board", "base_from_camera")
    rows = [_pose_row(name, calibration[name]) for name in names if calibration.get(name)]
    if not rows:
        return html.missing(f"The camera's place on the flange was not solved: {why}.")
    head = ("pose", "x", "y", "z", "quaternion x, y, z, w", "± turn")
    return html.table(head, rows, "Solved together with the camera, one-sigma uncertainties")


def _pose_row(name: str, pose: Mapping[str, Any]) -> tuple[str, ...]:
    sigma = _three(pose.get("sigma_p_m"))
    turn = pose.get("sigma_r_rad")
    turn = max(_three(turn)) if isinstance(turn, list) else turn
    position = (measured(value, each, "m") for value, each in zip(pose["p_m"], sigma, strict=True))
    quaternion = ", ".join(f"{q:.5f}".replace("-", "−") for q in pose["q_xyzw"])
    shown = "not known" if turn is None else f"{math.degrees(turn):.2g}°"
    return (name, *position, quaternion, shown)


def _three(sigma: object) -> list[float]:
    """Three sigmas, where the file gives one for all axes or none."""
    if isinstance(sigma, list):
        return sigma
    return [float(sigma)] * 3 if isinstance(sigma, int | float) else [math.nan] * 3
