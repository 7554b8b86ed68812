"""JSON: everything that is known of the camera, a focal length that moves included."""

from __future__ import annotations

import json
from typing import Any

from cell.storage.files.calibration_source import DISTORTION, CalibrationSource
from cell.verbs.export.focal_length import focal_lengths_px, moving_law

SCHEMA = "cell.camera/1"
TRANSFORMS = ("flange_from_camera", "base_from_board", "flange_from_board", "base_from_camera")


def json_text(calibration: CalibrationSource, name: str, distance_m: float | None) -> str:
    """The camera as one JSON object; `focus` says how alpha and beta move where they do.

    With a distance, alpha and beta are those there and `focus` is null: the same fixed camera
    that the other formats get. Without, they hold at `distance_m` of the object.
    """
    solution, law = calibration.solution(name), moving_law(calibration, name)
    alpha, beta = solution.alpha_px, solution.beta_px
    if distance_m is not None:
        alpha, beta = focal_lengths_px(calibration, name, distance_m)
    at = distance_m if distance_m is not None else solution.at_distance_m
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "recording": calibration.recording,
        "solution": name,
        "pixel_origin": "centre of the top-left pixel",
        "image_size_px": calibration.image_size_px,
        "projection": solution.projection,
        "alpha_px": alpha,
        "beta_px": beta,
        "u0_px": solution.u0_px,
        "v0_px": solution.v0_px,
        "skew_px": solution.skew_px,
        "distortion": dict(zip(DISTORTION, solution.distortion, strict=True)),
        "distance_m": at if law is not None else None,
        "focus": None if law is None or distance_m is not None else law.model_dump(),
        "distance_range_m": calibration.range_m,
        "sigma": solution.sigma,
    }
    for frame in TRANSFORMS:
        transform = getattr(calibration, frame)
        content[frame] = None if transform is None else transform.model_dump()
    return json.dumps(content, indent=2) + "\n"
