"""A ROS bag as a recording."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from calib.detection import Detection, detect
from calib.views import Board, FloatArray
from cell.errors import InputError
from cell.storage.recording import (
    FrameRecord,
    Header,
    PoseRecord,
    RecordingWriter,
    read_recording,
)
from cell.storage.recording.detect import Progress
from cell.verbs.importing.bags.bag import Bag, open_bag
from cell.verbs.importing.bags.clock import ClockOffset, clock_offset
from cell.verbs.importing.bags.contents import Contents, read_contents
from cell.verbs.importing.bags.pictures import picture
from cell.verbs.importing.bags.robot import Robot, find_robot, no_poses
from cell.verbs.importing.bags.stillness import choose, still
from cell.verbs.importing.bags.topics import image_topic, joint_topic, pose_topics
from cell.verbs.importing.described import Described
from cell.verbs.importing.outcome import Imported, checked, picture_check
from cell.verbs.importing.pairing import TIME_BOUND_S

_MOST_FOR_CLOCK = 60
_MOST_WITHOUT_POSES = 300
_SPEED_OVER_S = 0.01
_GOOD_RAD, _GOOD_SHARE = 0.06, 0.3
"""As far as rough intrinsics may be off; a wrong frame or mount is off by half the way and more."""


@dataclass(frozen=True)
class _Plan:
    """What is taken out of the bag: indices of pictures, their times by the joints' clock."""

    chosen: NDArray[np.int64]
    times_s: FloatArray
    moving: bool
    offset_s: float
    notes: tuple[str, ...]


def import_bag(
    source: Path, folder: Path, described: Described, progress: Progress | None = None
) -> Imported:
    """Make a recording in `folder` of a bag.

    Raises
    ------
    InputError
        The bag cannot be read, or does not show which topics are meant; the message lists them.
    BadAnswer
        The board was found in no picture.
    """
    if described.board is None:
        raise InputError(
            "no board: give --board ROWSxCOLSxSQUARE in inner corners and metres, such"
            " as --board 6x9x0.025"
        )
    stated = described.bag
    with open_bag(source) as bag:
        image = image_topic(bag, stated.image)
        poses = tuple(pose_topics(bag, stated.pose))
        contents = read_contents(bag, image, joint_topic(bag, stated.joints), poses)
        robot = find_robot(contents, described.robot, stated.base, stated.flange, stated.pose)
        header = _header(source, described, contents, robot, _size(bag, contents))
        plan = _plan(bag, contents, robot, described, header.board.board())
        header = _import_record(header, robot, plan)
        with TemporaryDirectory() as temporary:
            _write(bag, folder, _with_description(header, robot, Path(temporary)), robot, plan)
    recording = read_recording(folder)
    found = checked(recording, None, plan.notes, (), progress)
    return _held_against_pictures(found, robot, recording)


def _size(bag: Bag, contents: Contents) -> tuple[int, int]:
    """(width, height) of the first picture that is one."""
    fault = f"{bag.path}: {contents.image.name} has no picture"
    for _, pixels in _pictures(bag, contents, range(len(contents.picture_s))):
        if isinstance(pixels, str):
            fault = pixels
        else:
            return pixels.shape[1], pixels.shape[0]
    raise InputError(fault)


def _pictures(
    bag: Bag, contents: Contents, wanted: Collection[int]
) -> Iterator[tuple[int, NDArray[np.generic] | str]]:
    """Index and pixels of the pictures wanted, or why one is none."""
    for index, (_, _, message) in enumerate(bag.messages({contents.image.name})):
        if index in wanted:
            try:
                yield index, picture(message, f"{bag.path}: {contents.image.name}, message {index}")
            except InputError as fault:
                yield index, str(fault)


