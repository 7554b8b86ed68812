from __future__ import annotations

import logging
import math
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cell.errors import EXIT_DEVICE, EXIT_INPUT, DiskFailed, InputError
from cell.storage.incoming import read_picture
from cell.storage.recording import (
    Corners,
    FrameRecord,
    RecordingWriter,
    read_recording,
    write_corners,
)
from cell.storage.recording.detect import detect_corners
from cell.storage.recording.header import Header
from tests.cell.recordings import HEADER, POSE, corner_rows, frame_line

Folder = Callable[..., Path]


def test_frames_and_corners_become_views(recording_folder: Folder) -> None:
    views = read_recording(recording_folder()).views()
    assert len(views) == 3
    assert views.seen.all()
    assert views.corners_px[2, 4].tolist() == [10 + 5 + 2, 8 + 5]
    assert views.base_from_flange[0, :3, 3].tolist() == [0.5, 0.0, 0.4]
    assert np.isnan(views.joint_velocity_rad_s).all()
    assert (views.robot_model, views.width_px, views.mount) == ("ur5e", 64, "eye_in_hand")


def test_every_value_may_be_null_and_unknown_keys_are_kept(recording_folder: Folder) -> None:
    line = frame_line(7, base_from_flange=None, joints_rad=None, t_s=None, humidity=0.4)
    recording = read_recording(
        recording_folder(frames=line, detections="frame,row,col,u_px,v_px\n")
    )
    views = recording.views()
    assert not views.has_pose.any()
    assert not views.seen.any()
    assert '"humidity": 0.4' in recording.frames[0].as_line()


def test_a_camera_s_clock_of_nanoseconds_is_a_number_like_others(recording_folder: Folder) -> None:
    stamp = 1_795_000_000_123_456_789
    line = frame_line(7, camera_raw={"host_timestamp_ns": stamp, "counter": 2**64 - 1})
    (frame,) = read_recording(recording_folder(frames=line, detections=None)).frames
    assert (frame.model_extra or {})["camera_raw"]["host_timestamp_ns"] == stamp


def test_half_written_last_line_is_dropped_aloud(
    recording_folder: Folder, caplog: pytest.LogCaptureFixture
) -> None:
    text = frame_line(0) + frame_line(1) + frame_line(2)[:50]
    with caplog.at_level(logging.WARNING):
        recording = read_recording(recording_folder(frames=text))
    assert [frame.frame for frame in recording.frames] == [0, 1]
    assert "frames.jsonl:3" in caplog.text


