"""Whether other frames of the same cell would have given the same calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from cell.views.numbers import number, probability
from cell.views.report import html
from cell.views.report.data import ReportData

_QUANTITIES = {
    "alpha_px": "focal length α",
    "alpha_near_px": "focal length α, nearest",
    "alpha_far_px": "focal length α, farthest",
    "depth_near_m": "depth at the work piece, nearest",
    "depth_far_m": "depth at the work piece, farthest",
    "principal_point_px": "principal point",
    "board_in_camera_m": "where a logged pose has the board seen",
    "camera_position_m": "camera's place",
    "camera_turn_rad": "camera's turn",
    "board_position_m": "board's place",
    "board_turn_rad": "board's turn",
}


def cross_validation_sentences(data: ReportData) -> Iterator[str]:
    """For the first screen: the verdict in words, or why a fit with the robot has none."""
    calibration = data.calibration or {}
    found = calibration.get("cross_validation")
    reason = (calibration.get("missing") or {}).get("cross_validation")
    if found:
        yield found["why"]
    elif reason and (calibration.get("robot") or {}).get("source"):
        yield f"Not cross-validated: {reason}."


def cross_validation(calibration: Mapping[str, Any]) -> str:
    """The verdict, what the folds move, what frames held out are missed by, and single frames."""
    found = calibration.get("cross_validation")
    heading = "<h3>Would other frames have given the same?</h3>"
    if not found:
        reason = (calibration.get("missing") or {}).get("cross_validation", "no joint fit")
        return heading + html.missing(f"Not cross-validated: {reason}.")
    return "".join(
        (
            heading,
            html.paragraph(found["why"]),
            _moves(found),
            _held_out(found["held_out"]),
            _frames(found["influential_frames"]),
            html.paragraph(_how(found), "small"),
        )
    )


def _moves(found: Mapping[str, Any]) -> str:
    head = ("quantity", "largest move (sigmas of it)", "moves, times as stated", "by chance",
            "drift, by chance")  # fmt: skip
    rows = [
        (_QUANTITIES.get(m["quantity"], m["quantity"]), number(m["largest_z"], "", 2),
         number(m["factor"], "", 2), f"p {probability(m['p_value'])}",
         f"p {probability(m['drift_p_value'])}")
        for m in found["estimates"]
    ]  # fmt: skip
    return html.table(head, rows, "Fits without a fifth of the frames against the fit of all")


def _held_out(held: Mapping[str, Any]) -> str:
    low, high = held["expected_band_px"]
    rows = [
        ("distance from the logged pose's prediction, RMS", number(held["rms_px"], "px"),
         number(held["expected_px"], "px"), f"{number(low, '')} to {number(high, 'px')}"),
        *((label, number(held[key]["per_freedom"]), "1",
           " to ".join(number(edge) for edge in held[key]["band"]))
          for key, label in (("robot", "robot's poses, χ² per degree of freedom"),
                             ("picture", "pictures alone, χ² per degree of freedom"))),
    ]  # fmt: skip
    head = ("frames held out", "found", "expected", "99 of 100 within")
    return html.table(head, rows, "Every frame predicted by the fit that had no say of it")


def _frames(found: list[Mapping[str, Any]]) -> str:
    if not found:
        return ""
    rows = [
        (f"frame {f['frame']}", _QUANTITIES.get(f["quantity"], f["quantity"]),
         number(f["sigmas"], "", 2), number(f["z"], "", 2))
        for f in found
    ]  # fmt: skip
    head = ("without", "moves", "by sigmas of the fit", "by sigmas of such a move")
    return html.fold(f"Frames that carry an estimate ({len(found)})", html.table(head, rows))


def _how(found: Mapping[str, Any]) -> str:
    return (
        f"{len(found['folds'])} folds, each with frames of all distances, the earliest in the "
        "first; the same numbers free, noise levels kept. A fold's fit may differ from the fit of "
        "all by the root of the difference of their variances: 1 is as stated. More means that "
        "corners of one frame, or frames taken one after the other, err together (a board that is "
        "not flat, a lens that the model does not follow, an arm that warms up) and are counted as "
        "if they did not. Noise levels were estimated from these same frames: frames held out "
        "come out near 1 unless they differ in kind. An error common to all frames does not show."
    )
