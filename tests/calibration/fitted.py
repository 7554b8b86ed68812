"""A small cell and its joint fit from the truth on, for tests of what is made of a fit."""

from __future__ import annotations

from functools import cache

import numpy as np

from calib.chain.effects import make_effect
from calib.chain.model import CellModel
from calib.chain.optics import optics_row
from calib.solver.joint import JointFit, fit_joint
from calib.solver.noise import Noise
from calib.solver.unknowns import unknowns_of
from calib.views import Mount, Views
from tests.paper.scene import (
    ALPHA0,
    BASE_FROM_FIXED,
    BETA0,
    FLANGE_FROM_MOUNTED,
    HEIGHT,
    U0,
    V0,
    mixed_scene,
)

THIN_F_M, K1 = 0.018, -0.05
ROBOT_MM, ROBOT_DEG, NOISE_PX = 0.05, 0.005, 0.1


def shuffled(seed: int, mount: Mount = "eye_in_hand") -> Views:
    """24 views of all distances, parallel and tilted, in no order."""
    views = mixed_scene(
        10, 14, noise_px=NOISE_PX, thin_f_m=THIN_F_M, k1=K1, robot_mm=ROBOT_MM,
        robot_deg=ROBOT_DEG, mount=mount, seed=seed,
    ).views  # fmt: skip
    return views.take(np.random.default_rng(seed).permutation(len(views)))


def start() -> CellModel:
    """The true cell."""
    optics = optics_row(alpha_px=ALPHA0, beta_px=BETA0, u0_px=U0, v0_px=V0, k1=K1, height_px=HEIGHT)
    lens = make_effect("focus_breathing", {"law": "thin_lens", "f_m": THIN_F_M})
    return CellModel(optics, FLANGE_FROM_MOUNTED, BASE_FROM_FIXED, (lens,))


def fit(views: Views) -> JointFit:
    """The joint fit of such views."""
    model = start()
    return fit_joint(model, views, unknowns_of(model), Noise(NOISE_PX, 5e-5, 9e-5))


@cache
def fitted(seed: int, mount: Mount = "eye_in_hand") -> tuple[JointFit, Views]:
    """A fit and its views, nothing wrong with them."""
    views = shuffled(seed, mount)
    return fit(views), views
