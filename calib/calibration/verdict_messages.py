"""What a cross-validation found, in a plain sentence or two."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from calib.calibration.cross_validation import CrossValidation
from calib.calibration.held_out import HeldOut

_WORDS = {
    "alpha_px": "focal length",
    "alpha_near_px": "nearest focal length",
    "alpha_far_px": "farthest focal length",
    "depth_near_m": "nearest depth",
    "depth_far_m": "farthest depth",
    "principal_point_px": "principal point",
    "board_in_camera_m": "place at which a logged pose has the board seen",
    "camera_position_m": "camera's place",
    "camera_turn_rad": "camera's turn",
    "board_position_m": "board's place",
    "board_turn_rad": "board's turn",
}


def why(found: CrossValidation) -> str:
    """The verdict with what it rests on."""
    reported = [*_moved(found), *_missed(found.held_out), *_carried(found)]
    return " ".join(reported or [_agree(found.held_out)])


def _agree(held: HeldOut) -> str:
    return (
        "Fits without a fifth of the frames each agree with the fit of all within the stated"
        f" uncertainty, and miss the frames left out, poses tied to the robot, by"
        f" {held.rms_px:.2g} px where {held.expected_px:.2g} px is expected."
    )


def _moved(found: CrossValidation) -> Iterator[str]:
    far, drifting = found.too_far, found.drifting
    if far:
        reported = listed([f"{_the(m.quantity)} {m.factor:.1f} times" for m in far])
        yield (
            "Fits without a fifth of the frames each move farther than the stated uncertainty"
            f" allows: {reported}; take these sigmas so many times as large."
        )
    if drifting:
        names = listed([_the(m.quantity) for m in drifting])
        yield (
            f"The move of {names} grows from the earliest frames to the latest: something drifts."
        )


def _missed(held: HeldOut) -> Iterator[str]:
    if held.miss.each > held.miss.band[1]:
        yield (
            "Frames left out, poses tied to the robot, are missed by"
            f" {held.rms_px:.2g} px where {held.expected_px:.2g} px is expected."
        )
    for part, what in ((held.robot, "the robot's poses"), (held.picture, "their pictures")):
        if part.each > part.band[1]:
            yield (
                f"In {what} frames left out scatter {part.each**0.5:.2g} times as much as stated."
            )


def _carried(found: CrossValidation) -> Iterator[str]:
    if not found.pulls:
        return
    worst, count = found.pulls[0], len(found.pulls)
    what = f"without it {_the(worst.quantity)} moves by {worst.sigmas:.1f} sigma"
    if count == 1:
        yield f"Frame {worst.frame} carries the calibration by more than chance: {what}."
    else:
        yield (
            f"{count} frames each carry an estimate by more than chance, most of all frame"
            f" {worst.frame}: {what}."
        )


def _the(quantity: str) -> str:
    return f"the {_WORDS[quantity]}"


def listed(parts: Sequence[str]) -> str:
    """Words as a sentence has them: a, b and c."""
    return " and ".join((", ".join(parts[:-1]), parts[-1])) if len(parts) > 1 else parts[0]
