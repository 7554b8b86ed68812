"""The cell file of a bench: consistent in itself, so that a plan can be made of it at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.kinematics import MODELS, UnknownArm, arm
from calib.views import Board
from cell.errors import InputError
from cell.storage.files.board_file import BoardFile
from cell.storage.files.cell_file import SCHEMA, CellFile
from cell.storage.files.parts import Pose
from cell.storage.files.writing import yaml_text
from cell.verbs.init.answers import HOMES_DEG, Answers

FILE_NAME = "cell.yaml"
_FILLS = (0.25, 0.75)
"""Share of the picture's shorter side that the board's longer one takes, far and near."""

_SPAN_M = (0.25, 0.9)
"""Distances at which arms of this size can show a board tilted."""

_HEAD = (
    "# Made by `cell init`. Measure `layout` with a tape before the arm moves, to a centimetre or\n"
    "# two. Then: cell doctor FILE, cell plan FILE, cell run PLAN --dry-run\n"
)


def cell_of(answers: Answers) -> CellFile:
    """The cell of these answers.

    Raises
    ------
    InputError
        An answer cannot be, or the board would not be where the arm can look at it.
    """
    distances = answers.distances_m or _distances(answers)
    home, away_m = _home_and_distance(answers, distances)
    data: dict[str, Any] = {
        "schema": SCHEMA,
        "name": answers.name,
        "robot": _robot(answers),
        "camera": _camera(answers),
        "board": dict(answers.board),
        "mount": answers.mount,
        "layout": {
            "mounted": _pose(answers.mounted),
            "fixed": _pose(answers.board_at)
            if answers.board_at is not None
            else _seen_from_home(answers, home, away_m),
            "home_deg": list(home),
            "distances_m": list(distances),
        },
    }
    data |= _bounds(answers)
    try:
        return CellFile.model_validate(data)
    except ValidationError as invalid:
        faults = "\n".join(
            f"{'.'.join(map(str, e['loc']))}: {e['msg'].removeprefix('Value error, ')}"
            for e in invalid.errors()
        )
        raise InputError(faults) from None


def write_cell(cell: CellFile, folder: Path) -> Path:
    """Write `cell.yaml` into a folder; raises `InputError` where one is there or cannot be."""
    path = folder / FILE_NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(_HEAD + yaml_text(cell.as_mapping()))
    except FileExistsError:
        raise InputError(f"{path}: is there already and is never overwritten") from None
    except OSError as fault:
        raise InputError(f"{path}: cannot be written: {fault.strerror}") from None
    return path


def _home_and_distance(
    answers: Answers, distances_m: tuple[float, float]
) -> tuple[tuple[float, ...], float]:
    """A home posture, and how far from the camera the board lies there.

    In the middle of the distances; nearer where it would lie below the workspace, on a table say.
    """
    near, middle = distances_m[0], float(np.mean(distances_m))
    homes = (answers.home_deg,) if answers.home_deg is not None else _homes(answers.model)
    if answers.workspace is None or answers.mount == "eye_to_hand":
        return homes[0], middle
    lowest = min(answers.workspace[2], answers.workspace[5])
    away = 0.0
    for home in homes:
        camera = _flange(answers.model, home) * _transform(answers.mounted)
        away = float(camera.translation[2]) - lowest
        if away >= near or answers.board_at is not None:
            return home, min(middle, away)
    raise InputError(
        f"at home the camera is {away:.2f} m above the workspace's lowest height, and this lens"
        f" shows the board whole from {near:.2f} m on: take a smaller board or a shorter lens, or"
        " say where the board lies (--board-at) and where the arm looks from (--home)"
    )


def _homes(model: str) -> tuple[tuple[float, ...], ...]:
    for letters, homes in HOMES_DEG.items():
        if model.startswith(letters):
            return homes
    raise InputError(f"--model {model}: has no usual posture here; give --home, six degrees")


def _flange(model: str, home_deg: tuple[float, ...]) -> RigidTransform:
    try:
        return RigidTransform.from_matrix(arm(model).forward(np.radians(home_deg)))
    except UnknownArm as fault:
        raise InputError(f"--model {model}: {fault}") from None


def _robot(answers: Answers) -> dict[str, Any]:
    if answers.model not in MODELS:
        raise InputError(f"--model {answers.model}: is not known; known are {', '.join(MODELS)}")
    robot: dict[str, Any] = {
        "driver": answers.robot, "model": answers.model, "payload_kg": answers.payload_kg
    }  # fmt: skip
    if answers.robot != "sim":
        if answers.robot_address is None:
            raise InputError(f"--robot {answers.robot}: needs --robot-address")
        robot["address"] = answers.robot_address
    return robot


def _camera(answers: Answers) -> dict[str, Any]:
    camera: dict[str, Any] = {
        "driver": answers.camera,
        "width": answers.size_px[0],
        "height": answers.size_px[1],
        "pixel_size_um": answers.pixel_size_um,
        "focus": answers.focus,
        "lens": {"focal_length_mm": answers.focal_length_mm, "f_number": 8.0},
    }
    if answers.camera != "sim":
        if answers.camera_address is None:
            raise InputError(f"--camera {answers.camera}: needs --camera-address")
        key = "producer" if answers.camera == "genicam" else "address"
        camera[key] = answers.camera_address
    return camera


def _bounds(answers: Answers) -> dict[str, Any]:
    """What the arm stays inside and out of; a simulated arm runs into nothing."""
    bounds: dict[str, Any] = {"no_workspace_because": answers.no_workspace_because}
    if answers.workspace is not None:
        bounds["workspace"] = _box("workspace", answers.workspace)
    if answers.keep_out is not None:
        bounds["keep_out"] = [_box(name, corners) for name, corners in answers.keep_out.items()]
    return bounds


def _box(name: str, corners: tuple[float, ...]) -> dict[str, Any]:
    """A box of two opposite corners, in whichever order they were measured."""
    low, high = np.minimum(corners[:3], corners[3:]), np.maximum(corners[:3], corners[3:])
    return {"name": name, "low_m": low.tolist(), "high_m": high.tolist()}


def _distances(answers: Answers) -> tuple[float, float]:
    """From where the board fills the picture to where it takes a quarter of it."""
    alpha = 1e3 * answers.focal_length_mm / answers.pixel_size_um
    board = _longer_side_m(answers)
    shorter = min(answers.size_px)
    far, near = (alpha * board / (share * shorter) for share in _FILLS)
    near, far = max(near, _SPAN_M[0]), min(far, _SPAN_M[1])
    if far < 1.1 * near:
        raise InputError(
            f"the board of {board:.2f} m fits this lens' picture only from {near:.2f} m on, farther"
            " than an arm shows it tilted: take a smaller board or a shorter lens, or give"
            " --distances NEAR,FAR"
        )
    return round(near, 2), round(far, 2)


def _longer_side_m(answers: Answers) -> float:
    board = _board(answers)
    return max(board.extent_m) + 2 * board.square_m


def _transform(numbers: tuple[float, ...]) -> RigidTransform:
    if len(numbers) != 6:
        raise InputError("a place is x,y,z in metres and roll,pitch,yaw in degrees: six numbers")
    turn = Rotation.from_euler("xyz", numbers[3:], degrees=True)
    return RigidTransform.from_components(numbers[:3], turn)


def _pose(numbers: tuple[float, ...]) -> dict[str, Any]:
    return Pose.of(_transform(numbers)).model_dump(mode="json", exclude_none=True)


def _seen_from_home(answers: Answers, home: tuple[float, ...], distance_m: float) -> dict[str, Any]:
    """base_from_fixed with the board's middle straight before the camera at home, square to it."""
    flange = _flange(answers.model, home)
    middle = _board(answers).corners_m.mean(axis=0)
    camera_from_board = RigidTransform.from_translation(np.array([0.0, 0.0, distance_m]) - middle)
    mounted = flange * _transform(answers.mounted)
    hand = answers.mount == "eye_in_hand"
    fixed = mounted * (camera_from_board if hand else camera_from_board.inv())
    return Pose.of(fixed).model_dump(mode="json", exclude_none=True)


def _board(answers: Answers) -> Board:
    described: BoardFile = TypeAdapter(BoardFile).validate_python(answers.board)
    return described.board()
