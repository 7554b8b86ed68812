from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.kinematics import arm
from calib.views import FloatArray
from cell.errors import BadAnswer, InputError
from cell.storage.recording import read_recording
from cell.verbs.importing import RotationName
from cell.verbs.importing.conventions import Candidate, Convention, StatedConvention
from cell.verbs.importing.conventions import conclude as conclude_all
from cell.verbs.importing.importer import Described, import_source
from cell.verbs.importing.pairing import Pairing
from cell.verbs.importing.pose_files import read_poses
from cell.verbs.importing.raw import RawPose
from cell.verbs.importing.sources import common_size_px

TURN = Rotation.from_rotvec([0.3, -0.5, 0.9])
P_M = np.array([0.4, -0.2, 0.6])
BOARD = {"type": "chessboard", "rows": 4, "cols": 5, "square_m": 0.03}

WRITTEN: dict[RotationName, FloatArray] = {
    "quat_xyzw": TURN.as_quat(),
    "quat_wxyz": TURN.as_quat(scalar_first=True),
    "rotvec": TURN.as_rotvec(),
    "rotvec_deg": TURN.as_rotvec(degrees=True),
    "rpy": TURN.as_euler("xyz"),
    "rpy_deg": TURN.as_euler("xyz", degrees=True),
    "euler_zyx_deg": TURN.as_euler("ZYX", degrees=True),
}


def conclude(poses: list[RawPose], rotation: RotationName | None = None) -> Convention:
    """How poses are understood without pictures to ask."""
    in_order = Pairing("one by one in their order", tuple(range(len(poses))))
    return conclude_all([Candidate(poses, in_order)], StatedConvention(rotation))[1]


def words(values: FloatArray) -> str:
    return " ".join(f"{value:.12g}" for value in values)


@pytest.mark.parametrize("rotation", WRITTEN)
@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_poses_mean_what_they_are_stated_to_mean(
    tmp_path: Path, rotation: RotationName, scale: float
) -> None:
    file = tmp_path / "poses.txt"
    file.write_text(words(np.concatenate([scale * P_M, WRITTEN[rotation]])) + "\n")
    convention = conclude(read_poses(file), rotation)
    assert convention.unit == ("m" if scale == 1.0 else "mm")
    pose = convention.transform(read_poses(file)[0])
    np.testing.assert_allclose(pose.translation, P_M, atol=1e-9)
    np.testing.assert_allclose(pose.rotation.as_matrix(), TURN.as_matrix(), atol=1e-9)


MATRIX = RigidTransform.from_components(P_M, TURN).as_matrix()
COMMAS = words(MATRIX.ravel()).replace(" ", ",")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("p.txt", "\n".join(words(row) for row in MATRIX) + "\n\n" + "\n".join(map(words, MATRIX))),
        ("p.txt", 2 * (words(MATRIX.ravel()) + "\n")),
        ("p.csv", "".join(f"img_{n}.png,{COMMAS}\n" for n in (0, 1))),
        ("p.json", json.dumps({"poses": {"0": MATRIX.tolist(), "1": MATRIX.ravel().tolist()}})),
        ("p.yaml", json.dumps([{"T": MATRIX.tolist()}, {"T": MATRIX[:3].tolist()}][:1] * 2)),
    ],
)  # fmt: skip
def test_matrices_are_found_in_every_kind_of_file(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    poses = read_poses(tmp_path / name)
    assert len(poses) == 2
    convention = conclude(poses)
    assert convention.rotation == "matrix"
    assert any("rotations are matrix" in words for words in convention.guessed)
    np.testing.assert_allclose(convention.transform(poses[1]).as_matrix(), MATRIX, atol=1e-9)


def test_position_and_quaternion_under_names(tmp_path: Path) -> None:
    data = [{"p": P_M.tolist(), "q": TURN.as_quat().tolist()}]
    (tmp_path / "p.json").write_text(json.dumps(data))
    pose = Convention("quat_xyzw", "m").transform(read_poses(tmp_path / "p.json")[0])
    np.testing.assert_allclose(pose.as_matrix(), MATRIX, atol=1e-12)


def test_a_folder_of_one_pose_a_file_in_natural_order(tmp_path: Path) -> None:
    for number in (2, 10, 1):
        moved = MATRIX.copy()
        moved[0, 3] = number
        (tmp_path / f"pose{number}.txt").write_text("\n".join(map(words, moved)))
    poses = read_poses(tmp_path)
    assert [pose.number for pose in poses] == [1, 2, 10]
    assert [pose.values[3] for pose in poses] == [1, 2, 10]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (words(np.concatenate([P_M, TURN.as_quat()])), "x y z w or w x y z"),
        (words(np.concatenate([P_M, TURN.as_rotvec()])), r"rotation vector \(UR\) or angles"),
        ("1 2 3\n", "has 3 numbers"),
        ("nothing\n", "holds no pose"),
        (words(MATRIX.ravel()) + "\n" + words(MATRIX[:3].ravel()), "poses of 12 and 16 numbers"),
    ],
)
def test_nothing_is_guessed_silently(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "p.txt").write_text(text + "\n")
    with pytest.raises(InputError, match=message):
        conclude(read_poses(tmp_path / "p.txt"))


