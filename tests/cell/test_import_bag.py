"""ROS bags, written by rosbags and by the mcap library, imported and calibrated."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap_ros2.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from calib.chain.kinematics import arm
from calib.views import FloatArray
from cell.cli.app import app
from cell.errors import BadAnswer, InputError
from cell.storage.recording import PoseRecord, Recording, read_recording
from cell.verbs.calibrate import calibrate_recording
from tests.cell import bags
from tests.cell.bags import HAND, LATE_S, START_NS, STATED, STOPS, Message, T, Tour, write_bag
from tests.kinematics.made_up_arms import OFFSET_WRIST, urdf

PICTURES = "/camera/image_raw"


@pytest.fixture(scope="module")
def tour() -> Tour:
    return bags.tour()


@pytest.fixture(scope="module")
def pictures(tour: Tour) -> list[Message]:
    return list(bags.pictures_of(tour))


@pytest.fixture(scope="module")
def at_rest(tour: Tour, pictures: list[Message]) -> list[Message]:
    """One picture of each stop, from the middle of the rest."""
    middles = (bags.REST_S + bags.MOVE_S) * np.arange(STOPS) + bags.REST_S / 2 + LATE_S
    stamps = np.array([at for _, _, at, _ in pictures])
    return [pictures[int(np.abs(stamps - at).argmin())] for at in middles]


def _imported(bag: Path, out: Path, *options: str) -> tuple[dict[str, Any], Recording]:
    arguments = ["import", str(bag), "--board", STATED, "-o", str(out), "--json", *options]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, (done.output, done.exception)
    return json.loads(done.stdout), read_recording(out)


def _refused(bag: Path, out: Path, *options: str) -> str:
    arguments = ["import", str(bag), "--board", STATED, "-o", str(out), *options]
    done = CliRunner().invoke(app, arguments)
    assert isinstance(done.exception, InputError), (done.output, done.exception)
    return str(done.exception)


def _poses(recording: Recording) -> FloatArray:
    posed = [f.base_from_flange for f in recording.frames if f.base_from_flange is not None]
    return np.array([pose.transform().as_matrix() for pose in posed])


def _says(result: dict[str, Any], words: str) -> str:
    return next(result for result in result["guessed"] if words in result)


def test_from_a_bag_to_the_hand_eye(tour: Tour, pictures: list[Message], tmp_path: Path) -> None:
    """MCAP, transforms, a late camera clock: the camera's place on the flange comes out."""
    bag = write_bag(tmp_path / "bag", [*pictures, *bags.tf_of(tour), *bags.joints_of(tour)])
    result, recording = _imported(bag, tmp_path / "out")
    assert "transforms from base to tool0" in _says(result, "poses are")
    assert f"each of {STOPS} standstills" in _says(result, "standstills")
    assert "at most 20 ms away (bound 50 ms" in _says(result, "interpolated")
    assert "late against the joints'" in _says(result, "clock")
    offset_s = (recording.header.model_extra or {})["imported"]["clock_offset_s"]
    assert abs(offset_s + LATE_S) < 0.001
    assert recording.header.capture.mode == "stop"
    assert len(recording.frames) == result["with_corners"] == STOPS
    expected = tour.flange((bags.REST_S + bags.MOVE_S) * np.arange(STOPS) + bags.REST_S / 2)
    np.testing.assert_allclose(_poses(recording), expected, atol=1e-6)
    found = calibrate_recording(recording).mapping["flange_from_camera"]
    off = HAND.inv() * PoseRecord.model_validate(found).transform()
    place_m, turn = off.as_components()
    assert np.linalg.norm(place_m) < 2e-4
    assert turn.magnitude() < 1e-3


def test_sqlite_with_joints_alone_and_an_arm_by_its_name(
    tour: Tour, at_rest: list[Message], tmp_path: Path
) -> None:
    """Joints stand in the alphabet's order, not that of the arm."""
    content = [*at_rest, *bags.joints_of(tour)]
    bag = write_bag(tmp_path / "bag", content, StoragePlugin.SQLITE3)
    result, recording = _imported(bag, tmp_path / "out", "--robot", "ur5e")
    assert "made of the joints by the kinematics of ur5e" in _says(result, "poses are")
    assert "do not show" in _says(result, "clock")
    np.testing.assert_allclose(_poses(recording), tour.flange(_taken(at_rest)), atol=1e-9)
    joints = np.array([frame.joints_rad for frame in recording.frames])
    np.testing.assert_allclose(joints, tour.joints(_taken(at_rest)), atol=1e-9)


