"""The parts of the page that the run itself states, as plain JSON values."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cell.sequencer.session import header_of
from cell.sequencer.watcher import Checked
from cell.storage.files.plan_file import Plan, Until
from cell.storage.files.provenance import provenance
from cell.views.provenance_text import run_provenance_text
from cell.views.running_estimate.estimate import Estimate
from drivers.camera import Frame

_CAMERA = {
    "exposure_s": "exposure",
    "gain_db": "gain",
    "focus_position": "focus position",
    "focus_distance_m": "focus distance",
    "temperature_c": "temperature",
}
_UNITS = {"exposure_s": "s", "gain_db": "dB", "focus_distance_m": "m", "temperature_c": "°C"}


def run_part(plan: Plan, *, simulated: bool, folder: str) -> dict[str, Any]:
    """What does not change during a run."""
    cell = plan.cell
    return {
        "name": plan.file.name,
        "cell": cell.name,
        "arm": cell.robot.model,
        "camera": cell.camera.model,
        "simulated": simulated,
        "folder": folder,
        "provenance": run_provenance_text(
            provenance(header_of(plan, simulated=simulated).as_mapping())
        ),
        "goal_px": plan.file.until.alpha_sigma_px if plan.file.until else None,
    }


def camera_part(frame: Frame) -> dict[str, Any]:
    """The camera's settings as read back with a frame."""
    given = {key: getattr(frame, key) for key in _CAMERA}
    return {
        "values": [
            {"name": _CAMERA[key], "value": f"{value:.4g} {_UNITS.get(key, '')}".strip()}
            for key, value in given.items()
            if value is not None
        ]
    }


def frame_part(checked: Checked, number: int, view: str, plan: Plan) -> dict[str, Any]:
    """A frame's corners and what its check found."""
    height, width = checked.shot.frame.image.shape[:2]
    found, checks = checked.verdict.detection, plan.file.checks
    content: dict[str, Any] = {
        "number": number,
        "view": view,
        "width": width,
        "height": height,
        "fault": checked.verdict.fault,
        "kept": checked.record is not None,
        "max_blur_px": checks.max_blur_px,
        "max_saturated": checks.max_saturated,
    }
    if found is not None:
        content |= {
            "corners": [
                None if math.isnan(u) else [round(u, 1), round(v, 1)]
                for u, v in found.corners_px.tolist()
            ],
            "columns": plan.cell.board.board().cols,
            "blur_px": round(found.frame_blur_px, 2),
            "saturated": round(found.saturated, 4),
        }
    return content


def estimate_part(
    estimate: Estimate, history: tuple[tuple[int, float], ...], until: Until | None
) -> dict[str, Any]:
    """How well the scale factor is known, and what is lacking."""
    rows = np.round(np.stack([estimate.distance_m, estimate.alpha_px, estimate.sigma_px], 1), 4)
    return {
        "frames": estimate.frames,
        "used": estimate.used,
        "missing": estimate.missing,
        "lacks": list(estimate.lacks),
        "goal_px": until.alpha_sigma_px if until else None,
        "min_views": until.min_views if until else None,
        "history": [[frames, round(sigma, 4)] for frames, sigma in history],
        "by_distance": rows.tolist(),
    }
