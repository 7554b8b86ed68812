"""ROS bags made here, by rosbags' own writer: a UR5e that goes from stop to stop with a camera."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.kinematics import arm
from calib.views import Board, FloatArray
from tests.detection.board_rendering import render_board

BOARD = Board("chessboard", 5, 6, 0.03)
STATED = "5x6x0.03"
WIDTH, HEIGHT, F_PX = 320, 240, 330.0
HAND = RigidTransform.from_components([0.03, -0.05, 0.08], Rotation.from_rotvec([0.1, -0.05, 0.4]))
SPOT = RigidTransform.from_components([-0.1, -0.33, 0.0], Rotation.from_rotvec([3.1, 0.1, 0.2]))
LATE_S = 0.035
"""The pictures are stamped so long after they were taken."""
START_NS = 1_764_000_000_000_000_000
STOPS, REST_S, MOVE_S = 9, 0.5, 0.6
JOINT_NAMES = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
               "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")  # fmt: skip
TYPES = get_typestore(Stores.ROS2_HUMBLE)
T = TYPES.types


def _stops() -> FloatArray:
    """(STOPS, 6) joints at which the camera looks at the board."""
    rng = np.random.default_rng(3)
    kinematics, joints = arm("ur5e"), []
    near = np.array([-1.3, -1.6, -1.8, -1.3, 1.6, 0.3])
    middle = np.array([*BOARD.corners_m.mean(axis=0)])
    for _ in range(STOPS):
        turn = Rotation.from_euler("xyz", [*rng.uniform(-22, 22, 2), rng.uniform(-60, 60)], True)
        away = np.array([*rng.uniform(-0.03, 0.03, 2), rng.uniform(0.36, 0.5)])
        camera_from_board = RigidTransform.from_components(away - turn.apply(middle), turn)
        flange = SPOT * (HAND * camera_from_board).inv()
        near = kinematics.inverse(flange.as_matrix(), near)
        joints.append(near)
    return np.array(joints)


@dataclass(frozen=True)
class Tour:
    """Joints over time."""

    stops: FloatArray

    @property
    def end_s(self) -> float:
        return STOPS * (REST_S + MOVE_S) - MOVE_S

    def joints(self, times_s: FloatArray) -> FloatArray:
        """(N, 6): rest, then a smooth move to the next stop."""
        leg, inside = np.divmod(np.clip(times_s, 0, self.end_s), REST_S + MOVE_S)
        leg = leg.astype(int)
        share = np.clip((inside - REST_S) / MOVE_S, 0, 1)
        smooth = share**2 * (3 - 2 * share)
        after = np.minimum(leg + 1, STOPS - 1)
        return self.stops[leg] + smooth[:, None] * (self.stops[after] - self.stops[leg])

    def flange(self, times_s: FloatArray) -> FloatArray:
        return arm("ur5e").forward(self.joints(times_s))


def tour() -> Tour:
    return Tour(_stops())


def rendered(base_from_flange: FloatArray) -> np.ndarray:
    """(h, w) 8 bits: what the camera sees."""
    camera_from_board = (RigidTransform.from_matrix(base_from_flange) * HAND).inv() * SPOT
    M = camera_from_board.as_matrix()
    K = np.array([[F_PX, 0, (WIDTH - 1) / 2], [0, F_PX, (HEIGHT - 1) / 2], [0, 0, 1]])
    lattice = np.diag([BOARD.square_m, BOARD.square_m, 1.0])
    H = K @ M[:3, [0, 1, 3]] @ lattice
    grey = render_board((HEIGHT, WIDTH), H, BOARD.rows, BOARD.cols, blur_px=0.8, samples=2)[0]
    noise = np.random.default_rng(int(1e6 * abs(M[0, 3]))).normal(0, 1.0, grey.shape)
    return np.clip(np.rint(grey + noise), 0, 255).astype(np.uint8)


def stamp(time_s: float) -> Any:
    at_ns = START_NS + round(1e9 * time_s)
    return T["builtin_interfaces/msg/Time"](sec=at_ns // 10**9, nanosec=at_ns % 10**9)


def header(time_s: float, frame: str = "") -> Any:
    return T["std_msgs/msg/Header"](stamp=stamp(time_s), frame_id=frame)


def image(pixels: np.ndarray, encoding: str, time_s: float, *, step: int = 0, big: int = 0) -> Any:
    data = np.frombuffer(pixels.tobytes(), np.uint8)
    return T["sensor_msgs/msg/Image"](
        header=header(time_s, "camera"),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=big,
        step=step or data.size // pixels.shape[0],
        data=data,
    )


def joint_state(angles: FloatArray, time_s: float) -> Any:
    """In the alphabet's order, as drivers publish them."""
    order = sorted(range(6), key=lambda k: JOINT_NAMES[k])
    return T["sensor_msgs/msg/JointState"](
        header=header(time_s),
        name=[JOINT_NAMES[k] for k in order],
        position=np.asarray(angles)[order],
        velocity=np.empty(0),
        effort=np.empty(0),
    )


