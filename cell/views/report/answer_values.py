"""The answer: for which distances the camera may be used, with what error at the work piece.

It is worked out once beside the calibration and stands in `calibration.json`; terminal, report
and page show these numbers and no others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from cell.views.answer_text import SIGMAS, dominant
from cell.views.report.data import ReportData
from cell.views.report.workpiece_error import WorkpieceError, of_solution


def answer_of(data: ReportData) -> dict[str, Any] | None:
    """`answer` of the calibration; worked out where it does not stand there yet."""
    if data.calibration is None:
        return None
    stored = data.calibration.get("answer")
    return dict(stored) if stored else work_out(data)


def work_out(data: ReportData) -> dict[str, Any]:
    """The answer's numbers; None for what is not determined, with the reason in `limits`."""
    calibration = data.calibration or {}
    undetermined = calibration.get("undetermined") or {}
    best = None if data.recommended is None else of_solution(data, data.recommended)
    usable = None if "camera" in undetermined else usable_m(data, best)
    error = None
    if best is not None and not undetermined:
        shared = shared_sigma_m(calibration)
        error = {
            "p95": float(np.hypot(best.p95_m, SIGMAS * (shared or 0.0))),
            "rms": float(np.hypot(best.rms_m, shared or 0.0)),
            "each_picture_p95": best.p95_m,
            "each_picture_rms": best.rms_m,
            "calibration_sigma": shared,
            "against": best.against,
        }
    return {
        "usable_distances_m": None if usable is None else [float(usable[0]), float(usable[1])],
        "error_at_work_piece_m": error,
        "limits": list(_limits(data, usable, error)),
    }


def usable_m(data: ReportData, best: WorkpieceError | None) -> tuple[float, float] | None:
    """The range of distances the calibration vouches for, metres.

    Where the scale factor's dependence on distance is modelled, that is the range seen; where it
    is taken as constant, zone 2. Without flange poses, what the pictures alone say.
    """
    calibration = data.calibration or {}
    seen = [f["distance_m"] for f in calibration.get("scale_factors") or []]
    if best is not None:
        seen += [float(best.distance_m.min()), float(best.distance_m.max())]
    if not seen:
        by_pictures = calibration.get("distance_range_m")
        return None if by_pictures is None else (by_pictures[0], by_pictures[1])
    low, high = min(seen), max(seen)
    zones: dict[str, Any] = calibration.get("zones") or {}
    law = (calibration.get("focus_law") or {}).get("law")
    if law == "constant":
        if not zones.get("near_is_bound"):
            low = max(low, zones.get("near_limit_m") or low)
        if not zones.get("far_is_bound"):
            high = min(high, zones.get("far_limit_m") or high)
    return low, high


def shared_sigma_m(calibration: Mapping[str, Any]) -> float | None:
    """One sigma at the work piece that all pictures share: image's mean, worst distance."""
    found = shared_by_distance(calibration)
    return None if found is None else float(found[1].max())


def shared_by_distance(
    calibration: Mapping[str, Any],
) -> tuple[np.ndarray[Any, np.dtype[np.float64]], np.ndarray[Any, np.dtype[np.float64]]] | None:
    """(D,) distances and the one sigma there that all pictures share, metres; None if unknown."""
    found = calibration.get("uncertainty")
    if not found:
        return None
    sigma = np.linalg.norm(np.array(found["workpiece_sigma_m"]), axis=2)
    return np.array(found["distance_m"]), np.sqrt((sigma**2).mean(axis=1))


def _limits(
    data: ReportData, usable: tuple[float, float] | None, error: Mapping[str, Any] | None
) -> Iterator[str]:
    calibration = data.calibration or {}
    yield from (calibration.get("undetermined") or {}).values()
    if usable is not None:
        yield f"outside {usable[0]:.2f} to {usable[1]:.2f} m no view was taken"
    if error is not None:
        part = dominant(error)
        if part is not None:
            yield part
    elif not data.views.has_pose.any():
        yield "no flange pose was logged, so the error in millimetres is not known"
