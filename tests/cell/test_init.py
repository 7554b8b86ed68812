"""`cell init`: a few answers become a cell that can be planned and rehearsed at once."""

from __future__ import annotations

import io
import json
import sys
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from calib.chain.kinematics import MODELS, arm
from cell.devices.nominal_cell import USUAL_NOISE, nominal
from cell.devices.planned_camera import PlannedCamera
from cell.sequencer.bounded import check_bounded
from cell.storage.files.cell_file import read_cell
from cell.verbs.init.answers import HOMES_DEG, Answers
from cell.verbs.init.cell_text import cell_of
from cell.verbs.plan.candidates import varied
from cell.verbs.plan.reach import planning_guard, reachable
from cell.verbs.plan.shortfall import why_not
from drivers.errors import SafetyError
from tests.cell.test_cli import Cell
from tests.cell.test_cli import cell as cell  # a fixture

CHESS = {"type": "chessboard", "rows": 7, "cols": 10, "square_m": 0.025}
REAL = ("--robot", "ur", "--robot-address", "192.0.2.1", "--payload-kg", "0.8", "--model", "ur10e")
BOUNDS = ("--workspace", "0.9,-0.9,0,-0.9,0.9,1.4", "--keep-out", "post:0.5,0.5,0,0.6,0.6,1")


@pytest.fixture(autouse=True)
def nobody_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO())


def test_without_any_answer_it_is_a_simulated_cell_that_can_be_planned(
    cell: Cell, tmp_path: Path
) -> None:
    result = cell("init", tmp_path / "bench", "--json")
    assert result.status == 0, result.err
    assert "--robot sim (not given)" in result.err
    path = tmp_path / "bench" / "cell.yaml"
    assert json.loads(result.out)["file"] == str(path)
    made = read_cell(path)
    simulated = nominal(made).simulation
    assert simulated is not None
    assert simulated.noise == USUAL_NOISE
    assert min(USUAL_NOISE.corner_px, USUAL_NOISE.arm_position_m) > 0
    assert cell("doctor", path).status == 0
    again = cell("init", tmp_path / "bench")
    assert again.status == 2
    assert "never overwritten" in again.err


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("model", [m for m in MODELS if m.startswith(tuple(HOMES_DEG))])
def test_the_board_lies_before_the_camera_at_home(model: str, mount: str) -> None:
    made = cell_of(Answers(board=CHESS, model=model, mount=mount))  # type: ignore[arg-type]
    assert made.layout is not None
    home = np.radians(made.layout.home_deg)
    flange = arm(model).forward(home)
    assert flange[2, 2] == pytest.approx(-1.0, abs=1e-6), "faces down"
    mounted = flange @ made.layout.mounted.transform().as_matrix()
    camera_from_board = np.linalg.inv(mounted) @ made.layout.fixed.transform().as_matrix()
    if mount == "eye_to_hand":
        camera_from_board = np.linalg.inv(camera_from_board)
    middle = camera_from_board @ [9 * 0.0125, 6 * 0.0125, 0.0, 1.0]
    near, far = made.layout.distances_m
    assert middle[:3] == pytest.approx([0.0, 0.0, (near + far) / 2], abs=1e-5)


@pytest.mark.parametrize("mount", ["eye_in_hand", "eye_to_hand"])
@pytest.mark.parametrize("model", MODELS)
def test_every_arm_stands_free_at_home_and_reaches_views(model: str, mount: str) -> None:
    made = cell_of(Answers(board=CHESS, model=model, mount=mount))  # type: ignore[arg-type]
    assert made.layout is not None
    guard = planning_guard(made)
    near = guard.scene.at(np.radians(made.layout.home_deg))
    assert near is not None
    assert near.distance_m > made.clearance_m, f"{near.first} to {near.second}"
    tries = islice(varied(PlannedCamera.of(made), made.layout.distances_m, seed=1), 30)
    found = list(islice(reachable("varied", tries, made, guard), 3))
    assert len(found) == 3, why_not(made)


def test_a_real_arm_is_asked_for_what_it_could_run_into(cell: Cell, tmp_path: Path) -> None:
    for words, missing in (
        (REAL[:2], "--model"),
        ((*REAL[:2], *REAL[-2:]), "--robot-address"),
        (REAL, "--workspace"),
        ((*REAL, *BOUNDS[:2]), "--keep-out"),
    ):
        result = cell("init", tmp_path, *words)
        assert result.status == 2
        assert f"{missing} is needed" in result.err
    assert not list(tmp_path.iterdir())
    result = cell("init", tmp_path, *REAL, *BOUNDS)
    assert result.status == 0, result.err
    made = read_cell(tmp_path / "cell.yaml")
    check_bounded(made)
    assert made.workspace is not None
    assert made.workspace.low_m == (-0.9, -0.9, 0.0)
    assert made.keep_out[0].name == "post"
    assert made.robot.payload_kg == 0.8
    assert made.layout is not None
    assert made.layout.fixed.p_m[2] >= -1e-6, "on the table, not below it"
    assert "not in view from home" not in why_not(made)


def test_nothing_to_keep_out_is_an_answer_and_silence_is_none(cell: Cell, tmp_path: Path) -> None:
    free = ("--no-workspace-because", "hangs in a fenced hall", "--keep-out", "none")
    assert cell("init", tmp_path, *REAL, *free).status == 0
    check_bounded(read_cell(tmp_path / "cell.yaml"))
    with pytest.raises(SafetyError):
        check_bounded(cell_of(Answers(board=CHESS)))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--size", "big"), "--size big: must be 2 numbers separated by `x`"),
        (("--keep-out", "1,2,3"), "must be NAME:x,y,z,x,y,z, or none"),
        (("--board-at", "0,0,0"), "must be 6 numbers"),
        (("--focal-length-mm", "200"), "take a smaller board or a shorter lens"),
        (("--model", "ur99"), "is not known; known are"),
        (("--model", "ur3e", "--workspace", "-1,-1,0,1,1,1"), "take a smaller board or a shorter"),
        (("--robot", "abb"), "--model is needed"),
    ],
)
def test_an_answer_that_cannot_be_is_refused(
    cell: Cell, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    result = cell("init", tmp_path, *words)
    assert result.status == 2
    assert message in result.err
