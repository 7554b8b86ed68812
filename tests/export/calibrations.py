"""Contents of calibration.json to export, as small as the contract allows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from calib.chain.projection import project
from calib.views import FloatArray
from cell.verbs.export import Camera

STILL: dict[str, Any] = {
    "schema": "cell.calibration/1",
    "recording": "bench",
    "image_size_px": [4096, 3072],
    "distance_range_m": [0.36, 0.91],
    "solutions": {
        "zhang_mle": {"alpha_px": 4700.0, "beta_px": 4710.0, "u0_px": 2050.0, "v0_px": 1550.0,
                      "skew_px": 0.3, "k1": -0.08, "k2": 0.05},
        "joint_ml": {"alpha_px": 4755.8123, "beta_px": 4789.1456, "u0_px": 2052.3, "v0_px": 1548.5,
                     "skew_px": 0.0, "k1": -0.11, "k2": 0.057, "at_distance_m": None},
    },
}  # fmt: skip
MOVING = STILL | {
    "focus_law": {
        "law": "inverse_square",
        "parameters": {"alpha0_px": {"value": 4760.0, "sigma": 0.4, "unit": "px"},
                       "k_px_m2": {"value": 57.0, "sigma": 0.3, "unit": "px m^2"}},
    },
    "zones": {"near_limit_m": 0.6, "far_limit_m": 0.91, "alpha_px": 4700.0, "beta_px": 4705.0,
              "method": "tolerance"},
}  # fmt: skip
FOCUS = {
    "law": "thin_lens",
    "parameters": {"alpha_inf_px": {"value": 4600.0}, "beta_inf_px": {"value": 4646.0},
                   "f_m": {"value": 0.018}},
}  # fmt: skip
DISTORTIONS: dict[str, dict[str, float]] = {
    "two radial": {"k1": -0.11, "k2": 0.057},
    "decentred": {"k1": -0.11, "k2": 0.057, "p1": 0.0011, "p2": -0.0007},
    "three radial": {"k1": -0.11, "k2": 0.057, "p1": 0.0011, "p2": -0.0007, "k3": -0.02},
    "rational": {"k1": 0.3, "k2": 0.1, "p1": 1e-3, "k3": 0.01, "k4": 0.4, "k5": 0.05, "k6": 0.02},
    "thin prism": {"k1": -0.1, "s1": 1e-3, "s2": -2e-3, "s3": 5e-4, "s4": 1e-3},
}


def with_joint(content: dict[str, Any], **values: Any) -> dict[str, Any]:
    """The content with other values in its joint solution."""
    joint = content["solutions"]["joint_ml"] | values
    return content | {"solutions": content["solutions"] | {"joint_ml": joint}}


def write(folder: Path, content: dict[str, Any]) -> Path:
    path = folder / "calibration.json"
    path.write_text(json.dumps(content))
    return path


POINTS_M = np.stack(np.meshgrid(np.linspace(-0.38, 0.38, 9), np.linspace(-0.29, 0.29, 7)), -1)
POINTS_M = np.concatenate([POINTS_M.reshape(-1, 2), np.ones((63, 1))], axis=1) * 0.7


def own_projection(camera: Camera) -> FloatArray:
    """(63, 2) where the project's own chain puts the test points, all over the image."""
    return project(camera.optics[None], np.eye(4)[None], POINTS_M)[0]
