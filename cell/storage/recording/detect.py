"""The corners of a recording: those that came with it, or those its pictures show."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from numpy.typing import NDArray

from calib.detection import Detection, detect
from calib.views import Board
from cell.errors import InputError
from cell.storage.recording.corners import Corners
from cell.storage.recording.recording import Recording

log = logging.getLogger(__name__)

Progress = Callable[[int, int], None]
Load = Callable[[], NDArray[Any]]


def detect_corners(recording: Recording, progress: Progress | None = None) -> Corners:
    """Find the board in every picture of a recording.

    A frame whose picture is missing, broken or shows no usable board is rejected with the
    reason; it never stops the others.
    """
    usable = [frame for frame in recording.frames if frame.frame not in recording.rejected]
    pictures = [(frame.frame, partial(recording.image, frame)) for frame in usable]
    if not pictures:
        return Corners({}).without(recording.rejected)
    found = detect_in_pictures(pictures, recording.board, recording.size_px, progress)
    return found.without(recording.rejected)


def detect_in_pictures(
    pictures: Sequence[tuple[int, Load]],
    board: Board,
    size_px: tuple[int, int],
    progress: Progress | None = None,
) -> Corners:
    """As `detect_corners`, in pictures of (width, height) pixels with their frame numbers."""
    found: dict[int, Detection] = {}
    rejected: dict[int, str] = {}
    for at, (frame, load) in enumerate(pictures):
        detection = _detect(load, board, size_px)
        if isinstance(detection, Detection):
            found[frame] = detection
        else:
            rejected[frame] = detection
            log.info("frame %d: %s", frame, detection)
        if progress is not None:
            progress(at + 1, len(pictures))
    return Corners(
        px={number: d.corners_px for number, d in found.items()},
        sigma_px={number: d.sigma_px for number, d in found.items()},
        blur_px={number: d.frame_blur_px for number, d in found.items()},
        rejected=rejected,
    )


def _detect(load: Load, board: Board, size_px: tuple[int, int]) -> Detection | str:
    try:
        result = detect(_of_size(load(), size_px), board)
    except InputError as error:
        return str(error)
    return result if isinstance(result, Detection) else result.reason


def _of_size(image: NDArray[Any], size_px: tuple[int, int]) -> NDArray[Any]:
    """The picture; `InputError` where it has not the size of the recording's camera.

    A picture of another size comes from another camera, another binning or region, or was scaled:
    its pixels are not those of the other pictures.
    """
    found = (image.shape[1], image.shape[0])
    if found != size_px:
        raise InputError(
            f"the picture has {found[0]}x{found[1]} pixels, and the recording's camera"
            f" {size_px[0]}x{size_px[1]}: another camera, binning or region, or a scaled picture"
        )
    return image


def corners_of(recording: Recording, progress: Progress | None = None) -> Corners:
    """The corners that came with a recording, or those its pictures show."""
    if recording.has_detections:
        return recording.detections()
    return detect_corners(recording, progress)