def test_half_written_last_corner_is_dropped_aloud(
    recording_folder: Folder, caplog: pytest.LogCaptureFixture
) -> None:
    text = "frame,row,col,u_px,v_px\n" + corner_rows(0)[:-1]
    with caplog.at_level(logging.WARNING):
        views = read_recording(recording_folder(detections=text)).views()
    assert views.seen.sum() == 5
    assert "detections.csv:7" in caplog.text


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"header": HEADER.replace("/1", "/2")}, r"recording.yaml:1:1: schema: .*newer version"),
        ({"header": HEADER.replace("/1", "/0")}, r"expected cell.recording/1"),
        ({"header": HEADER.replace("recording/1", "plan/1")}, r"is this the right file"),
        ({"header": "board: ["}, r"recording.yaml:1:\d+: is not valid YAML"),
        ({"header": ""}, r"is empty"),
        (
            {"header": HEADER.replace("rows: 2, ", "")},
            r"yaml:5:1: board.rows: is missing",
        ),
        ({"header": HEADER.replace("0.025", "-1")}, r"yaml:5:\d+: board.square_m: .*\(got -1\)"),
        ({"frames": ""}, "has no frame"),
        ({"frames": "{oops\n" + frame_line(1)}, r"frames.jsonl:1: is not a frame"),
        ({"frames": frame_line(1) + frame_line(1)}, r"frames.jsonl:2: frame 1 .* twice"),
        ({"frames": '{"t_s": 1.0}\n'}, r"frames.jsonl:1: frame without a number: frame is missing"),
        ({"frames": frame_line(0, t_s="noon")}, r"frames.jsonl:1: frame 0: t_s: .*\(got 'noon'\)"),
        (
            {"frames": frame_line(0, base_from_flange={"p_m": [0, 0, 0], "q_xyzw": [0, 0, 0, 0]})},
            "no unit quaternion",
        ),
    ],
)
def test_broken_recording_says_where(
    recording_folder: Folder, files: dict[str, str], message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_recording(recording_folder(**files))
    assert caught.value.exit_status == EXIT_INPUT


@pytest.mark.parametrize(
    ("detections", "message"),
    [
        ("frame,row,col,u_px\n", r"detections.csv:1: has no column v_px"),
        ("frame,row,col,u_px,v_px\n0,2,0,1,1\n", r"detections.csv:2: corner \(2, 0\) lies outside"),
        ("frame,row,col,u_px,v_px\n0,1,0,one,1\n", r"detections.csv:2: is no corner"),
        ("frame,row,col,u_px,v_px\n0,1,0,1,1\n0,1,0,1,1\n", r"detections.csv:3: .*twice"),
    ],
)
def test_broken_detections_say_where(
    recording_folder: Folder, detections: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read_recording(recording_folder(detections=detections)).views()


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no folder"):
        read_recording(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"recording.yaml: cannot be read"):
        read_recording(tmp_path)


def test_image_that_is_not_an_image(recording_folder: Folder) -> None:
    folder = recording_folder(frames=frame_line(0, image="a.png") + frame_line(1, image="b.png"))
    (folder / "a.png").write_text("not a picture")
    recording = read_recording(folder)
    with pytest.raises(InputError, match=r"a.png: is not an image"):
        recording.image(recording.frames[0])
    with pytest.raises(InputError, match=r"b.png: cannot be read: No such file"):
        recording.image(recording.frames[1])


def test_size_comes_from_a_picture_where_the_header_has_none(recording_folder: Folder) -> None:
    header = HEADER.replace("width: 64, height: 48, ", "width: null, height: null, ")
    folder = recording_folder(header=header, frames=frame_line(0, image="a.png"))
    cv2.imwrite(str(folder / "a.png"), np.zeros((30, 40), np.uint8))
    assert read_recording(folder).size_px == (40, 30)


def test_a_picture_of_another_size_is_another_camera_s(recording_folder: Folder) -> None:
    lines = "".join(frame_line(k, image=f"{k}.png") for k in range(3))
    folder = recording_folder(frames=lines)
    for k, size in enumerate([(48, 64), (24, 32), (48, 64)]):
        cv2.imwrite(str(folder / f"{k}.png"), np.full(size, 200, dtype=np.uint8))
    found = detect_corners(read_recording(folder))
    assert "has 32x24 pixels, and the recording's camera 64x48" in found.rejected[1]
    assert "another camera, binning or region, or a scaled picture" in found.rejected[1]
    assert not any("pixels, and" in found.rejected[k] for k in (0, 2))


def test_a_picture_is_decoded_once_for_corners_and_report(
    recording_folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = recording_folder(frames=frame_line(0, image="a.png"))
    cv2.imwrite(str(folder / "a.png"), np.arange(600_000, dtype=np.uint16).reshape(600, 1000))
    read: list[Path] = []

    def counted(path: Path) -> NDArray[np.generic]:
        read.append(path)
        return read_picture(path)

    monkeypatch.setattr("cell.storage.recording.recording.read_picture", counted)
    recording = read_recording(folder)
    frame = recording.frames[0]
    assert recording.image(frame).shape == (600, 1000)
    small = recording.thumbnail(frame)
    assert (small.shape, small.dtype) == ((132, 220), np.uint16)
    assert len(read) == 1


def test_corners_survive_writing_and_reading(recording_folder: Folder, tmp_path: Path) -> None:
    folder = recording_folder()
    recording = read_recording(folder)
    px = np.random.default_rng(1).uniform(0, 60, (6, 2))
    px[3] = np.nan
    corners = Corners({4: px}, {4: np.full(6, 0.02)}, {4: 1.25})
    write_corners(folder / "detections.csv", corners, recording.board)
    back = read_recording(folder).detections()
    np.testing.assert_allclose(back.px[4], px, atol=6e-7)
    assert back.blur_px == {4: 1.25}
    assert np.isnan(back.sigma_px[4]).tolist() == [False, False, False, True, False, False]


def header(images: str | None = "images/") -> Header:
    return Header.model_validate(
        {
            "schema": "cell.recording/1",
            "board": {"type": "charuco", "squares_x": 5, "squares_y": 7, "square_m": 0.03,
                      "marker_m": 0.02, "dictionary": "DICT_6X6_250"},
            "images": images,
            "plan_sha256": "abc",
        }
    )  # fmt: skip


def test_written_frames_are_read_back(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (48, 64), dtype=np.uint8)
    with RecordingWriter.create(tmp_path / "r", header()) as writer:
        writer.append(FrameRecord.model_validate({"frame": 0, "wind": "calm"}), image)
        writer.append(FrameRecord(frame=1, t_s=0.5))
    recording = read_recording(tmp_path / "r")
    assert recording.header.as_mapping()["plan_sha256"] == "abc"
    assert (recording.board.rows, recording.board.cols) == (6, 4)
    assert recording.frames[0].image == "images/00000.png"
    np.testing.assert_array_equal(recording.image(recording.frames[0]), image)
    assert recording.frames[1].t_s == 0.5


def test_a_recording_is_never_overwritten(tmp_path: Path) -> None:
    with RecordingWriter.create(tmp_path / "r", header()) as writer:
        writer.append(FrameRecord(frame=0), np.zeros((4, 4), np.uint8))
        with pytest.raises(DiskFailed, match=r"00000.png: is there already and is never overwr"):
            writer.append(FrameRecord(frame=0), np.zeros((4, 4), np.uint8))
    with pytest.raises(InputError, match="never overwritten"):
        RecordingWriter.create(tmp_path / "r", header())


def test_resume_cuts_the_half_line_and_sets_unlogged_pictures_aside(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    with RecordingWriter.create(folder, header()) as writer:
        writer.append(FrameRecord(frame=0), np.full((4, 4), 1, np.uint8))
        writer.append(FrameRecord(frame=1), np.full((4, 4), 2, np.uint8))
    lines = folder / "frames.jsonl"
    lines.write_bytes(lines.read_bytes()[:-1])
    writer, frames = RecordingWriter.resume(folder)
    with writer:
        assert [frame.frame for frame in frames] == [0]
        writer.append(FrameRecord(frame=1), np.full((4, 4), 3, np.uint8))
    recording = read_recording(folder)
    assert [frame.frame for frame in recording.frames] == [0, 1]
    assert int(recording.image(recording.frames[1])[0, 0]) == 3
    assert (folder / "images" / "unlogged" / "00001-0.png").exists()


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (lambda r: (r / "frames.jsonl").unlink(), r"frames.jsonl: was deleted"),
        (lambda r: _replaced(r / "frames.jsonl"), r"frames.jsonl: was deleted, cut or repl"),
        (lambda r: os.truncate(r / "frames.jsonl", 5), r"frames.jsonl: has 5 bytes"),
        (lambda r: (r / "frames.jsonl").write_text("x" * 999), r"frames.jsonl: has 999 bytes"),
        (lambda r: (r / "recording.yaml").unlink(), r"recording.yaml: was deleted"),
        (lambda r: shutil.rmtree(r / "images"), r"images: was deleted"),
        (lambda r: (r / "images").rename(r / "elsewhere"), r"images: was deleted"),
        (lambda r: (r / "images" / "00001.png").unlink(), r"00001.png: was deleted"),
        (lambda r: os.truncate(r / "images" / "00001.png", 9), r"00001.png: was deleted, cut"),
    ],
)
def test_the_writer_notices_that_what_it_wrote_is_gone(
    tmp_path: Path, harm: Callable[[Path], object], message: str
) -> None:
    with RecordingWriter.create(tmp_path / "r", header()) as writer:
        for frame in (0, 1):
            writer.append(FrameRecord(frame=frame), np.zeros((4, 4), np.uint8))
        writer.check_complete()
        harm(tmp_path / "r")
        with pytest.raises(DiskFailed, match=message) as caught:
            writer.append(FrameRecord(frame=2), np.zeros((4, 4), np.uint8))
        assert caught.value.exit_status == EXIT_DEVICE
        with pytest.raises(DiskFailed, match=message):
            writer.check_complete()


def _replaced(path: Path) -> None:
    """By another file of the same content, as an editor does."""
    other = path.with_name("other")
    other.write_bytes(path.read_bytes())
    other.replace(path)


def test_a_recording_that_is_moved_while_it_is_written_is_called_so(tmp_path: Path) -> None:
    with RecordingWriter.create(tmp_path / "r", header()) as writer:
        writer.append(FrameRecord(frame=0), np.zeros((4, 4), np.uint8))
        # the very instant between the look at the names and the writing
        writer._kept.check = lambda: (tmp_path / "r").rename(tmp_path / "moved")  # type: ignore
        with pytest.raises(DiskFailed, match="moved or deleted"):
            writer.append(FrameRecord(frame=1), np.zeros((4, 4), np.uint8))
    assert [frame.frame for frame in read_recording(tmp_path / "moved").frames] == [0]


def test_an_older_picture_that_is_gone_is_noticed_at_the_end(tmp_path: Path) -> None:
    with RecordingWriter.create(tmp_path / "r", header()) as writer:
        for frame in range(3):
            writer.append(FrameRecord(frame=frame), np.zeros((4, 4), np.uint8))
        (tmp_path / "r" / "images" / "00000.png").unlink()
        with pytest.raises(DiskFailed, match=r"00000.png: was deleted"):
            writer.check_complete()


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: path.write_bytes(b"")])
def test_going_on_needs_the_pictures_of_its_lines(
    tmp_path: Path, harm: Callable[[Path], object]
) -> None:
    with RecordingWriter.create(tmp_path / "r", header()) as writer:
        for frame in range(4):
            writer.append(FrameRecord(frame=frame), np.zeros((4, 4), np.uint8))
    harm(tmp_path / "r" / "images" / "00002.png")
    with pytest.raises(InputError, match=r"pictures of 1 frames are missing or empty \(frames 2\)"):
        RecordingWriter.resume(tmp_path / "r")
    shutil.rmtree(tmp_path / "r" / "images")
    with pytest.raises(InputError, match=r"pictures of 4 frames are missing"):
        RecordingWriter.resume(tmp_path / "r")