def transform(parent: str, child: str, matrix: FloatArray, time_s: float) -> Any:
    turn = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    return T["geometry_msgs/msg/TransformStamped"](
        header=header(time_s, parent),
        child_frame_id=child,
        transform=T["geometry_msgs/msg/Transform"](
            translation=T["geometry_msgs/msg/Vector3"](*matrix[:3, 3].tolist()),
            rotation=T["geometry_msgs/msg/Quaternion"](*turn.tolist()),
        ),
    )


def pose_stamped(frame: str, matrix: FloatArray, time_s: float) -> Any:
    turn = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    return T["geometry_msgs/msg/PoseStamped"](
        header=header(time_s, frame),
        pose=T["geometry_msgs/msg/Pose"](
            position=T["geometry_msgs/msg/Point"](*matrix[:3, 3].tolist()),
            orientation=T["geometry_msgs/msg/Quaternion"](*turn.tolist()),
        ),
    )


def transforms(*stamped: Any) -> Any:
    return T["tf2_msgs/msg/TFMessage"](transforms=list(stamped))


Message = tuple[str, str, float, Any]
"""Topic, type, time of receipt, message."""


def joints_of(tour: Tour, topic: str = "/joint_states") -> Iterator[Message]:
    times = np.arange(-0.1, tour.end_s + 0.1, 0.01)
    for at, angles in zip(times, tour.joints(times), strict=True):
        yield topic, "sensor_msgs/msg/JointState", at, joint_state(angles, at)


def tf_of(tour: Tour) -> Iterator[Message]:
    half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
    yield (
        "/tf_static",
        "tf2_msgs/msg/TFMessage",
        -0.1,
        transforms(
            transform("base_link", "base", half_turn, -0.1),
            transform("wrist_3_link", "tool0", np.eye(4), -0.1),
        ),
    )
    times = np.arange(-0.1, tour.end_s + 0.1, 0.02)
    for at, pose in zip(times, tour.flange(times), strict=True):
        moved = transform("base_link", "wrist_3_link", half_turn @ pose, at)
        yield "/tf", "tf2_msgs/msg/TFMessage", at, transforms(moved)


def pictures_of(tour: Tour, topic: str = "/camera/image_raw") -> Iterator[Message]:
    """Ten a second, each stamped `LATE_S` after it was taken."""
    taken = np.arange(0.0, tour.end_s, 0.1)
    for at, pose in zip(taken, tour.flange(taken), strict=True):
        message = image(rendered(pose), "mono8", at + LATE_S)
        yield topic, "sensor_msgs/msg/Image", at + LATE_S, message


def write_bag(
    path: Path,
    messages: list[Message],
    storage: StoragePlugin = StoragePlugin.MCAP,
    zstd: CompressionMode = CompressionMode.NONE,
) -> Path:
    writer = Writer(path, version=9, storage_plugin=storage)
    writer.set_compression(zstd, CompressionFormat.ZSTD)
    with writer:
        known: dict[str, Any] = {}
        for topic, kind, at, message in sorted(messages, key=lambda m: m[2]):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            data = TYPES.serialize_cdr(message, kind)
            writer.write(known[topic], START_NS + round(1e9 * at), data)
    return path


ROS1_TYPES = get_typestore(Stores.ROS1_NOETIC)
ROS1_TYPES.register(
    get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
)


def write_ros1_bag(
    path: Path, messages: list[Message], compression: Ros1Writer.CompressionFormat | None = None
) -> Path:
    """The same messages as ROS 1 has them: a header counts, transforms are tf2_msgs'."""
    writer = Ros1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        known: dict[str, Any] = {}
        for topic, kind, at, message in sorted(messages, key=lambda m: m[2]):
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=ROS1_TYPES)
            content = _as_ros1(message)
            data = ROS1_TYPES.serialize_ros1(content, kind)
            writer.write(known[topic], START_NS + round(1e9 * at), data)
    return path


def _as_ros1(value: Any) -> Any:
    """A message of ROS 2 as one of ROS 1."""
    if isinstance(value, list):
        return [_as_ros1(each) for each in value]
    kind = getattr(value, "__msgtype__", None)
    if kind is None:
        return value
    fields = {k: _as_ros1(v) for k, v in vars(value).items() if not k.startswith("__")}
    if kind == "std_msgs/msg/Header":
        fields["seq"] = 0
    return ROS1_TYPES.types[kind](**fields)