def test_a_matrix_that_is_no_rotation_is_refused(tmp_path: Path) -> None:
    (tmp_path / "p.txt").write_text(words((2 * MATRIX).ravel()))
    with pytest.raises(InputError, match="no rotation"):
        Convention("matrix", "m").transform(read_poses(tmp_path / "p.txt")[0])


def picture() -> np.ndarray:
    """A plain chessboard of 4 x 5 inner corners, drawn larger and shrunk for soft edges."""
    squares = np.indices((5, 6)).sum(axis=0) % 2
    board = np.kron(squares, np.ones((160, 160))) * 200 + 30
    framed = np.pad(board, 200, constant_values=230)
    small = cv2.resize(framed, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), 0.8), np.uint8)


def pictures(folder: Path, count: int = 2) -> Path:
    folder.mkdir()
    for number in range(count):
        cv2.imwrite(str(folder / f"img_{number + 5}.png"), picture())
    return folder


def test_pictures_and_poses_become_a_recording(tmp_path: Path) -> None:
    source = pictures(tmp_path / "source")
    poses = tmp_path / "poses.csv"
    poses.write_text(f"img_6.png,{COMMAS}\n")
    stated = Described(
        board=BOARD, poses=poses, stated=StatedConvention(inverted=True), robot="ur5e"
    )
    imported = import_source(source, tmp_path / "r", stated)
    assert (imported.frames, imported.with_corners) == (2, 2)
    views = read_recording(tmp_path / "r").views()
    assert views.has_pose.tolist() == [False, True]
    np.testing.assert_allclose(views.base_from_flange[1], np.linalg.inv(MATRIX), atol=1e-9)
    assert views.robot_model == "ur5e"


def test_hidden_depth_and_pose_files_beside_the_pictures_are_no_pictures(tmp_path: Path) -> None:
    source = pictures(tmp_path / "source")
    for number in (5, 6):
        cv2.imwrite(str(source / f"depth_{number}.png"), np.zeros((9, 9), np.uint16))
        (source / f"._img_{number}.png").write_bytes(b"resource fork")
        (source / f"img_{number}.json").write_text(json.dumps({"pose": MATRIX.tolist()}))
    imported = import_source(source, tmp_path / "r", Described(board=BOARD, poses=source))
    assert (imported.frames, imported.with_corners, imported.with_pose) == (2, 2, 2)
    assert any("2 depth or infrared pictures" in words for words in imported.guessed)
    views = read_recording(tmp_path / "r").views()
    np.testing.assert_allclose(views.base_from_flange[0], MATRIX, atol=1e-9)


