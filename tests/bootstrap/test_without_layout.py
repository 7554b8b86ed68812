"""A cell of which nobody knows where anything is, but the lens."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cell.errors import BadAnswer, InputError
from cell.sequencer.states import Finish
from cell.storage.files.cell_file import CellFile
from cell.storage.files.writing import yaml_text
from cell.verbs.bootstrap import Bootstrap, LayoutUncertainty
from cell.verbs.bootstrap.near_guard import carried_uncertainty_m
from sim.arm import SimArm
from tests.bootstrap.trials import eye_to_hand, run_trial, ur3

pytestmark = pytest.mark.slow


def without_layout(cell: CellFile, pixel_um: float) -> tuple[CellFile, tuple[float, ...]]:
    """The cell with its lens' scale factor only, and where the arm stood."""
    assert cell.layout is not None
    camera = cell.camera.model_copy(update={"pixel_size_um": pixel_um})
    return cell.model_copy(update={"layout": None, "camera": camera}), cell.layout.home_deg


def test_three_shifts_take_the_place_of_a_layout(tmp_path: Path) -> None:
    unknown, start_deg = without_layout(ur3(), 3.8)
    trial = run_trial(unknown, tmp_path / "trial", start_deg)
    assert trial.error is None
    assert trial.violations() == []
    off_m, off_rad = trial.mounted_error()
    assert off_m < 2e-3
    assert off_rad < np.radians(0.2)
    whole, views = trial.planned_views_seen_whole()
    assert whole == views > 20
    assert trial.found is not None
    assert trial.found.layout.home_deg == pytest.approx(start_deg, abs=1e-3)


def test_a_board_of_unknown_place_on_the_flange_may_want_more_room(tmp_path: Path) -> None:
    """Neither board nor camera is known: what may be there bars the way, and that is reported."""
    unknown, start_deg = without_layout(eye_to_hand(), 4.7)
    with pytest.raises(BadAnswer, match="what is at the flange would strike keep-out box"):
        run_trial(unknown, tmp_path / "trial", start_deg)


def written(cell: CellFile, folder: Path) -> Path:
    path = folder / "some.cell.yaml"
    path.write_text(yaml_text(cell.as_mapping()))
    return path


def test_a_mount_of_the_wrong_kind_is_found_by_the_shifts(tmp_path: Path) -> None:
    unknown, start_deg = without_layout(ur3(), 3.8)
    right = Bootstrap.of(
        written(unknown, tmp_path), tmp_path / "run", tmp_path, LayoutUncertainty()
    )
    devices = right.devices(dry_run=True, start_deg=start_deg)
    mistaken = unknown.model_copy(
        update={"mount": "eye_to_hand", "workspace": None, "keep_out": ()}
    )
    path = written(mistaken, tmp_path)
    done = Bootstrap.of(path, tmp_path / "run", tmp_path, LayoutUncertainty()).run(
        devices, simulated=True
    )
    assert done.result.finish is Finish.BAD_INPUT
    assert "Check the mount" in done.result.reason
    assert isinstance(devices.arm, SimArm)
    assert devices.arm.moves_made == 4


def test_without_a_layout_whatever_is_at_the_flange_may_point_anywhere() -> None:
    unknown, _ = without_layout(eye_to_hand(), 4.7)
    uncertainty_m = carried_uncertainty_m(unknown, LayoutUncertainty(reach_m=0.1))
    assert uncertainty_m == pytest.approx(0.1 + np.hypot(0.16, 0.12), abs=1e-9)


def test_what_is_lacking_is_reported_before_anything_moves(tmp_path: Path) -> None:
    unknown, _ = without_layout(ur3(), 3.8)
    no_pixel = unknown.camera.model_copy(update={"pixel_size_um": None})
    path = written(unknown.model_copy(update={"camera": no_pixel}), tmp_path)
    with pytest.raises(InputError, match=r"camera\.lens\.focal_length_mm and camera\.pixel_size"):
        Bootstrap.of(path, tmp_path / "run", tmp_path, LayoutUncertainty())
    task = Bootstrap.of(written(unknown, tmp_path), tmp_path / "run", tmp_path, LayoutUncertainty())
    with pytest.raises(InputError, match="say with --start-deg"):
        task.devices(dry_run=True)
