from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cell.errors import EXIT_INPUT, InputError
from cell.storage.recording import (
    Corners,
    FrameRecord,
    RecordingWriter,
    read_recording,
    write_corners,
)
from cell.storage.recording.header import Header
from tests.cell.recordings import HEADER, corner_rows, frame_line

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


def test_size_comes_from_a_picture_where_the_header_does_not_tell(recording_folder: Folder) -> None:
    header = HEADER.replace("width: 64, height: 48, ", "width: null, height: null, ")
    folder = recording_folder(header=header, frames=frame_line(0, image="a.png"))
    cv2.imwrite(str(folder / "a.png"), np.zeros((30, 40), np.uint8))
    assert read_recording(folder).size_px == (40, 30)


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
        with pytest.raises(FileExistsError):
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
