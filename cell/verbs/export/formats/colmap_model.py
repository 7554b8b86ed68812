"""COLMAP: a whole model in text, with the camera's poses of a recording and its board's corners.

COLMAP 3.13 and newer take an image's pose from `frames.txt` and `rigs.txt` where these stand in
the folder, older ones from `images.txt`: both say the same here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.views import FloatArray
from cell.verbs.export.camera import Camera
from cell.verbs.export.formats import colmap

_CAMERA = _RIG = 1


@dataclass(frozen=True)
class Seen:
    """One picture.

    Attributes
    ----------
    number:
        Of its frame in the recording.
    name:
        Its path in the recording's folder.
    camera_from_world:
        Where the camera was.
    corners_px:
        (M, 2) the board's corners, (0, 0) at the centre of the top-left pixel; NaN where unseen.
    """

    number: int
    name: str
    camera_from_world: RigidTransform
    corners_px: FloatArray


def texts(camera: Camera, world: str, seen: Sequence[Seen], points_m: FloatArray) -> dict[str, str]:
    """The files of the model, by name.

    Parameters
    ----------
    world:
        What the model's world is, as text.
    points_m:
        (M, 3) the board's corners in the world, metres.
    """
    about = f"# {camera.about}; the world is {world}, in metres\n"
    found = {
        "cameras.txt": colmap.text(camera),
        "rigs.txt": f"{about}# RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID\n"
        f"{_RIG} 1 CAMERA {_CAMERA}\n",
        "frames.txt": f"{about}# FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ],"
        " NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)\n"
        + "".join(_frame(picture) for picture in seen),
        "images.txt": f"{about}# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
        "# POINTS2D[] as (X, Y, POINT3D_ID)\n" + "".join(_image(picture) for picture in seen),
    }
    return found | {"points3D.txt": about + _points(seen, points_m)}


def _frame(picture: Seen) -> str:
    name = _id(picture)
    return f"{name} {_RIG} {_pose(picture.camera_from_world)} 1 CAMERA {_CAMERA} {name}\n"


def _id(picture: Seen) -> int:
    """COLMAP counts from 1."""
    return picture.number + 1


def _pose(camera_from_world: RigidTransform) -> str:
    place, turn = camera_from_world.as_components()
    return _numbers((*turn.as_quat(canonical=True, scalar_first=True), *place))


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _image(picture: Seen) -> str:
    at = picture.corners_px + colmap.CORNER
    corners = (f"{_numbers(at[m])} {m + 1}" for m in _found(picture))
    pose = _pose(picture.camera_from_world)
    return f"{_id(picture)} {pose} {_CAMERA} {picture.name}\n{' '.join(corners)}\n"


def _found(picture: Seen) -> list[int]:
    return [int(m) for m in np.flatnonzero(np.isfinite(picture.corners_px).all(axis=1))]


def _points(seen: Sequence[Seen], points_m: FloatArray) -> str:
    tracks: Mapping[int, list[str]] = {m: [] for m in range(len(points_m))}
    for picture in seen:
        for place, m in enumerate(_found(picture)):
            tracks[m].append(f"{_id(picture)} {place}")
    lines = (
        f"{m + 1} {_numbers(points_m[m])} 0 0 0 -1 {' '.join(track)}\n"
        for m, track in tracks.items()
        if track
    )
    head = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
    return head + "".join(lines)
