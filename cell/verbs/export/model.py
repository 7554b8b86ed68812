"""A recording's pictures with their calibrated poses: what a structure-from-motion model holds."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from cell.errors import InputError
from cell.storage.files.calibration_source import CalibrationSource, TransformSource
from cell.storage.recording import Recording
from cell.verbs.export.camera import Camera
from cell.verbs.export.formats import colmap_model
from cell.verbs.export.formats.colmap_model import Seen
from cell.views.poses.placement import refuse_undetermined


def model_texts(
    calibration: CalibrationSource, camera: Camera, recording: Recording
) -> dict[str, str]:
    """COLMAP's files by name: the camera where it was for every frame of a recording.

    The world is the frame in which the board stands still: the robot's base, or the flange where
    that carries the board.

    Raises
    ------
    InputError
        The calibration does not say where the camera is, or no frame has a flange pose.
    """
    refuse_undetermined(calibration, "hand_eye")
    corners = recording.detections().px if recording.has_detections else {}
    blank = np.full((recording.board.corner_count, 2), np.nan)
    in_hand = recording.header.mount == "eye_in_hand"
    camera_side, board_side = (
        (calibration.flange_from_camera, calibration.base_from_board)
        if in_hand
        else (calibration.base_from_camera, calibration.flange_from_board)
    )
    camera_at, board_at = _known(camera_side), _known(board_side)
    seen = []
    for frame in recording.frames:
        if frame.base_from_flange is None:
            continue
        flange = frame.base_from_flange.transform()
        world_from_camera = (flange if in_hand else flange.inv()) * camera_at
        name = frame.image or f"frame-{frame.frame}"
        seen.append(
            Seen(frame.frame, name, world_from_camera.inv(), corners.get(frame.frame, blank))
        )
    if not seen:
        raise InputError(f"{recording.path}: no frame has a flange pose, and a model needs them")
    world = "the robot's base" if in_hand else "the robot's flange"
    return colmap_model.texts(camera, world, seen, board_at.apply(recording.board.corners_m))


def _known(transform: TransformSource | None) -> RigidTransform:
    if transform is None:
        raise InputError(
            "the calibration does not say where camera and board are with this recording's mount:"
            " calibrate that recording, or one of the same cell"
        )
    return RigidTransform.from_matrix(transform.matrix)
