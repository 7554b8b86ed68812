"""Poses in the layouts that people have: understood from names, numbers and pictures, and told."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.rigid import inverse
from calib.detection.orientation import pose_misfits
from calib.views import FloatArray, Mount
from cell.errors import InputError
from cell.verbs.importing import RotationName
from cell.verbs.importing.conventions import Convention, Witness, conclude
from cell.verbs.importing.pose_files import RawPose, read_poses
from tests.paper.scene import mixed_scene

FRAMES = 9


def _flange(mount: Mount = "eye_in_hand") -> FloatArray:
    return mixed_scene(
        2, FRAMES - 2, noise_px=0.3, robot_mm=0.1, mount=mount
    ).views.base_from_flange


FLANGE = _flange()
P_M, TURNS = FLANGE[:, :3, 3], Rotation.from_matrix(FLANGE[:, :3, :3])
BACK = inverse(FLANGE)


def witness(mount: Mount = "eye_in_hand") -> Witness:
    views = mixed_scene(2, FRAMES - 2, noise_px=0.3, robot_mm=0.1, mount=mount).views

    def misfits(readings: Sequence[FloatArray]) -> FloatArray:
        return pose_misfits(views.corners_px, views.board, readings, mount)

    return misfits


def _table(*columns: FloatArray, separator: str = " ", head: str = "", first: str = "") -> str:
    rows = np.column_stack(columns)
    lines = [head] if head else []
    for number, row in enumerate(rows):
        cells = [first.format(number)] if first else []
        lines.append(separator.join([*cells, *(f"{value:.10g}" for value in row)]))
    return "\n".join(lines) + "\n"


def _euler(order: str, *, degrees: bool = True) -> FloatArray:
    return np.asarray(TURNS.as_euler(order, degrees=degrees))


XYZW, WXYZ = TURNS.as_quat(), TURNS.as_quat(scalar_first=True)
LAYOUTS: dict[str, tuple[str, str, RotationName]] = {
    "ROS, x y z w": ("p.txt", _table(P_M, XYZW), "quat_xyzw"),
    "ABB, mm and w x y z": ("p.csv", _table(1e3 * P_M, WXYZ, separator=","), "quat_wxyz"),
    "UR, rotation vector": ("p.txt", _table(P_M, TURNS.as_rotvec()), "rotvec"),
    "rotation vector in degrees": (
        "p.csv", _table(1e3 * P_M, TURNS.as_rotvec(degrees=True), separator=";"), "rotvec_deg"),
    "Fanuc, mm and w p r": (
        "p.csv", _table(1e3 * P_M, _euler("xyz"), separator=",", head="x,y,z,w,p,r"), "rpy_deg"),
    "roll pitch yaw, radians": ("p.txt", _table(P_M, _euler("xyz", degrees=False)), "rpy"),
    "KUKA, a b c": (
        "p.csv", _table(1e3 * P_M, _euler("ZYX"), separator=",", head="X,Y,Z,A,B,C"),
        "euler_zyx_deg"),
    "KUKA, nothing named": ("p.txt", _table(1e3 * P_M, _euler("ZYX")), "euler_zyx_deg"),
    "Staubli": ("p.txt", _table(1e3 * P_M, _euler("XYZ")), "euler_xyz_deg"),
    "Kawasaki": ("p.txt", _table(1e3 * P_M, _euler("ZYZ")), "euler_zyz_deg"),
    "TUM, time and x y z w": (
        "p.txt", "# stamp tx ty tz qx qy qz qw\n" + _table(0.1 + np.arange(FRAMES), P_M, XYZW),
        "quat_xyzw"),
    "columns by name, quaternion first": (
        "p.csv",
        _table(WXYZ, P_M, separator=",", head="image,qw,qx,qy,qz,tx,ty,tz", first="im_{}.png"),
        "quat_xyzw"),
    "columns by name, joints among them": (
        "p.csv",
        _table(np.zeros((FRAMES, 6)), 1e3 * P_M, _euler("xyz"), separator=",",
               head="j1,j2,j3,j4,j5,j6,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg"),
        "rpy_deg"),
    "4x4, a row each line": (
        "p.txt", "\n\n".join(_table(matrix) for matrix in FLANGE), "matrix"),
    "4x4, one line, by columns": (
        "p.txt", _table(FLANGE.swapaxes(1, 2).reshape(FRAMES, 16)), "matrix_by_columns"),
    "3x4 under keys": (
        "p.json", json.dumps({f"im_{k}.png": m[:3].tolist() for k, m in enumerate(FLANGE)}),
        "matrix"),
    "ROS message": (
        "p.json",
        json.dumps([
            {"position": dict(zip("xyz", p.tolist(), strict=True)),
             "orientation": dict(zip("xyzw", q.tolist(), strict=True))}
            for p, q in zip(P_M, XYZW, strict=True)]),
        "quat_xyzw"),
    "translation and 3x3": (
        "p.yaml",
        json.dumps([
            {"id": k, "R": m[:3, :3].tolist(), "t": m[:3, 3].tolist()}
            for k, m in enumerate(FLANGE)]),
        "matrix"),
    "rotation before position": (
        "p.json",
        json.dumps([
            {"file": f"im_{k}.png", "q": q.tolist(), "t": p.tolist()}
            for k, (p, q) in enumerate(zip(P_M, WXYZ, strict=True))]),
        "quat_wxyz"),
}  # fmt: skip


def _poses(folder: Path, name: str, text: str) -> list[RawPose]:
    (folder / name).write_text(text)
    return read_poses(folder / name)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_layout_is_understood_and_told(tmp_path: Path, layout: str) -> None:
    name, text, rotation = LAYOUTS[layout]
    poses = _poses(tmp_path, name, text)
    found = conclude(poses, None, None, None, witness())
    assert found.rotation == rotation
    assert not found.inverted
    read = np.array([found.transform(pose).as_matrix() for pose in poses])
    np.testing.assert_allclose(read, FLANGE, atol=1e-7)
    told = " ".join(found.guessed)
    for words in (f"rotations are {rotation}", "positions are in", "base_from_flange", "bear this"):
        assert words in told


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("write", ["quaternions", "matrices"])
def test_poses_the_other_way_round_are_found_out(tmp_path: Path, mount: Mount, write: str) -> None:
    flange = _flange(mount)
    back = inverse(flange)
    text = _table(back.reshape(FRAMES, 16))
    if write == "quaternions":
        text = _table(back[:, :3, 3], Rotation.from_matrix(back[:, :3, :3]).as_quat())
    poses = _poses(tmp_path, "p.txt", text)
    found = conclude(poses, None, None, None, witness(mount))
    assert found.inverted
    np.testing.assert_allclose(found.transform(poses[0]).as_matrix(), flange[0], atol=1e-7)


def test_what_is_said_wrongly_is_contradicted_aloud(tmp_path: Path) -> None:
    poses = _poses(tmp_path, "p.txt", _table(P_M, XYZW))
    found = conclude(poses, "quat_wxyz", "m", False, witness())
    assert any("THE PICTURES SPEAK AGAINST IT" in words for words in found.guessed)


def test_poses_of_other_pictures_are_refused(tmp_path: Path) -> None:
    poses = _poses(tmp_path, "p.txt", _table(P_M[::-1], XYZW[::-1]))
    with pytest.raises(InputError, match="check the poses and which picture each is of"):
        conclude(poses, None, None, None, witness())


def test_pictures_that_cannot_tell_leave_the_question_to_the_user(tmp_path: Path) -> None:
    still = np.repeat(TURNS[:1].as_rotvec(), FRAMES, axis=0)
    poses = _poses(tmp_path, "p.txt", _table(P_M, still))

    def no_turn(readings: Sequence[FloatArray]) -> FloatArray:
        return np.zeros((len(readings), 2))

    with pytest.raises(InputError, match="nothing tells which"):
        conclude(poses, None, None, None, no_turn)


BROKEN: dict[str, Callable[[], tuple[str, str]]] = {
    "has 5 numbers": lambda: ("p.txt", "1 2 3 4 5\n"),
    "lacks numbers": lambda: ("p.csv", "x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n1,2,3,0,0,,1\n"),
    "cannot be read": lambda: ("p.json", "{"),
    "holds no pose": lambda: ("p.yaml", "[]\n"),
}


@pytest.mark.parametrize("message", BROKEN)
def test_a_broken_file_is_refused_with_its_place(tmp_path: Path, message: str) -> None:
    name, text = BROKEN[message]()
    with pytest.raises(InputError, match=message):
        _poses(tmp_path, name, text)


def test_a_convention_reads_what_it_says() -> None:
    pose = RigidTransform.from_components(P_M[0], TURNS[0])
    raw = RawPose("here", None, np.concatenate([P_M[0], TURNS[0].as_euler("ZYZ", degrees=True)]))
    read = Convention("euler_zyz_deg", "m").transform(raw)
    np.testing.assert_allclose(read.as_matrix(), pose.as_matrix(), atol=1e-9)
