"""An old calibration, and views taken since of a cell that may have changed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from calib.calibration import calibrate
from calib.calibration.mapping import as_mapping
from calib.chain.effects import make_effect
from calib.chain.model import CellModel, Errors, predict
from calib.chain.optics import optics_row
from calib.chain.rigid import from_vector
from calib.views import FloatArray, Mount, Views
from cell.verbs.export import CalibrationSource
from cell.verbs.verify.old_cell import OldCell, old_cell
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

K_PX_M2, K1, NOISE_PX = 50.0, -0.05, 0.1
FLANGE_M, FLANGE_RAD = 3e-5, 5e-5
NOTHING = np.zeros(6)


@cache
def calibration_text(mount: Mount = "eye_in_hand", seed: int = 1) -> CalibrationSource:
    true = mixed_scene(
        seed=seed,
        noise_px=NOISE_PX,
        robot_mm=1e3 * FLANGE_M,
        robot_deg=float(np.degrees(FLANGE_RAD)),
        k_px_m2=K_PX_M2,
        k1=K1,
        mount=mount,
    )
    return CalibrationSource.model_validate(as_mapping(calibrate(true.views), "old"))


def old(mount: Mount = "eye_in_hand") -> OldCell:
    return old_cell(calibration_text(mount))


def new_views(
    seed: int,
    *,
    mount: Mount = "eye_in_hand",
    camera: FloatArray = NOTHING,
    board: FloatArray = NOTHING,
    alpha_share: float = 0.0,
    flange: float = 1.0,
    parallel: int = 3,
    tilted: int = 6,
) -> Views:
    """Views of the cell after camera, board or lens changed; `flange` times its scatter."""
    log = mixed_scene(parallel, tilted, seed=seed, mount=mount).views
    on_flange, in_base = (camera, board) if mount == "eye_in_hand" else (board, camera)
    model = CellModel(
        optics_row(
            alpha_px=ALPHA0 * (1 + alpha_share),
            beta_px=BETA0 * (1 + alpha_share),
            u0_px=U0,
            v0_px=V0,
            k1=K1,
            height_px=HEIGHT,
        ),
        FLANGE_FROM_MOUNTED @ from_vector(on_flange),
        BASE_FROM_FIXED @ from_vector(in_base),
        (make_effect("focus_breathing", {"law": "inverse_square", "k_px_m2": K_PX_M2}),),
    )
    rng = np.random.default_rng(1000 + seed)
    error = rng.normal(0, 1, (len(log), 6)) * flange
    error *= [FLANGE_M] * 3 + [FLANGE_RAD] * 3
    corners = predict(model, log, errors=Errors(error))
    return replace(log, corners_px=corners + rng.normal(0, NOISE_PX, corners.shape))