BAD_FRAMES = {
    "not finite": ({"t_s": math.nan}, r"t_s: must be a finite number"),
    "infinite pose": (
        {"base_from_flange": {**POSE, "p_m": [math.inf, 0, 0]}},
        r"base_from_flange.p_m.0: must be a finite number",
    ),
    "no rotation": ({"base_from_flange": {**POSE, "q_xyzw": [0, 0, 0, 0]}}, "no unit quaternion"),
    "millimetres": (
        {"base_from_flange": {**POSE, "p_m": [500.0, 0.0, 400.0]}},
        r"p_m is 640.3 m away .* others are 0.64 m away: is it in millimetres",
    ),
    "a word": ({"t_s": "noon"}, r"t_s: .*got 'noon'"),
    "a joint too many": (
        {"joints_rad": [0.1] * 7},
        "has 7 joint values where the other frames have 6",
    ),
    "thousands of joints": ({"joints_rad": [0.1] * 5000}, "at most 32 items"),
    "a lens focused on itself": ({"focus_distance_m": 0}, "focus_distance_m: .*greater than 0"),
    "a number without end": ({"gain_db": 10**400}, "gain_db: is larger than 1e"),
    "a NUL": ({"image": "a\0b"}, "image: holds a NUL"),
}


@pytest.mark.parametrize("kind", BAD_FRAMES)
def test_one_bad_frame_is_one_rejected_frame(
    recording_folder: Folder, caplog: pytest.LogCaptureFixture, kind: str
) -> None:
    values, message = BAD_FRAMES[kind]
    lines = [frame_line(0), frame_line(1, **values), *map(frame_line, range(2, 6))]
    rows = "".join(map(corner_rows, range(6)))
    with caplog.at_level(logging.WARNING):
        recording = read_recording(
            recording_folder(frames="".join(lines), detections=f"frame,row,col,u_px,v_px\n{rows}")
        )
    assert list(recording.rejected) == [1]
    assert re.search(rf"frames.jsonl:2: frame 1: .*{message}", recording.rejected[1])
    assert re.search(message, caplog.text)
    views = recording.views()
    assert views.seen.all(axis=1).tolist() == [True, False, True, True, True, True]
    assert views.has_pose.tolist() == [True, False, True, True, True, True]
    assert recording.detections().rejected == recording.rejected


def test_a_whole_log_in_millimetres_is_read_as_it_is(recording_folder: Folder) -> None:
    pose = {**POSE, "p_m": [500.0, 0.0, 400.0]}
    lines = [frame_line(frame, base_from_flange=pose) for frame in range(3)]
    recording = read_recording(recording_folder(frames="".join(lines)))
    assert not recording.rejected
    assert recording.views().has_pose.all()


@pytest.mark.parametrize("u_px", ["nan", "inf", "-1e300"])
def test_a_corner_that_is_nowhere_is_not_found(recording_folder: Folder, u_px: str) -> None:
    rows = corner_rows(0).replace("0,0,1,15,8", f"0,0,1,{u_px},8") + corner_rows(1)
    views = read_recording(recording_folder(detections=f"frame,row,col,u_px,v_px\n{rows}")).views()
    assert views.seen[0].tolist() == [True, False, True, True, True, True]
    assert np.isnan(views.corners_px[0, 1]).all()
