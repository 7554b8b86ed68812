"""Where camera and board are, as robots and ROS need it: read back, in the direction stated."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from calibrations import STILL, write
from ruamel.yaml import YAML
from scipy.spatial.transform import RigidTransform, Rotation

from calib.views import FloatArray
from cell.errors import InputError
from cell.verbs.export import export_calibration, read_calibration
from cell.verbs.importing.pose_files import read_series

CAMERA = RigidTransform.from_components([0.01, -0.04, 0.07], Rotation.from_rotvec([0.4, -1.2, 2.0]))
BOARD = RigidTransform.from_components([0.8, 0.1, -0.2], Rotation.from_rotvec([-2.5, 0.3, 1.1]))


def part(transform: RigidTransform) -> dict[str, Any]:
    place, turn = transform.as_components()
    return {
        "p_m": place.tolist(),
        "q_xyzw": turn.as_quat().tolist(),
        "sigma_p_m": [1e-5, 2e-5, 3e-5],
        "sigma_r_rad": [1e-4, 1e-4, 1e-4],
    }


ON_FLANGE = STILL | {"flange_from_camera": part(CAMERA), "base_from_board": part(BOARD)}
STANDING = STILL | {"base_from_camera": part(CAMERA), "flange_from_board": part(BOARD)}


def exported(folder: Path, tool: str, content: dict[str, Any] = ON_FLANGE, **more: Any) -> str:
    return export_calibration(read_calibration(write(folder, content)), tool, **more).text


def close(found: FloatArray, transform: RigidTransform) -> None:
    np.testing.assert_allclose(found, transform.as_matrix(), atol=2e-8)


def matrix(place: Any, turn: Rotation) -> FloatArray:
    return np.asarray(RigidTransform.from_components(place, turn).as_matrix())


def test_the_ros_2_command_and_the_ros_1_one_say_the_same(tmp_path: Path) -> None:
    text = exported(tmp_path, "tf", frames={"camera": "wrist_camera"})
    commands = re.findall(r"^ros2 run .*$", text, re.MULTILINE)
    for command, transform, frames in zip(
        commands, (CAMERA, BOARD), (("tool0", "wrist_camera"), ("base", "board")), strict=True
    ):
        output = dict(re.findall(r"--([a-z-]+) (\S+)", command))
        place = [float(output[k]) for k in ("x", "y", "z")]
        turn = Rotation.from_quat([float(output[k]) for k in ("qx", "qy", "qz", "qw")])
        close(matrix(place, turn), transform)
        assert (output["frame-id"], output["child-frame-id"]) == frames
    old = re.findall(r"static_transform_publisher ([-\d. ]+) (\S+) (\S+)$", text, re.MULTILINE)
    numbers = np.array(old[0][0].split(), float)
    close(matrix(numbers[:3], Rotation.from_quat(numbers[3:])), CAMERA)
    assert old[0][1:] == ("tool0", "wrist_camera")


def test_the_moveit_launch_file_is_xml(tmp_path: Path) -> None:
    nodes = ElementTree.fromstring(exported(tmp_path, "moveit")).findall("node")
    words = nodes[0].attrib["args"].split()
    numbers = np.array(words[:7], float)
    close(matrix(numbers[:3], Rotation.from_quat(numbers[3:])), CAMERA)
    assert words[7:] == ["tool0", "camera_optical_frame"]


def test_the_urdf_joint(tmp_path: Path) -> None:
    text = f"<robot>{exported(tmp_path, 'urdf')}</robot>"
    joints = ElementTree.fromstring(text).findall("joint")
    for joint, transform in zip(joints, (CAMERA, BOARD), strict=True):
        origin = joint.find("origin")
        assert origin is not None
        place = [float(v) for v in origin.attrib["xyz"].split()]
        angles = [float(v) for v in origin.attrib["rpy"].split()]
        close(matrix(place, Rotation.from_euler("xyz", angles)), transform)


@pytest.mark.parametrize(("tool", "unit_m"), [("ur", 1.0), ("abb", 1e-3)])
def test_robot_programs_are_read_back_by_the_importer(
    tool: str, unit_m: float, tmp_path: Path
) -> None:
    text = exported(tmp_path, tool)
    assert text.index("pose of the camera in the flange") < text.index("pose of the board in")
    if tool == "abb":
        found = re.search(r"tooldata tCamera := \[TRUE,\[\[(.*?)\],\[(.*?)\]\]", text)
        assert found is not None
        q = np.array(found[2].split(","), float)
        assert np.linalg.norm(q) == pytest.approx(1, abs=1e-8)
        place = unit_m * np.array(found[1].split(","), float)
        close(matrix(place, Rotation.from_quat(q, scalar_first=True)), CAMERA)
    else:
        text = text.replace("#", "set_tcp #", 1)
    (tmp_path / "program.mod").write_text(text)
    poses = {p.name: p.values for p in read_series(tmp_path / "program.mod")[0].poses}
    board = poses["board_in_base" if tool == "ur" else "pBoard"]
    turn = Rotation.from_rotvec(board[3:]) if tool == "ur" else Rotation.from_quat(
        board[3:], scalar_first=True
    )  # fmt: skip
    close(matrix(unit_m * board[:3], turn), BOARD)


def test_a_camera_that_stands_still(tmp_path: Path) -> None:
    text = exported(tmp_path, "abb", STANDING)
    assert "wobjdata wobjCamera" in text
    assert "tooldata tBoard" in text
    assert "calibration_type: eye_on_base" in exported(tmp_path, "easy_handeye2", STANDING)
    assert "base_from_camera: pose of the camera in the base" in exported(tmp_path, "tf", STANDING)


def test_easy_handeye2_s_file(tmp_path: Path) -> None:
    data = YAML(typ="safe").load(exported(tmp_path, "easy_handeye2"))
    place, turn = data["transform"]["translation"], data["transform"]["rotation"]
    q = Rotation.from_quat([turn[k] for k in "xyzw"])
    close(matrix([place[k] for k in "xyz"], q), CAMERA)
    assert data["parameters"]["calibration_type"] == "eye_in_hand"


def test_plain_text_says_it_in_every_way(tmp_path: Path) -> None:
    text = exported(tmp_path, "text")
    rows = [line.split() for line in text.splitlines() if line.startswith("  ")]
    close(np.array(rows[:4], float), CAMERA)
    angles = re.search(r"KUKA A, B, C\): (.*)", text)
    assert angles is not None
    turn = Rotation.from_euler("ZYX", [float(v) for v in angles[1].split(",")], degrees=True)
    np.testing.assert_allclose(turn.as_matrix(), CAMERA.rotation.as_matrix(), atol=1e-6)


def test_what_was_not_determined_is_refused(tmp_path: Path) -> None:
    content = ON_FLANGE | {"undetermined": {"hand_eye": "the flange keeps one orientation"}}
    with pytest.raises(InputError, match="is not handed over: the flange keeps one orientation"):
        exported(tmp_path, "ur", content)
    assert exported(tmp_path, "opencv", content)
    content = ON_FLANGE | {"undetermined": {"camera": "the focal length is not determined"}}
    for tool in ("opencv", "ros", "json"):
        with pytest.raises(InputError, match="the focal length is not determined"):
            exported(tmp_path, tool, content)
    with pytest.raises(InputError, match="no flange pose was logged"):
        exported(tmp_path, "tf", STILL)
    with pytest.raises(InputError, match="is no frame"):
        exported(tmp_path, "tf", frames={"lens": "x"})


def test_a_recording_s_name_ends_no_comment(tmp_path: Path) -> None:
    text = exported(tmp_path, "urdf", ON_FLANGE | {"recording": "a --> b"})
    ElementTree.fromstring(f"<robot>{text}</robot>")
    assert json.dumps(text)
