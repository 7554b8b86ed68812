from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cell.cli.bootstrap import bootstrap as verb
from cell.errors import InputError
from cell.sequencer.journal import read_journal
from cell.sequencer.states import Finish
from cell.storage.files.cell_file import CellFile, read_cell
from cell.storage.files.parts import Box, Pose
from cell.storage.files.plan_file import read_plan
from cell.storage.files.writing import yaml_text
from cell.storage.recording import read_recording
from cell.verbs.bootstrap import Bootstrap, LayoutUncertainty
from cell.verbs.bootstrap.near_guard import NearGuard, carried_uncertainty_m
from drivers.arm import ArmState
from drivers.errors import SafetyError, StopFailed
from sim.arm import SimArm
from tests.bootstrap.trials import Wrong, eye_to_hand, irb140, run_trial, ur3

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("cell", "seed"),
    [(lambda: irb140(shrunk=4), 3), (ur3, 4), (eye_to_hand, 5)],
    ids=["irb140", "ur3", "eye_to_hand"],
)
def test_a_wrong_layout_is_found_without_leaving_the_neighbourhood(
    cell: Callable[[], CellFile], seed: int, tmp_path: Path
) -> None:
    guessed = Wrong().layout_of(cell(), np.random.default_rng(seed))
    trial = run_trial(guessed, tmp_path / "trial")
    assert trial.error is None
    assert trial.found is not None
    assert trial.violations() == []
    off_m, off_rad = trial.mounted_error()
    assert off_m < 2e-3
    assert off_rad < np.radians(0.2)
    assert off_m < 5 * np.linalg.norm(trial.found.mounted_sigma_m)
    whole, views = trial.planned_views_seen_whole()
    assert whole == views > 30
    folder = tmp_path / "trial"
    frames = read_recording(folder / "run").frames
    assert frames[-1].view == "back where it started"
    np.testing.assert_allclose(frames[-1].joints_rad, frames[0].joints_rad, atol=1e-9)
    (found,) = folder.glob("*.found.yaml")
    (planned,) = folder.glob("*.found.plan.yaml")
    assert read_plan(planned).cell == read_cell(found)
    events = [event["event"] for event in read_journal(folder / "run")]
    assert events.count("decided") == len(frames) - 1


def written(cell: CellFile, folder: Path) -> Path:
    path = folder / "some.cell.yaml"
    path.write_text(yaml_text(cell.as_mapping()))
    return path


def moved(task: Bootstrap, start_deg: tuple[float, ...] | None = None):  # type: ignore[no-untyped-def]
    devices = task.devices(dry_run=True, start_deg=start_deg)
    assert isinstance(devices.arm, SimArm)
    return devices, task.run(devices, simulated=True)


def test_without_a_board_nothing_moves(tmp_path: Path) -> None:
    task = Bootstrap.of(written(ur3(), tmp_path), tmp_path / "run", tmp_path, LayoutUncertainty())
    devices, done = moved(task, (31, -77, -110, -10, 10, 17))
    assert done.result.finish is Finish.GIVEN_UP
    assert "board not found" in done.result.reason
    assert (done.result.frames, done.found) == (0, None)
    assert devices.arm.truth().joints_rad == pytest.approx(np.radians([31, -77, -110, -10, 10, 17]))


def test_an_arm_that_somebody_moves_is_not_taken_over(tmp_path: Path) -> None:
    task = Bootstrap.of(written(ur3(), tmp_path), tmp_path / "run", tmp_path, LayoutUncertainty())
    devices = task.devices(dry_run=True)
    read = devices.arm.state

    def driven() -> ArmState:
        state = read()
        joints = np.array(state.joints_rad) + 0.05 * state.host_t_s
        return replace(state, joints_rad=tuple(joints.tolist()))

    devices.arm.state = driven  # type: ignore[method-assign]
    with pytest.raises(StopFailed, match="THE ARM DOES NOT STOP"):
        task.run(devices, simulated=True)
    assert devices.arm.moves_made == 0  # type: ignore[attr-defined]


def test_an_arm_of_another_model_is_not_moved(tmp_path: Path) -> None:
    task = Bootstrap.of(written(ur3(), tmp_path), tmp_path / "run", tmp_path, LayoutUncertainty())
    devices = task.devices(dry_run=True)
    other = task.cell.model_copy(
        update={
            "robot": task.cell.robot.model_copy(update={"model": "ur5"}),
            "keep_out": (),
            "workspace": None,
        }
    )
    with pytest.raises(SafetyError, match="ur5"):
        replace(task, cell=other).run(devices, simulated=True)
    assert devices.arm.moves_made == 0


