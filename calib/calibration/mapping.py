"""A calibration as plain dicts and lists: the content of `calibration.json`."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calib.calibration.caution import Caution
from calib.calibration.cross_validation import CrossValidation
from calib.calibration.held_out import ChiSquare, HeldOut
from calib.calibration.identifiability import Weakness
from calib.calibration.result import (
    Calibration,
    Covariance,
    Focus,
    PositionError,
    RobotReference,
    Solution,
    Statistics,
)
from calib.calibration.uncertainty import UncertaintyMap
from calib.calibration.verdict_messages import why
from calib.paper.focus_law import FocusLaw
from calib.paper.scale_factors import ScaleFactor
from calib.paper.zones import Zones
from calib.views import FloatArray

SCHEMA = "cell.calibration/1"

ROBOT_IN_IT = ("fixed_alpha_algebraic", "fixed_alpha_mle", "joint_ml")
"""Solutions made with the robot's distances: their error along the axis against that same robot
is small by construction, and proves nothing by itself."""

TRANSFORMS = {
    "eye_in_hand": ("flange_from_camera", "base_from_board"),
    "eye_to_hand": ("flange_from_board", "base_from_camera"),
}
"""What the chain's `flange_from_mounted` and `base_from_fixed` are called in the file."""


def as_mapping(calibration: Calibration, recording: str) -> dict[str, Any]:
    """`calibration.json` of a recording of that name; what is unknown is None."""
    c = calibration
    law = None if c.focus_law is None else c.focus_law.preferred
    return {
        "schema": SCHEMA,
        "recording": recording,
        "image_size_px": list(c.image_size_px),
        "distance_range_m": list(c.distance_range_m),
        "frames_used": [int(f) for f in c.frame[c.used]],
        "frames_rejected": [{"frame": r.frame, "reason": r.reason} for r in c.rejected],
        "corners_left_out": [
            {"frame": int(f), "corners": np.flatnonzero(w).tolist()}
            for f, w in zip(c.frame, c.wrong, strict=True)
            if w.any()
        ],
        "scale_factors": [_scale_factor(f) for f in c.scale_factors],
        "zones": None if c.zones is None else _zones(c.zones),
        "zones_reason": c.missing.get("zones"),
        "focus_law": None if law is None else _law(calibration, law),
        "solutions": {name: _solution(c, name) for name in c.solutions},
        **_transforms(c.robot),
        "robot": {} if c.robot is None else _robot(c.robot),
        "uncertainty": None if c.uncertainty is None else _uncertainty(c.uncertainty),
        "cross_validation": None
        if c.cross_validation is None
        else _cross_validation(c.cross_validation),
        "not_separable": [_weakness(w) for w in c.weaknesses],
        "warnings": [{"what": w.what, "where": w.where, "remedy": w.remedy} for w in c.cautions],
        "undetermined": _undetermined(c.cautions),
        "missing": dict(c.missing),
    }


def _undetermined(cautions: tuple[Caution, ...]) -> dict[str, str]:
    """Why each part is not determined, by the first caution that says so."""
    found: dict[str, str] = {}
    for caution in cautions:
        for part in caution.undetermined:
            found.setdefault(part, caution.what)
    return found


def _cross_validation(found: CrossValidation) -> dict[str, Any]:
    return {
        "verdict": found.verdict,
        "why": why(found),
        "factor": found.factor,
        "folds": [list(frames) for frames in found.folds],
        "held_out": _held_out(found.held_out),
        "estimates": [dict(vars(move)) for move in found.moves],
        "influential_frames": [dict(vars(pull)) for pull in found.pulls],
    }


def _held_out(held: HeldOut) -> dict[str, Any]:
    band = np.sqrt(held.miss.band)
    return {
        "rms_px": held.rms_px,
        "expected_px": held.expected_px,
        "expected_band_px": (held.expected_px * band).tolist(),
        "robot": _chi_square(held.robot),
        "picture": _chi_square(held.picture),
    }


def _chi_square(found: ChiSquare) -> dict[str, Any]:
    return {"per_freedom": found.each, "freedom": found.freedom, "band": list(found.band)}


def _weakness(weakness: Weakness) -> dict[str, Any]:
    return {
        "quantities": list(weakness.quantities),
        "inflation": weakness.inflation,
        "separate_with": weakness.views,
        "gain": weakness.gain,
    }


def _uncertainty(found: UncertaintyMap) -> dict[str, Any]:
    return {name: value.tolist() for name, value in vars(found).items()}