def _plan(bag: Bag, contents: Contents, robot: Robot, described: Described, board: Board) -> _Plan:
    times = contents.times_s
    order = np.argsort(times, kind="stable")
    notes = [f"the pictures are those of {contents.image.name}", *robot.notes]
    if contents.unstamped:
        notes.append(
            f"{contents.unstamped} pictures have no stamp: the time of their receipt is taken"
        )
    if not robot.has_poses:
        some = order[np.unique(np.linspace(0, len(order) - 1, _MOST_WITHOUT_POSES).astype(int))]
        return _Plan(some, times, False, 0.0, (*notes, no_poses(robot, contents)))
    offset_s, reported = _offset(bag, contents, robot, described, board, order)
    bound = TIME_BOUND_S if described.time_bound_s is None else described.time_bound_s
    at = times + offset_s
    away = robot.away_s(at)
    usable = away <= bound
    if not usable.any():
        nearest = float(away.min())
        raise InputError(
            f"{bag.path}: no picture has joints or transforms within {1e3 * bound:.3g} ms before"
            f" and after it (the nearest {1e3 * nearest:.3g} ms). Say --time-bound SECONDS if they"
            " are logged so rarely; otherwise the clocks differ: say --clock-offset SECONDS"
        )
    chosen, moving, why = choose(robot, at[order], usable[order], described.bag.take)
    if not len(chosen):
        raise InputError(f"{bag.path}: the arm never stands still; say --take moving")
    taken = order[chosen]
    notes += [reported, why, _bound_words(away[taken], bound, int((~usable).sum()))]
    return _Plan(taken, at, moving, offset_s, tuple(notes))


def _bound_words(away_s: FloatArray, bound_s: float, without: int) -> str:
    left = f"; {without} pictures without such are left out" if without else ""
    return (
        "poses are interpolated between the samples before and after the picture's stamp, at most"
        f" {1e3 * float(away_s.max()):.3g} ms away (bound {1e3 * bound_s:.3g} ms, --time-bound)"
        f"{left}"
    )


def _offset(
    bag: Bag,
    contents: Contents,
    robot: Robot,
    described: Described,
    board: Board,
    order: NDArray[np.int64],
) -> tuple[float, str]:
    """Seconds to add to the pictures' stamps, and what to say of it."""
    stated = described.bag.clock_offset_s
    found = _estimated(bag, contents, robot, board, order)
    if found is None:
        message = "the pictures do not show by how much the camera's clock is off from the joints'"
    else:
        late = "late" if found.offset_s < 0 else "early"
        message = (
            f"the camera's clock is {1e3 * abs(found.offset_s):.1f} ± {1e3 * found.sigma_s:.1f} ms"
            f" {late} against the joints'"
        )
    if stated is not None:
        return stated, f"{message}; {1e3 * stated:.1f} ms are added as stated (--clock-offset)"
    if found is None or not found.sure:
        return 0.0, f"{message}; nothing is added"
    return found.offset_s, f"{message}; made good (--clock-offset 0 leaves it)"


def _estimated(
    bag: Bag, contents: Contents, robot: Robot, board: Board, order: NDArray[np.int64]
) -> ClockOffset | None:
    """From some pictures that the arm moved at."""
    times = contents.times_s
    inside = robot.away_s(times[order]) < np.inf
    going = order[inside & ~still(robot, times[order])]
    if not len(going):
        return None
    some = going[np.unique(np.linspace(0, len(going) - 1, _MOST_FOR_CLOCK).astype(int))]
    corners: dict[int, FloatArray] = {}
    for index, pixels in _pictures(bag, contents, set(some.tolist())):
        seen = None if isinstance(pixels, str) else detect(pixels, board)
        if isinstance(seen, Detection):
            corners[index] = seen.corners_px
    whole = [k for k in some.tolist() if k in corners and np.isfinite(corners[k]).all()]
    if not whole:
        return None
    return clock_offset(robot, times[whole], np.array([corners[k] for k in whole]), board)


def _header(
    source: Path,
    described: Described,
    contents: Contents,
    robot: Robot,
    size_px: tuple[int, int],
) -> Header:
    info = contents.camera_info
    stated: dict[str, Any] = {"from": str(source), "image_topic": contents.image.name}
    stated["start_ns"] = contents.start_ns
    if info is not None:
        k, d = (getattr(info, n, getattr(info, n.upper(), ())) for n in ("k", "d"))
        stated["camera_info"] = {
            "distortion_model": str(info.distortion_model),
            "k": [float(v) for v in k],
            "d": [float(v) for v in d],
        }
    data: dict[str, Any] = {
        "schema": "cell.recording/1",
        "name": described.name or source.resolve().stem,
        "robot": {"model": described.robot},
        "camera": {"model": None, "width": size_px[0], "height": size_px[1]},
        "board": described.board,
        "mount": described.mount or "eye_in_hand",
        "images": "images/",
        "imported": stated,
    }
    return Header.model_validate(data)


