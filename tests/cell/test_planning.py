from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from calib.chain import rigid
from calib.chain.optics import optics_row
from calib.chain.projection import project
from cell.errors import InputError
from cell.files.cell_file import CellFile, read_cell
from cell.files.plan_file import Plan, PlanFile, read_plan
from cell.files.writing import yaml_text
from cell.planning import PlanSize, design_plan
from cell.sequencer.guard import Guard
from sim import presets
from tests.cell.plans import CELL

CONFIGS = Path(__file__).parents[2] / "configs"
NAMES = ("irb140-eosens", "ur3-robotiq")


@pytest.mark.parametrize("name", NAMES)
def test_every_planned_view_is_allowed_and_shows_the_whole_board(name: str) -> None:
    plan = read_plan(CONFIGS / f"{name}.plan.yaml")
    assert plan.cell.layout is not None
    home = np.radians(plan.cell.layout.home_deg)
    guard = Guard.of(plan)
    joints = np.array(guard.check_plan(plan, home))
    base_from_camera = guard.kinematics.forward(joints) @ (
        plan.cell.layout.mounted.transform().as_matrix()
    )
    camera_from_board = rigid.inverse(base_from_camera) @ (
        plan.cell.layout.fixed.transform().as_matrix()
    )
    camera, alpha = plan.cell.camera, plan.cell.layout.alpha_px
    optics = optics_row(
        alpha_px=alpha or 0, beta_px=alpha or 0, u0_px=camera.width / 2, v0_px=camera.height / 2
    )
    board = plan.cell.board.board()
    px = project(np.repeat(optics[None], len(joints), axis=0), camera_from_board, board.corners_m)
    assert (px > 0).all()
    assert (px < (camera.width, camera.height)).all()
    parallel = np.array([view.station == "parallel" for view in plan.file.views])
    tilt = np.degrees(np.arccos(camera_from_board[:, 2, 2]))
    assert tilt[parallel].max() < 0.01
    assert 11.9 < tilt[~parallel].min() < 20
    assert 35 < tilt[~parallel].max() < 42.1
    distance = camera_from_board[parallel] @ [*board.corners_m.mean(axis=0), 1.0]
    low, high = plan.cell.layout.distances_m
    assert distance[:, 2].min() == pytest.approx(low, rel=0.06)
    assert distance[:, 2].max() == pytest.approx(high, rel=0.06)


@pytest.mark.parametrize("name", NAMES)
def test_the_plans_that_come_along_are_what_the_planner_makes(name: str) -> None:
    path = CONFIGS / f"{name}.plan.yaml"
    made = design_plan(read_cell(CONFIGS / f"{name}.cell.yaml"), cell_path=f"{name}.cell.yaml")
    for planned, stored in zip(made.views, read_plan(path).file.views, strict=True):
        assert planned.name == stored.name
        np.testing.assert_allclose(planned.joints_deg, stored.joints_deg, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "preset"),
    [("irb140-eosens", presets.irb140_eosens), ("ur3-robotiq", presets.ur3_robotiq)],
)
def test_the_cells_that_come_along_are_the_simulators_presets(name: str, preset) -> None:  # type: ignore[no-untyped-def]
    from cell.simulated import home_of, simulated_cell

    plan = read_plan(CONFIGS / f"{name}.plan.yaml")
    ours, theirs = simulated_cell(plan.cell, home_of(plan)), preset()
    for part in ("optics", "flange_from_mounted", "base_from_fixed"):
        np.testing.assert_allclose(
            getattr(ours.model, part), getattr(theirs.model, part), rtol=1e-6, atol=1e-6
        )
    (effect,), (their_effect,) = ours.model.effects, theirs.model.effects
    assert effect.effect == their_effect.effect
    np.testing.assert_allclose(effect.values, their_effect.values, rtol=1e-3)
    assert (ours.board, ours.robot_model) == (theirs.board, theirs.robot_model)
    assert ours.camera.aperture_m == pytest.approx(theirs.camera.aperture_m)


def bench(**changes: str) -> CellFile:
    text = CELL
    for old, new in changes.items():
        text = text.replace(old, new)
    return CellFile.model_validate(YAML(typ="safe").load(text))


def test_what_a_plan_needs_is_said() -> None:
    with pytest.raises(InputError, match=r"write layout\.alpha_px, or camera\.lens"):
        design_plan(bench())
    without = bench().model_copy(update={"layout": None})
    with pytest.raises(InputError, match="poses need `layout`"):
        design_plan(without)


def test_a_board_out_of_reach_is_said() -> None:
    cell = bench()
    assert cell.layout is not None
    far = cell.layout.fixed.model_copy(update={"p_m": (3.0, 0.0, 0.0)})
    layout = cell.layout.model_copy(update={"fixed": far, "alpha_px": 500.0})
    with pytest.raises(InputError, match="the arm can take only 0 views"):
        design_plan(cell.model_copy(update={"layout": layout}), PlanSize(2, 2))


def test_a_plan_survives_writing_and_reading(tmp_path: Path) -> None:
    plan = read_plan(CONFIGS / "ur3-robotiq.plan.yaml")
    inline = plan.file.model_copy(update={"cell": plan.cell})
    (tmp_path / "p.yaml").write_text(yaml_text(inline.as_mapping(), comment="made\nhere"))
    back = read_plan(tmp_path / "p.yaml")
    assert isinstance(back, Plan)
    assert isinstance(back.file, PlanFile)
    assert back.file == inline
    assert back.cell == plan.cell


def test_the_plan_by_hand_tilts_the_near_views_and_leaves_the_far_ones_flat() -> None:
    path = CONFIGS / "irb140-eosens-by-hand.plan.yaml"
    made = design_plan(
        read_cell(CONFIGS / "irb140-eosens.cell.yaml"),
        PlanSize(by_hand=True),
        "irb140-eosens.cell.yaml",
    )
    stored = read_plan(path)
    for planned, view in zip(made.views, stored.file.views, strict=True):
        np.testing.assert_allclose(planned.joints_deg, view.joints_deg, atol=1e-3)
    layout, kinematics = stored.cell.layout, Guard.of(stored).kinematics
    assert layout is not None
    chosen = [v for v in stored.file.views if v.station == "varied"]
    flange = kinematics.forward(np.radians([v.joints_deg for v in chosen]))
    camera = rigid.inverse(flange @ layout.mounted.transform().as_matrix())
    board = camera @ layout.fixed.transform().as_matrix()
    tilt_deg, depth_m = np.degrees(np.arccos(board[:, 2, 2])), board[:, 2, 3]
    assert tilt_deg[depth_m < 0.5].min() > tilt_deg[depth_m > 0.8].max()
