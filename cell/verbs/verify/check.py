"""The whole check: from a recording and an old calibration to the content of `verify.json`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.chain.optics import COLUMN
from calib.errors import CalibrationError
from calib.paper.focus_law import LAWS, law_scale_px
from calib.views import FloatArray, Views
from cell.errors import InputError
from cell.storage.files.result_part import LeftOutPart
from cell.storage.files.verify_file import (
    SCHEMA,
    AlphaPart,
    BoardPart,
    DistancePart,
    FramePart,
    ImagePart,
    LengthPart,
    MountPart,
    NoisePart,
    NoticeablePart,
    Verdict,
    VerifyFile,
)
from cell.verbs.verify.judge import Judgement, judge
from cell.verbs.verify.length import KnownLength, LengthFound, measure
from cell.verbs.verify.messages import sentence_of
from cell.verbs.verify.misfit import Misfit, Place, by_distance, misfit_of, over_image
from cell.verbs.verify.notice import Noticeable, noticeable
from cell.verbs.verify.old_cell import OldCell

IntArray = NDArray[np.int64]
_ARM_ALARM = 1e-3
USUAL_TOLERANCE_M = 1e-3
CHANGED = ("moved", "lens_changed", "moved_and_lens_changed", "changed")
_NOISIER = 1.5
_ALPHA_DISTANCES = 3


@dataclass(frozen=True)
class Checked:
    """A check, with what its page draws.

    Attributes
    ----------
    content:
        What `verify.json` says.
    judgement, misfit:
        None where the pictures could not be held against the calibration.
    """

    content: VerifyFile
    judgement: Judgement | None
    misfit: Misfit | None


def check(
    old: OldCell,
    views: Views,
    *,
    calibration: str,
    recording: str,
    known: KnownLength | None,
    tolerance_m: float | None,
    left_out: dict[int, str],
) -> Checked:
    """Hold a recording's views against an old calibration.

    Parameters
    ----------
    calibration, recording:
        What they are called.
    known:
        A length measured by other means.
    tolerance_m:
        Error at the work piece that matters: a smaller change is no reason to calibrate anew, and
        the check must be able to notice a larger one. Where None, any change is one, and the check
        must notice one of `USUAL_TOLERANCE_M`.
    left_out:
        Frames without corners, and why.

    Raises
    ------
    InputError
        They cannot be of one cell, or the board has no such corners.
    """
    _same_camera(old, views)
    try:
        found = judge(old, views)
    except CalibrationError as error:
        return Checked(_nothing(calibration, recording, str(error), left_out), None, None)
    misfit = misfit_of(old, found)
    length = None if known is None else measure(old, found, misfit, known)
    notice = noticeable(old, found, misfit)
    verdict = _verdict(found, length, notice, tolerance_m or USUAL_TOLERANCE_M)
    if tolerance_m is not None and verdict in CHANGED and notice.workpiece_m < tolerance_m:
        inside = misfit.workpiece_m.max() < tolerance_m and not (length and length.wrong)
        verdict = "within_tolerance" if inside else verdict
    used = [int(frame) for frame in found.views.frame]
    content = VerifyFile(
        schema=SCHEMA,
        calibration=calibration,
        recording=recording,
        verdict=verdict,
        sentence="",
        p_value=found.p_value,
        frames_used=tuple(used),
        frames_left_out=_left_out(views, used, found, left_out),
        mount=_mount(old, found),
        alpha=_alpha(old, found, misfit),
        board=BoardPart(**vars(found.board)),
        noise=NoisePart(
            corner_px=found.noise.corner_px,
            corner_before_px=old.noise.corner_px,
            arm_scatter_ratio=found.arm_ratio,
            arm_p_value=found.arm_p_value,
        ),
        frames=_frames(found, misfit),
        distances=tuple(_distance(p) for p in by_distance(misfit, found.views)),
        image=tuple(_image(p) for p in over_image(misfit, found.views)),
        noticeable=NoticeablePart(**vars(notice), tolerance_m=tolerance_m or USUAL_TOLERANCE_M),
        length=None if length is None else _length(length),
        notes=_notes(old, found, length),
    )
    return Checked(content.model_copy(update={"sentence": sentence_of(content)}), found, misfit)


def _same_camera(old: OldCell, views: Views) -> None:
    size = (views.width_px, views.height_px)
    if size != old.image_size_px:
        sizes = " and ".join(f"{w} x {h}" for w, h in (old.image_size_px, size))
        raise InputError(f"calibration and recording are of images of {sizes}: not the same camera")
    if views.mount != old.mount:
        raise InputError(
            f"the calibration is of {old.mount}, the recording says mount: {views.mount}"
        )


def _nothing(calibration: str, recording: str, why: str, left_out: dict[int, str]) -> VerifyFile:
    return VerifyFile(
        schema=SCHEMA,
        calibration=calibration,
        recording=recording,
        verdict="cannot_tell",
        sentence=f"Whether the calibration still holds cannot be decided: {why}.",
        p_value=None,
        frames_used=(),
        frames_left_out=tuple(LeftOutPart(frame=f, reason=r) for f, r in left_out.items()),
    )


def _verdict(
    found: Judgement, length: LengthFound | None, notice: Noticeable, tolerance_m: float
) -> Verdict:
    if found.verdict != "good":
        return found.verdict
    if length is not None and length.wrong:
        return "length_wrong"
    if found.arm_p_value < _ARM_ALARM or notice.workpiece_m > tolerance_m:
        return "cannot_tell"
    return "good"


def _left_out(
    views: Views, used: list[int], found: Judgement, left_out: dict[int, str]
) -> tuple[LeftOutPart, ...]:
    reasons = dict(left_out)
    for index, frame in enumerate(views.frame.tolist()):
        if frame in used or frame in reasons:
            continue
        reasons[frame] = "no flange pose" if not views.has_pose[index] else "too few corners"
    reasons |= dict.fromkeys(found.wrong, "robot and picture disagree here as in no other frame")
    return tuple(LeftOutPart(frame=f, reason=r) for f, r in sorted(reasons.items()))


def _mount(old: OldCell, found: Judgement) -> MountPart | None:
    explanation = found.explanation
    at = np.flatnonzero(np.isin(explanation.at, old.group("mount")))
    if len(at) != 6:
        return None
    values, sigma = explanation.values[at], np.sqrt(np.diag(explanation.covariance)[at])
    return MountPart(
        shift_m=tuple(values[:3]),
        sigma_shift_m=tuple(sigma[:3]),
        turn_rad=tuple(values[3:]),
        sigma_turn_rad=tuple(sigma[3:]),
    )


def _alpha(old: OldCell, found: Judgement, misfit: Misfit) -> tuple[AlphaPart, ...]:
    explanation = found.explanation
    lens = np.flatnonzero(np.isin(explanation.at, old.group("lens")))
    if not len(lens):
        return ()
    near, far = float(misfit.distance_m.min()), float(misfit.distance_m.max())
    parts = []
    for distance in np.geomspace(near, far, _ALPHA_DISTANCES):
        before = _scale_px(old, np.zeros(len(lens)), explanation.at[lens], float(distance))
        change = (
            _scale_px(old, explanation.values[lens], explanation.at[lens], float(distance)) - before
        )
        gradient = _gradient(old, explanation.at[lens], float(distance))
        variance = float(gradient @ explanation.covariance[np.ix_(lens, lens)] @ gradient)
        parts.append(
            AlphaPart(
                distance_m=float(distance),
                alpha_px=before,
                change_px=change,
                sigma_px=float(np.sqrt(max(variance, 0.0))),
            )
        )
    return tuple(parts)


def _scale_px(old: OldCell, change: FloatArray, at: IntArray, distance_m: float) -> float:
    """Alpha at a distance after some of the lens's numbers changed."""
    alpha, bend = float(old.model.optics[COLUMN["alpha_px"]]), 0.0
    if old.model.effects:
        bend = float(old.model.effects[0].values[0])
    for k, by in zip(at, change, strict=True):
        unknown = old.unknowns[int(k)]
        if unknown.name == "alpha_px":
            alpha += float(by)
        elif unknown.place[0] == "effect":
            bend += float(by)
    law = str(old.model.effects[0].effect.law) if old.model.effects else "constant"
    return float(law_scale_px(law, np.array([alpha, bend])[: len(LAWS[law])], distance_m))