def _taken(messages: list[Message]) -> FloatArray:
    return np.array([at - LATE_S for _, _, at, _ in messages])


def test_the_mcap_library_s_file_with_the_arm_s_own_description(
    tour: Tour, at_rest: list[Message], tmp_path: Path
) -> None:
    """Another arm's kinematics: used as they are, and the pictures speak against them."""
    names = ("pan", "lift", "elbow", "roll", "bend", "turn")
    path = tmp_path / "logged.mcap"
    text = urdf(OFFSET_WRIST)
    with path.open("wb") as file:
        writer = McapWriter(file)
        kinds = {"std_msgs/msg/String", "sensor_msgs/msg/JointState", "sensor_msgs/msg/Image"}
        known = {
            kind: writer.register_msgdef(kind, bags.TYPES.generate_msgdef(kind, ros_version=2)[0])
            for kind in kinds
        }

        def put(topic: str, kind: str, at: float, content: dict[str, Any]) -> None:
            stamped = START_NS + round(1e9 * at)
            writer.write_message(topic, known[kind], content, stamped, stamped)

        put("/robot_description", "std_msgs/msg/String", 0.0, {"data": text})
        for at in np.arange(-0.1, tour.end_s, 0.02):
            angles = dict(zip(names, tour.joints(np.array([at]))[0].tolist(), strict=True))
            ordered = sorted(names)
            position = [angles[name] for name in ordered]
            content = {"header": _header(at), "name": ordered, "position": position}
            put("/joint_states", "sensor_msgs/msg/JointState", at, content)
        for topic, kind, at, message in at_rest:
            fields = ("height", "width", "encoding", "is_bigendian", "step")
            content = {name: getattr(message, name) for name in fields}
            content |= {"header": _header(at), "data": message.data.tobytes()}
            put(topic, kind, at, content)
        writer.finish()
    arguments = ["import", str(path), "--board", STATED, "-o", str(tmp_path / "out"), "--json"]
    done = CliRunner().invoke(app, arguments)
    assert isinstance(done.exception, BadAnswer)
    assert "robot_description from base_link to tool0" in _says(json.loads(done.stdout), "the arm")
    recording = read_recording(tmp_path / "out")
    assert (tmp_path / "out" / "arm.urdf").read_text() == text
    model = recording.header.robot.model
    assert model is not None
    expected = arm(model).forward(tour.joints(_taken(at_rest) + LATE_S))
    np.testing.assert_allclose(_poses(recording), expected, atol=1e-9)


def _poses_bag(path: Path, tour: Tour, at_rest: list[Message], topics: tuple[str, ...]) -> Path:
    """Written by the mcap library: pictures, and poses of the flange 25 times a second."""
    kinds = ("geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/CompressedImage")
    with path.open("wb") as file:
        writer = McapWriter(file)
        known = {
            kind: writer.register_msgdef(kind, bags.TYPES.generate_msgdef(kind, ros_version=2)[0])
            for kind in kinds
        }
        times = np.arange(-0.1, tour.end_s + 0.1, 0.04)
        for at, pose in zip(times, tour.flange(times), strict=True):
            turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
            content = {
                "header": _header(at) | {"frame_id": "robot_base"},
                "pose": {
                    "position": dict(zip("xyz", pose[:3, 3].tolist(), strict=True)),
                    "orientation": dict(zip("xyzw", turn.tolist(), strict=True)),
                },
            }
            stamped = START_NS + round(1e9 * at)
            for topic in topics:
                writer.write_message(topic, known[kinds[0]], content, stamped, stamped)
        for _, _, at, message in at_rest:
            pixels = message.data.reshape(message.height, message.width)
            packed = cv2.imencode(".jpg", pixels)[1].tobytes()
            content = {"header": _header(at), "format": "jpeg", "data": packed}
            stamped = START_NS + round(1e9 * at)
            writer.write_message(
                f"{PICTURES}/compressed", known[kinds[1]], content, stamped, stamped
            )
        writer.finish()
    return path


