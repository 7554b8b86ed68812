"""The joint problem's part of `solver_speed.py`: one linearised chain, once over all corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.solver_speed_problem import BOARD, FREE, HEIGHT, TRUE, WIDTH
from calib.chain import rigid
from calib.chain.effects import make_effect
from calib.chain.kinematics import arm
from calib.chain.model import CellModel, Errors
from calib.chain.projection import project
from calib.solver.joint import assemble
from calib.solver.unknowns import amounts, dependence, prior_information, unknowns_of
from calib.views import FloatArray, Views

MIDDLE_RAD = np.array([0.3, -1.5, 1.6, -1.7, -1.5, 0.4])
EFFECTS: dict[str, dict[str, float | str]] = {
    "link_geometry": {},
    "joint_zero_offset": {},
    "joint_compliance": {},
    "board_warp": {},
    "board_scale": {},
    "board_shear": {},
    "focus_breathing": {"law": "thin_lens"},
    "focus_hysteresis": {},
    "entrance_pupil_shift": {},
    "protective_window": {},
    "distance_dependent_distortion": {},
    "decentering": {},
    "higher_order_radial": {},
    "sensor_tilt": {},
    "lens_sag": {},
    "mount_flex": {},
    "pose_time_lag": {},
}


def joint_cell(frames: int) -> tuple[CellModel, Views]:
    """A cell with 36 numbers of effects beside the plain 18, and what it recorded."""
    rng = np.random.default_rng(2)
    kinematics = arm("ur5e")
    joints = MIDDLE_RAD + rng.uniform(-0.12, 0.12, (frames, 6))
    ahead = rigid.compose(np.array([0.3, 0.2, 0.1]), np.array([-0.08, -0.08, 0.55]))
    mounted = rigid.compose(np.array([0.02, -0.03, 0.7]), np.array([0.03, -0.04, 0.09]))
    fixed = kinematics.forward(MIDDLE_RAD) @ mounted @ ahead
    effects = [make_effect(name, given) for name, given in EFFECTS.items()]
    model = CellModel(TRUE, mounted, fixed, tuple(effects))
    blank = Views.blank(BOARD, width_px=WIDTH, height_px=HEIGHT, frames=frames)
    flange = kinematics.forward(joints)
    seen = project(
        np.repeat(TRUE[None], frames, axis=0),
        rigid.inverse(flange @ mounted) @ fixed,
        BOARD.corners_m,
    )
    views = replace(
        blank,
        corners_px=seen,
        base_from_flange=flange,
        joints_rad=joints,
        approach_joints_rad=joints + rng.uniform(-0.1, 0.1, joints.shape),
        joint_velocity_rad_s=rng.uniform(-0.5, 0.5, joints.shape),
        t_s=np.arange(frames, dtype=float),
        robot_model="ur5e",
        moving=True,
    )
    return model, views


def normal_equations(model: CellModel, views: Views) -> FloatArray:
    """Linearise the chain and go once over all corners."""
    unknowns = unknowns_of(model, (*FREE[:6],))
    error = np.zeros((len(views), 6))
    found = dependence(model, views, unknowns, kinematics=arm("ur5e"), errors=Errors(error))
    prior = (amounts(model, unknowns), prior_information(unknowns))
    weight = np.ones(views.corners_px.shape[:2])
    equations, _ = assemble(found, views, weight, error, None, prior)
    return equations.frames.shared
