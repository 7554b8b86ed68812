"""The answer in sentences: the same for the terminal, the report and the page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cell.views.numbers import millimetres

SIGMAS = 2.0
"""Of what all pictures share, in the error that a work piece must allow."""

_DOMINATES = 2.0


def dominant(error: Mapping[str, Any]) -> str | None:
    """Which part of the error is the larger by far, as text."""
    shared, each = SIGMAS * (error.get("calibration_sigma") or 0.0), error["each_picture_p95"]
    if shared > _DOMINATES * each:
        return (
            "most of the error is the calibration's own uncertainty, which all pictures share:"
            " more views, and more different ones, lower it"
        )
    if each > _DOMINATES * shared:
        return "most of the error differs from picture to picture"
    return None


def answer_text(answer: Mapping[str, Any] | None) -> str:
    """The answer in a sentence or two."""
    if not answer:
        return "No calibration was made."
    usable, error = answer["usable_distances_m"], answer["error_at_work_piece_m"]
    limits = answer.get("limits") or []
    if usable is None:
        return "This camera cannot be used: " + "; ".join(limits or ["nothing is determined"]) + "."
    span = f"from {usable[0]:.2f} to {usable[1]:.2f} m"
    if error is None:
        why = "; ".join(w for w in limits if not w.startswith("outside")) or "it is not known why"
        return f"The calibration covers distances {span}. Its error at the work piece: {why}."
    each = millimetres(error["each_picture_p95"])
    parts = f"95 % of pictures stay below {each} against {error['against']}"
    if error.get("calibration_sigma") is not None:
        whole = millimetres(SIGMAS * error["calibration_sigma"])
        parts += f", and the calibration as a whole may be off by {whole} (two sigma)"
    return (
        f"Use this camera {span}, for work that allows {millimetres(error['p95'])} at the work"
        f" piece: {parts}."
    )
