"""A recording as a whole: header, frames, pictures, corners, and the views they make."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.chain.kinematics import MODELS, UnknownArm, arm
from calib.views import Board, FloatArray, Views
from cell.errors import InputError
from cell.storage.incoming import inside, plain_file, read_picture
from cell.storage.recording import corners as corner_file
from cell.storage.recording import frames as frame_file
from cell.storage.recording.additional_columns import additional_labels, additional_numbers
from cell.storage.recording.corners import Corners, check_corners, read_corners
from cell.storage.recording.frame_log import VECTORS, read_frames
from cell.storage.recording.frames import FrameRecord
from cell.storage.recording.header import Header, read_header
from cell.storage.recording.thumbnail import KEPT, shrunk

log = logging.getLogger(__name__)

_SCALARS = ("t_s", "temperature_c", "focus_position", "focus_distance_m", "exposure_s")
_NO_COVARIATES = ("frame", "image", "base_from_flange", *VECTORS, *_SCALARS)


@dataclass(frozen=True)
class Recording:
    """A recording's folder, read.

    Attributes
    ----------
    path:
        Its folder.
    header:
        `recording.yaml`.
    frames:
        The lines of `frames.jsonl`, in their order.
    rejected:
        Frame number to why its line cannot be used; it has neither pose nor corners.
    """

    path: Path
    header: Header
    frames: tuple[FrameRecord, ...]
    rejected: Mapping[int, str] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Its own name, or its folder's."""
        return self.header.name or self.path.resolve().name

    @cached_property
    def board(self) -> Board:
        """The board as the calibration knows it."""
        return self.header.board.board()

    @property
    def has_detections(self) -> bool:
        """Whether corners came with the recording; its pictures are then not needed."""
        return plain_file(self.path / corner_file.FILE_NAME)

    def detections(self) -> Corners:
        """The corners that came with the recording; raises `InputError` without any."""
        return read_corners(self.path / corner_file.FILE_NAME, self.board).without(self.rejected)

    def image(self, frame: FrameRecord) -> NDArray[np.generic]:
        """(height, width[, 3]) picture of a frame, as stored.

        Raises
        ------
        InputError
            The frame has no picture, the file is missing, or it is not an image.
        """
        picture = read_picture(self.picture(frame))
        if len(self._shrunk) < KEPT:
            self._shrunk[frame.frame] = shrunk(picture)
        return picture

    @cached_property
    def _shrunk(self) -> dict[int, NDArray[np.generic]]:
        """Pictures that were read already, small: a report shows them without reading them anew."""
        return {}

    def thumbnail(self, frame: FrameRecord) -> NDArray[np.generic]:
        """The picture of a frame, small; raises as `image` does."""
        known = self._shrunk.get(frame.frame)
        return shrunk(self.image(frame)) if known is None else known

    def picture(self, frame: FrameRecord) -> Path:
        """File of a frame's picture; raises `InputError` where it has none or leads elsewhere."""
        if frame.image is None:
            raise InputError(f"frame {frame.frame} has no picture")
        where = f"{self.path / frame_file.FILE_NAME}: frame {frame.frame}: image"
        return inside(self.path, frame.image, where)

    @cached_property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the images; raises `InputError` where nothing states."""
        camera = self.header.camera
        if camera.width and camera.height:
            return camera.width, camera.height
        for frame in self.frames:
            if frame.image is not None:
                height, width = self.image(frame).shape[:2]
                return width, height
        raise InputError(
            f"{self.path / 'recording.yaml'}: camera.width and camera.height are unknown and no"
            " picture shows; write them there"
        )

    def views(self, corners: Corners | None = None) -> Views:
        """All frames as the arrays a calibration works on, in the recording's order.

        Parameters
        ----------
        corners:
            Corners by frame number; those that came with the recording where None. A frame
            without corners is a view whose corners are all NaN.
        """
        return frames_as_views(self, self.frames, self.detections() if corners is None else corners)


def read_recording(path: Path | str) -> Recording:
    """Read a recording's folder.

    Raises
    ------
    InputError
        It is no recording, comes from a newer version, or a file in it is broken.
    """
    folder = Path(path)
    if not _is_folder(folder):
        raise InputError(f"{folder}: is no folder; a recording is a folder with recording.yaml")
    header = read_header(folder)
    log = read_frames(folder / frame_file.FILE_NAME)
    if not log.frames:
        raise InputError(f"{folder / frame_file.FILE_NAME}: has no frame")
    check_corners(len(log.frames), header.board.board().corner_count, str(folder))
    return Recording(folder, header, log.frames, log.rejected)


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except ValueError:  # a NUL in its name
        return False


def frames_as_views(
    recording: Recording, frames: Sequence[FrameRecord], corners: Corners | None = None
) -> Views:
    """Frames of `recording`'s cell, its own or others (to predict), as arrays.

    Raises
    ------
    InputError
        Frames with different numbers of joints.
    """
    width_px, height_px = recording.size_px
    header = recording.header
    blank = Views.blank(
        recording.board,
        width_px=width_px,
        height_px=height_px,
        frames=len(frames),
        mount=header.mount,
        joints=_joint_count(recording.path, frames),
    )
    columns: dict[str, Any] = {name: _stack(frames, name, blank) for name in VECTORS + _SCALARS}
    return replace(
        blank,
        frame=np.array([frame.frame for frame in frames], dtype=np.int64),
        base_from_flange=_poses(frames),
        robot_model=_known_model(recording.path, header.robot.model),
        payload_kg=header.robot.payload_kg,
        moving=header.capture.mode == "moving",
        extra=additional_numbers(_additional(frames)),
        labels=additional_labels(_additional(frames)),
        **columns,
        **_corner_columns(frames, corners or Corners({}), blank),
    )


def _known_model(path: Path, model: str | None) -> str | None:
    """The arm's model, or None where nobody knows its kinematics: it is calibrated without."""
    try:
        return None if model is None else arm(model).name
    except UnknownArm:
        log.warning(
            "%s: robot.model %s is not known, so its joint angles are not used; put its description"
            " there as robot.urdf, or write one of %s",
            path,
            str(model)[:80],
            ", ".join(MODELS),
        )
        return None


