"""`cell calibrate` on recordings: files in, files out, clear words for what cannot be."""

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from calib.detection.same_order import same_order_everywhere
from calib.views import Views
from cell.errors import BadAnswer, InputError
from cell.storage.recording import read_recording
from cell.verbs.calibrate import calibrate_into, default_folder
from cell.views.numbers import millimetres
from cell.views.terminal.summary import answer_line
from tests.paper.scene import mixed_scene


def _write(folder: Path, views: Views) -> Path:
    folder.mkdir()
    board = views.board
    (folder / "recording.yaml").write_text(
        f"schema: cell.recording/1\nname: bench\nrobot: {{model: null}}\n"
        f"camera: {{width: {views.width_px}, height: {views.height_px}}}\n"
        f"board: {{type: chessboard, rows: {board.rows}, cols: {board.cols},"
        f" square_m: {board.square_m}}}\nmount: {views.mount}\nimages: null\n"
    )
    from scipy.spatial.transform import Rotation

    with (folder / "frames.jsonl").open("w") as file:
        for number, pose in zip(views.frame, views.base_from_flange, strict=True):
            q = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
            pose_record = {"p_m": pose[:3, 3].tolist(), "q_xyzw": q}
            line = {"frame": int(number), "image": None, "base_from_flange": pose_record}
            file.write(json.dumps(line) + "\n")
    with (folder / "detections.csv").open("w") as file:
        file.write("frame,row,col,u_px,v_px\n")
        for number, corners in zip(views.frame, views.corners_px, strict=True):
            for m, (u, v) in enumerate(corners):
                if np.isfinite(u):
                    file.write(f"{number},{m // board.cols},{m % board.cols},{u:.4f},{v:.4f}\n")
    return folder


def test_it_writes_the_file_and_the_report_and_leaves_the_recording_alone(tmp_path: Path) -> None:
    folder = _write(tmp_path / "bench", mixed_scene(noise_px=0.1).views)
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    calibrated, out = calibrate_into(read_recording(folder), tmp_path / "out")
    content = json.loads((out / "calibration.json").read_text())
    assert content == json.loads(json.dumps(calibrated.mapping))
    assert content["schema"] == "cell.calibration/1"
    assert len(content["frames_used"]) == 27
    report = unescape((out / "report.html").read_text())
    error = content["answer"]["error_at_work_piece_m"]["p95"]
    assert error > 1e-5
    shown = millimetres(error)
    assert f"allows {shown} at the work piece" in answer_line(content), "in the terminal"
    assert f"allows {shown} at the work piece" in report, "in the first sentence"
    assert re.search(rf"Error at the work piece</[^>]+>\s*<[^>]+>{re.escape(shown)}<", report), (
        "tile"
    )
    assert f"answer, 95 %: {shown}" in report, "chart"
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before


def test_results_go_beside_the_recording_or_here_where_it_is_read_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = read_recording(_write(tmp_path / "bench", mixed_scene(noise_px=0.1).views))
    assert default_folder(recording) == tmp_path / "bench" / "calibration"
    monkeypatch.setattr("cell.storage.files.results.os.access", lambda *_: False)
    monkeypatch.chdir(tmp_path)
    assert default_folder(recording) == tmp_path / "bench-calibration"


def test_two_frames_only_is_a_bad_answer_with_exit_status_1(tmp_path: Path) -> None:
    views = mixed_scene(noise_px=0.1).views.take(np.array([0, 20]))
    with pytest.raises(BadAnswer, match="2 of 2 frames") as caught:
        calibrate_into(read_recording(_write(tmp_path / "two", views)), tmp_path / "out")
    assert caught.value.exit_status == 1
    assert not (tmp_path / "out").exists()


def test_pictures_that_are_no_images_are_reported_frame_by_frame(tmp_path: Path) -> None:
    folder = _write(tmp_path / "bad", mixed_scene().views.take(np.arange(4)))
    (folder / "detections.csv").unlink()
    (folder / "broken.png").write_text("not a picture")
    lines = [json.loads(line) for line in (folder / "frames.jsonl").read_text().splitlines()]
    text = "".join(json.dumps(line | {"image": "broken.png"}) + "\n" for line in lines)
    (folder / "frames.jsonl").write_text(text)
    with pytest.raises(BadAnswer, match="is not an image"):
        calibrate_into(read_recording(folder), tmp_path / "out")


def test_an_output_that_cannot_be_written_is_bad_input(tmp_path: Path) -> None:
    folder = _write(tmp_path / "bench", mixed_scene(noise_px=0.1).views)
    (tmp_path / "out").write_text("a file, not a folder")
    with pytest.raises(InputError, match="cannot be written"):
        calibrate_into(read_recording(folder), tmp_path / "out")


def test_half_turned_frames_of_a_symmetric_board_are_turned_back(tmp_path: Path) -> None:
    from dataclasses import replace

    from calib.views import Board

    views = mixed_scene(noise_px=0.1).views
    even = Board("chessboard", rows=7, cols=9, square_m=0.025)
    corners = views.corners_px.reshape(len(views), 7, 10, 2)[:, :, :9].reshape(len(views), 63, 2)
    turned = corners.copy()
    turned[[2, 9, 20]] = turned[[2, 9, 20], ::-1]
    plain = replace(views, board=even, corners_px=turned, corner_sigma_px=np.zeros((27, 63)))
    assert np.array_equal(same_order_everywhere(plain).corners_px, corners)


def test_a_square_board_of_even_sides_has_one_order_in_every_frame() -> None:
    from dataclasses import replace

    import cv2

    from calib.views import Board

    views = mixed_scene(noise_px=0.0).views
    known = views.corners_px.reshape(len(views), 7, 10, 2)
    board = Board("chessboard", rows=14, cols=14, square_m=0.02)
    ends = np.array([[0, 0], [13, 0], [13, 13], [0, 13]], np.float32)
    grid = np.stack(np.meshgrid(np.arange(14.0), np.arange(14.0)), -1).reshape(1, -1, 2)
    corners = np.array(
        [
            cv2.perspectiveTransform(
                grid,
                cv2.getPerspectiveTransform(
                    ends, np.array([k[0, 0], k[0, -1], k[-1, -1], k[-1, 0]], np.float32)
                ),
            )[0]
            for k in known
        ]
    )
    turned = corners.copy()
    turned[[2, 9]] = turned[[2, 9], ::-1]
    # as a file's reader may lay them out in memory
    strided = np.ascontiguousarray(turned.swapaxes(0, 2)).swapaxes(0, 2)
    sigma = np.zeros(corners.shape[:2])
    plain = replace(views, board=board, corners_px=strided, corner_sigma_px=sigma)
    assert np.array_equal(same_order_everywhere(plain).corners_px, corners)


def test_corners_far_off_stand_in_the_file_and_in_the_report(tmp_path: Path) -> None:
    from dataclasses import replace

    views = mixed_scene(noise_px=0.1).views
    corners = views.corners_px.copy()
    corners[4, [10, 33]] += 5.0
    corners[8, 2] -= 6.0
    folder = _write(tmp_path / "bench", replace(views, corners_px=corners))
    _, out = calibrate_into(read_recording(folder), tmp_path / "out")
    content = json.loads((out / "calibration.json").read_text())
    reported = {one["frame"]: one["corners"] for one in content["corners_left_out"]}
    assert reported == {4: [10, 33], 8: [2]}
    report = (out / "report.html").read_text()
    assert "3 corners lie far from the board and had no say (frames 4, 8)" in report