def test_a_topic_of_poses_is_the_flange_s(
    tour: Tour, at_rest: list[Message], tmp_path: Path
) -> None:
    """The only one is taken; of two, the one that is named; bounded in time like transforms."""
    some = at_rest[:3]
    bag = _poses_bag(tmp_path / "one.mcap", tour, some, ("/tcp_pose",))
    result, recording = _imported(bag, tmp_path / "out")
    assert "of /tcp_pose in robot_base" in _says(result, "poses are")
    assert "bound 50 ms" in _says(result, "interpolated")
    expected = tour.flange(_taken(some))
    np.testing.assert_allclose(_poses(recording), expected, atol=1e-6)
    words = _refused(bag, tmp_path / "late", "--time-bound", "0.001")
    assert "no picture has joints or transforms within 1 ms" in words
    two = _poses_bag(tmp_path / "two.mcap", tour, at_rest[:1], ("/tcp_pose", "/goal"))
    assert "--pose-topic: /goal, /tcp_pose" in _refused(two, tmp_path / "two")
    assert "--pose-topic /none: is no such topic" in _refused(
        two, tmp_path / "two", "--pose-topic", "/none"
    )


def test_a_pose_topic_that_is_named_comes_before_the_transforms(
    tour: Tour, at_rest: list[Message], tmp_path: Path
) -> None:
    some = at_rest[:3]
    kind = "geometry_msgs/msg/PoseStamped"
    times = np.arange(-0.1, tour.end_s + 0.1, 0.04)
    moved = [
        (topic, kind, at, bags.pose_stamped("base", pose @ shift, at))
        for topic, shift in (("/tcp", np.eye(4)), ("/goal", np.diag([-1.0, -1.0, 1.0, 1.0])))
        for at, pose in zip(times, tour.flange(times), strict=True)
    ]
    elsewhere = bags.transforms(bags.transform("base", "tool0", np.eye(4), 0.0))
    tf = [("/tf", "tf2_msgs/msg/TFMessage", 0.0, elsewhere)]
    bag = write_bag(tmp_path / "bag", [*some, *moved, *tf])
    result, recording = _imported(bag, tmp_path / "out", "--pose-topic", "/tcp")
    assert "of /tcp in base" in _says(result, "poses are")
    np.testing.assert_allclose(_poses(recording), tour.flange(_taken(some)), atol=1e-6)


def test_a_ros_1_bag_with_transforms(tour: Tour, at_rest: list[Message], tmp_path: Path) -> None:
    """Compressed pieces, ROS 1's headers and type names; pictures as they were."""
    content = [*at_rest, *bags.tf_of(tour)]
    lz4 = Ros1Writer.CompressionFormat.LZ4
    bag = bags.write_ros1_bag(tmp_path / "ros1.bag", content, lz4)
    result, recording = _imported(bag, tmp_path / "out")
    assert "transforms from base to tool0" in _says(result, "poses are")
    assert result["with_corners"] == result["with_pose"] == STOPS
    np.testing.assert_allclose(_poses(recording), tour.flange(_taken(at_rest)), atol=1e-6)
    first = at_rest[0][3]
    pixels = recording.image(recording.frames[0])
    np.testing.assert_array_equal(pixels, first.data.reshape(first.height, first.width))


