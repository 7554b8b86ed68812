"""A check in words: one sentence, and a page of the terminal."""

from __future__ import annotations

import numpy as np

from cell.storage.files.verify_file import AlphaPart, LengthPart, MountPart, VerifyFile
from cell.views.terminal.columns import aligned

HEADS = {
    "good": "Still good",
    "within_tolerance": "Still good, inside your tolerance",
    "moved": "Moved",
    "lens_changed": "Lens changed",
    "moved_and_lens_changed": "Moved, and the lens changed",
    "changed": "Changed",
    "length_wrong": "Known length measured wrong",
    "cannot_tell": "Inconclusive",
}
FRAME_HEAD = ("frame", "distance m", "misfit px", "one sigma px", "limit px", "across mm",
              "work piece mm")  # fmt: skip
DISTANCE_HEAD = ("distance m", "corners", "misfit px", "one sigma px", "limit px", "worst px",
                 "at u, v", "mm")  # fmt: skip
IMAGE_HEAD = ("part of the image", "corners", "misfit px", "one sigma px", "limit px",
              "mean u, v px", "mm")  # fmt: skip
_LENGTH_SAID = ("good", "within_tolerance", "length_wrong")
_THIRDS = (("top left", "top", "top right"), ("left", "middle", "right"),
           ("bottom left", "bottom", "bottom right"))  # fmt: skip


def sentence_of(found: VerifyFile) -> str:
    """The verdict in one or two sentences."""
    match found.verdict:
        case "good":
            return f"The camera is as it was calibrated{_noticed(found)}.{_length(found)}"
        case "within_tolerance":
            return _inside(found)
        case "moved":
            return f"The camera moved on its mount: {_shift(found.mount)}. Its lens is as it was."
        case "lens_changed":
            return f"The lens changed: {_alpha(found.alpha)}. Its place on the mount is as it was."
        case "moved_and_lens_changed":
            return (
                f"Camera and lens both changed: {_shift(found.mount)}; {_alpha(found.alpha)}."
                " Where one of the two is all that happened, something else is wrong, too."
            )
        case "changed":
            return (
                "The camera is not as it was calibrated, but these views do not show whether it"
                " moved or its lens changed: take more views, tilted and at several distances."
            )
        case "length_wrong":
            return (
                f"Camera and robot agree with each other as they did, but not with the known"
                f" length.{_length(found)} Robot, length, or the board the camera was calibrated"
                " with is off in scale."
            )
        case _:
            return _cannot_tell(found)