def _import_record(header: Header, robot: Robot, plan: _Plan) -> Header:
    """The header with what was concluded."""
    known = dict((header.model_extra or {})["imported"])
    known |= {"clock_offset_s": plan.offset_s, "guessed": list(plan.notes)}
    if robot.way is not None:
        known |= {"base": robot.way.base, "flange": robot.way.flange}
    mode = "moving" if plan.moving else "stop"
    mapping = header.as_mapping() | {"imported": known, "capture": {"mode": mode}}
    return Header.model_validate(mapping)


def _with_description(header: Header, robot: Robot, temporary: Path) -> Header:
    """The header that names the bag's robot description, which the recording gets a copy of."""
    if robot.description is None:
        return header
    urdf = temporary / "arm.urdf"
    urdf.write_text(robot.description.text, encoding="utf-8")
    links = {"base": robot.description.base, "flange": robot.description.flange}
    return header.model_copy(
        update={"robot": header.robot.model_copy(update={"urdf": urdf, **links})}
    )


def _write(bag: Bag, folder: Path, header: Header, robot: Robot, plan: _Plan) -> None:
    bag_contents = Contents(bag.topics[(header.model_extra or {})["imported"]["image_topic"]])
    numbers = {int(index): frame for frame, index in enumerate(np.sort(plan.chosen))}
    with RecordingWriter.create(folder, header) as writer:
        for index, pixels in _pictures(bag, bag_contents, numbers):
            record = _frame(numbers[index], float(plan.times_s[index]), robot)
            if isinstance(pixels, str):
                writer.append(record.model_copy(update={"picture_fault": pixels}))
            else:
                writer.append(record, pixels)


def _frame(frame: int, time_s: float, robot: Robot) -> FrameRecord:
    values: dict[str, Any] = {"frame": frame, "t_s": time_s}
    at = np.array([time_s])
    if robot.has_poses:
        pose = RigidTransform.from_matrix(robot.poses(at)[0])
        values["base_from_flange"] = PoseRecord.of(pose)
    if robot.joints is not None:
        around = robot.joints.at(np.array([time_s - _SPEED_OVER_S, time_s, time_s + _SPEED_OVER_S]))
        values["joints_rad"] = tuple(around[1].tolist())
        speed = (around[2] - around[0]) / (2 * _SPEED_OVER_S)
        values["joint_velocity_rad_s"] = tuple(speed.tolist())
    return FrameRecord.model_validate(values)


def _held_against_pictures(found: Imported, robot: Robot, recording: Any) -> Imported:
    """What the pictures say of the poses, frames and mount that were taken."""
    if not robot.has_poses:
        return found
    corners, frames = recording.detections(), recording.frames
    posed = {f.frame: f.base_from_flange for f in frames if f.base_from_flange is not None}
    matrices = np.full((len(frames), 4, 4), np.nan)
    for frame, pose in posed.items():
        matrices[frame] = pose.transform().as_matrix()
    check = picture_check(len(frames), corners, recording.board, recording.header.mount)
    closure = None if check is None else check(matrices)
    if closure is None:
        return replace(found, guessed=(*found.guessed, "too few pictures to check the poses by"))
    message = (
        f"robot's and camera's turns agree to {np.degrees(closure.angle_rad):.2f} degrees, places"
        f" to {1e2 * closure.place_share:.1f} % of the way"
    )
    if closure.angle_rad <= _GOOD_RAD and closure.place_share <= _GOOD_SHARE:
        stated = f"the pictures bear the poses out: {message}"
        return replace(found, guessed=(*found.guessed, stated))
    against = f"the poses taken agree with the pictures only so: {message}. Check --base, --flange,"
    return replace(found, contradicted=(f"{against} --mount and --clock-offset",))
