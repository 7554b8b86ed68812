"""The corners of a recording: those that came with it, or those its pictures show."""

from __future__ import annotations

import logging
from collections.abc import Callable

from calib.detection import Detection, detect
from cell.errors import InputError
from cell.storage.recording.corners import Corners
from cell.storage.recording.frames import FrameRecord
from cell.storage.recording.recording import Recording

log = logging.getLogger(__name__)

Progress = Callable[[int, int], None]


def detect_corners(recording: Recording, progress: Progress | None = None) -> Corners:
    """Find the board in every picture of a recording.

    A frame whose picture is missing, broken or shows no usable board is rejected with the
    reason; it never stops the others.
    """
    found: dict[int, Detection] = {}
    rejected: dict[int, str] = {}
    for at, frame in enumerate(recording.frames):
        detection = _detect(recording, frame)
        if isinstance(detection, Detection):
            found[frame.frame] = detection
        else:
            rejected[frame.frame] = detection
            log.info("frame %d: %s", frame.frame, detection)
        if progress is not None:
            progress(at + 1, len(recording.frames))
    return Corners(
        px={number: d.corners_px for number, d in found.items()},
        sigma_px={number: d.sigma_px for number, d in found.items()},
        blur_px={number: d.frame_blur_px for number, d in found.items()},
        rejected=rejected,
    )


def _detect(recording: Recording, frame: FrameRecord) -> Detection | str:
    try:
        result = detect(recording.image(frame), recording.board)
    except InputError as error:
        return str(error)
    return result if isinstance(result, Detection) else result.reason


def corners_of(recording: Recording, progress: Progress | None = None) -> Corners:
    """The corners that came with a recording, or those its pictures show."""
    if recording.has_detections:
        return recording.detections()
    return detect_corners(recording, progress)