def test_pictures_without_poses_say_so(tmp_path: Path) -> None:
    source = pictures(tmp_path / "source")
    (source / "poses.csv").write_text("nothing read it")
    imported = import_source(source, tmp_path / "r", Described(board=BOARD))
    assert any("no flange poses" in w and "poses.csv" in w for w in imported.guessed)


def test_joint_angles_become_poses_by_the_arms_kinematics(tmp_path: Path) -> None:
    source = pictures(tmp_path / "source")
    angles = np.array([[0.5, -1.3, -2.2, -0.2, 1.1, 0.3], [0.3, -1.8, -1.7, -0.1, 1.3, 0.2]])
    ros = ["elbow", "shoulder_lift", "shoulder_pan", "wrist_1", "wrist_2", "wrist_3"]
    reported = {
        "joint_names": [f"{name}_joint" for name in ros],
        "joint_values": angles[:, [2, 1, 0, 3, 4, 5]].tolist(),
    }
    (tmp_path / "joints.yaml").write_text(json.dumps(reported))
    stated = Described(board=BOARD, joints=tmp_path / "joints.yaml", robot="ur3")
    import_source(source, tmp_path / "r", stated)
    views = read_recording(tmp_path / "r").views()
    np.testing.assert_allclose(views.base_from_flange, arm("ur3").forward(angles), atol=1e-9)
    np.testing.assert_allclose(views.joints_rad, angles, atol=1e-12)
    with pytest.raises(InputError, match="Say --robot MODEL"):
        import_source(source, tmp_path / "s", Described(board=BOARD, poses=stated.joints))


def test_pictures_and_poses_that_do_not_match(tmp_path: Path) -> None:
    source = pictures(tmp_path / "source", 3)
    (tmp_path / "p.txt").write_text(2 * (words(MATRIX.ravel()) + "\n"))
    stated = Described(board=BOARD, poses=tmp_path / "p.txt")
    with pytest.raises(InputError, match="3 pictures and 2 poses"):
        import_source(source, tmp_path / "r", stated)


def test_what_is_missing_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no folder of pictures"):
        import_source(tmp_path / "nowhere", tmp_path / "r", Described())
    with pytest.raises(InputError, match="has no pictures"):
        import_source(tmp_path, tmp_path / "r", Described(board=BOARD))
    with pytest.raises(InputError, match="no board: give"):
        import_source(pictures(tmp_path / "source"), tmp_path / "r", Described())


def test_a_wrong_board_is_found_nowhere(tmp_path: Path) -> None:
    board = {**BOARD, "rows": 9, "cols": 11}
    with pytest.raises(BadAnswer, match="found in none of 2 pictures"):
        import_source(pictures(tmp_path / "source"), tmp_path / "r", Described(board=board))


def test_a_recording_is_copied_whole(tmp_path: Path) -> None:
    import_source(pictures(tmp_path / "source"), tmp_path / "r", Described(board=BOARD))
    again = import_source(tmp_path / "r", tmp_path / "copy", Described())
    assert again.with_corners == 2
    original, copy = read_recording(tmp_path / "r"), read_recording(tmp_path / "copy")
    assert copy.frames == original.frames
    np.testing.assert_array_equal(copy.views().corners_px, original.views().corners_px)


def test_pictures_of_another_size_are_left_out_with_a_word(tmp_path: Path) -> None:
    sizes = [(24, 32), (48, 64), (48, 64), (12, 16), (48, 64)]
    files = [tmp_path / f"{k}.png" for k in range(len(sizes))]
    for path, size in zip(files, sizes, strict=True):
        cv2.imwrite(str(path), np.full(size, 200, dtype=np.uint8))
    size_px, notes = common_size_px(files)
    assert size_px == (64, 48)
    assert "1 of 32x24, 1 of 16x12 are left out" in notes[0]
    assert common_size_px(files[1:3]) == ((64, 48), ())