def with_mounted(cell: CellFile, turn: Rotation) -> CellFile:
    assert cell.layout is not None
    pose = cell.layout.mounted.transform()
    wrong = Pose.of(pose.from_components(pose.translation, pose.rotation * turn))
    return cell.model_copy(update={"layout": cell.layout.model_copy(update={"mounted": wrong})})


@pytest.mark.parametrize(
    ("turn", "says", "most_moves"),
    [
        (Rotation.from_euler("x", 180, degrees=True), "layout: from here the picture", 1),
        (Rotation.from_euler("z", 90, degrees=True), "the board does not move in the picture", 3),
    ],
)
def test_a_layout_wrong_beyond_what_is_stated_ends_the_moves(
    turn: Rotation, says: str, most_moves: int, tmp_path: Path
) -> None:
    path = written(with_mounted(ur3(), turn), tmp_path)
    task = Bootstrap.of(path, tmp_path / "run", tmp_path, LayoutUncertainty())
    devices, done = moved(task)
    assert done.result.finish is Finish.BAD_INPUT
    assert says in done.result.reason
    assert devices.arm.moves_made <= most_moves


def test_a_box_that_the_layout_may_reach_stops_it_before_the_first_move(tmp_path: Path) -> None:
    cell = ur3()
    assert cell.workspace is not None
    low = cell.workspace.model_copy(update={"high_m": (0.6, 0.5, 0.42)})
    path = written(cell.model_copy(update={"workspace": low}), tmp_path)
    task = Bootstrap.of(path, tmp_path / "run", tmp_path, LayoutUncertainty())
    with pytest.raises(SafetyError, match=r"would leave the workspace.*drive the arm away"):
        moved(task)
    assert not (tmp_path / "run").exists()


def test_boxes_grow_by_what_may_be_off() -> None:
    uncertainty = LayoutUncertainty(mount_m=0.04, mount_rad=0.1)
    assert carried_uncertainty_m(ur3(), uncertainty) == pytest.approx(0.04)
    corner_m = np.hypot(0.16, 0.12)
    beside = carried_uncertainty_m(eye_to_hand(), uncertainty)
    assert beside == pytest.approx(0.04 + 0.1 * corner_m, abs=1e-3)
    with pytest.raises(InputError, match="nothing is left of it"):
        carried_uncertainty_m(ur3(), LayoutUncertainty(mount_m=0.6))


def test_what_hangs_on_the_flange_is_held_against_boxes_by_what_it_may_be_off() -> None:
    start = np.radians([31.0, -77, -128, -10, 63, 17])
    sure = NearGuard.around(ur3(), start, LayoutUncertainty(mount_m=0.0, mount_rad=0.0))
    camera_m = sure.kinematics.forward(start)[:3, 3]
    low_m, high_m = (
        camera_m + np.array([0.1, -0.02, -0.02]),
        camera_m + np.array([0.14, 0.02, 0.02]),
    )
    ahead = Box(name="ahead", low_m=tuple(low_m.tolist()), high_m=tuple(high_m.tolist()))
    sure.with_box(ahead).check_surroundings()
    doubtful = NearGuard.around(ur3(), start, LayoutUncertainty(mount_m=0.1, mount_rad=0.0))
    with pytest.raises(SafetyError, match=r"\(it may be 0.10 m off\) would strike"):
        doubtful.with_box(ahead).check_surroundings()


def test_a_guard_keeps_near(tmp_path: Path) -> None:
    start = np.radians([31.0, -77, -128, -10, 63, 17])
    guard = NearGuard.around(ur3(), start, LayoutUncertainty())
    guard.check_move(start, start + np.radians([0, 0, 0, 0, 10, 0]), "little")
    with pytest.raises(SafetyError, match="a bootstrap stays within 150 mm and 25°"):
        guard.check_move(start, start + np.radians([0, 0, 0, 0, 0, 30]), "far")
    with pytest.raises(SafetyError, match="a joint would turn too far"):
        guard.check_move(start, start + np.radians([0, 0, 0, 0, 0, 70]), "farther")


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = written(ur3(), tmp_path)
    (tmp_path / "some.found.yaml").write_text("mine")
    with pytest.raises(InputError, match="is there already and is not overwritten"):
        Bootstrap.of(path, tmp_path / "run", tmp_path, LayoutUncertainty())


def test_start_angles_are_checked(tmp_path: Path) -> None:
    path = written(ur3(), tmp_path)
    with pytest.raises(InputError, match="is not six angles"):
        verb(path, dry_run=True, output=tmp_path, start_deg="1,2,3")
    with pytest.raises(InputError, match="goes with --dry-run"):
        verb(path, output=tmp_path, start_deg="1,2,3,4,5,6")
