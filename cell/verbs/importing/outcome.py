"""What came of an import: its corners, and what the pictures say of its poses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.detection.orientation import Closure, RoughPoses
from calib.views import Board, FloatArray, Mount
from cell.errors import BadAnswer
from cell.storage.recording import Corners, Recording, write_corners
from cell.storage.recording.corners import FILE_NAME as DETECTIONS
from cell.storage.recording.detect import Progress, detect_corners
from cell.verbs.importing.conventions import PictureCheck

_ENOUGH_TO_ASK = 4


@dataclass(frozen=True)
class Imported:
    """What came of an import.

    Attributes
    ----------
    folder, frames, with_corners, with_pose:
        The recording, its frames, in how many of them the board was found, and how many have a
        flange pose.
    guessed:
        What was concluded and not stated.
    rejected:
        Frame number to the reason why it has no corners.
    contradicted:
        What was stated and the pictures speak against.
    """

    folder: Path
    frames: int
    with_corners: int
    with_pose: int
    guessed: tuple[str, ...]
    rejected: dict[int, str]
    contradicted: tuple[str, ...] = ()


def picture_check(
    pictures: int, corners: Corners, board: Board, mount: Mount
) -> PictureCheck | None:
    """What the whole boards among the pictures say of a reading of the poses; None if too few."""
    whole = [k for k in range(pictures) if k in corners.px and np.isfinite(corners.px[k]).all()]
    if len(whole) < _ENOUGH_TO_ASK:
        return None
    rough = RoughPoses.of(np.array([corners.px[k] for k in whole]), board, mount)

    def closure(by_picture: FloatArray) -> Closure | None:
        read = by_picture[whole]
        known = int(np.isfinite(read).all(axis=(1, 2)).sum())
        return rough.closure(read) if known >= _ENOUGH_TO_ASK else None

    return closure


def checked(
    recording: Recording,
    corners: Corners | None,
    guessed: tuple[str, ...],
    contradicted: tuple[str, ...],
    progress: Progress | None,
) -> Imported:
    """The recording's corners, found where they did not come with it, and what there is to say."""
    if recording.has_detections:
        corners = recording.detections()
    else:
        corners = detect_corners(recording, progress) if corners is None else corners
        write_corners(recording.path / DETECTIONS, corners, recording.board)
    if not corners.px:
        reasons = "".join(
            f"\n  frame {frame}: {why}" for frame, why in list(corners.rejected.items())[:3]
        )
        raise BadAnswer(
            f"{recording.path}: the board was found in none of {len(recording.frames)} pictures."
            f" Check rows, cols and type of the board.{reasons}"
        )
    posed = sum(frame.base_from_flange is not None for frame in recording.frames)
    return Imported(
        recording.path,
        len(recording.frames),
        len(corners.px),
        posed,
        guessed,
        dict(corners.rejected),
        contradicted,
    )