def _header(time_s: float) -> dict[str, Any]:
    at_ns = START_NS + round(1e9 * time_s)
    return {"stamp": {"sec": at_ns // 10**9, "nanosec": at_ns % 10**9}, "frame_id": ""}


def test_an_arm_that_never_stops_gives_moving_frames(
    tour: Tour, pictures: list[Message], tmp_path: Path
) -> None:
    some = [message for message in pictures if 0.4 < message[2] < 1.7]
    bag = write_bag(tmp_path / "bag", [*some, *bags.tf_of(tour)])
    options = ("--clock-offset", str(-LATE_S))
    result, recording = _imported(bag, tmp_path / "out", *options)
    assert recording.header.capture.mode == "moving"
    assert "capture: moving" in _says(result, "stood still")
    assert "-35.0 ms are added as stated" in _says(result, "clock")
    # 20 ms between transforms of an arm that accelerates
    np.testing.assert_allclose(_poses(recording), tour.flange(_taken(some)), atol=5e-4)


def test_pictures_alone_are_a_recording_without_poses(
    at_rest: list[Message], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "bag", at_rest)
    result, recording = _imported(bag, tmp_path / "out")
    assert "--base and --flange" in _says(result, "no flange poses")
    assert result["with_pose"] == 0
    assert len(recording.frames) == STOPS


def test_what_is_not_stated_is_asked_for_with_the_list(
    tour: Tour, at_rest: list[Message], tmp_path: Path
) -> None:
    """Two cameras, two arms; a depth camera and the same pictures compressed are no question."""
    one = at_rest[0]
    depth = ("/camera/depth/image_raw", *one[1:])
    other = ("/left/image_raw", *one[1:])
    second = list(bags.joints_of(tour, "/second/joints"))
    first = list(bags.joints_of(tour, "/first/joints"))
    bag = write_bag(tmp_path / "bag", [*at_rest, depth, other, *first, *second])
    words = _refused(bag, tmp_path / "out")
    assert "--image-topic: /camera/image_raw (sensor_msgs/msg/Image, 9), /left/image_raw" in words
    assert "depth" not in words
    words = _refused(bag, tmp_path / "out", "--image-topic", PICTURES)
    assert "--joint-topic: /first/joints" in words
    words = _refused(bag, tmp_path / "out", "--image-topic", "/none")
    assert "is no such topic" in words
    options = ("--image-topic", PICTURES, "--joint-topic", "/second/joints", "--robot", "ur5e")
    result, _ = _imported(bag, tmp_path / "out", *options)
    assert result["with_pose"] == STOPS
    assert not (tmp_path / "elsewhere").exists()


def test_poses_too_far_in_time_are_refused_with_the_remedy(
    tour: Tour, at_rest: list[Message], tmp_path: Path
) -> None:
    late = [(topic, kind, at, _stamped(message, 3600.0)) for topic, kind, at, message in at_rest]
    bag = write_bag(tmp_path / "bag", [*late, *bags.tf_of(tour)])
    words = _refused(bag, tmp_path / "out")
    assert "--time-bound" in words
    assert "--clock-offset" in words
    assert "is no frame of the bag's transforms: base, base_link, tool0" in _refused(
        bag, tmp_path / "out", "--base", "world"
    )


def _stamped(message: Any, time_s: float) -> Any:
    return T["sensor_msgs/msg/Image"](**{**vars(message), "header": bags.header(time_s)})


def _cut(path: Path, share: float) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])


BREAKS: dict[str, Callable[[Path], object]] = {
    "cut in the middle": lambda path: _cut(path, 0.5),
    "cut near the end": lambda path: _cut(path, 0.999),
    "empty": lambda path: path.write_bytes(b""),
    "noise": lambda path: path.write_bytes(np.random.default_rng(1).bytes(4000)),
    "noise at its beginning": lambda path: path.write_bytes(
        path.read_bytes()[:12] + np.random.default_rng(1).bytes(1000) + path.read_bytes()[1012:]
    ),
}


@pytest.mark.parametrize("how", BREAKS)
@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_broken_bag_is_refused_in_one_line(
    storage: StoragePlugin, how: str, at_rest: list[Message], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "bag", at_rest[:1], storage)
    (file,) = [path for path in bag.iterdir() if path.suffix != ".yaml"]
    BREAKS[how](file)
    words = _refused(bag, tmp_path / "out")
    assert "cannot be read as a ROS bag" in words or "no picture" in words
    assert "\n" not in words


def test_a_folder_without_its_files_and_a_file_that_is_not_there(
    at_rest: list[Message], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "bag", at_rest[:1])
    for file in bag.glob("*.mcap"):
        file.rename(tmp_path / "moved.mcap")
    assert "no pictures" in _refused(bag, tmp_path / "out")
    assert "is not there" in _refused(tmp_path / "none.mcap", tmp_path / "out")
    _imported(tmp_path / "moved.mcap", tmp_path / "out")
