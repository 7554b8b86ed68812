"""What the data do not determine, or contradict, is reported with its remedy and refused later."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.calibration import Calibration, calibrate
from calib.calibration.cautions import cautions, frames_text
from calib.chain.projection import project
from calib.chain.rigid import inverse
from calib.errors import CalibrationError
from calib.handeye import solve_hand_eye
from calib.views import Views
from cell.cli import main
from cell.verbs.log_warnings import log_mixups, mixup_warnings
from tests.calibration.test_cell_calibrate import _write
from tests.paper.scene import (
    BASE_FROM_FIXED,
    BOARD,
    FLANGE_FROM_MOUNTED,
    mixed_scene,
    scene,
)

VIEWS = mixed_scene(4, 8, noise_px=0.1, robot_mm=0.05).views


def undetermined(found: Calibration) -> set[str]:
    return {part for caution in found.cautions for part in caution.undetermined}


def output(found: Calibration) -> str:
    return " ".join(f"{c.what} ({c.where}): {c.remedy}" for c in found.cautions)


def test_a_sound_recording_determines_everything() -> None:
    found = calibrate(VIEWS)
    assert not undetermined(found)
    assert "not determined" not in output(found)


def one_orientation() -> Views:
    """A tilted board, seen from places that differ by translation alone."""
    seen = mixed_scene(0, 9)
    rng = np.random.default_rng(3)
    camera = np.tile(seen.camera_from_board[0], (9, 1, 1))
    camera[:, :3, 3] = rng.uniform(-0.04, 0.04, (9, 3))
    camera[:, 2, 3] = np.linspace(0.3, 0.6, 9)
    corners = project(np.tile(seen.optics[0], (9, 1)), camera, BOARD.corners_m)
    flange = BASE_FROM_FIXED @ inverse(camera) @ inverse(FLANGE_FROM_MOUNTED)
    noisy = corners + rng.normal(0, 0.1, corners.shape)
    return replace(seen.views, corners_px=noisy, base_from_flange=flange)


def test_views_of_one_tilt_determine_neither_lens_nor_hand_eye() -> None:
    views = one_orientation()
    with pytest.raises(CalibrationError, match="leave the focal length open"):
        calibrate(views)
    with pytest.raises(CalibrationError, match="keeps one orientation"):
        solve_hand_eye(
            np.linalg.inv(views.base_from_flange), views.base_from_flange, "eye_in_hand",
            np.zeros(3),
        )  # fmt: skip


def test_a_focal_length_known_to_a_few_percent_is_not_determined() -> None:
    found = calibrate(VIEWS.take(np.array([5, 7, 9])))
    name = "zhang_mle_no_skew"
    loose = replace(found.solutions[name], sigma={"alpha_px": 150.0})
    reported = cautions(VIEWS, {name: loose}, None, None, (), None)
    assert [caution.undetermined for caution in reported] == [("camera",)]
    assert "the board tilted by 20 to 45 degrees" in reported[0].remedy


def test_views_square_to_the_board_are_no_calibration_at_all() -> None:
    with pytest.raises(CalibrationError, match=r"focal length open|no real camera fits"):
        calibrate(scene(distance_m=np.linspace(0.4, 0.7, 9), tilt_deg=np.zeros(9)).views)


def with_poses(base_from_flange: np.ndarray) -> Views:
    return replace(VIEWS, base_from_flange=base_from_flange)


@pytest.mark.parametrize(
    ("scale", "words"),
    [(1e3, "millimetres"), (1e2, "centimetres"), (1 / 0.0254, "inches"), (2.0, "factor of 2")],
)
def test_another_unit_of_length_is_named(scale: float, words: str) -> None:
    poses = VIEWS.base_from_flange.copy()
    poses[:, :3, 3] *= scale
    found = calibrate(with_poses(poses))
    assert undetermined(found) == {"hand_eye"}
    assert words in output(found)
    assert "miss by" not in output(found)


def test_mirrored_pictures_are_named_by_the_sign_of_the_length() -> None:
    corners = VIEWS.corners_px.reshape(len(VIEWS), BOARD.rows, BOARD.cols, 2)[:, :, ::-1].copy()
    corners[..., 0] = VIEWS.width_px - 1 - corners[..., 0]
    found = calibrate(replace(VIEWS, corners_px=corners.reshape(VIEWS.corners_px.shape)))
    assert undetermined(found) == {"hand_eye"}
    assert "the pictures are mirrored" in output(found)


def test_a_tool_frame_set_midway_is_no_matter_of_units() -> None:
    poses = VIEWS.base_from_flange.copy()
    tool = np.eye(4)
    tool[:3, 3] = [0.05, -0.02, 0.25]
    poses[6:] = poses[6:] @ tool
    found = calibrate(with_poses(poses))
    assert undetermined(found) == {"hand_eye"}
    assert "by a factor of" not in output(found)
    assert "which picture each is of" in output(found)


def mixups_said(views: Views, found: Calibration) -> str:
    return " ".join(f"{w['what']}: {w['remedy']}" for w in mixup_warnings(log_mixups(views, found)))


def test_poses_of_the_other_direction_or_another_mount_are_named_as_a_pair() -> None:
    views = with_poses(inverse(VIEWS.base_from_flange))
    found = calibrate(views)
    assert undetermined(found) == {"hand_eye"}
    words = mixups_said(views, found)
    assert "it is flange_from_base, the inverse; or they are right, and the recording's" in words
    assert "`mount` is the wrong one of eye_in_hand and eye_to_hand" in words
    assert "the camera or the board rides on the flange" in words


def test_poses_that_froze_midway_are_named_by_the_calibration() -> None:
    poses = VIEWS.base_from_flange.copy()
    poses[6:] = poses[6]
    views = with_poses(poses)
    words = mixups_said(views, calibrate(views))
    assert "stands still from frame 7 to 11 while the pictures go on" in words


def test_identical_frames_count_once() -> None:
    copied = VIEWS.take(np.repeat(np.arange(len(VIEWS)), 3))
    copied = replace(copied, frame=np.arange(len(copied)))
    found, alone = calibrate(copied), calibrate(VIEWS)
    assert found.used.sum() == len(VIEWS)
    one, other = (c.solutions["joint_ml"].sigma["alpha_px"] for c in (found, alone))
    assert one == pytest.approx(other, rel=1e-6)
    assert "each counts once" in output(found)
    assert "frames 1-2, 4-5" in output(found)


def test_frames_as_runs() -> None:
    assert frames_text([7]) == "frame 7"
    assert frames_text([9, 1, 2, 3]) == "frames 1-3, 9"


def test_the_verb_says_it_exits_1_and_export_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    poses = VIEWS.base_from_flange.copy()
    poses[:, :3, 3] *= 1e3
    folder = _write(tmp_path / "bench", with_poses(poses))

    def cell(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["cell", *words])
        with pytest.raises(SystemExit) as left:
            main()
        reported = capsys.readouterr()
        code = left.value.code
        return (code if isinstance(code, int) else 0), reported.out, reported.err

    status, out, err = cell("calibrate", str(folder), "-o", str(tmp_path / "out"), "--json")
    content = json.loads(out)
    assert status == 1
    assert "warning: " in err
    assert "millimetres" in err
    assert "not determined: the camera's place on the robot" in err
    assert set(content["undetermined"]) == {"hand_eye"}
    assert {"what", "where", "remedy"} == set(content["warnings"][0])
    assert content["answer"]["usable_distances_m"] is not None
    assert content["answer"]["error_at_work_piece_m"] is None
    assert content["program"].startswith("calibration-cell ")
    report = (tmp_path / "out" / "report.html").read_text()
    assert "Known to be wrong or not determined" in report
    status, _, err = cell("export", str(tmp_path / "out"), "--format", "tf")
    assert status == 2
    assert "is not handed over" in err
    status, out, _ = cell("export", str(tmp_path / "out"), "--format", "opencv")
    assert status == 0
    assert "camera_matrix" in out