def _gradient(old: OldCell, at: IntArray, distance_m: float) -> FloatArray:
    out = np.zeros(len(at))
    for k, index in enumerate(at):
        step = np.zeros(len(at))
        step[k] = 1e-4 * old.unknowns[int(index)].typical
        ahead = _scale_px(old, step, at, distance_m)
        out[k] = (ahead - _scale_px(old, -step, at, distance_m)) / (2 * step[k])
    return out


def _frames(found: Judgement, misfit: Misfit) -> tuple[FramePart, ...]:
    rms = np.sqrt(np.nanmean((misfit.residual_px**2).sum(axis=2), axis=1))
    columns = (
        rms,
        *misfit.expected_each(),
        misfit.distance_m,
        misfit.lateral_m,
        misfit.workpiece_m,
    )
    names = ("rms_px", "sigma_px", "limit_px", "distance_m", "lateral_m", "workpiece_m")
    return tuple(
        FramePart(frame=int(frame), **{n: float(c[k]) for n, c in zip(names, columns, strict=True)})
        for k, frame in enumerate(found.views.frame)
    )


def _distance(place: Place) -> DistancePart:
    kept = ("corners", "rms_px", "sigma_px", "limit_px", "worst_px", "worst_at_px", "lateral_m")
    values = {name: getattr(place, name) for name in kept}
    return DistancePart(near_m=place.low[0], far_m=place.high[0], **values)


