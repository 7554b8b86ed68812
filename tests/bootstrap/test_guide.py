"""The guide on its own: corners of the true cell in, views out; no pictures."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from calib.chain.kinematics import arm
from cell.storage.files.cell_file import CellFile
from cell.verbs.bootstrap import LayoutUncertainty
from cell.verbs.bootstrap.guide import BootstrapGuide
from cell.verbs.bootstrap.near_guard import NearGuard
from tests.bootstrap.trials import Wrong, eye_to_hand, frame_of, run_on_corners, worn_out


def guide_at_home(cell: CellFile) -> BootstrapGuide:
    assert cell.layout is not None
    start = np.radians(cell.layout.home_deg)
    guide = BootstrapGuide(
        cell, cell.layout, NearGuard.around(cell, start, LayoutUncertainty()), LayoutUncertainty()
    )
    guide.checked(frame_of(cell, start, 0, np.random.default_rng(0)))
    return guide


def first_turn_rad(cell: CellFile, *, lost: bool) -> float:
    """How far the second move turns the flange, the first one's frame lost or not."""
    guide = guide_at_home(cell)
    first = guide.next_view()
    assert first is not None
    if not lost:
        guide.checked(frame_of(cell, np.array(first.joints()), 1, np.random.default_rng(1)))
    second = guide.next_view()
    assert second is not None
    kinematics = arm(cell.robot.model or "")
    poses = kinematics.forward(np.array([np.radians(cell.layout.home_deg), second.joints()]))  # type: ignore[union-attr]
    away = RigidTransform.from_matrix(poses[0]).inv() * RigidTransform.from_matrix(poses[1])
    return float(away.rotation.magnitude())


def test_after_a_board_lost_the_moves_are_smaller() -> None:
    cell = Wrong().layout_of(eye_to_hand(), np.random.default_rng(0))
    usual, careful = first_turn_rad(cell, lost=False), first_turn_rad(cell, lost=True)
    assert careful < 0.7 * usual


def test_moves_grow_as_more_is_known_and_end_where_they_began() -> None:
    rng = np.random.default_rng(1)
    cell = Wrong().layout_of(eye_to_hand(), rng)
    guide = guide_at_home(cell)
    sigmas_m, names = [], []
    while (view := guide.next_view()) is not None:
        assert guide.knowledge is not None
        sigmas_m.append(guide.knowledge.fit.sigma("flange_from_mounted.x"))
        names.append(view.name)
        guide.checked(frame_of(cell, np.array(view.joints()), len(names), rng))
    assert names[-1] == "back where it started"
    assert len(names) > 8
    assert sigmas_m[0] > 0.02
    assert sigmas_m[4] < 0.5 * sigmas_m[0]
    assert sigmas_m[-1] < 1e-3


def test_joints_that_are_off_and_a_soft_bracket_cost_millimetres_and_no_view() -> None:
    rng = np.random.default_rng(2)
    worn = worn_out(Wrong().layout_of(eye_to_hand(), rng), rng)
    trial = run_on_corners(worn, rng)
    assert trial.error is None
    assert trial.violations() == []
    assert trial.mounted_error()[0] < 0.01
    whole, views = trial.planned_views_seen_whole()
    assert whole == views > 20
