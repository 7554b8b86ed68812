"""Every verb from outside: arguments, exit status, what is printed where."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cell.cli.app import main
from cell.storage.defaults import DRY_RUN_PLAN
from cell.storage.files.plan_file import read_plan
from cell.storage.recording import read_recording
from tests.cell.plans import CELL, PLAN, SIMULATION
from tests.cell.recordings import HEADER, corner_rows, frame_line

ROOT = Path(__file__).parents[2]


class CommandResult:
    def __init__(self, status: int, out: str, err: str) -> None:
        self.status, self.out, self.err = status, out, err


Cell = Callable[..., CommandResult]


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Cell:
    def call(*words: str | Path) -> CommandResult:
        monkeypatch.setattr(sys, "argv", ["cell", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        done = capsys.readouterr()
        return CommandResult(int(left.value.code or 0), done.out, done.err)

    return call


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    (tmp_path / "bench.yaml").write_text(CELL + SIMULATION)
    (tmp_path / "plan.yaml").write_text(PLAN + "checks: {board: false}\n")
    return tmp_path / "plan.yaml"


def test_a_dry_run_records_and_can_be_reported_as_json(
    cell: Cell, plan: Path, tmp_path: Path
) -> None:
    done = cell("run", plan, "--dry-run", "--record-only", "-o", tmp_path / "r", "--json")
    assert done.status == 0, done.err
    result = json.loads(done.out)
    assert (result["finish"], result["frames"]) == ("completed", 4)
    recording = read_recording(tmp_path / "r")
    assert recording.header.simulated
    assert recording.image(recording.frames[0]).shape == (480, 640)
    assert "SIMULATED" in done.err
    assert done.err.count("logged") == 4


def test_resume_has_nothing_left_to_do(cell: Cell, plan: Path, tmp_path: Path) -> None:
    words = ("run", plan, "--dry-run", "--record-only", "-o", tmp_path / "r")
    assert cell(*words).status == 0
    assert "never overwritten" in cell(*words).err
    assert cell(*words, "--resume").status == 0
    plan.write_text(plan.read_text().replace("0.2", "0.1"))
    done = cell(*words, "--resume")
    assert done.status == 2
    assert "another plan or cell" in done.err


def test_a_plan_is_designed_and_simulated(cell: Cell, tmp_path: Path) -> None:
    shutil.copy(ROOT / "configs" / "ur3-robotiq.cell.yaml", tmp_path)
    words = ("--parallel", "4", "--varied", "6", "--json")
    done = cell("plan", tmp_path / "ur3-robotiq.cell.yaml", *words)
    assert done.status == 0, done.err
    reported = json.loads(done.out)
    assert (reported["views"], reported["parallel"] + reported["varied"]) == (10, 10)
    assert 0.05 < max(reported["expected"]["alpha_sigma_px"]) < 1.0
    assert 10 < reported["expected"]["duration"]["whole_s"] < 120
    assert reported["effects"]["joint_zero_offset"] < 1.0
    made = tmp_path / "ur3-robotiq.plan.yaml"
    assert cell("plan", tmp_path / "ur3-robotiq.cell.yaml").status == 2
    done = cell("simulate", made, "-o", tmp_path / "r", "--json", "--seed", "5")
    assert done.status == 0, done.err
    assert json.loads(done.out)["effects"] == ["focus_breathing"]
    views = read_recording(tmp_path / "r").views()
    assert len(views) == 10
    assert views.seen.all()
    assert views.has_pose.all()


def test_effects_on_the_command_line_take_the_place_of_the_cells_own(
    cell: Cell, tmp_path: Path
) -> None:
    plan = ROOT / "configs" / "ur3-robotiq.plan.yaml"
    quiet = "board_scale:relative=0"
    pulled = "joint_zero_offset:offset_rad_2=0.01"
    for name, effect in (("quiet", quiet), ("pulled", pulled)):
        done = cell("simulate", plan, "-o", tmp_path / name, "--effect", effect)
        assert done.status == 0, done.err
    quiet_px, pulled_px = (
        read_recording(tmp_path / name).views().corners_px for name in ("quiet", "pulled")
    )
    assert np.nanmedian(np.abs(pulled_px - quiet_px)) > 1.0


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        ("gremlins", "no effect is called 'gremlins'"),
        ("focus_breathing:law=inverse_square,k=3", "has no parameter 'k'"),
        ("focus_breathing:law=inverse_square,k_px_m2=x", "is no number"),
        ("focus_breathing:law", "is no key=value"),
        ("lens_sag", "has no amount and would change nothing"),
    ],
)
def test_an_effect_that_is_not_understood(
    cell: Cell, tmp_path: Path, effect: str, message: str
) -> None:
    plan = ROOT / "configs" / "ur3-robotiq.plan.yaml"
    done = cell("simulate", plan, "-o", tmp_path / "r", "--effect", effect)
    assert done.status == 2
    assert message in done.err


@pytest.mark.parametrize(
    "effect",
    [
        "frame_pose_offset:frames=1",
        "frame_pose_swap:frames=4",
        "length_unit:metres_per_unit=0.001",
        "rotation_convention:law=scalar_first",
        "robot_model:law=ur3e",
    ],
)
def test_slips_of_the_log_change_poses_and_not_corners(
    cell: Cell, tmp_path: Path, effect: str
) -> None:
    plan = ROOT / "configs" / "ur3-robotiq.plan.yaml"
    for name, effects in (("true", "length_unit:metres_per_unit=1"), ("slip", effect)):
        done = cell("simulate", plan, "-o", tmp_path / name, "--effect", effects)
        assert done.status == 0, done.err
    true, slip = (read_recording(tmp_path / name).views() for name in ("true", "slip"))
    np.testing.assert_array_equal(true.corners_px, slip.corners_px)
    changed = np.abs(true.base_from_flange - slip.base_from_flange).max(axis=(1, 2)) > 1e-3
    expected = {"frame_pose_offset": 39, "frame_pose_swap": 4}.get(effect.split(":")[0], 40)
    assert changed.sum() == expected
    assert slip.robot_model == ("ur3e" if effect.startswith("robot") else "ur3")


def test_a_twin_is_simulated_at_its_logged_poses(cell: Cell, tmp_path: Path) -> None:
    (tmp_path / "twin.yaml").write_text(
        "schema: cell.plan/1\nname: twin\ncell:\n  "
        + "\n  ".join((CELL + SIMULATION).replace("model: ur5e", "model: null").splitlines())
        + "\nviews:\n"
        + "- {frame: 7, t_s: 3.5, temperature_c: 30, joints_rad: [0, -1.5, 1.5, -1.5, -1.5, 0],"
        " base_from_flange: {p_m: [-0.5, -0.15, 0.45], q_xyzw: [1, 0, 0, 0]}}\n"
    )
    done = cell("simulate", tmp_path / "twin.yaml", "-o", tmp_path / "r")
    assert done.status == 0, done.err
    frame = read_recording(tmp_path / "r").frames[0]
    assert (frame.frame, frame.t_s, frame.temperature_c) == (7, 3.5, 30)
    assert frame.base_from_flange is not None
    assert frame.base_from_flange.p_m == (-0.5, -0.15, 0.45)


def test_unusable_arguments(cell: Cell, plan: Path, tmp_path: Path) -> None:
    assert cell("run").status == 2
    assert cell("run", plan, "--dry-run", "--resume").status == 2
    assert cell("run", plan, "--frobnicate").status == 2
    assert cell("calibrate", tmp_path / "nowhere").status == 2
    done = cell("run", plan)
    assert done.status == 2
    assert "its arm is simulated" in done.err


# -- bad input: each with its status, and an error that says what, where and how to mend it -----


def test_missing_and_broken_yaml(cell: Cell, plan: Path, tmp_path: Path) -> None:
    done = cell("run", tmp_path / "nowhere.yaml", "--dry-run")
    assert (done.status, done.out) == (2, "")
    assert "nowhere.yaml: cannot be read" in done.err
    plan.write_text("schema: cell.plan/1\nviews: [")
    done = cell("run", plan, "--dry-run")
    assert done.status == 2
    assert "plan.yaml:2:" in done.err
    assert "is not valid YAML" in done.err
    assert "Traceback" not in done.err


def test_an_unreachable_pose(cell: Cell, plan: Path, tmp_path: Path) -> None:
    far = "- {name: far, base_from_flange: {p_m: [3, 0, 0.5], q_xyzw: [0, 1, 0, 0]}}\n"
    plan.write_text(PLAN + far)
    done = cell("run", plan, "--dry-run", "-o", tmp_path / "r")
    assert done.status == 2
    assert "views.4 (far): is unreachable" in done.err


def test_a_plan_that_is_too_fast(cell: Cell, plan: Path, tmp_path: Path) -> None:
    plan.write_text(PLAN.replace("0.2", "0.5"))
    done = cell("run", plan, "--dry-run", "-o", tmp_path / "r")
    assert done.status == 5
    assert "plan.yaml:4:1: speed_m_s: 0.5 m/s is faster than 0.25 m/s" in done.err
    assert not (tmp_path / "r").exists()


def test_a_board_found_nowhere(cell: Cell, tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((120, 160), 128, np.uint8))
    done = cell("import", tmp_path, "--board", "4x5x0.03", "-o", tmp_path / "r")
    assert done.status == 1
    assert "the board was found in none of 3 pictures" in done.err
    done = cell("calibrate", tmp_path / "r")
    assert done.status == 1
    assert "Traceback" not in done.err


def test_two_frames_only(cell: Cell, recording_folder: Callable[..., Path]) -> None:
    rows = "frame,row,col,u_px,v_px\n" + corner_rows(0) + corner_rows(1)
    folder = recording_folder(frames=frame_line(0) + frame_line(1), detections=rows)
    done = cell("calibrate", folder)
    assert done.status == 1
    assert "Traceback" not in done.err
    assert "2" in done.err


def test_a_recording_from_a_newer_schema(cell: Cell, recording_folder: Callable[..., Path]) -> None:
    done = cell("calibrate", recording_folder(header=HEADER.replace("/1", "/9")))
    assert done.status == 2
    assert "newer version" in done.err
    assert "recording.yaml:1:1" in done.err


def test_an_image_that_is_not_an_image(cell: Cell, recording_folder: Callable[..., Path]) -> None:
    header = HEADER.replace("images: null", "images: images/")
    folder = recording_folder(header=header, frames=frame_line(0, image="a.png"))
    (folder / "detections.csv").unlink()
    (folder / "a.png").write_text("this is no picture")
    done = cell("calibrate", folder)
    assert done.status == 1
    assert "a.png: is not an image" in done.err


def test_the_plan_that_a_dry_run_has_by_itself_names_a_cell_that_is_there() -> None:
    assert read_plan(DRY_RUN_PLAN).cell.robot.model == "irb140"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("alpha_px: 500", "alpha_px: 0", "simulation.optics.alpha_px: 0 is not above 0"),
        ("beta_px: 500", "beta_px: -500", "simulation.optics.beta_px: -500 is not above 0"),
    ],
)
def test_a_simulated_cell_that_cannot_be_is_refused_and_no_error_of_the_program(
    cell: Cell, plan: Path, tmp_path: Path, old: str, new: str, words: str
) -> None:
    file = tmp_path / "bench.yaml"
    file.write_text(file.read_text().replace(old, new))
    result = cell("simulate", plan, "-o", tmp_path / "made")
    assert words in result.err
    assert result.status == 2


def test_a_board_behind_the_simulated_camera_is_named(cell: Cell, tmp_path: Path) -> None:
    for file in (ROOT / "configs").glob("irb140-eosens.*.yaml"):
        (tmp_path / file.name).write_text(file.read_text().replace("eye_in_hand", "eye_to_hand"))
    name = tmp_path / "irb140-eosens.cell.yaml"
    if "eye_to_hand" not in name.read_text():
        name.write_text(name.read_text() + "mount: eye_to_hand\n")
    result = cell("simulate", tmp_path / "irb140-eosens.plan.yaml", "-o", tmp_path / "made")
    assert result.status == 2
    assert "Does the board stand before the camera there?" in result.err
