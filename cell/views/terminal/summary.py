"""A calibration in a few lines for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cell.views.answer_text import answer_text
from cell.views.unnamed import look_at, sentence

_NAMES = {
    "zhang_algebraic": "Zhang, algebraic",
    "zhang_mle": "Zhang, maximum likelihood",
    "zhang_mle_no_skew": "Zhang, maximum likelihood, no skew",
    "fixed_alpha_algebraic": "fixed scale factors, algebraic",
    "fixed_alpha_mle": "fixed scale factors, maximum likelihood",
    "joint_ml": "joint with the robot",
}


def calibration_summary(calibration: Mapping[str, Any], *, answer: bool = True) -> str:
    """What `calibration.json` says, for people; the answer last."""
    used, rejected = calibration["frames_used"], calibration["frames_rejected"]
    lines = [f"{_count(used)} frames used, {len(rejected)} rejected"]
    law = calibration.get("focus_law")
    if law:
        values = ", ".join(f"{name} = {p['value']:.6g}" for name, p in law["parameters"].items())
        lines.append(f"focus law {law['law']}: {values}")
    lines.append(f"{'':52}{'rms px,':>12}{'camera against':>18}")
    lines.append(f"{'solution':42}{'alpha px':>10}{'poses free':>12}{'robot, rms mm':>18}")
    lines += [_solution(name, found) for name, found in calibration["solutions"].items()]
    checked = calibration.get("cross_validation")
    if checked:
        lines.append(f"cross-validation: {checked['why']}")
    elif (calibration.get("robot") or {}).get("source") and "cross_validation" in calibration.get(
        "missing", {}
    ):
        lines.append(f"not cross-validated: {calibration['missing']['cross_validation']}")
    return "\n".join([*lines, answer_line(calibration)] if answer else lines)


def answer_line(calibration: Mapping[str, Any]) -> str:
    """For which distances the camera may be used, with what error."""
    return f"answer: {answer_text(calibration.get('answer'))}"


def warning_lines(calibration: Mapping[str, Any]) -> list[str]:
    """What is known to be wrong or undetermined, a line each."""
    return [
        f"warning: {w['what']} ({w['where']}). {w['remedy'][:1].upper()}{w['remedy'][1:]}"
        for w in calibration.get("warnings") or ()
    ]


def undetermined_text(calibration: Mapping[str, Any]) -> str | None:
    """What the data do not determine, or None."""
    names = {"camera": "the camera", "hand_eye": "the camera's place on the robot"}
    parts = [names[part] for part in calibration.get("undetermined") or ()]
    if not parts:
        return None
    return f"not determined: {' and '.join(parts)}; the warnings say why and what to do"


def diagnosis_summary(diagnosis: Mapping[str, Any]) -> str:
    """What `diagnosis.json` says, for people."""
    lines = [f"verdict: {diagnosis['verdict']}"]
    holdout = diagnosis.get("holdout")
    if holdout:
        before, after, noise = (holdout[k] for k in ("rms_px_before", "rms_px_after", "noise_px"))
        lines.append(
            f"frames held out: {before:.3f} px before, {after:.3f} px after; noise {noise:.3f} px"
            " (poses tied to the robot)"
        )
    lines += [f"- {effect['name']}: {effect['physics']}" for effect in diagnosis["effects"]]
    for left in diagnosis.get("unexplained_all") or ():
        lines.append(f"- without a name: {sentence(left)}")
        if left.get("law"):
            lines.append(f"  {left['law']['equation']}")
        lines.append(f"  {look_at(left)}")
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
    return f"{label:42}{found['alpha_px']:>10.1f}{rms:>12.3f}{off:>18}"