def _image(place: Place) -> ImagePart:
    kept = ("corners", "rms_px", "sigma_px", "limit_px", "mean_px", "lateral_m")
    values = {name: getattr(place, name) for name in kept}
    (left, top), (right, bottom) = place.low, place.high
    return ImagePart(from_px=(left, top), to_px=(right, bottom), **values)


def _length(found: LengthFound) -> LengthPart:
    return LengthPart(
        known_m=found.known.length_m,
        known_sigma_m=found.known.sigma_m,
        corners=found.known.corners,
        frames=found.frames,
        measured_m=found.measured_m,
        error_m=found.error_m,
        sigma_m=found.sigma_m,
        p_value=found.p_value,
    )


def _notes(old: OldCell, found: Judgement, length: LengthFound | None) -> tuple[str, ...]:
    notes = []
    if found.because:
        notes.append(found.because)
    if found.arm_p_value < _ARM_ALARM:
        notes.append(
            f"the arm's poses scatter {found.arm_ratio:.1f} times as much as when it was"
            " calibrated; the larger scatter is reckoned with here"
        )
    if found.noise.corner_px > _NOISIER * old.noise.corner_px:
        notes.append(
            f"corners scatter by {found.noise.corner_px:.3f} px, by {old.noise.corner_px:.3f} px"
            " when it was calibrated: look at focus, light and the board's print"
        )
    if found.board.moved:
        notes.append(
            f"the board is {1e3 * found.board.shift_m:.2f} mm and"
            f" {1e3 * found.board.turn_rad:.2f} mrad from where it was calibrated; that is no fault"
            " of the camera, and its place was left free"
        )
    if length is None:
        notes.append(
            "no known length was given: camera and robot were held against each other alone;"
            " --length-m, --length-sigma-m and --corners bring in a third, independent measurement"
        )
    return tuple(notes)
