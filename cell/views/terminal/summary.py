"""A calibration in a few lines for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_NAMES = {
    "zhang_algebraic": "Zhang, algebraic",
    "zhang_mle": "Zhang, maximum likelihood",
    "zhang_mle_no_skew": "Zhang, maximum likelihood, no skew",
    "fixed_alpha_algebraic": "fixed scale factors, algebraic",
    "fixed_alpha_mle": "fixed scale factors, maximum likelihood",
    "joint_ml": "joint with the robot",
}


def calibration_summary(calibration: Mapping[str, Any]) -> str:
    """What `calibration.json` says, for people."""
    used, rejected = calibration["frames_used"], calibration["frames_rejected"]
    lines = [f"{_count(used)} frames used, {len(rejected)} rejected"]
    law = calibration.get("focus_law")
    if law:
        values = ", ".join(f"{name} = {p['value']:.6g}" for name, p in law["parameters"].items())
        lines.append(f"focus law {law['law']}: {values}")
    lines.append(f"{'solution':42}{'alpha px':>10}{'rms px':>9}{'camera off by mm':>18}")
    lines += [_solution(name, found) for name, found in calibration["solutions"].items()]
    checked = calibration.get("cross_validation")
    if checked:
        lines.append(f"cross-validation: {checked['why']}")
    elif calibration.get("robot") and "cross_validation" in calibration.get("missing", {}):
        lines.append(f"not cross-validated: {calibration['missing']['cross_validation']}")
    return "\n".join(lines)


def diagnosis_summary(diagnosis: Mapping[str, Any]) -> str:
    """What `diagnosis.json` says, for people."""
    lines = [f"verdict: {diagnosis['verdict']}"]
    holdout = diagnosis.get("holdout")
    if holdout:
        before, after, noise = (holdout[k] for k in ("rms_px_before", "rms_px_after", "noise_px"))
        lines.append(
            f"frames held out: {before:.3f} px before, {after:.3f} px after; noise {noise:.3f} px"
        )
    lines += [f"- {effect['name']}: {effect['physics']}" for effect in diagnosis["effects"]]
    return "\n".join(lines)


def _count(frames: Any) -> int:
    return frames if isinstance(frames, int) else len(frames)


def _solution(name: str, found: Mapping[str, Any] | None) -> str:
    label = _NAMES.get(name, name)
    if not found:
        return f"{label:42}{'-':>10}"
    error = found.get("camera_position_error_m") or {}
    off = f"{1e3 * error['rms']:.2f}" if error.get("rms") is not None else "-"
    rms = found["reprojection_px"]["rms"]
    return f"{label:42}{found['alpha_px']:>10.1f}{rms:>9.3f}{off:>18}"