def _scale_factor(factor: ScaleFactor) -> dict[str, Any]:
    names = ("frame", "distance_m", "alpha_px", "alpha_sigma_px", "beta_px", "beta_sigma_px")
    return {name: getattr(factor, name) for name in (*names, "tilt_rad")}


def _zones(zones: Zones) -> dict[str, Any]:
    return dict(vars(zones))


def _law(calibration: Calibration, law: FocusLaw) -> dict[str, Any]:
    choice = calibration.focus_law
    assert choice is not None
    return {
        "law": law.law,
        "parameters": _parameters(law),
        "beta_parameters": {}
        if calibration.beta_law is None
        else _parameters(calibration.beta_law),
        "why": choice.why,
        "decisive": choice.decisive,
        "candidates": [
            {
                "law": c.law,
                "aicc": c.aicc if np.isfinite(c.aicc) else None,
                "bic": c.bic,
                "scatter": c.scatter,
                "parameters": _parameters(c),
            }
            for c in choice.candidates
        ],
    }


def _parameters(law: FocusLaw) -> dict[str, dict[str, Any]]:
    return {name: dict(vars(p)) for name, p in law.parameters.items()}


def _solution(calibration: Calibration, name: str) -> dict[str, Any]:
    solution: Solution = calibration.solutions[name]
    error = calibration.position_error.get(name)
    return {
        "projection": solution.projection,
        **solution.values,
        "domain": {
            "invertible_angle_rad": solution.invertible_rad,
            "supported_angle_rad": calibration.supported_rad[name],
        },
        "at_distance_m": solution.at_distance_m,
        "focus": None if solution.focus is None else _focus(solution.focus),
        "sigma": dict(solution.sigma),
        "covariance": _covariance(calibration, solution.covariance),
        "reprojection_px": solution.reprojection_px,
        "camera_position_error_m": None if error is None else _position_error(name, error),
        "robot_consistency": None if error is None else _consistency(error),
    }


def _focus(focus: Focus) -> dict[str, Any]:
    return {"law": focus.law, "parameters": {n: dict(vars(p)) for n, p in focus.parameters.items()}}


def _covariance(calibration: Calibration, found: Covariance | None) -> dict[str, Any] | None:
    if found is None:
        return None
    mount = "eye_in_hand" if calibration.robot is None else calibration.robot.mount
    frames = dict(zip(("flange_from_mounted", "base_from_fixed"), TRANSFORMS[mount], strict=True))
    names = []
    for name in found.names:
        frame, _, axis = name.partition(".")
        names.append(f"{frames[frame]}.{axis}" if frame in frames else name)
    return {"names": names, "matrix": found.matrix.tolist()}


def _statistics(error_m: FloatArray) -> dict[str, Any]:
    found = Statistics.of(error_m)
    return {"mean": list(found.mean), "std": list(found.std), "rms": found.rms}


def _position_error(name: str, error: PositionError) -> dict[str, Any]:
    return {
        **_statistics(error.common),
        "own_hand_eye": None if error.own is None else _statistics(error.own),
        "robot_in_it": name in ROBOT_IN_IT,
    }


def _consistency(error: PositionError) -> dict[str, float] | None:
    hand = error.hand_eye
    return None if hand is None else {"rms_m": hand.rms_m, "rms_rad": hand.rms_rad}


def _transforms(robot: RobotReference | None) -> dict[str, Any]:
    out: dict[str, Any] = {name: None for pair in TRANSFORMS.values() for name in pair}
    if robot is not None:
        mounted, fixed = TRANSFORMS[robot.mount]
        sigma = np.sqrt(np.maximum(np.diag(robot.covariance), 0.0))
        out[mounted] = _transform(robot.flange_from_mounted, sigma[:6])
        out[fixed] = _transform(robot.base_from_fixed, sigma[6:])
    return out


def _transform(a_from_b: FloatArray, sigma: FloatArray) -> dict[str, Any]:
    return {
        "p_m": a_from_b[:3, 3].tolist(),
        "q_xyzw": Rotation.from_matrix(a_from_b[:3, :3]).as_quat(canonical=True).tolist(),
        "sigma_p_m": sigma[:3].tolist(),
        "sigma_r_rad": sigma[3:].tolist(),
    }


def _robot(robot: RobotReference) -> dict[str, Any]:
    return {
        "mount": robot.mount,
        "source": robot.source,
        "focus_law": robot.law,
        "focus_law_gain_aic": robot.gain_aic,
        "flange_sigma_m": robot.flange_sigma_m,
        "flange_sigma_rad": robot.flange_sigma_rad,
        "corner_sigma_px": robot.corner_sigma_px,
        "outliers": list(robot.outliers),
    }