def _inside(found: VerifyFile) -> str:
    """What changed, what it makes at the work piece, and that it is inside the tolerance."""
    assert found.noticeable is not None
    worst = max(frame.workpiece_m for frame in found.frames)
    changes = []
    if found.mount is not None:
        changes.append(f"moved {1e3 * np.linalg.norm(found.mount.shift_m):.2g} mm")
    if found.alpha:
        middle = found.alpha[len(found.alpha) // 2]
        changes.append(f"alpha changed by {1e2 * middle.change_px / middle.alpha_px:+.2g} %")
    what = " and ".join(changes) or "changed"
    return (
        f"{what[0].upper()}{what[1:]}, which makes at most {1e3 * worst:.2g} mm at the work piece,"
        f" inside your {1e3 * found.noticeable.tolerance_m:g} mm: still good.{_length(found)}"
    )


def _noticed(found: VerifyFile) -> str:
    assert found.noticeable is not None
    return (
        f", as far as these views show: a change that makes"
        f" {1e3 * found.noticeable.workpiece_m:.2f} mm at the work piece would have been noticed"
        " nine times in ten"
    )


def _cannot_tell(found: VerifyFile) -> str:
    notice = found.noticeable
    if notice is None:
        return found.sentence
    if notice.workpiece_m > notice.tolerance_m:
        return (
            "Nothing speaks against the calibration, but only a change that makes"
            f" {1e3 * notice.workpiece_m:.2f} mm at the work piece would have been noticed nine"
            f" times in ten, and {1e3 * notice.tolerance_m:.2f} mm is asked for: take more views,"
            " tilted and at several distances."
        )
    return (
        "Camera and robot disagree by more than when they were calibrated, and neither a moved"
        " camera nor a changed lens accounts for it: cell diagnose on a whole run may name it."
    )


def _shift(mount: MountPart | None) -> str:
    assert mount is not None
    shift, turn = 1e3 * np.array(mount.shift_m), 1e3 * np.array(mount.turn_rad)
    sigma_shift, sigma_turn = (
        1e3 * np.array(mount.sigma_shift_m),
        1e3 * np.array(mount.sigma_turn_rad),
    )
    return (
        f"hand-eye differs by {_vector(shift, sigma_shift)} mm and"
        f" {_vector(turn, sigma_turn)} mrad (right, down, ahead)"
    )


def _vector(values: np.ndarray, sigma: np.ndarray) -> str:
    listed = ", ".join(f"{v:+.3f} ± {s:.3f}" for v, s in zip(values, sigma, strict=True))
    return f"{np.linalg.norm(values):.2f} ({listed})"


def _alpha(alpha: tuple[AlphaPart, ...]) -> str:
    listed = ", ".join(
        f"{a.change_px:+.2f} ± {a.sigma_px:.2f} px at {a.distance_m:.3f} m" for a in alpha
    )
    share = alpha[len(alpha) // 2]
    return f"alpha differs by {listed} ({1e2 * share.change_px / share.alpha_px:+.3f} %)"


def _length(found: VerifyFile) -> str:
    return "" if found.length is None else f" {length_text(found.length)}"


def length_text(length: LengthPart) -> str:
    """The known length and its error."""
    ends = " and ".join(f"({row}, {col})" for row, col in length.corners)
    return (
        f"Error of length measurement: {1e3 * length.error_m:+.4f} ± {1e3 * length.sigma_m:.4f} mm"
        f" (one sigma) on {1e3 * length.known_m:.4f} mm between the corners {ends}, triangulated"
        f" from {length.frames} poses (p = {length.p_value:.2g})."
    )


def frame_rows(found: VerifyFile) -> list[tuple[str, ...]]:
    """Rows under `FRAME_HEAD`, the worst first."""
    return [
        (
            str(f.frame),
            f"{f.distance_m:.3f}",
            f"{f.rms_px:.3f}",
            f"{f.sigma_px:.3f}",
            f"{f.limit_px:.3f}",
            f"{1e3 * f.lateral_m:.3f}",
            f"{1e3 * f.workpiece_m:.3f}",
        )
        for f in sorted(found.frames, key=lambda f: -f.rms_px / f.limit_px)
    ]


def distance_rows(found: VerifyFile) -> list[tuple[str, ...]]:
    """Rows under `DISTANCE_HEAD`, nearest first."""
    return [
        (
            f"{p.near_m:.3f} – {p.far_m:.3f}",
            str(p.corners),
            f"{p.rms_px:.3f}",
            f"{p.sigma_px:.3f}",
            f"{p.limit_px:.3f}",
            f"{p.worst_px:.3f}",
            f"{p.worst_at_px[0]:.0f}, {p.worst_at_px[1]:.0f}",
            f"{1e3 * p.lateral_m:.3f}",
        )
        for p in found.distances
    ]


def image_rows(found: VerifyFile) -> list[tuple[str, ...]]:
    """Rows under `IMAGE_HEAD`, row by row of the image."""
    return [
        (
            _part(p.from_px, p.to_px),
            str(p.corners),
            f"{p.rms_px:.3f}",
            f"{p.sigma_px:.3f}",
            f"{p.limit_px:.3f}",
            f"{p.mean_px[0]:+.3f}, {p.mean_px[1]:+.3f}",
            f"{1e3 * p.lateral_m:.3f}",
        )
        for p in found.image
    ]


def _part(low: tuple[float, float], high: tuple[float, float]) -> str:
    column, row = (round(low[k] / (high[k] - low[k])) for k in (0, 1))
    return _THIRDS[row][column]


def text(found: VerifyFile) -> str:
    """For the terminal."""
    lines = [f"verdict: {HEADS[found.verdict].lower()}", found.sentence]
    if found.p_value is not None:
        used, left = len(found.frames_used), len(found.frames_left_out)
        lines.append(
            f"{used} frames used, {left} left out; probability of a misfit as large by chance:"
            f" {found.p_value:.2g}"
        )
        lines += ["", *aligned([DISTANCE_HEAD, *distance_rows(found)])]
        lines += ["", *aligned([IMAGE_HEAD, *image_rows(found)])]
        lines += [
            "",
            "misfit: seen less predicted by the old calibration, the board where it fits best;",
            "one sigma: by the uncertainties of calibration, arm and corners; limit: what they"
            " exceed once in a hundred times; mm: across the axis.",
        ]
    if found.length is not None and found.verdict not in _LENGTH_SAID:
        lines.append(length_text(found.length))
    lines += [f"frame {f.frame} left out: {f.reason}" for f in found.frames_left_out]
    lines += [f"note: {note}" for note in found.notes]
    return "\n".join(lines)