def _joint_count(path: Path, frames: Sequence[FrameRecord]) -> int:
    counts: dict[int, int] = {}
    for frame in frames:
        for name in VECTORS:
            vector = getattr(frame, name)
            if vector is not None:
                counts.setdefault(len(vector), frame.frame)
    if len(counts) > 1:
        disk_errors = ", ".join(f"{count} in frame {frame}" for count, frame in counts.items())
        raise InputError(f"{path}: frames have different numbers of joints: {disk_errors}")
    return next(iter(counts), 6)


def _stack(frames: Sequence[FrameRecord], name: str, blank: Views) -> FloatArray:
    column: FloatArray = getattr(blank, name).copy()
    for index, frame in enumerate(frames):
        value = getattr(frame, name)
        if value is not None:
            column[index] = value
    return column


def _additional(frames: Sequence[FrameRecord]) -> list[dict[str, Any]]:
    """What every frame's line says under keys that have no column of their own."""
    return [
        {k: v for k, v in frame.model_dump().items() if k not in _NO_COVARIATES} for frame in frames
    ]


def _poses(frames: Sequence[FrameRecord]) -> FloatArray:
    poses = np.full((len(frames), 4, 4), np.nan)
    for index, frame in enumerate(frames):
        if frame.base_from_flange is not None:
            poses[index] = frame.base_from_flange.transform().as_matrix()
    return poses


def _corner_columns(
    frames: Sequence[FrameRecord], corners: Corners, blank: Views
) -> dict[str, Any]:
    px, sigma_px = blank.corners_px.copy(), blank.corner_sigma_px.copy()
    blur_px = blank.blur_px.copy()
    for index, frame in enumerate(frames):
        if frame.frame in corners.px:
            px[index] = corners.px[frame.frame]
        if frame.frame in corners.sigma_px:
            sigma_px[index] = corners.sigma_px[frame.frame]
        blur_px[index] = corners.blur_px.get(frame.frame, np.nan)
    return {"corners_px": px, "corner_sigma_px": sigma_px, "blur_px": blur_px}
