"""How uncertain the camera itself is where it is used, and what the views cannot distinguish."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from calib.calibration.verdict_messages import listed
from cell.views.numbers import millimetres, number
from cell.views.report import html
from cell.views.report.data import ReportData
from cell.views.report.sections.cross_validation import cross_validation


def uncertainty(data: ReportData) -> str:
    """Table over the distances, map over the image, and the combinations that are weak."""
    calibration = data.calibration or {}
    return html.section(
        "uncertainty",
        "Uncertainty of the camera, and what the views cannot distinguish",
        _uncertainty_map(calibration.get("uncertainty")),
        _not_separable(calibration),
        cross_validation(calibration),
    )


def uncertainty_sentences(data: ReportData) -> Iterator[str]:
    """For the first screen: the camera's own part in millimetres, and each weak combination."""
    calibration = data.calibration or {}
    found = calibration.get("uncertainty")
    if found:
        metres = np.linalg.norm(found["workpiece_sigma_m"], axis=2)
        yield (
            f"The calibration's own uncertainty puts a part off by {millimetres(_rms(metres[0]))} "
            f"at {number(found['distance_m'][0], 'm')} and {millimetres(_rms(metres[-1]))} at "
            f"{number(found['distance_m'][-1], 'm')} (one sigma, image's mean)."
        )
    for weak in calibration.get("not_separable") or ():
        message = f"These views hardly distinguish {listed(quantity_names(weak['quantities']))}"
        more = weak["separate_with"]
        helps = f"; {more}." if more.startswith("none") else f": record {more} as well."
        yield message + helps


_FRAMES = {
    "flange_from_camera": "the camera's {} on the flange",
    "base_from_camera": "the camera's {} in the base",
    "base_from_board": "the board's {} in the base",
    "flange_from_board": "the board's {} on the flange",
}
_NUMBERS = {
    "alpha_px": "the focal length α",
    "beta_px": "the focal length β",
    "u0_px": "the principal point u0",
    "v0_px": "the principal point v0",
    "k1": "the distortion k1",
    "k2": "the distortion k2",
}


def quantity_names(names: Sequence[str]) -> list[str]:
    """The numbers of a calibration as a reader knows them."""
    reported = []
    for name in names:
        frame, _, axis = name.partition(".")
        what = f"turn about {axis[1:]}" if axis.startswith("r") else f"place along {axis}"
        reported.append(
            _FRAMES[frame].format(what) if frame in _FRAMES else _NUMBERS.get(name, name)
        )
    return reported


def _uncertainty_map(found: Mapping[str, Any] | None) -> str:
    if not found:
        return html.missing("The camera's uncertainty is not known: no joint fit with the robot.")
    head = ("distance", "pixels: mean, worst (px)", "across (mm)", "along the axis (mm)",
            "worst in the image (mm)")  # fmt: skip
    pixels = np.linalg.norm(found["projection_sigma_px"], axis=2)
    metres = np.array(found["workpiece_sigma_m"])
    rows = [
        (number(d, "m"), f"{number(_rms(px), '', 2)}, {number(px.max(), '', 2)}",
         *(number(1e3 * value, "", 2) for value in _axes(m)))
        for d, px, m in zip(found["distance_m"], pixels, metres, strict=True)
    ]  # fmt: skip
    message = (
        "One sigma, from the full covariance of lens, focus law and the camera's place on the "
        "robot. Pixels: where a thing appears that the robot has the place of. Millimetres: where "
        "the robot takes a part to be that one picture located, without that picture's own corner "
        "noise and the robot's repeatability. What the model leaves out is not in them."
    )
    return html.table(head, rows) + html.paragraph(message, "small") + _map(found, metres)


def _axes(sigma_m: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, float, float]:
    """Across, along and worst, metres, of (G, 3) one sigma."""
    across = np.linalg.norm(sigma_m[:, :2], axis=1)
    return _rms(across), _rms(sigma_m[:, 2]), float(np.linalg.norm(sigma_m, axis=1).max())


def _map(found: Mapping[str, Any], sigma_m: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """Every place in the image at every distance, to be opened."""
    head = ("place in the image (px)", *(number(d, "m") for d in found["distance_m"]))
    total_mm = 1e3 * np.linalg.norm(sigma_m, axis=2)
    rows = [
        (f"{u:.0f}, {v:.0f}", *(number(mm, "", 2) for mm in total_mm[:, k]))
        for k, (u, v) in enumerate(found["pixels_px"])
    ]
    caption = "Uncertainty at the work piece (mm), all axes together"
    return html.fold("Map over image and distance", html.table(head, rows, caption))


def _not_separable(calibration: Mapping[str, Any]) -> str:
    found = calibration.get("not_separable")
    if found is None:
        return html.missing("Whether the views determine everything was not worked out.")
    if not found:
        if not (calibration.get("robot") or {}).get("source"):
            return html.missing("Without a joint fit it is not known what goes together.")
        return html.paragraph("The views distinguish all fitted quantities.")
    head = ("hardly distinguished", "times worse than each alone", "record as well",
            "four such views help")  # fmt: skip
    rows = [
        (listed(quantity_names(w["quantities"])), number(w["inflation"], "", 2), w["separate_with"],
         f"{number(w['gain'], '', 2)} times")
        for w in found
    ]  # fmt: skip
    return html.table(head, rows, "What the views see nearly only together")


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
